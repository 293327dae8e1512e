"""How far a reconstructed road is from the true one: for tests and figures, never for the reconstruction itself."""

from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..base.arrays import Bool, Float
from ..road.geometry import RoadGeometry
from ..road.objects import LineObject, Side, width_at
from ..road.parameters import RoadParameters
from ..road.things.concrete_barrier import ConcreteBarrier
from ..road.things.delineator import Delineator
from ..road.things.guardrail import Guardrail
from ..road.things.noise_barrier import NoiseBarrier
from .path import CloudPath
from .smoothing import difference_figures

BARRIER_DISTANCE, POST_DISTANCE = 0.5, 1.0
"""Barriers and delineators within so far of each other are the same, m. Chosen: less than the distance of two of
them."""
_STEP = 1.0
"""Step along the road at which both are compared, m. Chosen: as of the profiles."""
_LANE_THERE = 1.0
"""Width from which on a lane is there, m. Chosen: a narrower one begins or ends."""
_FAR = 1e3
"""Distance of a barrier that isn't there, m. Chosen: beyond any that counts."""
_BARRIERS = (Guardrail, ConcreteBarrier, NoiseBarrier)
"""Classes of objects that are compared as barriers."""


def compare(reconstructed: RoadParameters, truth: RoadParameters) -> dict[str, Any]:
    """Return the deviations, m, of a reconstructed ("found") road from the true one, as JSON data.

    Both are compared at the true road's stations, each metre; a station that the found road doesn't reach counts for
    ``covered`` alone. Barriers are compared metre by metre, delineators one to one.
    """
    true_road, found_road = RoadGeometry(truth), RoadGeometry(reconstructed)
    station = np.arange(0.0, true_road.length, _STEP)
    point = true_road.alignment.position(station) + _plan_shift(truth, reconstructed)
    found_station, offset = found_road.alignment.project(point)
    covered_mask = (found_station > 0.0) & (found_station < found_road.length)
    turn = found_road.alignment.heading(found_station) - true_road.alignment.heading(station)
    same_direction = bool(np.median(np.cos(turn[covered_mask] if covered_mask.any() else turn)) > 0.0)
    height = found_road.profile.elevation(found_station) + reconstructed.transform.translate[2]
    height = height - true_road.profile.elevation(station) - truth.transform.translate[2]
    sides = {
        side: _carriageway(
            true_road, found_road, side, same_direction, station[covered_mask], found_station[covered_mask]
        )
        for side in true_road.sections
    }
    return {
        "covered": round(float(covered_mask.mean()), 4),
        "centreline": _difference_figures(offset[covered_mask]),
        "profile": _difference_figures(height[covered_mask]),
        "carriageways": sides,
        "surface": _difference_figures(_surface(true_road, found_road, station[covered_mask], truth, reconstructed)),
        "barriers": _barriers(true_road, found_road, _plan_shift(truth, reconstructed)),
        "delineators": _posts(true_road, found_road, _plan_shift(truth, reconstructed)),
    }


def compare_axis(reconstructed: RoadParameters, axis: Float) -> dict[str, Any]:
    """Return figures of the lateral offsets, m, of a true axis' points (N, 3), in map coordinates, from a found road.

    As JSON data: figures of the signed offsets of the points that the found road reaches, and their share ``covered``.
    Elevations are left aside: lines of road networks often have none.
    """
    found_road = RoadGeometry(reconstructed)
    found_station, offset = found_road.alignment.project(axis[:, :2] - np.array(reconstructed.transform.translate[:2]))
    covered_mask = (found_station > 0.0) & (found_station < found_road.length)
    return {"covered": round(float(covered_mask.mean()), 4), "centreline": _difference_figures(offset[covered_mask])}


def compare_line(line: CloudPath, axis: Float) -> dict[str, Any]:
    """Return figures of the lateral offsets, m, of a true axis' points (N, 2) from a found line in the same plane.

    As JSON data, as of `compare_axis`.
    """
    line_station, offset = line.project(axis)
    covered_mask = (line_station > line.start) & (line_station < line.start + line.length)
    return {"covered": round(float(covered_mask.mean()), 4), "centreline": _difference_figures(offset[covered_mask])}


def _plan_shift(truth: RoadParameters, reconstructed: RoadParameters) -> Float:
    """Return the vector (2,), m, to add to local plan coordinates of the true set to get those of the found set."""
    return np.array(truth.transform.translate[:2]) - np.array(reconstructed.transform.translate[:2])


def _difference_figures(difference: Float) -> dict[str, float]:
    """Return mean, mean absolute, root mean square, 95th percentile and largest of differences, m."""
    return difference_figures(difference, "mean", "mae", "rms", "p95", "largest")


def _carriageway(
    true_road: RoadGeometry,
    found_road: RoadGeometry,
    side: Side,
    same_direction: bool,
    station: Float,
    found_station: Float,
) -> dict[str, Any]:
    """Return as JSON data the lanes and widths, m, of a found carriageway against the true one on the same side."""
    found_side: Side = side if same_direction else ("left" if side == "right" else "right")
    if found_side not in found_road.sections:
        return {"found": False}
    section_stations = ((true_road.sections[side], station), (found_road.sections[found_side], found_station))
    lanes = [
        sum((width_at(lane.width, where) >= _LANE_THERE).astype(int) for lane in section.carriageway.lanes)
        for section, where in section_stations
    ]
    inner_offsets = [width_at(section.carriageway.inner_offset, where) for section, where in section_stations]
    width = [
        section.main_edge(where) - inner_offset
        for (section, where), inner_offset in zip(section_stations, inner_offsets, strict=True)
    ]
    return {
        "found": True,
        "lanes": [int(np.median(count)) for count in lanes],
        "lanes_right": round(float(np.mean(lanes[0] == lanes[1])), 4),
        "width": _difference_figures(width[1] - width[0]),
        "inner_offset": _difference_figures(inner_offsets[1] - inner_offsets[0]),
    }


def _surface(
    true_road: RoadGeometry,
    found_road: RoadGeometry,
    station: Float,
    truth: RoadParameters,
    reconstructed: RoadParameters,
) -> Float:
    """Return the height differences (N,), m, found less true surface, at places on the true pavement."""
    result = []
    for side in true_road.sections.values():
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            bounds = side.distances(station)
            offset = float(side.carriageway.sign) * (bounds[:, 0] + share * (side.main_edge(station) - bounds[:, 0]))
            found_station, found_offset = found_road.alignment.project(
                true_road.alignment.place(station, offset) + _plan_shift(truth, reconstructed)
            )
            found_height = found_road.elevation(found_station, found_offset) + reconstructed.transform.translate[2]
            result.append(found_height - true_road.elevation(station, offset) - truth.transform.translate[2])
    return np.concatenate(result)


def _barriers(true_road: RoadGeometry, found_road: RoadGeometry, shift: Float) -> dict[str, Any]:
    """Return as JSON data the length, recall and precision of all barriers, metre by metre, and their offsets, m."""
    true_barriers, found_barriers = (
        [item for item in road.parameters.objects.values() if isinstance(item, _BARRIERS)]
        for road in (true_road, found_road)
    )
    is_recalled, error = _match_barriers(true_road, true_barriers, found_road, found_barriers, shift)
    is_correct, _ = _match_barriers(found_road, found_barriers, true_road, true_barriers, -shift)
    return {
        "true_length": round(float(len(is_recalled)), 1),
        "found_length": round(float(len(is_correct)), 1),
        "recall": _share(is_recalled),
        "precision": _share(is_correct),
        "offset": _difference_figures(error),
    }


def _match_barriers(
    road: RoadGeometry, items: list[Any], other_road: RoadGeometry, other_items: list[Any], shift: Float
) -> tuple[Bool, Float]:
    """Return whether each metre of a road's barriers has a match on the other road, and the matches' distances, m.

    Args:
        road: whose barriers are looked at, metre by metre.
        items: its barriers.
        other_road: on which a barrier within `BARRIER_DISTANCE` is a match.
        other_items: its barriers.
        shift: (2,) from plan coordinates of the first road to those of the other one, m.
    """
    distances: list[Float] = []
    for item in items:
        point = _points_along(road, item) + shift
        station, offset = other_road.alignment.project(point)
        distance = np.full(len(point), _FAR)
        for rival in other_items:
            lateral_distance = np.abs(offset - rival.offset)
            in_reach = (station >= rival.start_station - _STEP) & (station <= rival.end_station + _STEP)
            distance = np.where(in_reach & (lateral_distance < distance), lateral_distance, distance)
        distances.append(distance)
    distance = np.concatenate(distances) if distances else np.empty(0)
    is_match = distance <= BARRIER_DISTANCE
    return is_match, distance[is_match]


def _points_along(road: RoadGeometry, item: LineObject) -> Float:
    """Return points (N, 2), m, each metre along an object, at least one."""
    end = min(item.end_station, road.length)
    station = np.arange(item.start_station, max(end, item.start_station + 1e-6), _STEP)
    return road.alignment.place(station, np.full(len(station), item.offset))


def _posts(true_road: RoadGeometry, found_road: RoadGeometry, shift: Float) -> dict[str, Any]:
    """Return as JSON data count, recall and precision of delineators, matched one to one by least distance."""
    points = []
    for road in (true_road, found_road):
        items = [item for item in road.parameters.of_type(Delineator).values() if item.station <= road.length]
        station_offsets = np.array([(item.station, item.offset) for item in items]).reshape(-1, 2)
        points.append(road.alignment.place(*station_offsets.T))
    true_points, found_points = points[0] + shift, points[1]
    if not len(true_points) or not len(found_points):
        return {
            "true": len(true_points),
            "found": len(found_points),
            "recall": 0.0 if len(true_points) else None,
            "precision": None,
        }
    distance = cdist(true_points, found_points)
    rows, columns = linear_sum_assignment(np.minimum(distance, 10.0 * POST_DISTANCE))
    match_distances = distance[rows, columns]
    match_distances = match_distances[match_distances <= POST_DISTANCE]
    return {
        "true": len(true_points),
        "found": len(found_points),
        "recall": round(len(match_distances) / len(true_points), 4),
        "precision": round(len(match_distances) / len(found_points), 4),
        "distance": _difference_figures(match_distances),
    }


def _share(hits: Bool) -> float | None:
    """Return the share of hits, rounded; None without any element."""
    return round(float(hits.mean()), 4) if len(hits) else None
