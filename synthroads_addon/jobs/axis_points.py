"""The axis of a job's road from a line of points: found, cleaned, moved to where the axis is, and fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import LONGITUDE_LATITUDE, MapSystem, moved
from ..base.maps.places import Placement, bring
from ..base.remarks import assume, warn
from ..fitting.fit import AxisFit, axis_of_points
from ..road.axes.centerline import read_declared_axis
from ..road.given_road import GivenRoad
from ..road.guidelines import StandardCrossSection
from ..road.parameters import AlignmentObject
from ..road_files.axis import utm_zone
from ..road_files.line import ExactAxis, RoadLine
from ..road_files.points import PointLine
from ..road_files.read import named_line, read_points
from ..road_files.spacing import cleaned, moved_aside, tell_spacing
from ..road_files.track import has_times
from ..sampling.section import cross_section_of
from ..scenario.road import RoadScenario
from .mapped_section import meets, side_by_side, with_mapped_section

_APART = 1.0
"""Distance of the points of a vehicle's path that are fitted, m: closer ones hold noise alone."""

FARTHEST_ASIDE, FARTHEST_ABOVE = 100.0, 1000.0
"""Largest offset of an axis from a path, and height of a path above the road, to either side, m."""


@dataclass(frozen=True)
class PathPlace:
    """Where the axis lies beside a line of points.

    Attributes:
        offset: of the axis from the line, m, positive to the left in the direction of the points; None if not given.
        lane: of the carriageway, in whose middle the line runs, counted from outside, 0 the outermost; None if not
            given. Traffic keeps right, so that the axis lies to the left.
        height: of the line above the road, m; None if not given.
    """

    offset: float | None = None
    lane: int | None = None
    height: float | None = None

    @property
    def given(self) -> str | None:
        """Return the option that is given, None without any."""
        options = (
            ("--offset-from-path", self.offset),
            ("--path-lane", self.lane),
            ("--height-above-road", self.height),
        )
        return next((name for name, value in options if value is not None), None)

    def aside(self, section: StandardCrossSection) -> float | None:
        """Return the offset of the axis, m, with the cross-section that a lane is counted in; None if none is given.

        Raises:
            InputError: offset and lane are given, or there is no such lane.
        """
        if self.lane is None:
            return self.offset
        if self.offset is not None:
            raise InputError("--path-lane", self.lane, "can't be given together with --offset-from-path")
        if not 0 <= self.lane < len(section.lanes):
            allowed = f"the road has {len(section.lanes)} lanes each way: 0, the outermost, to {len(section.lanes) - 1}"
            raise InputError("--path-lane", self.lane, allowed)
        distance_in_lanes = sum(section.lanes[self.lane + 1 :]) + 0.5 * section.lanes[self.lane]
        return 0.5 * section.median + section.inner_edge_strip + distance_in_lanes


NOWHERE_ELSE = PathPlace()
"""The axis is the line itself."""


@dataclass
class RoadBeside:
    """Parts of a road that a file says beside its axis.

    Attributes:
        line, axis: the file's line of elements and what was taken from it; None for lines of points.
        given: carriageways that a map says and limits of a scenario can't hold; None where it says none.
    """

    line: RoadLine | None = None
    axis: ExactAxis | None = None
    given: GivenRoad | None = None


def axis_of_line(
    path: Path,
    kind: str | None,
    scenario: RoadScenario,
    name: str | None,
    place: PathPlace,
    receive_fit: Callable[[AxisFit], None] | None = None,
    road_beside: RoadBeside | None = None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis fitted to a line of points of a file, the scenario for it, and a report.

    Args:
        path: the file.
        kind: its format, one of `road_files.read.OF_POINTS`; None for CSV and GeoJSON.
        scenario: limits of the road.
        name: of the line; None takes the longest that is a road by itself.
        place: where the axis lies beside the line.
        receive_fit: gets the fit, to draw it.
        road_beside: gets the carriageways of a road whose directions lie side by side, which no limits say.

    Returns:
        as `jobs.axis_source.axis_from_file`; the report's ``heights`` is None where the file has none.

    Raises:
        AxisRefusedError, MissingFileError, InputError: see there.
    """
    if kind is None:
        return _axis_of_text(path, scenario, name, place, receive_fit)
    line = chosen_line(path.name, read_points(path, kind), name)
    declared = None if line.system is None else MapSystem.read(line.system)
    scenario = _in_a_system(path.name, line, declared, scenario)
    system = Placement.of(MapSystem.of(scenario.epsg, scenario.height_epsg))
    points = bring(path.name, line.points, declared, system)
    for text in line.remarks:
        warn("%s: %s: %s", path.name, line.name, text)
    outlines = [bring(path.name, outline, declared, system) for outline in line.outlines]
    scenario, losses = with_mapped_section(f"{path.name}: {line.name}", line.section, scenario)
    section = cross_section_of(scenario)
    if meets(line.section, scenario):
        section = replace(section, median=0.0, inner_edge_strip=0.0)
    points = _prepared(path.name, points, line.driven, section, place)
    sagitta = tell_spacing(path.name, outlines or [points])
    axis, limits, report = axis_of_points(path.name, points, declared, scenario, receive_fit)
    if road_beside and meets(line.section, limits):
        road_beside.given = GivenRoad(side_by_side(limits, axis))
    left_out = [*line.left_out, *losses]
    if left_out:
        subjects = ", ".join(text.partition(":")[0] for text in left_out)
        warn("%s: of %r is left out: %s; the report says where", path.name, line.name, subjects)
    report |= {"source": line.source, "name": line.name, "sagitta": round(sagitta, 4), "left_out": left_out}
    if not line.has_heights:
        del report["height"]
        report["heights"] = None
    return axis, limits, report


def _axis_of_text(
    path: Path,
    scenario: RoadScenario,
    name: str | None,
    place: PathPlace,
    receive_fit: Callable[[AxisFit], None] | None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis fitted to the one line of a CSV or GeoJSON file, the scenario for it, and a report.

    Args:
        path: the file.
        scenario: limits of the road.
        name: of a line, which such a file can't have.
        place: where the axis lies beside the line.
        receive_fit: gets the fit, to draw it.

    Returns:
        the axis in local coordinates; the scenario with its length, origin and map system; how well it fits, m, and the
        ``sagitta`` (m) of the widest gap between points, by which the road between them may lie beside the chord.

    Raises:
        AxisRefusedError, MissingFileError, InputError: see `axis_of_line`.
    """
    if name is not None:
        raise InputError(
            "--axis-name", name, "is for files with several roads or lines; this file has one line of points"
        )
    scenario_system = Placement.of(MapSystem.of(scenario.epsg, scenario.height_epsg))
    line_points, declared_system = read_declared_axis(path, scenario_system)
    is_path = has_times(path)
    axis_points = _prepared(path.name, line_points, is_path, cross_section_of(scenario), place)
    sagitta = tell_spacing(path.name, [axis_points])
    axis, fitted_scenario, report = axis_of_points(path.name, axis_points, declared_system, scenario, receive_fit)
    return axis, fitted_scenario, report | {"sagitta": round(sagitta, 4)}


def chosen_line(file: str, lines: Sequence[PointLine], name: str | None) -> PointLine:
    """Return the line of a name, or without one the longest that is a road by itself, which is told.

    Raises:
        InputError: there is none of that name, none at all, or it can't be used.
    """
    if not lines:
        raise InputError(file, None, "the file has no line of two points or more")
    if name is not None:
        line = named_line(lines, name, file)
    else:
        usable_lines = [candidate for candidate in lines if candidate.fault is None] or list(lines)
        candidates = [
            candidate for candidate in usable_lines if not (candidate.junction or candidate.carriageway)
        ] or usable_lines
        line = max(candidates, key=line_length)
    if line.fault is not None:
        raise InputError(f"{file}: {line.name}: {line.fault.field}", line.fault.value, line.fault.allowed)
    if name is None and len(lines) > 1:
        assume("%s has %d lines: the longest, %r, is taken", file, len(lines), line.name)
    return line


def line_length(line: PointLine) -> float:
    """Return the length of a line in plan, m: of one in degrees on its ellipsoid, else in its units made metres."""
    system = None if line.system is None else MapSystem.read(line.system)
    if system is not None and system.unit is None:
        return degrees_length(line.points)
    steps = np.hypot(*np.diff(line.points[:, :2], axis=0).T)
    return float(steps.sum()) * (1.0 if system is None or system.unit is None else system.unit)


def degrees_length(points: Float) -> float:
    """Return the length, m, of a line of longitudes and latitudes (N, 2 or more) on the ellipsoid of WGS 84."""
    from pyproj import Geod  # takes a fifth of a second, and few roads come in degrees

    return float(Geod(ellps="WGS84").line_length(points[:, 0], points[:, 1]))


def _in_a_system(file: str, line: PointLine, declared: MapSystem | None, scenario: RoadScenario) -> RoadScenario:
    """Return the scenario with the coordinate system for the road: its own, the file's, or a zone of UTM."""
    if declared is None or "epsg" in scenario.model_fields_set:
        return scenario
    if declared.unit is not None and declared.epsg and declared.in_metres and not declared.local:
        return scenario.model_copy(update={"epsg": declared.epsg})
    middle_point = line.points[len(line.points) // 2 : len(line.points) // 2 + 1]
    if declared.unit is not None:
        middle_point, _ = moved(middle_point, declared, MapSystem.read(LONGITUDE_LATITUDE))
    zone = utm_zone(*middle_point[0, :2].tolist())
    system_text = "in degrees" if declared.unit is None else f"in {declared.label}"
    assume("%s is %s: the road lies in %s; --set road.epsg=CODE names another", file, system_text, zone.label)
    return scenario.model_copy(update={"epsg": zone.epsg})


def _prepared(file: str, points: Float, is_path: bool, section: StandardCrossSection, place: PathPlace) -> Float:
    """Return the points (M, 3) of the axis: those of a line cleaned, thinned if it is a path, and moved."""
    points = cleaned(file, points, _APART if is_path else 0.0)
    offset = place.aside(section)
    if is_path and offset is None:
        text = (
            "%s is the path of a vehicle, and is used as the axis itself: --offset-from-path METRES (positive to the "
        )
        warn(text + "left) or --path-lane N says where the axis lies beside it", file)
    if is_path and place.height is None:
        warn("%s: heights are those of the path: --height-above-road METRES takes them down to the road", file)
    if offset is None and place.height is None:
        return points
    return cleaned(file, moved_aside(file, points, offset or 0.0, place.height or 0.0))
