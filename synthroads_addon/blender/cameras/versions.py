"""Rendering features that differ between Blender versions."""

from __future__ import annotations

import bpy


def _compiles_shaders() -> bool:
    """Return whether this Blender's Cycles can compile Open Shading Language; Debian's can't."""
    try:
        import _cycles
    except ImportError:
        return False
    return hasattr(_cycles, "osl_compile")


HAS_RETURN_CAMERA = bpy.app.version >= (5, 0, 0) and _compiles_shaders()
"""Whether Cycles has custom cameras, and can compile their shaders."""


def eevee_engine() -> str:
    """Return the render engine identifier of EEVEE in this Blender version."""
    return "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0, 0) else "BLENDER_EEVEE"


def multilayer_exr(settings: bpy.types.ImageFormatSettings) -> None:
    """Set image settings to uncompressed multilayer EXR of 32-bit floats, in place."""
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "NONE"
