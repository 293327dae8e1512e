"""The sidebar panel "SynthRoads": properties from the schema, operators that call the library, panels.

Each module has the classes that Blender is to know in `CLASSES`, and where it keeps something of its own in Blender,
`register` and `unregister`. Panels come in the order of their `bl_order`, but a parent before its children.
"""

from __future__ import annotations

import bpy

from .fields import preferences, properties
from .panels import calibration, cloud_view, edit, export, file_lists, panels, presets, road_files, rules, swatches
from .work import build, long_operator, scan

MODULES = (
    preferences,
    properties,
    long_operator,
    build,
    scan,
    file_lists,
    presets,
    road_files,
    panels,
    rules,
    edit,
    swatches,
    cloud_view,
    export,
    calibration,
)


def register() -> None:
    """Register every class and attach the settings."""
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
        if hasattr(module, "register"):
            module.register()


def unregister() -> None:
    """Undo `register`; what is at work is stopped."""
    for module in reversed(MODULES):
        if hasattr(module, "unregister"):
            module.unregister()
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
