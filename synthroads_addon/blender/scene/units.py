"""Units of length that scenes declare."""

import bpy

_SAME = 1e-6
"""Share by which a unit may differ from 1 m, in the single precision of Blender's setting."""


def scene_unit(scene: bpy.types.Scene | None = None) -> float:
    """Return the metres that a unit of a scene's (the open one's) lengths stands for; 1 without a system of units."""
    units = (scene or bpy.context.scene).unit_settings
    scale = 1.0 if units.system == "NONE" else float(units.scale_length)
    return 1.0 if abs(scale - 1.0) < _SAME else scale
