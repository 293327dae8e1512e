"""Colours and material layers of points."""
