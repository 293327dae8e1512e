"""Roads from files and to files: parameter sets, and measured centrelines that a road is fitted to.

Annotations are not postponed here: Blender reads the properties from them.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import bpy

from ...base.errors import InputError
from ...base.files import output_folder
from ...blender.model.build import BuildTarget
from ...blender.model.store import BUILT_FROM, find_road, recall_parameters
from ...fitting.fit import AxisRefusedError
from ...fitting.plot import axis_picture
from ...jobs.axis_points import FARTHEST_ABOVE, FARTHEST_ASIDE, NOWHERE_ELSE, PathPlace
from ...jobs.axis_source import axis_summary
from ...jobs.generate import RoadSource
from ...jobs.whole_road import SURFACE, has_whole_road
from ...road.parameters import RoadParameters
from ...road_files.kinks import FARTHEST_ROUNDING
from ...scenario.road import RoadScenario
from ...scenario.scenario import Scenario
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.room import buttons_row
from ..translations.blender import said
from ..work.build import road_work, shown_place
from ..work.common import column, has_road, refusing
from ..work.job import Aside, PanelJob, Work
from ..work.long_operator import FileOperator
from ..work.pictures import FIT_PICTURE, ShowPicture, keep_picture
from ..work.view import look_along, view_of
from .presets import JsonFileChooser
from .rules import edited_parameters

_FROM_FILE, _NAME = "file", "parameters.json"


def from_file(path: Path) -> str:
    """Return the text that is kept with a road of what it was built from: this file."""
    return json.dumps([_FROM_FILE, path.name])


def source_file_name(road: bpy.types.Object) -> str | None:
    """Return the name of the file that a road was built from; None if it was built from settings."""
    try:
        what, name = json.loads(road[BUILT_FROM])
    except (KeyError, TypeError, ValueError):
        return None
    return str(name) if what == _FROM_FILE else None


class RoadLoader(FileOperator):
    """Base of operators that build a road from a file, read in a thread."""

    filepath: bpy.props.StringProperty(
        name="File", description="File that is read or written", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    _first = False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Build from the file that was dropped, or open the file browser if there is none."""
        return self.begin(context) if self.filepath else super().invoke(context, event)

    def job(self, context: bpy.types.Context) -> PanelJob[str]:
        """Return the job that reads the file in a thread and builds its road."""
        self._first = find_road(context.scene) is None
        path, scenario = self.chosen_file(), context.scene.synthroads.scenario()
        place = replace(shown_place(context.scene), keep_moves=False)  # the file says where its road lies
        return PanelJob("Build", self._work(path, scenario, place))

    def succeed(self, context: bpy.types.Context, job: PanelJob[str]) -> str:
        """Turn the view to the road if it is the first; return the message."""
        road, space = find_road(context.scene), view_of(context)
        if self._first and not bpy.app.background and road and space:
            look_along(space, recall_parameters(road))
        return str(job.result)

    def _work(self, path: Path, scenario: Scenario, place: BuildTarget) -> Work[str]:
        parameters, message = yield Aside(lambda _: self.read(path, scenario), "Reading", 0.0, 0.02)
        yield from road_work(parameters, scenario, from_file(path), place)
        return message

    def read(self, path: Path, scenario: Scenario) -> tuple[RoadParameters, str]:
        """Return a file's road parameters and the message for when it is built; runs in a thread."""
        raise NotImplementedError


class SYNTHROADS_OT_load_road(RoadLoader, bpy.types.Operator):
    """Build the road of a parameter set, at the panel's fidelity. It replaces the road that was built before"""

    bl_idname = "synthroads.load_road"
    bl_label = "Load Parameter Set"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def read(self, path: Path, scenario: Scenario) -> tuple[RoadParameters, str]:
        """Return the parameter set in a file, and the message for when it is built."""
        parameters, _ = RoadSource(scenario, parameters=path).read()
        return parameters, f"Built {parameters.alignment.length:,.0f} m of road from {path.name}"


class SYNTHROADS_OT_load_axis(RoadLoader, bpy.types.Operator):
    """Build the road of an OpenDRIVE file, or a road along a centreline: the alignment of a LandXML or IFC file, or one fitted to the points of a map (OpenStreetMap, GeoPackage, shapefile) or a survey (CSV with x, y, z, GeoJSON, KML, GPX, SBET). The cross-section then comes from the panel, and the lanes from OpenStreetMap where given. The road replaces the one built before"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.load_axis"
    bl_label = "Along Centreline"
    filter_glob: bpy.props.StringProperty(
        default="*.xodr;*.xml;*.ifc;*.osm;*.pbf;*.gpkg;*.shp;*.fgb;*.kml;*.gpx;*.sbet;*.out;*.csv;*.txt;*.geojson;*.json",
        options={"HIDDEN"},
    )
    option_labels: ClassVar = {
        "--axis-name": "Name",
        "--offset-from-path": "Offset",
        "--path-lane": "Lane",
        "--height-above-road": "Height",
        "--round-kinks": "Round Kinks",
    }
    axis_name: bpy.props.StringProperty(
        name="Name",
        description="Road, alignment or line of the file; if empty, the longest one that is a road by itself",
        options={"SKIP_SAVE"},
    )
    points_are: bpy.props.EnumProperty(
        name="Points",
        items=[
            ("AXIS", "The Axis", "The file's points are those of the axis"),
            ("BESIDE", "Beside the Axis", "The axis lies at an offset from the file's points"),
            ("LANE", "In a Lane", "The file's points lie in the middle of a lane"),
        ],
        description="Where on the road a line of points or a vehicle's path runs; designed roads have their own axis",
        options={"SKIP_SAVE"},
    )
    offset: bpy.props.FloatProperty(
        name="Offset",
        description="Distance from the points to the axis, positive to the left in the direction of the points",
        min=-FARTHEST_ASIDE,
        max=FARTHEST_ASIDE,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    lane: bpy.props.IntProperty(
        name="Lane",
        description="Number of the lane, counted from outside, 0 for the outermost; traffic keeps right",
        min=0,
        max=7,
        options={"SKIP_SAVE"},
    )
    height: bpy.props.FloatProperty(
        name="Height",
        description="Height of the points above the road; 0 keeps the heights of the points",
        min=-FARTHEST_ABOVE,
        max=FARTHEST_ABOVE,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    round_kinks: bpy.props.FloatProperty(
        name="Round Kinks",
        description="How far roundings may be from kinks of a designed line. At 0 a line with kinks is refused",
        min=0.0,
        max=FARTHEST_ROUNDING,
        step=1,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    # The fields as they are when the job begins: the file is read in a thread.
    _name, _place, _round_kinks = "", NOWHERE_ELSE, None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings beside the file browser."""
        layout = column(self)
        aside = {"AXIS": (), "BESIDE": ("offset",), "LANE": ("lane",)}[self.points_are]
        for name in ("axis_name", "points_are", *aside, "height", "round_kinks"):
            layout.prop(self, name)

    def job(self, context: bpy.types.Context) -> PanelJob[str]:
        """Return the job that reads the file in a thread and builds its road."""
        self._name = self.axis_name.strip()
        self._place = PathPlace(
            exact(self.offset, None) if self.points_are == "BESIDE" else None,
            self.lane if self.points_are == "LANE" else None,
            exact(self.height, None) or None,
        )
        self._round_kinks = exact(self.round_kinks, None) or None
        return super().job(context)

    def read(self, path: Path, scenario: Scenario) -> tuple[RoadParameters, str]:
        """Take the file's whole road, or fit an alignment to its centreline; return the road, and the message."""
        if scenario.road.epsg == RoadScenario.model_fields["epsg"].default:
            road = scenario.road.model_copy()
            road.model_fields_set.discard("epsg")
            scenario = scenario.model_copy(update={"road": road})
        whole = has_whole_road(path)
        source = RoadSource(
            scenario,
            axis=None if whole else path,
            road=path if whole else None,
            axis_name=self._name or None,
            axis_place=self._place,
            round_kinks=self._round_kinks,
        )
        parameters, report = source.read()
        text = f"Built {parameters.alignment.length:,.0f} m of road {'of' if whole else 'along'} {path.name}"
        surface = any(text.startswith(SURFACE) for text in report["axis"].get("left_out", ()))
        surface |= report["axis"].get("whole", {}).get("surface_lost", False)
        loss_text = "; parts of its surface were left out" if surface else ""
        return parameters, f"{text}: {axis_summary(report['axis'])}{loss_text}"

    def refuse(self, error: InputError) -> set[str]:
        """Report an error; if the fit misses its points, also keep a picture of it."""
        if not isinstance(error, AxisRefusedError):
            return super().refuse(error)
        keep_picture(FIT_PICTURE, axis_picture(error.fit, error.name))
        return super().refuse(error.with_picture("Show Missed Axis"))


class SYNTHROADS_OT_show_fit(ShowPicture, bpy.types.Operator):
    """Show in an image editor how far the last fitted road is from its points, by station"""

    bl_idname = "synthroads.show_fit"
    bl_label = "Show Missed Axis"
    picture = FIT_PICTURE
    no_picture = "No centreline has been missed"


class SYNTHROADS_OT_save_road(JsonFileChooser, bpy.types.Operator):
    """Write the parameter set of the road as it is edited now"""

    bl_idname = "synthroads.save_road"
    bl_label = "Save Parameter Set"

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return has_road(cls, context)

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the file browser's path to `parameters.json` beside the .blend file, if none is set."""
        if not self.filepath:
            self.filepath = str(Path(bpy.data.filepath).with_name(_NAME)) if bpy.data.filepath else _NAME

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Write the road's parameter set with edits read back; an existing file is replaced."""
        parameters, path = edited_parameters(context.scene), self.chosen_file().with_suffix(".json")
        assert parameters  # poll() has seen the road
        with output_folder(path.parent, [path.name], overwrite=True) as folder:
            (folder / path.name).write_text(parameters.to_json(), encoding="utf-8")
        self.report({"INFO"}, said(f"Parameter set written to {path}"))


def draw_road_files(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Draw buttons to load and save a parameter set fit an axis, and show a missed fit; return their layout."""
    column = layout.column(align=True)
    row = buttons_row(column, ("Load Set", "Save Set"), align=True)
    row.operator(SYNTHROADS_OT_load_road.bl_idname, text="Load Set", icon="IMPORT")
    row.operator(SYNTHROADS_OT_save_road.bl_idname, text="Save Set", icon="EXPORT")
    column.operator(SYNTHROADS_OT_load_axis.bl_idname, icon="CURVE_PATH")
    if FIT_PICTURE in bpy.data.images:
        column.operator(SYNTHROADS_OT_show_fit.bl_idname, icon="IMAGE_DATA")
    return column
