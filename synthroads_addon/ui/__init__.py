"""The sidebar panel "SynthRoads": properties from the schema, operators that call the library, panels."""

from __future__ import annotations

import bpy

from . import operators, panels, properties

CLASSES = (*properties.CLASSES, *operators.CLASSES, *panels.CLASSES)


def register() -> None:
    """Register every class and attach the settings to scenes."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.synthroads = bpy.props.PointerProperty(type=properties.SYNTHROADS_PG_settings)


def unregister() -> None:
    """Undo `register`; a scan that is at work is stopped."""
    operators.stop_scan()
    del bpy.types.Scene.synthroads
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
