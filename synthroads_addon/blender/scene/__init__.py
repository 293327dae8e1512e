"""Scenes as triangles, ours and foreign ones."""
