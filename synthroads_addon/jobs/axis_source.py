"""The axis of a job's road from a file: elements taken over where the file has them, points fitted where it hasn't."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import LONGITUDE_LATITUDE, MapSystem
from ..base.maps.places import Placement, bring
from ..base.random_streams import stream
from ..base.remarks import assume, collected_remarks, warn
from ..fitting.fit import AxisFit, axis_of_points, fit_heights, fitted_axis
from ..fitting.plot import axis_picture, deviation_picture
from ..road.alignment import clip_offset, left_vectors
from ..road.geometry import alignment_of
from ..road.parameters import AlignmentObject
from ..road.terrain import road_elevation_model
from ..road_files.axis import line_deviation, road_axis, utm_zone
from ..road_files.points import read_point_lines
from ..road_files.read import OF_POINTS, READERS, format_of, named_line, read_lines
from ..sampling.alignment import sample_profile
from ..scenario.road import RoadScenario

_SPACING = 10.0
"""Distance of the heights that are taken from an elevation model, m."""
_NEAR = 1e-3
"""Height, m, by which parabolas may be off a file's cubics and circles without a word."""
_OVERLAP = 1.0
"""Metres by which the ground of two stretches may overlap without a word."""
_GROUND_TOLERANCE = 0.5
"""Distance that a profile may keep from the ground of an elevation model (root mean square), m: chosen, as a road
cuts and fills."""


def axis_from_file(
    path: Path,
    scenario: RoadScenario,
    seed: int,
    name: str | None = None,
    round_kinks: float | None = None,
    picture: Path | None = None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis of a file in local coordinates, the scenario that follows from it, and a report.

    Elements of OpenDRIVE, LandXML and IFC are taken over (`road_files.axis.road_axis`); points of CSV, GeoJSON, KML and
    GPX are fitted (`fitting.fit.fitted_axis`). A file of elements without heights gets those of the scenario's
    elevation model, else drawn ones.

    Args:
        path: the file; its content says its format.
        scenario: limits of the road.
        seed: of what is drawn.
        name: of the road or alignment in the file; None takes the longest.
        round_kinks: distance (m) from kinks of a file's elements that roundings may keep; None refuses kinks.
        picture: file for a picture of how far the file's line or points are from the axis; none is drawn if None.

    Raises:
        AxisRefusedError: no road follows the points.
        MissingFileError, InputError: see both functions; or a name is given for a file of points.
    """
    kind = format_of(path)
    if kind not in READERS:
        if kind is None and name is not None:
            raise InputError("--axis-name", name, "is for files of several roads or lines: this one has one of points")
        fits: list[AxisFit] = []
        if kind is None:
            fitted, limits, report = fitted_axis(path, scenario, fits.append)
        else:
            fitted, limits, report = _line_of_degrees(path, scenario, name, fits.append)
        if picture:
            axis_picture(fits[0], path.name).save(picture, "PNG")
        _tell_overlap(path, fitted, limits.half_width)
        return fitted, limits, report
    axis, limits, report = road_axis(path, scenario, name, round_kinks)
    if picture:
        with collected_remarks():  # they were made a line above
            deviation_picture(path.name, *line_deviation(path, name, round_kinks)).save(picture, "PNG")
    _tell_overlap(path, axis, limits.half_width)
    if report["heights"] is None:
        vertical, source = _heights(axis, limits, seed)
        axis = axis.model_copy(update={"vertical": vertical})
        report["heights"] = {"points": len(vertical), "source": source}
        assume("%s has no heights: %s", path.name, source)
    if report["heights"].get("deviation", 0.0) > _NEAR:
        heights = report["heights"]
        text = "%s: parabolas are %.4f m off its heights at station %.1f m"
        warn(text, path.name, heights["deviation"], heights["deviation_station"])
    for step in report["heights"].get("steps_left_out", []):
        text = "%s: heights jump by %.3f m at station %.3f m: what follows is moved to meet what is before"
        warn(text, path.name, step["step"], step["station"])
    return axis, limits, report


def _line_of_degrees(
    path: Path, scenario: RoadScenario, name: str | None, seen: Callable[[AxisFit], None]
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the axis fitted to a line of KML or GPX: the one of a name, or the longest; see `axis_from_file`.

    Without a coordinate system in the scenario it lies in its zone of UTM (WGS 84).
    """
    lines = read_point_lines(path)
    if not lines:
        raise InputError(path.name, None, "the file has no line of two points or more")
    degrees = MapSystem.read(LONGITUDE_LATITUDE)
    line = (
        max(lines, key=lambda one: degrees_length(one.points)) if name is None else named_line(lines, name, path.name)
    )
    if name is None and len(lines) > 1:
        assume("%s has %d lines: the longest, %r, is taken", path.name, len(lines), line.name)
    if "epsg" not in scenario.model_fields_set:
        zone = utm_zone(*line.points[len(line.points) // 2, :2].tolist())
        scenario = scenario.model_copy(update={"epsg": zone.epsg})
        assume("%s is in degrees: the road lies in %s; --set road.epsg=CODE names another", path.name, zone.label)
    if not line.has_heights:
        assume("%s has no heights: they are 0 m", path.name)
    place = Placement.of(MapSystem.of(scenario.epsg, scenario.height_epsg))
    points = bring(path.name, line.points, degrees, place)
    axis, limits, report = axis_of_points(path.name, points, None, scenario, seen)
    return axis, limits, report | {"name": line.name}


def degrees_length(points: Float) -> float:
    """Return the length, m, of a line of longitudes and latitudes (N, 2 or more) on the ellipsoid of WGS 84."""
    from pyproj import Geod  # takes a fifth of a second, and few roads come in degrees

    return float(Geod(ellps="WGS84").line_length(points[:, 0], points[:, 1]))


def _tell_overlap(path: Path, axis: AlignmentObject, half_width: float) -> None:
    """Warn where an axis comes back so near to itself that the ground beside one stretch lies on another.

    A drawn road never does. Places at the ground's edge are looked at: they should be nearest to their own station.
    """
    alignment = alignment_of(axis)
    station = np.linspace(0.0, axis.length, max(2, int(np.ceil(axis.length / _SPACING)) + 1))
    position, heading, curvature = alignment.frame(station)
    worst, where = 0.0, (0.0, 0.0)
    for side in (-1.0, 1.0):
        offset = clip_offset(side * half_width, curvature)
        there, away = alignment.project(position + offset[:, None] * left_vectors(heading))
        inside = np.abs(offset) - np.abs(away)
        inside[np.abs(there - station) < 2.0 * half_width] = 0.0
        at = int(inside.argmax())
        if inside[at] > worst:
            worst, where = float(inside[at]), (float(station[at]), float(there[at]))
    if worst > _OVERLAP:
        first, second = sorted(where)
        text = "%s: the road at station %.0f m comes back so near to that at %.0f m that one's ground lies %.1f m deep"
        warn(
            f"{text} over the other's: try road.half_width=%.0f",
            path.name,
            first,
            second,
            worst,
            _narrower(half_width, worst),
        )


def _narrower(half_width: float, overlap: float) -> float:
    """Return a width (m) at which the ground of two stretches no longer overlaps by as much."""
    return max(5.0, np.floor(half_width - 0.5 * overlap))


def _heights(axis: AlignmentObject, scenario: RoadScenario, seed: int) -> tuple[tuple[Any, ...], str]:
    """Return points of vertical intersection for an axis without heights, and where they come from."""
    if scenario.elevation_model is None:
        return sample_profile(scenario, stream(seed, "profile")), "they are drawn within the limits of the scenario"
    east, north, up = scenario.map_origin
    model = road_elevation_model(scenario.elevation_model, scenario.epsg, axis, (east, north), 0.0)
    alignment = alignment_of(axis)
    station = np.linspace(0.0, axis.length, max(2, int(np.ceil(axis.length / _SPACING)) + 1))
    place = alignment.position(station)
    ground = model.elevation(place[:, 0] + east, place[:, 1] + north) - up
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
    worst = max((row["deviation"] for row in report["approximated"]), default=0.0)
    rest = f"; {len(report['approximated'])} of them within {1000.0 * worst:.2f} mm" if report["approximated"] else ""
    name = f"{report['source']} {report['name']!r}"
    return f"axis: {name}, {report['length']:,.1f} m: {kinds}, as in the file{rest}"


def listed_lines(path: Path) -> list[dict[str, Any]]:
    """Return what a list says of each road, alignment or line of a file, as JSON data.

    Raises:
        MissingFileError, InputError: the file can't be read, or is of a format with one line alone.
    """
    nothing: dict[str, Any] = {"elements": 0, "points": 0, "lanes": None, "junction": False, "fault": None}
    if format_of(path) in OF_POINTS:
        return [
            nothing
            | {
                "name": line.name,
                "length": round(degrees_length(line.points), 3),
                "points": len(line.points),
                "heights": line.has_heights,
                "system": LONGITUDE_LATITUDE,
            }
            for line in read_point_lines(path)
        ]
    return [
        nothing
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
