"""The sidebar panel "SynthRoads": properties from the schema, operators that call the library, panels.

Blender is to know every class of its own that a module defines, or those in its `CLASSES` where they are made of data.
A module can have `ATTACHED`, an owner and the name and class of a property group that is attached to it, `HANDLERS` by
the event that calls them, and functions `register` and `unregister` for what else it keeps in Blender. Panels come in
the order of their `bl_order`, but a parent before its children.
"""

from __future__ import annotations

from types import ModuleType

import bpy

from . import alignment
from .drawing import along_curve, dots, tool
from .fields import preferences, properties
from .fields.wording import title_case
from .panels import (
    calibration,
    calibration_settings,
    cloud_view,
    dataset,
    edit,
    epochs,
    export,
    file_menus,
    menus,
    panels,
    placing,
    presets,
    road_choice,
    road_files,
    rules,
    scan_road,
    scene_scan,
    things,
    turnouts,
    views,
)
from .translations import blender as translations
from .translations.blender import set_translation_context
from .work import build, edited, follow, long_operator, scan

MODULES = (
    *(
        preferences,
        properties,
        long_operator,
        build,
        road_choice,
        follow,
        edited,
        scan,
        presets,
        road_files,
        panels,
        rules,
        scan_road,
        things,
        placing,
        edit,
        turnouts,
        epochs,
        cloud_view,
        views,
        scene_scan,
    ),
    *alignment.MODULES,
    *(along_curve, tool, dots),
    *(export, file_menus, calibration_settings, calibration, dataset, menus, translations),
)


def register() -> None:
    """Register all classes of the panel with Blender, attach the settings' property groups, and add event handlers."""
    for module in MODULES:
        for cls in _classes_of(module):
            set_translation_context(cls)
            bpy.utils.register_class(cls)
        if attached := getattr(module, "ATTACHED", None):
            owner, name, group = attached
            label = title_case(name).replace("Synthroads", "SynthRoads")
            setattr(owner, name, bpy.props.PointerProperty(type=group, name=label))
        for event, function in getattr(module, "HANDLERS", {}).items():
            getattr(bpy.app.handlers, event).append(function)
        if hasattr(module, "register"):
            module.register()


def unregister() -> None:
    """Undo `register` in reverse order: remove handlers, property groups and classes; running work is stopped."""
    for module in reversed(MODULES):
        for event, function in getattr(module, "HANDLERS", {}).items():
            getattr(bpy.app.handlers, event).remove(function)
        if hasattr(module, "unregister"):
            module.unregister()
        if attached := getattr(module, "ATTACHED", None):
            delattr(*attached[:2])
        for cls in reversed(_classes_of(module)):
            bpy.utils.unregister_class(cls)


def _classes_of(module: ModuleType) -> list[type]:
    """Return the classes of a module to be registered with Blender, in the order of their definition."""
    defined = [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]
    return list(getattr(module, "CLASSES", ())) or [c for c in defined if issubclass(c, bpy.types.bpy_struct)]
