"""A job's whole road from a file: what the file says taken over, and the rest drawn around it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..base.errors import InputError
from ..base.remarks import assume
from ..base.schema import round_value
from ..road.geometry import RoadGeometry
from ..road.given_road import GivenRoad
from ..road.objects import nominal_width
from ..road.other_roads.axis import VerticalPoint
from ..road.parameters import AlignmentObject, RoadParameters, read_parameters
from ..road.section import Carriageway
from ..road.things.registry import THINGS
from ..road_files.lanes.carriageways import deviations
from ..road_files.lanes.differences import Difference, differences
from ..road_files.lanes.loss import Loss
from ..road_files.lanes.road import WholeRoad, whole_road, with_heights
from ..road_files.line import ExactAxis, RoadLine, within_limits
from ..road_files.opendrive import read_opendrive
from ..road_files.read import READERS, choose_line, format_of
from ..sampling.road import sample_road
from ..scenario.road import RoadScenario
from ..scenario.scenario import Scenario
from .axis_points import NOWHERE_ELSE, PathPlace, RoadBeside
from .axis_source import axis_from_file
from .mapped_section import with_speed

_BESIDE = 10.0
"""Ground, m, beside the edge of a given road."""
SURFACE = ("lanes", "lateral profile", "crossfall")
"""First words of what is left out and is surface."""
_OF_WHOLE = ("lanes of", "lateral profile", "objects", "signals")


def has_whole_road(path: Path) -> bool:
    """Return whether a file is of a format that says more of a road than its line."""
    return format_of(path) in READERS


def road_from_file(
    path: Path,
    scenario: Scenario,
    name: str | None = None,
    place: PathPlace = NOWHERE_ELSE,
    round_kinks: float | None = None,
    picture: Path | None = None,
) -> tuple[RoadParameters, dict[str, Any]]:
    """Return the road of a file as a parameter set, and a report of its axis and of what became of the rest.

    Of OpenDRIVE all is taken over, of LandXML the superelevation, of an IFC file of ours carriageways, turnouts,
    markings and things.

    Args:
        path: the file.
        scenario: what it doesn't say.
        name: of the road; None takes the longest that belongs to no junction.
        place: where the axis lies beside a line of points: refused, as the file says where it is.
        round_kinks: distance (m) from kinks of its line that roundings may keep; None refuses kinks.
        picture: file for a picture of how far the file's line is from the axis; none is drawn if None.

    Raises:
        MissingFileError, InputError: it can't be read, is of another format, or a parameter set can't hold it.
    """
    parameters, report, _ = _read_road(path, scenario, name, place, round_kinks, picture)
    return parameters, report


def _read_road(
    path: Path,
    scenario: Scenario,
    name: str | None = None,
    place: PathPlace = NOWHERE_ELSE,
    round_kinks: float | None = None,
    picture: Path | None = None,
) -> tuple[RoadParameters, dict[str, Any], GivenRoad | None]:
    """Return what `road_from_file` does, and what of the road the file gives; None where it has no lanes."""
    if not has_whole_road(path):
        text = f"must be one of {', '.join(READERS)} for a whole road; for other files use --axis"
        raise InputError(path.name, format_of(path), text)
    if format_of(path) != "OpenDRIVE":
        return _read_beside(path, scenario, name, place, round_kinks, picture)
    axis_arguments = (path, scenario.road, scenario.seed, name, place, round_kinks, picture)
    if choose_line(read_opendrive(path), name, path.name).lanes is None:
        axis, limits, report = axis_from_file(*axis_arguments)
        return sample_road(limits, scenario.seed, scenario.title, axis), report, None
    with within_limits(path.name):
        road = whole_road(path, scenario.road, name, round_kinks)
        axis, limits, report = axis_from_file(*axis_arguments)
        if road.heights is not None:
            axis, report["heights"] = _with_profile(axis, limits, road, round_kinks)
        limits = _wide_enough(path, limits, road.given)
        if road.speed is not None:
            limits = with_speed(path.name, road.speed, limits)
        parameters = sample_road(limits, scenario.seed, scenario.title, axis, road.given)
    report["surface"] = deviations(road.pavements, _lifted(parameters), road.stations, road.loss)
    report["left_out"] = [text for text in report["left_out"] if not _is_taken(text)]
    return parameters, report | {"whole": road.loss.to_dict(), "summary": road.loss.lines()}, road.given


def _read_beside(
    path: Path,
    scenario: Scenario,
    name: str | None,
    place: PathPlace,
    round_kinks: float | None,
    picture: Path | None,
) -> tuple[RoadParameters, dict[str, Any], GivenRoad | None]:
    """Return the same of a LandXML or IFC file."""
    road_beside = RoadBeside()
    axis_arguments = (path, scenario.road, scenario.seed, name, place, round_kinks, picture)
    axis, limits, report = axis_from_file(*axis_arguments, road_beside)
    line, exact_axis = road_beside.line, road_beside.axis
    assert line is not None
    assert exact_axis is not None
    if line.given is None:
        return sample_road(limits, scenario.seed, scenario.title, axis), report, None
    for text in line.remarks:
        assume("%s: %s: %s", path.name, line.name, text)
    file_parts = _along(line.given, line, exact_axis)
    if file_parts.carriageways:
        limits = _wide_enough(path, limits, file_parts)
    try:
        parameters = sample_road(limits, scenario.seed, scenario.title, axis, file_parts)
    except ValidationError as error:
        fault = str(error.errors(include_url=False)[0]["msg"])
        raise InputError(f"{path.name}: {line.name}", None, f"its parts must fit together ({fault})") from None
    loss = Loss(read=Counter(line.taken), surface=any(text.startswith(SURFACE) for text in line.left_out))
    return parameters, report | {"whole": loss.to_dict(), "summary": loss.lines()}, file_parts


def _along(file_parts: GivenRoad, line: RoadLine, exact_axis: ExactAxis) -> GivenRoad:
    """Return the parts of a file's road with the crossfall at stations of the axis."""
    file_stations = np.array(
        [*(piece.station for piece in line.pieces), line.pieces[-1].station + line.pieces[-1].length]
    )
    axis_stations = np.array([*exact_axis.starts, exact_axis.alignment.length])

    def place(station: float) -> float:
        """Return the axis's station of a station in the file; beyond the ends it goes on at the same rate."""
        distance_beyond = station - min(max(station, file_stations[0]), file_stations[-1])
        return round_value(float(np.interp(station, file_stations, axis_stations) + distance_beyond))

    moved_crossfall = {
        side: tuple(point.model_copy(update={"station": place(point.station)}) for point in points)
        for side, points in file_parts.crossfall.items()
    }
    return replace(file_parts, crossfall=moved_crossfall)


def differences_from(
    path: Path, against: Path, scenario: Scenario, name: str | None = None
) -> tuple[list[Difference], dict[str, Any]]:
    """Return in which fields the road of a file differs from a parameter set, and a report of the file.

    Line, heights, carriageways and turnouts are compared, and markings and things if the file has any.

    Raises:
        MissingFileError, InputError: a file can't be read, or a parameter set can't hold the road.
    """
    old_parameters = read_parameters(against)
    new_parameters, report, file_parts = _read_road(path, scenario, name)
    types = {"Alignment", "Carriageway", "Turnout"} if file_parts and file_parts.carriageways else {"Alignment"}
    types |= {"LineMarking"} if file_parts and file_parts.markings is not None else set()
    types |= {*THINGS, "Arrow", "Hatching"} if file_parts and file_parts.things is not None else set()
    return differences(old_parameters, new_parameters, types), report


def _is_taken(text: str) -> bool:
    """Return whether what the axis's reader left out is taken over with the whole road."""
    return text.startswith(_OF_WHOLE[:2]) or text.endswith(_OF_WHOLE[2:])


def _with_profile(
    axis: AlignmentObject, limits: RoadScenario, road: WholeRoad, round_kinks: float | None
) -> tuple[AlignmentObject, dict[str, Any]]:
    """Return an axis with the heights that the road's planes give it, and what the report says of them."""
    assert road.heights is not None
    heights = with_heights(road.line, road.heights, round_kinks)
    origin_height = limits.map_origin[2]
    points = tuple(
        VerticalPoint(station=p.station, elevation=p.elevation - origin_height, radius=p.radius) for p in heights.points
    )
    report = {"points": len(points), "deviation": heights.deviation, "deviation_station": heights.station}
    return axis.model_copy(update={"vertical": points}), report


def _lifted(parameters: RoadParameters) -> RoadGeometry:
    """Return a set's geometry with heights of the map."""
    origin_height = parameters.transform.translate[2]
    axis = parameters.alignment
    vertical = tuple(p.model_copy(update={"elevation": p.elevation + origin_height}) for p in axis.vertical)
    name = next(key for key, item in parameters.objects.items() if item is axis)
    objects = parameters.objects | {name: axis.model_copy(update={"vertical": vertical})}
    return RoadGeometry(parameters.model_copy(update={"objects": objects}))


def _wide_enough(path: Path, limits: RoadScenario, file_parts: GivenRoad) -> RoadScenario:
    """Return the scenario with ground that reaches beyond the road's edges."""
    edge = max(_farthest(carriageway) for carriageway in file_parts.carriageways.values()) + _BESIDE
    if limits.half_width >= edge:
        return limits
    half_width = float(np.ceil(edge))
    assume(
        "%s: the road is wide: road.half_width is %.0f m instead of %.0f m", path.name, half_width, limits.half_width
    )
    return limits.model_copy(update={"half_width": half_width})


def _farthest(carriageway: Carriageway) -> float:
    """Return the largest distance (m) of a carriageway's edges from the centreline, verge included."""
    widths = (
        carriageway.inner_offset,
        carriageway.inner_edge_strip_width,
        *(lane.width for lane in carriageway.lanes),
        carriageway.outer_edge_strip_width,
        carriageway.hard_shoulder_width,
        carriageway.verge_width,
    )
    return max(abs(nominal_width(widths[0])), sum(nominal_width(width) for width in widths))
