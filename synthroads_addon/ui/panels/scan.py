"""Lower part of the Scanner panel: where the files go, the button, and how far the scan is."""

from __future__ import annotations

from typing import Any

import bpy

from ...blender.model.store import find_road
from ...blender.things.model_builder import ROLE
from ..fields.drawing import value_row
from ..fields.preferences import preferences
from ..work.common import large_button
from ..work.long_operator import draw_job
from ..work.scan import SYNTHROADS_OT_scan, last_written
from ..work.scan_job import Written

_SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


def draw_folder(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw where the files go; greyed where the preferences say it."""
    value_row(layout, "Folder").prop(settings, "output", text="", placeholder=preferences().output_folder)


def draw_scan(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the folder and the button; while something is at work, how far it is."""
    settings = context.scene.synthroads
    if draw_job(layout):
        return
    if find_road(context.scene) is None:
        layout.label(text="Build a road first", icon="INFO")
    else:
        _others(layout, context)
        if settings.needs_saved_file():
            _ask_to_save(layout, settings)
    large_button(layout).operator(SYNTHROADS_OT_scan.bl_idname, icon="LIGHT_AREA")
    if (written := last_written()) is not None:
        _result(layout, settings, written)


def _ask_to_save(layout: bpy.types.UILayout, settings: Any) -> None:
    row = layout.row(align=True)
    row.alert = True
    row.label(text="Save the file, or choose a folder", icon="ERROR")
    row.operator("wm.save_mainfile", text="", icon="FILE_TICK")
    draw_folder(layout, settings)


def _others(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Say that objects of the user's own are scanned as well."""
    count = sum(item.type in _SOLID and ROLE not in item for item in context.visible_objects)
    if count:
        text = "1 other object is scanned too" if count == 1 else f"{count} other objects are scanned too"
        layout.label(text=text, icon="INFO")


def _result(layout: bpy.types.UILayout, settings: Any, written: Written) -> None:
    """Show what the last scan wrote, as long as the panel names its folder."""
    if settings.needs_saved_file() or not settings.chosen_folder().strip() or settings.folder() != written.target:
        return
    row = layout.row(align=True)
    row.label(text=f"{written.points:,} points written", icon="CHECKMARK")
    row.operator("wm.path_open", text="", icon="FILE_FOLDER").filepath = str(written.target)
