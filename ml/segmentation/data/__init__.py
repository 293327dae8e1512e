"""Labelled points: where they come from, as tiles, crops and packed files."""
