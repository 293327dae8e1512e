"""Points whose class isn't that of the road's parameter set at their place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_id
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import LineMarking

Float = NDArray[np.float64]


def misplaced_points(points: PointBlock, geometry: RoadGeometry, margin: Float | float) -> NDArray[np.bool_]:
    """Return, for each point of the pavement's classes, whether it lies outside every strip of its class.

    Args:
        points: a cloud in map coordinates.
        geometry: the analytic road of its parameter set.
        margin: distance (m) by which a point may lie outside; a number, or (N,) for all points of the cloud.

    Returns:
        (K,) for the K points of class road or road_marking.
    """
    origin = np.array(geometry.parameters.transform.translate)
    paved = np.isin(points.class_id, [class_id("road"), class_id("road_marking")])
    station, offset = geometry.alignment.project(points.xyz[paved, :2] - origin[:2])
    margin = np.broadcast_to(margin, len(points))[paved]
    on_line = _distance_to_markings(geometry, station, offset)
    on_road = _distance_to_strips(geometry, station, offset, "road")
    is_line = points.class_id[paved] == class_id("road_marking")
    # A point of the pavement must not lie on paint: its distance into the nearest marking must not exceed the margin.
    return np.where(is_line, on_line > margin, (on_road > margin) | (on_line < -margin))


def _distance_to_strips(geometry: RoadGeometry, station: Float, offset: Float, name: str) -> Float:
    """Return the distance (N,) to the nearest strip of a class; 0 inside."""
    distance = np.full(len(offset), np.inf)
    boundaries = geometry.offsets(station)
    for strip, left, right in zip(geometry.strips, boundaries.T[:-1], boundaries.T[1:], strict=True):
        if strip.class_name == name:
            beside = np.maximum(np.maximum(offset - left, right - offset), 0.0)
            distance = np.where(left > right, np.minimum(distance, beside), distance)
    return distance


def _distance_to_markings(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the signed distance (N,) to the nearest dash: negative inside, by how far it is to the dash's edge."""
    distance = np.full(len(offset), np.inf)
    for line in geometry.parameters.of_type(LineMarking).values():
        left, right = geometry.marking_edges(line, station)
        across = np.maximum(offset - left, right - offset)
        dashes = geometry.dashes(line)
        if not len(dashes):
            continue
        index = np.clip(np.searchsorted(dashes[:, 0], station, side="right") - 1, 0, len(dashes) - 1)
        along = np.full(len(station), np.inf)
        for near in (index, np.minimum(index + 1, len(dashes) - 1)):
            along = np.minimum(along, np.maximum(dashes[near, 0] - station, station - dashes[near, 1]))
        outside = np.hypot(np.maximum(across, 0.0), np.maximum(along, 0.0))
        signed = np.where(outside > 0.0, outside, np.maximum(across, along))
        distance = np.minimum(distance, signed)
    return distance
