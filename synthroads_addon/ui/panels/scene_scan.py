"""Settings of a scan without a road: along what the scanner moves, and which classes things have.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import bpy

from ...base.classes import classes
from ...blender.labels import CLASS_PROPERTY
from ..fields.room import draw_text, value_row
from ..fields.wording import title_case
from ..translations.blender import said

_SOLID = ("MESH", "CURVE", "SURFACE", "META", "FONT")
_items: list[tuple[str, str, str]] = []
"""Texts that Blender shows at present: it doesn't keep them itself."""


def _is_guide(settings: Any, item: bpy.types.Object) -> bool:
    return item.type in ("CURVE", "CAMERA")


def _class_items(settings: Any, context: Any) -> list[tuple[str, str, str]]:
    _items[:] = [(row.name, title_case(row.name), f"class_id {row.id}") for row in classes()]
    return _items


class SYNTHROADS_PG_scene_scan(bpy.types.PropertyGroup):
    """Settings of the scan of a scene without a road."""

    guide: bpy.props.PointerProperty(
        name="Along",
        type=bpy.types.Object,
        poll=_is_guide,
        description="Curve that the platform follows at its height, or camera: a tripod stands at the camera, another "
        "platform follows its animation. If empty, the path is straight over the middle of the scene",
    )
    classes: bpy.props.StringProperty(
        name="Classes",
        subtype="FILE_PATH",
        description="JSON file of classes by name of object, material or collection, as for synthroads scan",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    visible: bpy.props.EnumProperty(
        name="As Seen In",
        items=(
            ("render", "Renders", "Objects, modifiers, particles and their levels as in renders"),
            ("viewport", "Viewport", "Objects, modifiers, particles and their levels as in the viewport"),
        ),
        description="State of the scene to scan",
    )
    point_class: bpy.props.EnumProperty(name="Class", items=_class_items, description="Class for the selected objects")


class SYNTHROADS_OT_set_class(bpy.types.Operator):
    """Give the selected objects this class, as their custom property synthroads_class"""

    bl_idname = "synthroads.set_class"
    bl_label = "Set Class of Selected"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether objects are selected."""
        if not context.selected_objects:
            cls.poll_message_set(said("Select objects first"))
        return bool(context.selected_objects)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the panel's class as custom property of all selected objects."""
        chosen, items = context.scene.synthroads_scene_scan.point_class, context.selected_objects
        for item in items:
            item[CLASS_PROPERTY] = chosen
        self.report({"INFO"}, said(f"{len(items)} objects are {title_case(chosen)}"))
        return {"FINISHED"}


def unclassified(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return visible objects with faces that have no class by custom property or by a collection's name."""
    names = {row.name for row in classes()}
    collections = [item for item in context.scene.collection.children_recursive if item.name in names]
    named = {item for collection in collections for item in collection.all_objects}
    rendered = context.scene.synthroads_scene_scan.visible == "render"
    visible = context.visible_objects
    if rendered:
        visible = [item for item in context.view_layer.objects if not item.hide_render]
    return [item for item in visible if item.type in _SOLID and CLASS_PROPERTY not in item and item not in named]


def draw_scene_scan(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the settings of a scan without a road, and how many objects have no class."""
    settings = context.scene.synthroads_scene_scan
    draw_text(layout, "No road: what is visible is scanned", "INFO")
    if context.scene.synthroads.scan.platform.kind != "trajectory":
        value_row(layout, "Along").prop(settings, "guide", text="")
    value_row(layout, "As Seen In").prop(settings, "visible", text="")
    value_row(layout, "Classes").prop(settings, "classes", text="")
    row = value_row(layout, "Class")
    row.prop(settings, "point_class", text="")
    layout.operator(SYNTHROADS_OT_set_class.bl_idname, icon="CHECKMARK")
    missing = unclassified(context)
    if missing:
        text = f"{missing[0].name} has no class" if len(missing) == 1 else f"{len(missing)} objects have no class"
        draw_text(layout, text, "QUESTION")


ATTACHED = (bpy.types.Scene, "synthroads_scene_scan", SYNTHROADS_PG_scene_scan)
