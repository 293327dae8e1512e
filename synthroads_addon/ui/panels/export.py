"""Export: clouds in other formats, thinner or with fewer classes; and the road as a geometric-semantic model.

Annotations are not postponed here: Blender reads the properties from them.
"""

import importlib
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError
from ...base.files import output_folder
from ...cloud.formats.registry import missing_package as cloud_package
from ...cloud.formats.registry import with_ending
from ...cloud.tools.convert import convert, subsample
from ...cloud.tools.display import BLOCK
from ...road.parameters import RoadParameters
from ...twin.formats import (
    FORMATS,
    TOLERANCE,
    TWIN_FORMATS,
    IfcSettings,
    check_formats,
    missing_package,
    twin_file_names,
    write_twin,
)
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.room import draw_text
from ..translations.blender import said
from ..work import common
from ..work.common import Sidebar, column, has_road, is_free, refusing
from ..work.job import PanelJob, Report
from ..work.long_operator import FileChooser, FileOperator, draw_job
from .cloud_view import AVAILABLE, ENDINGS_GLOB, cloud_path, last_cloud
from .road_choice import draw_road_name
from .rules import edited_parameters

IFC_PACKAGE = "ifcopenshell"
_REPOSITORY = "user_default"
"""Blender's name of where extensions from files go."""
_FORMATS = {
    ".laz": ("LAZ", "LAS 1.4, compressed"),
    ".las": ("LAS", "LAS 1.4"),
    ".copc.laz": ("COPC", "LAZ ordered for viewers that load what they show"),
    ".ply": ("PLY", "Polygon file format, binary, points only"),
    ".pcd": ("PCD", "Point Cloud Library, binary"),
    ".e57": ("E57", "ASTM E57"),
    ".npz": ("NPZ", "NumPy arrays"),
}


def export_cloud(source: Path, output: Path, classes: str | None, spacing: float, report: Report) -> dict[str, Any]:
    """Write a cloud in the format of `output`'s ending, thinned if `spacing` (m) is above 0; return counts."""

    def progress(stage: str, share: float) -> None:
        report(share)

    if spacing > 0.0:
        return subsample(source, output, spacing, classes, overwrite=True, progress=progress, block_size=BLOCK)
    return convert(source, output, classes, overwrite=True, progress=progress, block_size=BLOCK)


def export_twin(
    parameters: RoadParameters,
    folder: Path,
    formats: Sequence[str],
    tolerance: float,
    ifc: IfcSettings,
    local_projection: bool,
    overwrite: bool,
    report: Report,
) -> tuple[str, ...]:
    """Write a road's geometric-semantic model into a folder, all formats or none; return the names of the files."""
    names = twin_file_names(formats)
    with output_folder(folder, names, overwrite) as temporary:
        write_twin(parameters, temporary, formats, tolerance, ifc, local_projection, lambda _, share: report(share))
        report(1.0)  # the last chance to stop
    return names


class SYNTHROADS_OT_export_cloud(FileOperator, bpy.types.Operator):
    """Write the last scan's cloud, or any other, in another format, thinned out or with fewer classes"""

    bl_idname = "synthroads.export_cloud"
    bl_label = "Export Cloud"
    nothing_done = "nothing was written"

    filepath: bpy.props.StringProperty(
        name="File", description="File that is read or written", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    filter_glob: bpy.props.StringProperty(default=ENDINGS_GLOB, options={"HIDDEN"})
    source: bpy.props.StringProperty(
        name="Cloud", description="Cloud to read; if empty, that of the last scan", options={"SKIP_SAVE"}
    )
    format: bpy.props.EnumProperty(
        name="Format", items=[(ending, *_FORMATS[ending]) for ending in AVAILABLE], description="Format of the file"
    )
    classes: bpy.props.EnumProperty(
        name="Classes",
        items=[("own", "As they are", "The classes of the cloud"), ("5", "5", "The 17 classes merged into five")],
        description="Classes to write",
    )
    spacing: bpy.props.FloatProperty(
        name="Spacing",
        description="Edge of the grid cells, each of which keeps one point; 0 keeps all points",
        default=0.0,
        min=0.0,
        max=10.0,
        step=1,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the file browser's path to a file beside the source cloud, if none is set."""
        source = Path(bpy.path.abspath(self.source)) if self.source else last_cloud(context)
        if source is not None and not self.filepath:
            self.filepath = str(source.with_name(f"{source.stem}-export{self.format}"))

    def check(self, context: bpy.types.Context) -> bool:
        """Give `filepath` the ending of the chosen format; return whether that changed it."""
        path = Path(self.filepath)
        if not path.name or path == with_ending(path, self.format):
            return False
        self.filepath = str(with_ending(path, self.format))
        return True

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the export's settings beside the file browser."""
        layout = column(self)
        source = self.source or last_cloud(context)
        layout.label(text=Path(source).name if source else "Scan first, or choose a cloud", icon="POINTCLOUD_DATA")
        for name in ("format", "classes", "spacing"):
            layout.prop(self, name)

    def job(self, context: bpy.types.Context) -> PanelJob[dict[str, Any]]:
        """Return the export as a job in a thread; an existing file is replaced."""
        source, output = cloud_path(context, self.source), self.chosen_file()
        classes = None if self.classes == "own" else self.classes
        work = partial(export_cloud, source, output, classes, exact(self.spacing, None))
        return PanelJob.aside("Export", work, "Exporting")

    def succeed(self, context: bpy.types.Context, job: PanelJob[dict[str, Any]]) -> str:
        """Return the message with the number of points and the file."""
        assert job.result
        return f"{job.result['points']:,} points written to {job.result['output']}"


class SYNTHROADS_OT_export_twin(FileOperator, bpy.types.Operator):
    """Write the road as it is edited now as a geometric-semantic model, in map coordinates"""

    bl_idname = "synthroads.export_twin"
    bl_label = "Export Model"
    nothing_done = "nothing was written"

    directory: bpy.props.StringProperty(
        name="Folder", description="Folder for the files", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    formats: bpy.props.EnumProperty(
        name="Formats",
        items=[(name, FORMATS[name].label, FORMATS[name].description) for name in TWIN_FORMATS],
        options={"ENUM_FLAG"},
        default={"cityjson"},
        description="Formats to write",
    )
    tolerance: bpy.props.FloatProperty(
        name="Tolerance",
        description="Largest chord error of curved surfaces and lines",
        default=TOLERANCE,
        min=0.0001,
        max=1.0,
        precision=LENGTH_DIGITS,
        step=0.1,
        unit="LENGTH",
    )
    ifc_placement: bpy.props.EnumProperty(
        name="IFC Placement",
        items=[
            ("linear", "Along the Alignment", "Objects are placed by distance along the alignment, as in the standard"),
            ("local", "Coordinates", "Objects are placed by coordinates, for viewers without alignments"),
        ],
        description="How objects are placed in IFC",
    )
    local_projection: bpy.props.BoolProperty(
        name="Local Projection",
        description="Write OpenDRIVE in a local projection without offset, for programs that read lat_0 and lon_0 only",
    )
    overwrite: bpy.props.BoolProperty(name="Replace Files", description="Replace files that are already there")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and nothing else is at work."""
        return has_road(cls, context) and is_free(cls, context)

    def suggest(self, context: bpy.types.Context) -> None:
        """Set an empty folder to the panel's output folder, and formats and IFC placement to the scenario's."""
        folder = context.scene.synthroads.folder_to_open()
        if folder is not None and not self.directory:
            self.directory = f"{folder}{os.sep}"
        if context.scene.synthroads.twin:
            self.formats = context.scene.synthroads.twin
        with suppress(InputError):  # a setting of the panel is wrong, which is its own buttons' business
            if chosen := context.scene.synthroads.scenario().ifc:
                self.ifc_placement = chosen.placement

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings beside the file browser; formats whose package is missing are disabled."""
        layout = column(self)
        _draw_formats(layout, self)
        layout.prop(self, "tolerance")
        row = layout.row()
        row.enabled = "ifc" in self.formats
        row.prop(self, "ifc_placement")
        row = layout.row()
        row.enabled = "opendrive" in self.formats
        row.prop(self, "local_projection")
        layout.prop(self, "overwrite")

    def job(self, context: bpy.types.Context) -> PanelJob[tuple[str, ...]]:
        """Return the export of the road, with edits read back, as a job in a thread."""
        parameters = edited_parameters(context.scene)
        assert parameters  # poll() has seen the road
        formats = [name for name in TWIN_FORMATS if name in self.formats]
        if not formats:
            raise InputError("Formats", None, "choose at least one format")
        if not self.directory.strip():
            raise InputError("Folder", None, "choose a folder for the files")
        check_formats(formats)
        folder, tolerance = Path(bpy.path.abspath(self.directory)), exact(self.tolerance, None)
        ifc = IfcSettings(placement=self.ifc_placement)
        work = partial(export_twin, parameters, folder, formats, tolerance, ifc, self.local_projection, self.overwrite)
        return PanelJob.aside("Export", work, "Exporting")

    def succeed(self, context: bpy.types.Context, job: PanelJob[tuple[str, ...]]) -> str:
        """Return the message with the files' names and their folder."""
        assert job.result
        return f"{', '.join(job.result)} written to {bpy.path.abspath(self.directory)}"


class SYNTHROADS_OT_install_ifc(FileChooser, bpy.types.Operator):
    """Install the extension SynthRoads IFC from its file, synthroads_ifc-….zip, so that IFC can be written"""

    bl_idname = "synthroads.install_ifc"
    bl_label = "Install IFC"  # the button of Blender's file browser has no room for more

    filepath: bpy.props.StringProperty(
        name="File", description="File that is read or written", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    filter_glob: bpy.props.StringProperty(default="*.zip", options={"HIDDEN"})

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Install and enable the chosen extension zip, and check that IFC can then be written."""
        path = self.chosen_file()
        if not path.name.startswith("synthroads_ifc") or not path.is_file():
            raise InputError("File", str(path), "choose the zip of SynthRoads IFC: synthroads_ifc-….zip")
        install = bpy.ops.extensions.package_install_files
        install(filepath=str(path), repo=_REPOSITORY, enable_on_install=True)
        importlib.invalidate_caches()
        if missing_package("ifc"):
            raise InputError("File", path.name, "was installed, but Blender can't load it; is it for this platform?")
        self.report({"INFO"}, said("IFC can be written"))


class SYNTHROADS_PT_export(Sidebar, bpy.types.Panel):
    """Panel to export clouds and the road's geometric-semantic model."""

    bl_label = "Export"
    bl_parent_id = "SYNTHROADS_PT_output"
    bl_order = 20
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the export buttons, or the progress of a running export."""
        layout = column(self)
        if draw_job(layout):
            return
        row = layout.row()
        shown = context.scene.synthroads_cloud_view.file
        row.enabled = bool(shown) or last_cloud(context) is not None
        row.operator(SYNTHROADS_OT_export_cloud.bl_idname, icon="EXPORT").source = shown
        draw_road_name(layout, context)
        layout.operator(SYNTHROADS_OT_export_twin.bl_idname, icon="EXPORT")


def _draw_formats(layout: bpy.types.UILayout, operator: SYNTHROADS_OT_export_twin) -> None:
    rows = layout.column(align=True)
    rows.use_property_split = False
    missing = {name: package for name in TWIN_FORMATS if (package := missing_package(name))}
    for name in TWIN_FORMATS:
        row = rows.row()
        row.enabled = name not in missing
        row.prop_enum(operator, "formats", name)
    _draw_missing_packages(rows, {FORMATS[name].label: package for name, package in missing.items()})


def draw_missing_packages(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw which packages the chosen cloud and twin formats need that aren't installed."""
    settings = context.scene.synthroads
    clouds = {_FORMATS[f".{name}"][0]: cloud_package(f".{name}") for name in sorted(settings.cloud.formats)}
    twins = {FORMATS[name].label: missing_package(name) for name in TWIN_FORMATS if name in settings.twin}
    missing = {name: package for name, package in (clouds | twins).items() if package}
    _draw_missing_packages(layout, missing)


def _draw_missing_packages(layout: bpy.types.UILayout, missing: Mapping[str, str]) -> None:
    for name, package in missing.items():
        extra = "twin" if package == IFC_PACKAGE else "e57"
        if not common.RUNS_AS_EXTENSION:
            draw_text(layout, f"{name} needs the package {package}: pip install {package}, with Blender's Python")
            continue
        draw_text(layout, f"{name} {common.IN_BLENDER[extra]}", "INFO")
        if package == IFC_PACKAGE:
            layout.operator(SYNTHROADS_OT_install_ifc.bl_idname, text="Install SynthRoads IFC", icon="IMPORT")
