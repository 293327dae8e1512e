"""The axis of a parameter set from a line of a file: where it lies, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import LONGITUDE_LATITUDE, MapSystem, moved
from ..base.maps.places import check_heights
from ..base.remarks import assume, warn
from ..road.alignment import Alignment
from ..road.axes.centerline import FARTHEST
from ..road.parameters import AlignmentObject
from ..road.profile import Profile
from ..scenario.road import RoadScenario
from .line import ExactAxis, RoadLine, alignment_object, exact_axis, heights_at, sampled, within_limits
from .read import choose_line, read_lines

_ARM = 50.0
"""Half the distance over which a map's direction and scale are measured, m."""
_NORTHERN, _SOUTHERN = 32600, 32700
"""EPSG codes of the zones of UTM on WGS 84, less the zone's number."""


def road_axis(
    path: Path,
    scenario: RoadScenario,
    name: str | None = None,
    round_kinks: float | None = None,
    seen: Callable[[RoadLine, ExactAxis], None] | None = None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis of a road or alignment of a file, the scenario for it, and a report.

    Args:
        path: OpenDRIVE, LandXML or IFC, told by its content.
        scenario: whose coordinate system the road is to have, if it names one; else the file's is taken.
        name: of the line; None: the longest that belongs to no junction.
        round_kinks: distance (m) from kinks that roundings may keep; None refuses them (`exact_axis`).
        seen: gets the file's line and the axis taken from it, where the file has them, to draw both.

    Returns:
        the alignment in local coordinates; if the file has no heights its only vertical point is at 0 m, and the
        report's ``heights`` is None. The scenario has the length, the map origin and the systems that follow from the
        file. The report says what was read, approximated and left out.

    Raises:
        MissingFileError, InputError: the file can't be read or has no such line, it can't be followed exactly, or it
            lies outside of the coordinate system.
    """
    lines = read_lines(path)
    line = choose_line(lines, name, path.name)
    if name is None and len(lines) > 1:
        assume("%s has %d roads: the longest, %r, is taken", path.name, len(lines), line.name)
    axis = exact_axis(line, round_kinks)
    if seen:
        seen(line, axis)
    for kink in axis.roundings:
        text = "%s: the kink of %.4f rad at station %.3f m is rounded over %.2f m, %.1f mm off it"
        warn(text, path.name, kink.angle, kink.station, kink.length, 1000.0 * kink.deviation)
    system, axis, placing = _placed(path, line, axis, scenario)
    middle = axis.alignment.position(0.5 * axis.alignment.length)
    height = axis.heights.points[0].elevation if axis.heights else 0.0
    if not np.abs(middle).max() <= FARTHEST:
        allowed = f"must be at most {FARTHEST:g}: are the coordinates in metres?"
        raise InputError(f"{path.name}: coordinates, m", np.round(middle, 3).tolist(), allowed)
    origin = np.round([*middle, height])
    check_heights(path.name, np.array([[*middle, height]]))
    alignment = _checked_object(path, axis, origin, line)
    update: dict[str, Any] = {"length": alignment.length, "map_origin": tuple(origin.tolist())}
    if system is not None and system.epsg:
        update |= {"epsg": system.epsg, "height_epsg": scenario.height_epsg or system.height_epsg}
    road = scenario.model_copy(update=update)
    return alignment, road, report_of(path, line, axis) | {"placed": placing}


def line_deviation(line: RoadLine, axis: ExactAxis) -> tuple[float, Float, Float, Float | None]:
    """Return how far a file's line is from the axis that `road_axis` takes from it.

    Returns:
        the axis' length, and of places of the line at most a metre apart the stations, the distances to the left of
        the axis and the heights above it (N,), m; None for the heights where the file has none.
    """
    places, file_stations = sampled(line)
    station, offsets = axis.alignment.project(places)
    station = np.clip(station, 0.0, axis.alignment.length)
    if axis.heights is None:
        return axis.alignment.length, station, offsets, None
    profile = Profile(axis.heights.points)
    return axis.alignment.length, station, offsets, heights_at(line, file_stations) - profile.elevation(station)


def _checked_object(path: Path, axis: ExactAxis, origin: Float, line: RoadLine) -> AlignmentObject:
    """Return an axis as the alignment of a parameter set; raise `InputError` for one beyond the limits of roads."""
    with within_limits(path.name):
        return alignment_object(axis, origin, line)


def report_of(path: Path, line: RoadLine, axis: ExactAxis) -> dict[str, Any]:
    """Return what was read of a line, approximated and left out, as JSON data."""
    kinds: dict[str, int] = {}
    for piece in line.pieces:
        kinds[piece.kind] = kinds.get(piece.kind, 0) + 1
    heights = axis.heights
    return {
        "file": path.name,
        "source": line.source,
        "name": line.name,
        "length": round(axis.alignment.length, 6),
        "elements": len(axis.alignment.elements),
        "kinds": kinds,
        "first_station": round(line.first_station, 6),
        "equations": [{"station": e.station, "back": e.back, "ahead": e.ahead} for e in line.equations],
        "heights": None if heights is None else {"points": len(heights.points), **_worst(heights)},
        "joints": {
            "gap": round(axis.gap, 6),
            "gap_station": round(axis.gap_station, 3),
            "kink": round(axis.kink, 9),
            "kink_station": round(axis.kink_station, 3),
            "drift": round(axis.drift, 6),
            "drift_station": round(axis.drift_station, 3),
        },
        "approximated": [
            {"kind": kind, "station": round(station, 3), "elements": count, "deviation": round(worst, 6)}
            for kind, station, count, worst in axis.approximated
        ],
        "rounded": [
            {
                "station": round(kink.station, 3),
                "angle": round(kink.angle, 6),
                "length": round(kink.length, 3),
                "radius": round(1.0 / abs(kink.curvature), 3),
                "deviation": round(kink.deviation, 6),
            }
            for kink in axis.roundings
        ],
        "left_out": list(line.left_out),
    }


def _worst(heights: Any) -> dict[str, Any]:
    """Return the profile's largest deviation and the steps left out, as JSON data."""
    steps = [{"station": round(station, 3), "step": round(step, 6)} for station, step in heights.jumps]
    figures: dict[str, Any] = {"deviation": round(heights.deviation, 6), "deviation_station": round(heights.station, 3)}
    return figures | ({"steps_left_out": steps} if steps else {})


def _placed(
    path: Path, line: RoadLine, axis: ExactAxis, scenario: RoadScenario
) -> tuple[MapSystem | None, ExactAxis, str]:
    """Return the map system of the axis (None if unknown), the axis in it, and a text on how it came there."""
    has_epsg = "epsg" in scenario.model_fields_set
    system = MapSystem.of(scenario.epsg, scenario.height_epsg) if has_epsg else None
    file_system = line.system
    if file_system is not None and file_system.local:
        file_system = None
    if file_system is None:
        name = MapSystem.of(scenario.epsg).label
        remedy = "" if has_epsg else "; --set road.epsg=CODE names another"
        assume("%s names no coordinate system: its coordinates are read as %s%s", path.name, name, remedy)
        return None, axis, f"as the file has it, read as {name}"
    if file_system.unit is None:
        raise InputError(
            f"{path.name}: coordinate system", file_system.label, "must have metres as its unit; this one has degrees"
        )
    if not file_system.in_metres:
        file_system = file_system.metric()  # readers give metres, whatever the file's unit is
    middle = axis.alignment.position(np.array([0.5 * axis.alignment.length]))
    if file_system.outside(middle).max() > 0.0:
        warn("%s lies outside of the area that %s is meant for (%s)", path.name, file_system.label, file_system.area)
    if system is not None and file_system.same_as(system):
        return system, axis, "as the file has it"
    if system is None and file_system.epsg:
        return file_system, axis, f"as the file has it, in {file_system.label}"
    target = system or _utm(file_system, middle)
    return target, *_moved_rigidly(path, axis, file_system, target)


def _utm(system: MapSystem, place: Float) -> MapSystem:
    """Return the zone of UTM (WGS 84) of a place (1, 2) given in a system."""
    degrees, _ = moved(np.column_stack([place, [0.0]]), system, MapSystem.read(LONGITUDE_LATITUDE))
    return utm_zone(*degrees[0, :2].tolist())


def utm_zone(longitude: float, latitude: float) -> MapSystem:
    """Return the zone of UTM (WGS 84) of a place, degrees."""
    zone = int(np.clip(math.floor((longitude + 180.0) / 6.0) + 1, 1, 60))
    return MapSystem.of((_NORTHERN if latitude >= 0.0 else _SOUTHERN) + zone)


def _moved_rigidly(path: Path, axis: ExactAxis, source: MapSystem, target: MapSystem) -> tuple[ExactAxis, str]:
    """Return an axis moved and turned about its middle into another system, lengths as they are.

    Arcs and clothoids of one projection aren't exactly such curves in another: a warning says how far the ends are off.
    """
    alignment = axis.alignment
    middle = alignment.position(0.5 * alignment.length)
    arms = middle + _ARM * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    ends = alignment.position(np.array([0.0, alignment.length]))
    points = np.vstack([middle, arms, ends])
    moved_points = moved(np.column_stack([points, np.zeros(len(points))]), source, target)[0][:, :2]
    east, north = moved_points[1] - moved_points[2], moved_points[3] - moved_points[4]
    # The rotation that fits both axes best (least squares, Procrustes in two dimensions).
    turn = math.atan2(east[1] - north[0], east[0] + north[1])
    cos, sin = math.cos(turn), math.sin(turn)
    rotation = np.array([[cos, -sin], [sin, cos]])
    start = moved_points[0] + rotation @ (np.array([alignment.x, alignment.y]) - middle)
    moved_alignment = Alignment(alignment.elements, float(start[0]), float(start[1]), alignment.start_heading + turn)
    end_error = float(
        np.hypot(*(moved_alignment.position(np.array([0.0, alignment.length])) - moved_points[5:]).T).max()
    )
    name = source.label if source.epsg else "the file's own projection"
    text = f"moved from {name} to {target.label} about its middle, lengths as they are: its ends are off by"
    text += f" {end_error:.3f} m"
    warn("%s is %s", path.name, text)
    return replace(axis, alignment=moved_alignment), text
