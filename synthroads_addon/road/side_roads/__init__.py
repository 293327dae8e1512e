"""Side roads that join the edge of a carriageway: what they are, their mouths, and their triangles."""
