"""A road from a scan: a cloud becomes an editable road, and the panel says how far it is to be trusted, and where not.

The work is `reconstruction.report`'s, in a thread, and then the building of any road.

Annotations are not postponed here: Blender reads the properties from them.
"""

import json
from dataclasses import replace
from functools import lru_cache
from typing import Any, ClassVar, cast

import bpy

from ...blender.model.build import BuildTarget
from ...blender.model.store import FOUND, find_road, recall_parameters
from ...reconstruction.layout import RoadKind
from ...reconstruction.report import (
    FIT_TOLERANCE,
    TOLERANCES,
    ReconstructedRoad,
    ReconstructionJob,
    doubt_lines,
    measure_lines,
    run_reconstruction,
)
from ...road.geometry import RoadGeometry
from ...scenario.scenario import Scenario
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.room import draw_text
from ..translations.blender import said
from ..work.build import road_work, shown_place
from ..work.common import Sidebar, column, refusing
from ..work.job import Aside, PanelJob, Report, Work, part_of_work
from ..work.view import look_at_place, redraw_views, view_of
from .cloud_view import ENDINGS_GLOB, SYNTHROADS_OT_show_cloud
from .road_files import RoadLoader, from_file

_FINDING = 0.7
"""Share of the work that is done when the road is found, before it is built."""
_BOX_SHARE = 0.92


class SYNTHROADS_OT_road_from_scan(RoadLoader, bpy.types.Operator):
    """Find the road in a cloud, and build it from its measured parameters. It replaces the road built before"""

    bl_idname = "synthroads.road_from_scan"
    bl_label = "Road from a Scan"
    option_labels: ClassVar = {"--path": "Course", "--road": "Carriageways"}
    filter_glob: bpy.props.StringProperty(default=ENDINGS_GLOB, options={"HIDDEN"})
    road: bpy.props.EnumProperty(
        name="Carriageways",
        items=[
            ("auto", "Automatic", "Found in the cloud"),
            ("dual", "Dual", "Two carriageways with a median"),
            ("single", "Single", "One carriageway"),
        ],
        description="Kind of road, if known",
    )
    course: bpy.props.StringProperty(
        name="Course",
        subtype="FILE_PATH",
        description="Approximate course of the road (CSV or GeoJSON, in the cloud's coordinates), if it isn't found",
    )
    tolerance: bpy.props.FloatProperty(
        name="Tolerance",
        description="Largest root mean square distance of the alignment from the measured axis",
        default=FIT_TOLERANCE,
        min=TOLERANCES[0],
        max=TOLERANCES[1],
        precision=LENGTH_DIGITS,
        step=1,
        unit="LENGTH",
    )
    snap: bpy.props.BoolProperty(
        name="Standard Widths",
        description="Use the widths of the standard cross-section that matches all measured widths",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings beside the file browser."""
        layout = column(self)
        for name in ("road", "course", "tolerance", "snap"):
            layout.prop(self, name)

    def job(self, context: bpy.types.Context) -> PanelJob[str]:
        """Return the job that finds the road in a thread, and builds it where the cloud lies."""
        self._first = find_road(context.scene) is None
        job = ReconstructionJob(
            cloud=self.chosen_file(),
            road=None if self.road == "auto" else cast(RoadKind, self.road),
            course=self.optional_file(self.course),
            tolerance=exact(self.tolerance, None),
            snap=self.snap,
        )
        scenario, place = context.scene.synthroads.scenario(), shown_place(context.scene)
        return PanelJob("Road from a Scan", find_and_build(job, scenario, replace(place, keep_moves=False)))


class SYNTHROADS_OT_show_doubt(bpy.types.Operator):
    """Look along the road at the beginning of this stretch"""

    bl_idname = "synthroads.show_doubt"
    bl_label = "Look at the Stretch"
    bl_options = {"INTERNAL"}  # noqa: RUF012 (Blender reads a plain set)

    station: bpy.props.FloatProperty(name="Station", description="Distance along the road, m")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the shown road was found in a cloud and there is a 3D view; else set the tooltip."""
        reason = ""
        if found_road(find_road(context.scene)) is None:
            reason = "Make a road from a scan first"
        elif view_of(context) is None:
            reason = "There is no 3D view"
        if reason:
            cls.poll_message_set(said(reason))
        return not reason

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Turn the 3D view to the station on the road's axis."""
        road, space = find_road(context.scene), view_of(context)
        assert road  # poll() has seen both
        assert space
        look_at_place(space, RoadGeometry(recall_parameters(road)), self.station, 0.0)
        redraw_views(context)


class SYNTHROADS_PT_scan_road(Sidebar, bpy.types.Panel):
    """Panel of how far a road that was found in a cloud is to be trusted; for such roads only."""

    bl_label = "Road from a Scan"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 0

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the shown road was found in a cloud."""
        return found_road(find_road(context.scene)) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the doubts with their reasons, what was measured with its deviations, and the notes."""
        layout, result = self.layout, found_road(find_road(context.scene))
        assert result  # poll() has seen it
        draw_text(layout, verdict(result["judgement"]), "ERROR" if is_doubtful(result) else "CHECKMARK")
        for station, text in doubt_lines(result["judgement"]):
            row = layout.box().row()
            draw_text(row.column(align=True), text, share=_BOX_SHARE, beside=1)
            row.operator(SYNTHROADS_OT_show_doubt.bl_idname, text="", icon="VIEWZOOM").station = station
        measures = layout.column(align=True)
        for text in result["measures"]:
            draw_text(measures, text)
        for note in result["notes"]:
            draw_text(layout, note, "INFO")
        layout.operator(SYNTHROADS_OT_show_cloud.bl_idname, icon="POINTCLOUD_DATA").filepath = result["cloud"]


def found_road(road: bpy.types.Object | None) -> dict[str, Any] | None:
    """Return what is kept of how a road was found in a cloud; None for a road that wasn't.

    It is ``cloud`` (path), ``judgement`` (as in `reconstruction.json`), ``measures`` and ``notes`` (lines of text).
    """
    return None if road is None or FOUND not in road else _read(str(road[FOUND]))


@lru_cache(maxsize=4)
def _read(text: str) -> dict[str, Any] | None:
    try:
        result: dict[str, Any] = json.loads(text)
        return result if {"cloud", "judgement", "measures", "notes"} <= result.keys() else None
    except (TypeError, ValueError, AttributeError):  # edited by hand
        return None


def is_doubtful(result: dict[str, Any]) -> bool:
    """Return whether any stretch of a found road isn't to be trusted."""
    return any(True for _ in doubt_lines(result["judgement"]))


def verdict(judgement: dict[str, Any]) -> str:
    """Return a sentence that says how far a found road is to be trusted."""
    places = sum(1 for _ in doubt_lines(judgement))
    if not places:
        return "No part of it is doubtful"
    share = 1.0 - judgement["trusted"]
    axis = f", the axis on {share:.0%} of the length" if share > 0.0 else ""
    return f"The result is doubtful at {places} {'place' if places == 1 else 'places'}{axis}"


def find_and_build(job: ReconstructionJob, scenario: Scenario, place: BuildTarget) -> Work[str]:
    """Generator that finds the road in a cloud in a thread, and builds it; returns the message."""

    def find(report: Report) -> ReconstructedRoad:
        return run_reconstruction(job, lambda _, share: report(share))

    road: ReconstructedRoad = yield Aside(find, "Finding the road", 0.0, _FINDING)
    record = {
        "cloud": str(job.cloud),
        "judgement": road.report["judgement"],
        "measures": [*measure_lines(road.report), *_surface_lines(road.report["surface"])],
        "notes": road.report["notes"],
    }
    parameters = road.reconstruction.parameters
    build = road_work(parameters, scenario, from_file(job.cloud), place, json.dumps(record))
    yield from part_of_work(build, _FINDING, 1.0)
    length, sentence = parameters.alignment.length, verdict(road.report["judgement"])
    return f"Built {length:,.0f} m of road from {job.cloud.name}. {sentence}"


def _surface_lines(surface: dict[str, Any]) -> list[str]:
    """Return by carriageway how far the cloud's points are from the built surface, a line each."""
    return [
        f"{side}: points {100.0 * figures['rms']:.1f} cm rms from the surface, mean {100.0 * figures['mean']:+.1f} cm"
        for side, figures in surface.items()
        if "rms" in figures
    ]
