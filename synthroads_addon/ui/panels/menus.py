"""Blender's own menus: Add > SynthRoads, Object > SynthRoads, and the menu of the right mouse button.

Blender's search (F3) finds what stands in a menu, by the menu's text: every operator stands in one, by its verb.
"""

from __future__ import annotations

import bpy

from ...blender.model.store import find_road
from ..alignment.panel import SYNTHROADS_MT_alignment
from ..drawing.along_curve import (
    SYNTHROADS_OT_fit_again,
    SYNTHROADS_OT_road_from_curve,
    SYNTHROADS_OT_unlink_curve,
    active_curve,
)
from ..drawing.tool import SYNTHROADS_OT_draw_road
from ..fields.wording import thing_name
from ..work.build import SYNTHROADS_OT_build, SYNTHROADS_OT_build_edited
from ..work.long_operator import SYNTHROADS_OT_cancel
from ..work.scan import SYNTHROADS_OT_scan
from .calibration import (
    SYNTHROADS_OT_compare_intensities,
    SYNTHROADS_OT_fit_materials,
    SYNTHROADS_OT_save_materials,
    SYNTHROADS_OT_show_calibration,
)
from .cloud_view import (
    SYNTHROADS_OT_add_cloud,
    SYNTHROADS_OT_frame_cloud,
    SYNTHROADS_OT_hide_cloud,
    SYNTHROADS_OT_show_cloud,
)
from .dataset import SYNTHROADS_OT_make_dataset
from .edit import SYNTHROADS_OT_show_plants
from .epochs import SYNTHROADS_OT_list_edits, SYNTHROADS_OT_next_epoch, SYNTHROADS_OT_save_changes
from .export import SYNTHROADS_OT_export_cloud, SYNTHROADS_OT_export_twin, SYNTHROADS_OT_install_ifc
from .placing import (
    ICONS,
    SYNTHROADS_OT_add_thing,
    SYNTHROADS_OT_delete_thing,
    SYNTHROADS_OT_repeat_thing,
    menu_groups,
)
from .presets import (
    SYNTHROADS_OT_load_device,
    SYNTHROADS_OT_load_scenario,
    SYNTHROADS_OT_random_road,
    SYNTHROADS_OT_save_scenario,
)
from .road_files import (
    SYNTHROADS_OT_load_axis,
    SYNTHROADS_OT_load_road,
    SYNTHROADS_OT_save_road,
    SYNTHROADS_OT_show_fit,
)
from .rules import SYNTHROADS_OT_check_rules, SYNTHROADS_OT_clear_rules
from .scan_road import SYNTHROADS_OT_road_from_scan
from .scene_scan import SYNTHROADS_OT_set_class
from .things import thing_of
from .turnouts import (
    ICONS as TURNOUT_ICONS,
)
from .turnouts import (
    KINDS,
    SYNTHROADS_OT_add_turnout,
    SYNTHROADS_OT_change_turnout,
    SYNTHROADS_OT_delete_turnout,
    turnout_name,
    turnouts_of,
)
from .views import SYNTHROADS_OT_add_night, SYNTHROADS_OT_add_views

_BLOCKS_BESIDE_ROADS = 1
"""Blocks of things that stand below the roads in the first column of the menu Add; the others are the second."""
Block = tuple[tuple[type[bpy.types.Operator], str, str], ...]
"""Entries of a menu between two lines: operator, text, icon."""
_ROADS: Block = (
    (SYNTHROADS_OT_build, "Build Road", "MOD_BUILD"),
    (SYNTHROADS_OT_random_road, "Random Road", "FILE_REFRESH"),
    (SYNTHROADS_OT_draw_road, "Draw Road", "GREASEPENCIL"),
    (SYNTHROADS_OT_road_from_curve, "Build Road from Curve", "CURVE_DATA"),
    (SYNTHROADS_OT_load_road, "Load Parameter Set...", "IMPORT"),
    (SYNTHROADS_OT_load_axis, "Build Along Centreline...", "CURVE_PATH"),
    (SYNTHROADS_OT_road_from_scan, "Build Road from a Scan...", "POINTCLOUD_DATA"),
)
_WORK: tuple[Block, ...] = (
    (
        (SYNTHROADS_OT_build_edited, "Build Road as Edited", "FILE_REFRESH"),
        (SYNTHROADS_OT_fit_again, "Fit Road to Curve Again", "FILE_REFRESH"),
        (SYNTHROADS_OT_unlink_curve, "Unlink Road from Curve", "UNLINKED"),
        (SYNTHROADS_OT_repeat_thing, "Repeat Along Road", "MOD_ARRAY"),
        (SYNTHROADS_OT_delete_thing, "Delete from Road", "TRASH"),
        (SYNTHROADS_OT_show_plants, "Hide or Show Plants", "HIDE_OFF"),
        (SYNTHROADS_OT_check_rules, "Check Rules", "CHECKMARK"),
        (SYNTHROADS_OT_clear_rules, "Clear List of Rules", "X"),
        (SYNTHROADS_OT_show_fit, "Show Missed Axis", "IMAGE_DATA"),
        (SYNTHROADS_OT_set_class, "Set Class of Selected", "CHECKMARK"),
        (SYNTHROADS_OT_add_views, "Add Sun, Sky, Cameras", "LIGHT_SUN"),
        (SYNTHROADS_OT_add_night, "Light by Night", "LIGHT_SPOT"),
    ),
    (
        (SYNTHROADS_OT_scan, "Scan", "LIGHT_AREA"),
        (SYNTHROADS_OT_show_cloud, "Show Cloud...", "POINTCLOUD_DATA"),
        (SYNTHROADS_OT_hide_cloud, "Remove Cloud", "X"),
        (SYNTHROADS_OT_frame_cloud, "Look at Cloud", "VIEWZOOM"),
        (SYNTHROADS_OT_add_cloud, "Add Cloud to Scene", "OUTLINER_OB_POINTCLOUD"),
        (SYNTHROADS_OT_compare_intensities, "Compare Intensities", "SEQ_HISTOGRAM"),
        (SYNTHROADS_OT_fit_materials, "Fit Materials", "MOD_DATA_TRANSFER"),
        (SYNTHROADS_OT_show_calibration, "Show Calibration's Diagrams", "IMAGE_DATA"),
        (SYNTHROADS_OT_save_materials, "Save Fitted Materials to Table", "FILE_TICK"),
        (SYNTHROADS_OT_make_dataset, "Make Data Set", "FILE_FOLDER"),
        (SYNTHROADS_OT_cancel, "Cancel Running Work", "X"),
    ),
    (
        (SYNTHROADS_OT_export_twin, "Export Twin (Model)...", "EXPORT"),
        (SYNTHROADS_OT_next_epoch, "Next Epoch", "FORWARD"),
        (SYNTHROADS_OT_list_edits, "Edits as List", "GREASEPENCIL"),
        (SYNTHROADS_OT_save_changes, "Save List...", "EXPORT"),
        (SYNTHROADS_OT_export_cloud, "Export Cloud...", "EXPORT"),
        (SYNTHROADS_OT_save_road, "Save Parameter Set...", "EXPORT"),
        (SYNTHROADS_OT_load_scenario, "Load Scenario...", "FILE_FOLDER"),
        (SYNTHROADS_OT_save_scenario, "Save Scenario...", "FILE_TICK"),
        (SYNTHROADS_OT_load_device, "Load Device...", "FILE_FOLDER"),
        (SYNTHROADS_OT_install_ifc, "Install SynthRoads IFC...", "IMPORT"),
    ),
)


def _draw_blocks(layout: bpy.types.UILayout, blocks: tuple[Block, ...]) -> None:
    layout.operator_context = "INVOKE_REGION_WIN"  # Blender's menu Add has operators run without being asked
    for number, block in enumerate(blocks):
        if number:
            layout.separator()
        for operator, text, icon in block:
            layout.operator(operator.bl_idname, text=text, icon=icon)


class SYNTHROADS_MT_add(bpy.types.Menu):
    """Menu Add > SynthRoads: a road, and every thing that can stand on it."""

    bl_idname = "SYNTHROADS_MT_add"
    bl_label = "SynthRoads"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the ways to a road, exits and signs, and beside them the other things in blocks."""
        columns = self.layout.row()
        layout, things = columns.column(), columns.column()  # one column is higher than most windows
        _draw_blocks(layout, (_ROADS,))
        layout.separator()
        things.operator_context = layout.operator_context
        for kind, text in KINDS.items():
            entry = layout.operator(SYNTHROADS_OT_add_turnout.bl_idname, text=text, icon=TURNOUT_ICONS[kind])
            entry.kind = kind
        for number, group in enumerate(menu_groups()):
            block = layout if number < _BLOCKS_BESIDE_ROADS else things
            if block is layout or number > _BLOCKS_BESIDE_ROADS:
                block.separator()
            for kind in group:
                entry = block.operator(
                    SYNTHROADS_OT_add_thing.bl_idname, text=thing_name(kind), icon=ICONS.get(kind, "DOT")
                )
                entry.kind = kind


class SYNTHROADS_MT_turnouts(bpy.types.Menu):
    """Menu Object > SynthRoads > Exits and Bays: each of the road's exits, entries and bays changed or deleted."""

    bl_idname = "SYNTHROADS_MT_turnouts"
    bl_label = "Exits and Bays"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw two entries for each one."""
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        for name in turnouts_of(context.scene):
            title = turnout_name(name)
            entry = layout.operator(
                SYNTHROADS_OT_change_turnout.bl_idname, text=f"Change {title}...", icon="GREASEPENCIL"
            )
            entry.turnout = name
            entry = layout.operator(SYNTHROADS_OT_delete_turnout.bl_idname, text=f"Delete {title}", icon="TRASH")
            entry.turnout = name


class SYNTHROADS_MT_object(bpy.types.Menu):
    """Menu Object > SynthRoads: what is done with a road."""

    bl_idname = "SYNTHROADS_MT_object"
    bl_label = "SynthRoads"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the entries in blocks: the road, scans, files."""
        self.layout.menu(SYNTHROADS_MT_alignment.bl_idname, icon="CURVE_PATH")
        self.layout.menu(SYNTHROADS_MT_turnouts.bl_idname, icon="TRIA_RIGHT")
        _draw_blocks(self.layout, _WORK)


def _draw_add(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    menu.layout.menu(SYNTHROADS_MT_add.bl_idname, icon="CURVE_PATH")


def _draw_object(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.menu(SYNTHROADS_MT_object.bl_idname, icon="CURVE_PATH")


def _draw_context(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw what is done with a curve, or a thing of the road, that is clicked with the right mouse button."""
    layout = menu.layout
    if active_curve(context) is not None:
        layout.separator()
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.operator(SYNTHROADS_OT_road_from_curve.bl_idname, icon="CURVE_DATA")
    if find_road(context.scene) is None:
        return
    layout.separator()
    layout.operator_context = "INVOKE_REGION_WIN"
    if thing_of(context.view_layer.objects.active, context.scene) is not None:
        layout.operator(SYNTHROADS_OT_repeat_thing.bl_idname, icon="MOD_ARRAY")
        layout.operator(SYNTHROADS_OT_delete_thing.bl_idname, icon="TRASH")
    layout.menu(SYNTHROADS_MT_object.bl_idname, icon="CURVE_PATH")
    layout.menu(SYNTHROADS_MT_add.bl_idname, text="Add to Road", icon="ADD")


def _draw_convert(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw Road from Curve beside Blender's own conversions of the active curve."""
    menu.layout.separator()
    menu.layout.operator(SYNTHROADS_OT_road_from_curve.bl_idname, icon="CURVE_PATH")


_MENUS = (
    ("VIEW3D_MT_object_convert", _draw_convert),
    ("VIEW3D_MT_add", _draw_add),
    ("VIEW3D_MT_object", _draw_object),
    ("VIEW3D_MT_object_context_menu", _draw_context),
)


def register() -> None:
    """Add the entries to Blender's menus."""
    for name, draw in _MENUS:
        getattr(bpy.types, name).append(draw)


def unregister() -> None:
    """Remove the entries from Blender's menus."""
    for name, draw in _MENUS:
        getattr(bpy.types, name).remove(draw)
