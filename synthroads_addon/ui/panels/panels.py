"""The panels in the 3D view's sidebar: those made of the scenario's fields (`sheets`), and what some have beside."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import bpy

from ...blender.model.store import BUILT_FROM, find_road
from ...blender.things.model_builder import ROLE, SUPPORT
from ..drawing.links import curve_name
from ..fields.preferences import preferences
from ..fields.room import buttons_row, draw_flag, draw_menu, draw_text, value_row
from ..fields.sheets import SHEETS, PanelFields, fields_of
from ..translations.blender import said
from ..work.build import SYNTHROADS_OT_build
from ..work.common import Sidebar, column, large_button
from ..work.edited import draw_edits
from ..work.long_operator import draw_job
from ..work.scan import SYNTHROADS_OT_scan, last_written
from ..work.scan_steps import Written
from .cloud_view import SYNTHROADS_OT_show_cloud
from .edit import open_parameters
from .export import draw_missing_packages
from .presets import (
    SYNTHROADS_MT_devices,
    SYNTHROADS_MT_scenarios,
    SYNTHROADS_OT_random_road,
    device_title,
    scenario_title,
)
from .road_choice import draw_road_choice, draw_road_name
from .road_files import draw_road_files, source_file_name
from .scan_road import SYNTHROADS_OT_road_from_scan
from .scene_scan import draw_scene_scan

_BOX_SHARE = 0.92
_OTHER_LENGTH = 0.5
"""From so large a difference on, m, the road's length is another one than the settings'."""
_LENGTH = re.compile(r"^[\d.,]+ k?m\b")
_SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class SheetPanel(Sidebar):
    """Base of panels that draw the scenario fields listed in their `Sheet`."""

    sheet: ClassVar[PanelFields]
    layout: bpy.types.UILayout

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel: the fields of its sheet."""
        self.draw_fields(column(self), context.scene.synthroads)

    def draw_fields(self, layout: bpy.types.UILayout, settings: Any) -> None:
        """Draw every field of the sheet into a layout, each as its kind is drawn."""
        for field in fields_of(self.sheet):
            field.draw(layout, settings)


class MainPanel(SheetPanel):
    """Panel with the scenario's menu and its fidelity."""

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the first steps where there is no road yet, the menu of scenarios and the sheet's fields."""
        layout, settings = column(self), context.scene.synthroads
        if find_road(context.scene) is None:
            draw_first_steps(layout)
        parameters = open_parameters(context.scene)
        length = settings.road.length if parameters is None else parameters.alignment.length
        title = with_length(scenario_title(settings.preset), length)
        draw_menu(layout, SYNTHROADS_MT_scenarios.bl_idname, title, "Scenario")
        self.draw_fields(layout, settings)


FIRST_STEPS = (
    "1. Choose a scenario below",
    "2. Road: press Build Road",
    "3. Click a part, and change it in Road > Edit",
    "4. Scanner: choose a device, and press Scan",
)
"""Steps of a new user, in order."""


def draw_first_steps(layout: bpy.types.UILayout) -> None:
    """Draw the way from an empty scene to a cloud, in four steps."""
    box = layout.box().column(align=True)
    box.label(text="First Steps", icon="INFO")
    for step in FIRST_STEPS:
        draw_text(box, step, share=_BOX_SHARE)


def with_length(title: str, length: float) -> str:
    """Return a scenario's title with another road's length (m) where it begins with its own: ``600 m of motorway``."""
    return _LENGTH.sub(f"{length:,.0f} m", title, count=1)


class RoadPanel(SheetPanel):
    """Panel of the road with the buttons to build, load and save it."""

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the choice of road, the fields, notes on the road's source and edits, and the buttons."""
        layout, settings = column(self), context.scene.synthroads
        draw_road_choice(layout, context)
        self.draw_fields(layout, settings)
        if (seed := settings.exact_seed()) != settings.seed:
            draw_text(layout, f"Seed of the file: {seed}", "INFO")
        road = find_road(context.scene)
        parameters = open_parameters(context.scene)
        if parameters is not None and abs(parameters.alignment.length - settings.road.length) >= _OTHER_LENGTH:
            draw_text(layout, f"Length of the road: {parameters.alignment.length:,.0f} m", "DRIVER_DISTANCE")
        if road and source_file_name(road):
            draw_text(layout, f"Built from {source_file_name(road)}", "FILE")
        elif road and curve_name(road):
            draw_text(layout, f"Built along {curve_name(road)}", "CURVE_DATA")
        elif road and not road.get(BUILT_FROM):
            draw_text(layout, "Built by a command, not from these settings", "FILE")
        elif road and road.get(BUILT_FROM) != settings.road_values():
            draw_text(layout, "Changed since it was built", "INFO")
        draw_edits(layout, context)
        if draw_job(layout):
            return
        text = said("Rebuild Road") if road else said("Build Road")
        row = buttons_row(large_button(layout), (text, "Random Road"))
        row.operator(SYNTHROADS_OT_build.bl_idname, text=text, icon="MOD_BUILD")
        row.operator(SYNTHROADS_OT_random_road.bl_idname, text="Random Road", icon="FILE_REFRESH")
        draw_road_files(layout).operator(SYNTHROADS_OT_road_from_scan.bl_idname, icon="POINTCLOUD_DATA")


class ScannerPanel(SheetPanel):
    """Panel of the scanner with the scan button."""

    def draw_fields(self, layout: bpy.types.UILayout, settings: Any) -> None:
        """Draw the sheet's fields; the device is a menu."""
        for field in fields_of(self.sheet):
            if field.path == "scan.device":
                draw_menu(layout, SYNTHROADS_MT_devices.bl_idname, device_title(settings.scan.device), "Device")
            else:
                field.draw(layout, settings)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the fields, then the scan button, progress or last result."""
        layout = column(self)
        self.draw_fields(layout, context.scene.synthroads)
        draw_scan(layout, context)


class OutputPanel(SheetPanel):
    """Panel of the output folder and the files to write."""

    def draw(self, context: bpy.types.Context) -> None:
        """Draw folder, overwrite flag and fields, and which packages are missing."""
        layout, settings = column(self), context.scene.synthroads
        draw_folder(layout, settings)
        draw_flag(layout, settings, "overwrite", "Replace Files")
        self.draw_fields(layout, settings)
        draw_missing_packages(layout, context)


def draw_folder(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw the output folder's text field, with the preferences' folder as placeholder."""
    value_row(layout, "Folder").prop(settings, "output", text="", placeholder=preferences().output_folder)


def draw_scan(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the scan button with notes and the last result, or the progress of running work."""
    settings = context.scene.synthroads
    if draw_job(layout):
        return
    if find_road(context.scene) is None:
        draw_scene_scan(layout, context)
    else:
        draw_road_name(layout, context)
        _draw_other_objects(layout, context)
    if settings.needs_saved_file():
        _draw_request_to_save(layout, settings)
    large_button(layout).operator(SYNTHROADS_OT_scan.bl_idname, icon="LIGHT_AREA")
    if (written := last_written()) is not None:
        _draw_result(layout, settings, written)


def _draw_request_to_save(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw what an unsaved file needs before it can be scanned: a note, a button to save it, or the output folder."""
    row = layout.row(align=True)
    row.alert = True
    draw_text(row, "Save the file, or choose a folder", "ERROR", beside=1)
    row.operator("wm.save_mainfile", text="", icon="FILE_TICK")
    draw_folder(layout, settings)


def _draw_other_objects(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a note on the number of visible objects that aren't the road's but are scanned too."""
    count = sum(
        item.type in _SOLID and not (item.hide_render or ROLE in item or SUPPORT in item)
        for item in context.visible_objects
    )
    if count:
        text = "1 other object is scanned too" if count == 1 else f"{count} other objects are scanned too"
        draw_text(layout, text, "INFO")


def _draw_result(layout: bpy.types.UILayout, settings: Any, written: Written) -> None:
    """Draw the number of points of the last scan and a button for its folder, if that is the panel's folder."""
    if settings.needs_saved_file() or not settings.chosen_folder().strip() or settings.folder() != written.target:
        return
    row = layout.row(align=True)
    draw_text(row, f"{written.points:,} points written", "CHECKMARK", beside=1)
    row.operator("wm.path_open", text="", icon="FILE_FOLDER").filepath = str(written.target)
    layout.operator(SYNTHROADS_OT_show_cloud.bl_idname, icon="POINTCLOUD_DATA")


_OWN_PANELS = {"main": MainPanel, "road": RoadPanel, "scanner": ScannerPanel, "output": OutputPanel}


def _panel(sheet: PanelFields) -> type:
    """Create and return the Blender panel class of a sheet."""
    base = _OWN_PANELS.get(sheet.name, SheetPanel)
    parent = {"bl_parent_id": f"SYNTHROADS_PT_{sheet.parent}"} if sheet.parent else {}
    members = {
        "__doc__": sheet.title,
        "bl_idname": sheet.panel,
        "bl_label": sheet.title,
        "bl_order": sheet.order,
        "bl_options": {"DEFAULT_CLOSED"} if sheet.closed else set(),
        "sheet": sheet,
    }
    return type(sheet.panel, (base, bpy.types.Panel), members | parent)


CLASSES = tuple(_panel(sheet) for sheet in SHEETS)
