"""The axis of a job's road from a file: elements taken over where the file has them, points fitted where it hasn't."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.maps.crs import LONGITUDE_LATITUDE, MapSystem
from ..base.random_streams import stream
from ..base.remarks import assume, warn
from ..fitting.fit import AxisFit, fit_heights
from ..fitting.plot import axis_picture, deviation_picture
from ..road.alignment import clip_offset, left_vectors
from ..road.geometry import alignment_of
from ..road.parameters import AlignmentObject
from ..road.terrain import road_elevation_model
from ..road_files.axis import line_deviation, road_axis
from ..road_files.line import ExactAxis, RoadLine
from ..road_files.read import OF_POINTS, READERS, format_of, read_lines, read_points
from ..sampling.alignment import sample_profile
from ..scenario.road import RoadScenario
from .axis_points import NOWHERE_ELSE, PathPlace, RoadBeside, axis_of_line, line_length

_SPACING = 10.0
"""Distance of the heights that are taken from an elevation model, m."""
_NEAR = 1e-3
"""Height, m, by which parabolas may be off a file's cubics and circles without a word."""
_OVERLAP = 1.0
"""Metres by which the ground of two stretches may overlap without a word."""
_AT_ONCE = 1000
"""Stations at which an overlap is looked for before one that was found is told. Chosen: 10 km of road."""
_GROUND_TOLERANCE = 0.5
"""Distance that a profile may keep from the ground of an elevation model (root mean square), m: chosen, as a road
cuts and fills."""


def axis_from_file(
    path: Path,
    scenario: RoadScenario,
    seed: int,
    name: str | None = None,
    place: PathPlace = NOWHERE_ELSE,
    round_kinks: float | None = None,
    picture: Path | None = None,
    road_beside: RoadBeside | None = None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis of a file in local coordinates, the scenario that follows from it, and a report.

    Elements of OpenDRIVE, LandXML and IFC are taken over (`road_files.axis.road_axis`); points of all others are
    cleaned and fitted (`axis_points.axis_of_line`). A file without heights gets those of the scenario's elevation
    model, else drawn ones; CSV and GeoJSON without z lie at 0 m.

    Args:
        path: the file; its content says its format.
        scenario: limits of the road.
        seed: of what is drawn.
        name: of the road or alignment in the file; None takes the longest.
        place: where the axis lies beside a line of points.
        round_kinks: distance (m) from kinks of a file's elements that roundings may keep; None refuses kinks.
        picture: file for a picture of how far the file's line or points are from the axis; none is drawn if None.
        road_beside: gets what the file says of the road beside its axis.

    Raises:
        AxisRefusedError: no road follows the points.
        MissingFileError, InputError: see both functions; or a name is given for a file of one line, a place for one of
            elements.
    """
    kind = format_of(path)
    if kind not in READERS:
        fits: list[AxisFit] = []
        axis, limits, report = axis_of_line(path, kind, scenario, name, place, fits.append, road_beside)
        if picture:
            axis_picture(fits[0], path.name).save(picture, "PNG")
    elif place.given:
        raise InputError(place.given, path.name, f"is for lines of points and paths; {kind} gives the axis itself")
    else:
        lines: list[tuple[RoadLine, ExactAxis]] = []
        axis, limits, report = road_axis(
            path, scenario, name, round_kinks, lambda *line_and_axis: lines.append(line_and_axis)
        )
        if picture:
            deviation_picture(path.name, *line_deviation(*lines[0])).save(picture, "PNG")
        if road_beside:
            road_beside.line, road_beside.axis = lines[0]
    _tell_overlap(path, axis, limits.half_width)
    if report.get("heights", ()) is None:
        vertical, source = _heights(axis, limits, seed)
        axis = axis.model_copy(update={"vertical": vertical})
        report["heights"] = {"points": len(vertical), "source": source}
        assume("%s has no heights: %s", path.name, source)
    if kind in READERS:
        _tell_heights(path, report["heights"])
    return axis, limits, report


def _tell_heights(path: Path, heights: dict[str, Any]) -> None:
    """Warn where a file's heights were approximated by more than is good, or moved."""
    if heights.get("deviation", 0.0) > _NEAR:
        text = "%s: parabolas are %.4f m off its heights at station %.1f m"
        warn(text, path.name, heights["deviation"], heights["deviation_station"])
    for step in heights.get("steps_left_out", []):
        text = "%s: heights jump by %.3f m at station %.3f m: the profile after it is shifted to close the gap"
        warn(text, path.name, step["step"], step["station"])


def _tell_overlap(path: Path, axis: AlignmentObject, half_width: float) -> None:
    """Warn where an axis comes back so near to itself that the ground beside one stretch lies on another.

    A drawn road never does. Places on the axis and at the ground's edges are looked at, which should be nearest to
    their own station. Of a long road the worst place of the first stretch that has any is told.
    """
    alignment = alignment_of(axis)
    station = np.linspace(0.0, axis.length, max(2, int(np.ceil(axis.length / _SPACING)) + 1))
    position, heading, curvature = alignment.frame(station)
    largest_overlap, stations_there = 0.0, (0.0, 0.0)
    for first in range(0, len(station), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        for side in (0.0, -1.0, 1.0):  # 0: another stretch may run along the same line
            offset = clip_offset(side * half_width, curvature[part])
            points = position[part] + offset[:, None] * left_vectors(heading[part])
            projected_station, projected_offset = alignment.project(points)
            overlap = (np.abs(offset) if side else half_width) - np.abs(projected_offset)
            overlap[np.abs(projected_station - station[part]) < 2.0 * half_width] = 0.0
            index = int(overlap.argmax())
            if overlap[index] > largest_overlap:
                largest_overlap = float(overlap[index])
                stations_there = (float(station[first + index]), float(projected_station[index]))
        if largest_overlap > _OVERLAP:  # a line that runs round a circle hundreds of times would take minutes
            break
    if largest_overlap > _OVERLAP:
        lower_station, higher_station = sorted(stations_there)
        text = "%s: the road at station %.0f m comes back so near to that at %.0f m that one's ground lies %.1f m deep"
        warn(
            f"{text} over the other's: try road.half_width=%.0f",
            path.name,
            lower_station,
            higher_station,
            largest_overlap,
            _narrower(half_width, largest_overlap),
        )


def _narrower(half_width: float, overlap: float) -> float:
    """Return a width (m) at which the ground of two stretches no longer overlaps by as much."""
    return max(5.0, np.floor(half_width - 0.5 * overlap))


def _heights(axis: AlignmentObject, scenario: RoadScenario, seed: int) -> tuple[tuple[Any, ...], str]:
    """Return points of vertical intersection for an axis without heights, and where they come from."""
    if scenario.elevation_model is None:
        return sample_profile(scenario, stream(seed, "profile")), "they are drawn within the limits of the scenario"
    east, north, origin_height = scenario.map_origin
    model = road_elevation_model(scenario.elevation_model, scenario.epsg, axis, (east, north), 0.0)
    alignment = alignment_of(axis)
    station = np.linspace(0.0, axis.length, max(2, int(np.ceil(axis.length / _SPACING)) + 1))
    xy = alignment.position(station)
    ground = model.elevation(xy[:, 0] + east, xy[:, 1] + north) - origin_height
    points = fit_heights(station, ground, axis.length, _GROUND_TOLERANCE)
    return points, f"they follow {Path(scenario.elevation_model).name} within {_GROUND_TOLERANCE:g} m"


def axis_summary(report: dict[str, Any]) -> str:
    """Return a line on what became of a file's axis, from the report of `axis_from_file`."""
    if "horizontal" in report:  # points
        fit = report["horizontal"]
        return (
            f"axis: {report['elements']} elements, rms {fit['rms'] * 100:.1f} cm, 95 % within {fit['p95'] * 100:.1f}"
            f" cm, worst {fit['worst'] * 100:.1f} cm at station {fit['worst_station']:.0f} m"
        )
    kinds = ", ".join(f"{count} {kind}" for kind, count in report["kinds"].items())
    largest_deviation = max((row["deviation"] for row in report["approximated"]), default=0.0)
    deviation_text = (
        f"; {len(report['approximated'])} of them within {1000.0 * largest_deviation:.2f} mm"
        if report["approximated"]
        else ""
    )
    name = f"{report['source']} {report['name']!r}"
    return f"axis: {name}, {report['length']:,.1f} m: {kinds}, as in the file{deviation_text}"


def listed_lines(path: Path) -> list[dict[str, Any]]:
    """Return what a list says of each road, alignment or line of a file, as JSON data.

    Raises:
        MissingFileError, InputError: the file can't be read, or is of a format with one line alone.
    """
    defaults: dict[str, Any] = {"elements": 0, "points": 0, "lanes": None, "junction": False, "fault": None}
    defaults |= {"carriageway": False, "kind": ""}
    if (kind := format_of(path)) in OF_POINTS:
        return [
            defaults
            | {
                "name": line.name,
                "length": round(line_length(line), 3),
                "points": len(line.points),
                "heights": line.has_heights,
                "system": None if line.system is None else _shown_system(line.system),
                "lanes": line.section.lanes if line.section else None,
                "junction": line.junction,
                "carriageway": line.carriageway,
                "kind": line.source,
                "fault": str(line.fault) if line.fault else None,
            }
            for line in read_points(path, kind)
        ]
    return [
        defaults
        | {
            "name": line.name,
            "length": round(line.length, 3),
            "elements": len(line.pieces),
            "lanes": line.lanes,
            "heights": bool(line.heights),
            "junction": line.junction,
            "system": line.system.label if line.system else None,
            "fault": str(line.fault) if line.fault else None,
        }
        for line in read_lines(path)
    ]


def _shown_system(text: str) -> str:
    """Return a coordinate system's name for people: longitude and latitude as they are, others by their label."""
    return text if text == LONGITUDE_LATITUDE else MapSystem.read(text).label
