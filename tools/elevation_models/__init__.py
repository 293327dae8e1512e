"""SynthRoads Elevation Models: brings rasterio into Blender, where SynthRoads finds it; it has nothing of its own."""

from __future__ import annotations


def register() -> None:
    """Do nothing: Blender requires this function, but the extension only brings wheels."""


def unregister() -> None:
    """Do nothing: Blender requires this function."""
