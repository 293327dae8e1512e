"""Roads that are drawn in the 3D view: along a curve object, by a tool, and by dots that are dragged along the road."""
