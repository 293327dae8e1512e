"""Which of a scene's roads the panels are about: shown and chosen at the top of the panel "Road".

It is the active object's, else the only one, else the one chosen here; see `blender.model.roads.road_meant`.
Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import bpy

from ...blender.model.roads import choose_road
from ...blender.model.store import find_road, roads
from ..drawing.along_curve import SYNTHROADS_OT_road_from_curve
from ..drawing.tool import SYNTHROADS_OT_draw_road
from ..fields.room import draw_text, fits
from ..work.build import SYNTHROADS_OT_build

_items: list[tuple[str, str, str, str, int]] = []
"""Texts that Blender shows at present: it doesn't keep them itself."""


def _road_items(state: Any, context: Any) -> list[tuple[str, str, str, str, int]]:
    names = [root.name for root in roads(context.scene)]
    _items[:] = [(name, name, "", "EMPTY_ARROWS", number) for number, name in enumerate(names)]
    return _items


def _shown_road(state: Any) -> int:
    scene = bpy.context.scene
    scene_roads, shown = roads(scene), find_road(scene)
    return scene_roads.index(shown) if shown in scene_roads else 0


def _choose_road(state: Any, number: int) -> None:
    """Make a road the one that the panels are about, and its root the only selected and active object."""
    context = bpy.context
    root = roads(context.scene)[number]
    choose_road(context.scene, root)
    for other in context.view_layer.objects.selected:
        other.select_set(False)
    context.view_layer.objects.active = root
    if root.visible_get():
        root.select_set(True)


class SYNTHROADS_PG_roads(bpy.types.PropertyGroup):
    """Choice of the scene's road that the panels are about."""

    shown: bpy.props.EnumProperty(
        name="Road",
        items=_road_items,
        get=_shown_road,
        set=_choose_road,
        description="Road that the panels show: that of the active object. A chosen road's root becomes active",
    )


class SYNTHROADS_MT_one_more(bpy.types.Menu):
    """Where one more road is built. It gets a seed that no road of the scene has"""

    bl_idname = "SYNTHROADS_MT_one_more"
    bl_label = "One More Road"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the places: beside what is there, at the cursor, along the active curve, or drawn by hand."""
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.operator(SYNTHROADS_OT_build.bl_idname, text="Beside the Others", icon="ADD").beside = True
        entry = layout.operator(SYNTHROADS_OT_build.bl_idname, text="At the 3D Cursor", icon="PIVOT_CURSOR")
        entry.beside = entry.at_cursor = True
        layout.operator(
            SYNTHROADS_OT_road_from_curve.bl_idname, text="Along the Active Curve", icon="CURVE_DATA"
        ).beside = True
        layout.operator(SYNTHROADS_OT_draw_road.bl_idname, text="Draw It", icon="GREASEPENCIL").beside = True


def draw_road_choice(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the choice of the road and the menu that adds another one; nothing without a road."""
    shown = find_road(context.scene)
    if shown is None:
        return
    if not fits(shown.name, icons=3):
        draw_text(layout, shown.name)
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(context.window_manager.synthroads_roads, "shown", text="")
    row.menu(SYNTHROADS_MT_one_more.bl_idname, text="", icon="ADD")


def draw_road_name(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the name of the road that a button applies to, if the scene has several."""
    scene_roads = roads(context.scene)
    if len(scene_roads) > 1 and (shown := find_road(context.scene)):
        draw_text(layout, shown.name, "EMPTY_ARROWS")


ATTACHED = (bpy.types.WindowManager, "synthroads_roads", SYNTHROADS_PG_roads)
