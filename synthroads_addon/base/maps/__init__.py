"""Coordinate systems of maps, and where files lie on them."""
