"""SynthRoads IFC: brings ifcopenshell into Blender, where SynthRoads finds it; it has nothing of its own."""

from __future__ import annotations


def register() -> None:
    """Blender wants it; the wheels are all that matters."""


def unregister() -> None:
    """Blender wants it."""
