"""Errors of what was made against the truth that it was made from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.random_streams import stream
from ...cloud.points import PointBlock
from ...road.geometry import RoadGeometry
from ...road.parameters import LineMarking
from ...scanning.scene.mesh import SceneMesh

Float = NDArray[np.float64]

_BESIDE_STEPS = 0.01
"""To either side of a step, m: faces at it may begin a little aside."""


def mesh_height_errors(
    mesh: SceneMesh, geometry: RoadGeometry, samples: int = 100_000, names: tuple[str, ...] = ("road", "roadside")
) -> Float:
    """Return signed height errors (N,) in metres of random points of the mesh's road surface.

    Without the centimetres along which the pavement changes at once, at noses and ends of ramps: faces there go
    slantwise from one cross-section to quite another one.

    Args:
        mesh: scene mesh in local coordinates.
        geometry: the analytic road.
        samples: points, drawn evenly by area with a fixed seed.
        names: classes of the faces that belong to the analytic surface.
    """
    rng = stream(0, "mesh height errors")
    faces = np.flatnonzero(np.isin(mesh.class_id, [class_id(name) for name in names]))
    area = mesh.areas()[faces]
    chosen = faces[rng.choice(len(faces), size=samples, p=area / area.sum())]
    corners = mesh.vertices[mesh.triangles[chosen]].astype(np.float64)
    u, v = rng.random((2, samples))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    station, offset = geometry.alignment.project(points[:, :2])
    inside = (station >= 0) & (station <= geometry.length)
    for low, high in (step for section in geometry.sections.values() for step in section.steps()):
        inside &= (station < low - _BESIDE_STEPS) | (station > high + _BESIDE_STEPS)
    error = points[inside, 2] - geometry.elevation(station[inside], offset[inside])
    return np.asarray(error[np.isfinite(error)])


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
