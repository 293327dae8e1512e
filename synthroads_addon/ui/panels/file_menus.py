"""File > Import, File > Export, and files dropped onto a 3D view: parameter sets, axes, clouds.

Annotations are not postponed here: Blender reads the properties from them.
"""

import bpy

from .cloud_view import AVAILABLE, SYNTHROADS_OT_show_cloud
from .export import SYNTHROADS_OT_export_cloud, SYNTHROADS_OT_export_twin
from .road_files import SYNTHROADS_OT_load_axis, SYNTHROADS_OT_load_road, SYNTHROADS_OT_save_road
from .scan_road import SYNTHROADS_OT_road_from_scan

_AXES = (
    *(".csv", ".txt", ".geojson", ".xodr", ".xml", ".ifc", ".kml", ".gpx"),
    *(".osm", ".pbf", ".gpkg", ".shp", ".fgb", ".sbet", ".out"),
)


class _DropHandler:
    """Base of handlers for files that are dropped onto a 3D view."""

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        """Return whether the file is dropped onto a 3D view."""
        return bool(context.area) and context.area.type == "VIEW_3D"


class SYNTHROADS_FH_parameters(_DropHandler, bpy.types.FileHandler):
    """Handler of dropped parameter sets (.json)."""

    bl_idname = "SYNTHROADS_FH_parameters"
    bl_label = "SynthRoads Parameter Set"
    bl_import_operator = SYNTHROADS_OT_load_road.bl_idname
    bl_export_operator = SYNTHROADS_OT_save_road.bl_idname
    bl_file_extensions = ".json"


class SYNTHROADS_FH_axis(_DropHandler, bpy.types.FileHandler):
    """Handler of dropped centrelines: roads of other programs (.xodr, .xml, .ifc), of maps, and measured lines."""

    bl_idname = "SYNTHROADS_FH_axis"
    bl_label = "SynthRoads Centreline"
    bl_import_operator = SYNTHROADS_OT_load_axis.bl_idname
    bl_file_extensions = ";".join(_AXES)


class SYNTHROADS_FH_cloud(_DropHandler, bpy.types.FileHandler):
    """Handler of dropped point clouds, without .ply, which Blender's own importer handles as well."""

    bl_idname = "SYNTHROADS_FH_cloud"
    bl_label = "SynthRoads Point Cloud"
    bl_import_operator = SYNTHROADS_OT_show_cloud.bl_idname
    bl_file_extensions = ";".join(ending for ending in AVAILABLE if ending != ".ply")


def _draw_import(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    layout = menu.layout
    layout.operator(SYNTHROADS_OT_load_road.bl_idname, text="SynthRoads Parameter Set (.json)")
    layout.operator(
        SYNTHROADS_OT_load_axis.bl_idname, text="SynthRoads Centreline (.xodr, .xml, .ifc, .osm, .gpkg, .csv, ...)"
    )
    endings = ", ".join(AVAILABLE)
    layout.operator(SYNTHROADS_OT_road_from_scan.bl_idname, text=f"SynthRoads Road from a Scan ({endings})")


def _draw_export(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    layout = menu.layout
    layout.operator(SYNTHROADS_OT_save_road.bl_idname, text="SynthRoads Parameter Set (.json)")
    layout.operator(SYNTHROADS_OT_export_twin.bl_idname, text="SynthRoads Model (CityJSON, IFC, OpenDRIVE)")
    layout.operator(SYNTHROADS_OT_export_cloud.bl_idname, text="SynthRoads Point Cloud")


def register() -> None:
    """Add SynthRoads' entries to Blender's menus File > Import and File > Export."""
    bpy.types.TOPBAR_MT_file_import.append(_draw_import)
    bpy.types.TOPBAR_MT_file_export.append(_draw_export)


def unregister() -> None:
    """Remove SynthRoads' entries from Blender's menus File > Import and File > Export."""
    bpy.types.TOPBAR_MT_file_import.remove(_draw_import)
    bpy.types.TOPBAR_MT_file_export.remove(_draw_export)
