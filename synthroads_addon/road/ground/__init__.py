"""The ground and the surface of the main road with its side roads."""
