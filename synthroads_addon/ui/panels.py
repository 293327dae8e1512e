"""The sidebar panel in the 3D view."""

from __future__ import annotations

import bpy

from ..blender.kept_road import BUILT_FROM, find_road
from ..blender.model_builder import ROLE
from . import scan_job
from .operators import SYNTHROADS_OT_build, SYNTHROADS_OT_cancel_scan, SYNTHROADS_OT_scan
from .properties import SYNTHROADS_PG_settings
from .scan_job import ScanJob

_SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class _Sidebar:
    bl_category = "SynthRoads"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"


class SYNTHROADS_PT_main(_Sidebar, bpy.types.Panel):
    """The panel that holds the others."""

    bl_label = "SynthRoads"

    def draw(self, context: bpy.types.Context) -> None:
        """Show what everything starts from."""
        layout, settings = _column(self), context.scene.synthroads
        layout.prop(settings, "preset")
        layout.prop(settings, "fidelity")


class SYNTHROADS_PT_road(_Sidebar, bpy.types.Panel):
    """What the road is."""

    bl_label = "Road"
    bl_parent_id = "SYNTHROADS_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        """Show the road's settings and its button."""
        layout, settings = _column(self), context.scene.synthroads
        for name in ("cross_section", "length", "seed"):
            layout.prop(settings, name)
        road = find_road(context.scene)
        if road and road.get(BUILT_FROM) != settings.road_values():
            layout.label(text="Changed since it was built", icon="INFO")
        text = "Rebuild Road" if road else "Build Road"
        _button(layout).operator(SYNTHROADS_OT_build.bl_idname, text=text, icon="MOD_BUILD")


class SYNTHROADS_PT_scanner(_Sidebar, bpy.types.Panel):
    """How it is scanned."""

    bl_label = "Scanner"
    bl_parent_id = "SYNTHROADS_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        """Show the scanner's settings and its button."""
        layout, settings = _column(self), context.scene.synthroads
        for name in ("device", "platform", "height", "speed", "output", "overwrite"):
            layout.prop(settings, name)
        job = scan_job.latest
        if job and job.running:
            _progress(layout, job)
            return
        if find_road(context.scene) is None:
            layout.label(text="Build a road first", icon="INFO")
        else:
            _others(layout, context)
            if settings.needs_saved_file():
                _ask_to_save(layout)
        _button(layout).operator(SYNTHROADS_OT_scan.bl_idname, icon="LIGHT_AREA")
        if job and job.points is not None:
            _result(layout, settings, job)


def _column(panel: bpy.types.Panel) -> bpy.types.UILayout:
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def _button(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    row = layout.row()
    row.scale_y = 1.4
    return row


def _progress(layout: bpy.types.UILayout, job: ScanJob) -> None:
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.progress(factor=job.share, text=job.state)
    row.operator(SYNTHROADS_OT_cancel_scan.bl_idname, text="", icon="X")


def _ask_to_save(layout: bpy.types.UILayout) -> None:
    row = layout.row(align=True)
    row.alert = True
    row.label(text="Save the file, or choose a folder", icon="ERROR")
    row.operator("wm.save_mainfile", text="", icon="FILE_TICK")


def _others(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Say that objects of the user's own are scanned as well."""
    count = sum(item.type in _SOLID and ROLE not in item for item in context.visible_objects)
    if count:
        text = "1 other object is scanned too" if count == 1 else f"{count} other objects are scanned too"
        layout.label(text=text, icon="INFO")


def _result(layout: bpy.types.UILayout, settings: SYNTHROADS_PG_settings, job: ScanJob) -> None:
    """Show what the last scan wrote, as long as the panel names its folder."""
    if settings.needs_saved_file() or not settings.output or settings.folder() != job.target:
        return
    row = layout.row(align=True)
    row.label(text=f"{job.points:,} points written", icon="CHECKMARK")
    row.operator("wm.path_open", text="", icon="FILE_FOLDER").filepath = str(job.target)


CLASSES = (SYNTHROADS_PT_main, SYNTHROADS_PT_road, SYNTHROADS_PT_scanner)
