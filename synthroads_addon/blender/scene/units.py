"""Units of length that scenes declare."""

import bpy

_SAME = 1e-6
"""Difference of a unit from 1 m, as a share, that counts as none: Blender's setting has single precision; chosen."""


def scene_unit(scene: bpy.types.Scene | None = None) -> float:
    """Return the length, m, of a scene's unit (of the open scene's if None); 1 without a system of units."""
    units = (scene or bpy.context.scene).unit_settings
    scale = 1.0 if units.system == "NONE" else float(units.scale_length)
    return 1.0 if abs(scale - 1.0) < _SAME else scale
