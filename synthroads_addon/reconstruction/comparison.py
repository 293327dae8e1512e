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
    """Return the deviations, m, of a reconstructed road from the true one, as JSON data.

    Stations are the true ones, each metre; a place of the true road that the found one doesn't reach counts for
    ``covered`` alone. Barriers are compared metre by metre, delineators one to one.
    """
    there, here = RoadGeometry(truth), RoadGeometry(reconstructed)
    station = np.arange(0.0, there.length, _STEP)
    point = there.alignment.position(station) + _plan_shift(truth, reconstructed)
    at, offset = here.alignment.project(point)
    covered = (at > 0.0) & (at < here.length)
    turn = here.alignment.heading(at) - there.alignment.heading(station)
    same = bool(np.median(np.cos(turn[covered] if covered.any() else turn)) > 0.0)
    height = here.profile.elevation(at) + reconstructed.transform.translate[2]
    height = height - there.profile.elevation(station) - truth.transform.translate[2]
    sides = {side: _carriageway(there, here, side, same, station[covered], at[covered]) for side in there.sections}
    return {
        "covered": round(float(covered.mean()), 4),
        "centreline": _figures(offset[covered]),
        "profile": _figures(height[covered]),
        "carriageways": sides,
        "surface": _figures(_surface(there, here, station[covered], truth, reconstructed)),
        "barriers": _barriers(there, here, _plan_shift(truth, reconstructed)),
        "delineators": _posts(there, here, _plan_shift(truth, reconstructed)),
    }


def compare_axis(reconstructed: RoadParameters, axis: Float) -> dict[str, Any]:
    """Return the lateral offsets, m, of a known line's points (N, 3), map coordinates, from a found road, as JSON.

    As in `compare`: signed offsets of the points that the found road reaches, and their share as ``covered``.
    Elevations are left aside: lines of road networks often have none.
    """
    here = RoadGeometry(reconstructed)
    at, offset = here.alignment.project(axis[:, :2] - np.array(reconstructed.transform.translate[:2]))
    covered = (at > 0.0) & (at < here.length)
    return {"covered": round(float(covered.mean()), 4), "centreline": _figures(offset[covered])}


def compare_line(line: CloudPath, axis: Float) -> dict[str, Any]:
    """Return the lateral offsets, m, of a known line's points (N, 2) from a found one in the same plane, as JSON data.

    As in `compare_axis`: signed offsets of the points that the found line reaches, and their share as ``covered``.
    """
    at, offset = line.project(axis)
    covered = (at > line.start) & (at < line.start + line.length)
    return {"covered": round(float(covered.mean()), 4), "centreline": _figures(offset[covered])}


def _plan_shift(truth: RoadParameters, reconstructed: RoadParameters) -> Float:
    """Return the shift (2,), m, from local plan coordinates of the true set to those of the found one."""
    return np.array(truth.transform.translate[:2]) - np.array(reconstructed.transform.translate[:2])


def _figures(difference: Float) -> dict[str, float]:
    return difference_figures(difference, "mean", "mae", "rms", "p95", "largest")


def _carriageway(
    there: RoadGeometry, here: RoadGeometry, side: Side, same: bool, station: Float, at: Float
) -> dict[str, Any]:
    """Return as JSON data the lanes and widths, m, of a found carriageway against the true one on the same side."""
    other: Side = side if same else ("left" if side == "right" else "right")
    if other not in here.sections:
        return {"found": False}
    both = ((there.sections[side], station), (here.sections[other], at))
    lanes = [
        sum((width_at(lane.width, where) >= _LANE_THERE).astype(int) for lane in section.carriageway.lanes)
        for section, where in both
    ]
    inner = [width_at(section.carriageway.inner_offset, where) for section, where in both]
    width = [section.main_edge(where) - near for (section, where), near in zip(both, inner, strict=True)]
    return {
        "found": True,
        "lanes": [int(np.median(count)) for count in lanes],
        "lanes_right": round(float(np.mean(lanes[0] == lanes[1])), 4),
        "width": _figures(width[1] - width[0]),
        "inner_offset": _figures(inner[1] - inner[0]),
    }


def _surface(
    there: RoadGeometry, here: RoadGeometry, station: Float, truth: RoadParameters, reconstructed: RoadParameters
) -> Float:
    """Return the height differences (N,), m, found less true surface, at places on the true pavement."""
    result = []
    for side in there.sections.values():
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            bounds = side.distances(station)
            offset = float(side.carriageway.sign) * (bounds[:, 0] + share * (side.main_edge(station) - bounds[:, 0]))
            at, beside = here.alignment.project(
                there.alignment.place(station, offset) + _plan_shift(truth, reconstructed)
            )
            high = here.elevation(at, beside) + reconstructed.transform.translate[2]
            result.append(high - there.elevation(station, offset) - truth.transform.translate[2])
    return np.concatenate(result)


def _barriers(there: RoadGeometry, here: RoadGeometry, shift: Float) -> dict[str, Any]:
    """Return as JSON data the length, recall and precision of all barriers, metre by metre, and their offsets, m."""
    true, reconstructed = (
        [item for item in road.parameters.objects.values() if isinstance(item, _BARRIERS)] for road in (there, here)
    )
    recalled, error = _match_barriers(there, true, here, reconstructed, shift)
    precise, _ = _match_barriers(here, reconstructed, there, true, -shift)
    return {
        "true_length": round(float(len(recalled)), 1),
        "found_length": round(float(len(precise)), 1),
        "recall": _share(recalled),
        "precision": _share(precise),
        "offset": _figures(error),
    }


def _match_barriers(
    one: RoadGeometry, items: list[Any], other: RoadGeometry, others: list[Any], shift: Float
) -> tuple[Bool, Float]:
    """Return for each metre of some barriers whether another one stands there, and for hits how far beside, m."""
    hit: list[Float] = []
    for item in items:
        point = _along(one, item) + shift
        station, offset = other.alignment.project(point)
        distance = np.full(len(point), _FAR)
        for rival in others:
            beside = np.abs(offset - rival.offset)
            inside = (station >= rival.start_station - _STEP) & (station <= rival.end_station + _STEP)
            distance = np.where(inside & (beside < distance), beside, distance)
        hit.append(distance)
    distance = np.concatenate(hit) if hit else np.empty(0)
    near = distance <= BARRIER_DISTANCE
    return near, distance[near]


def _along(road: RoadGeometry, item: LineObject) -> Float:
    end = min(item.end_station, road.length)
    station = np.arange(item.start_station, max(end, item.start_station + 1e-6), _STEP)
    return road.alignment.place(station, np.full(len(station), item.offset))


def _posts(there: RoadGeometry, here: RoadGeometry, shift: Float) -> dict[str, Any]:
    """Return as JSON data count, recall and precision of delineators, matched one to one by least distance."""
    points = []
    for road in (there, here):
        items = [item for item in road.parameters.of_type(Delineator).values() if item.station <= road.length]
        places = np.array([(item.station, item.offset) for item in items]).reshape(-1, 2)
        points.append(road.alignment.place(*places.T))
    true, reconstructed = points[0] + shift, points[1]
    if not len(true) or not len(reconstructed):
        return {"true": len(true), "found": len(reconstructed), "recall": 0.0 if len(true) else None, "precision": None}
    distance = cdist(true, reconstructed)
    rows, columns = linear_sum_assignment(np.minimum(distance, 10.0 * POST_DISTANCE))
    matched = distance[rows, columns]
    matched = matched[matched <= POST_DISTANCE]
    return {
        "true": len(true),
        "found": len(reconstructed),
        "recall": round(len(matched) / len(true), 4),
        "precision": round(len(matched) / len(reconstructed), 4),
        "distance": _figures(matched),
    }


def _share(hits: Bool) -> float | None:
    return round(float(hits.mean()), 4) if len(hits) else None
