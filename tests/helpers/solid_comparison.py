"""How far two descriptions of a solid thing lie apart: a mesh's triangles, and closed bodies with their fittings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from synthroads_addon.road.things.body import Body
from synthroads_addon.twin.faces import loft, triangulate

Float = NDArray[np.float64]
ALIKE = 1.02e-3
"""Distance (m) within which points are the same: a millimetre, and what 32 bits leave of it."""
FITTING = 0.1
"""Distance (m) from the bodies within which fittings lie."""
_BLOCK = 2_000_000


class Misfit(NamedTuple):
    """Points of which there is nothing in the other description.

    Attributes:
        of_mesh: (N, 3) of the mesh: in no body, and in no fitting near the bodies.
        of_bodies: (M, 3) corners of bodies that aren't on the mesh.
    """

    of_mesh: Float
    of_bodies: Float


def triangles_of(body: Body) -> Float:
    """Return the triangles (T, 3, 3) of a body."""
    faces = loft(body.sections)
    return faces.points[triangulate(faces)]


def compare(mesh: Float, bodies: Sequence[Float], fittings: Sequence[Float]) -> Misfit:
    """Return where a mesh and bodies differ.

    Args:
        mesh: (T, 3, 3) triangles.
        bodies, fittings: (T, 3, 3) triangles of closed bodies, and of the boxes around fittings.
    """
    corners = np.unique(mesh.reshape(-1, 3).round(6), axis=0)
    solid = np.unique(np.concatenate([body.reshape(-1, 3) for body in bodies]).round(7), axis=0)
    left = corners[cKDTree(solid).query(corners)[0] > ALIKE]
    away = _least([_signed(left, body) for body in bodies], len(left))
    outside = away > ALIKE
    fitted = _least([_signed(left[outside], box) for box in fittings], int(outside.sum())) <= ALIKE
    lost = left[outside][~(fitted & (away[outside] <= FITTING))]
    bare = solid[cKDTree(corners).query(solid)[0] > ALIKE]
    return Misfit(lost, bare[_distance(bare, mesh) > ALIKE])


def _least(values: list[Float], count: int) -> Float:
    return np.min(values, axis=0) if values else np.full(count, np.inf)


def _signed(points: Float, body: Float) -> Float:
    """Return the distances (N,) of points (N, 3) from a closed body (T, 3, 3); 0 within its box grown by nothing."""
    low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
    # Of what is far from its box the distance doesn't matter.
    beside = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
    near = np.flatnonzero(beside <= FITTING)
    found = beside.copy()
    found[near] = np.where(_inside(points[near], body), 0.0, _distance(points[near], body))
    return found


def _inside(points: Float, body: Float) -> NDArray[np.bool_]:
    """Return which points (N,) a closed body winds around."""
    a, b, c = (body[None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(edge, axis=2) for edge in (a, b, c))
    dot = [np.einsum("ijk,ijk->ij", *pair) for pair in ((a, b), (b, c), (c, a))]
    volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    angle = 2.0 * np.arctan2(volume, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)
    return np.abs(angle.sum(axis=1)) > 2.0 * np.pi


def _distance(points: Float, triangles: Float) -> Float:
    """Return the distances (N,) of points (N, 3) from the nearest of triangles (T, 3, 3)."""
    found = np.empty(len(points))
    step = max(1, _BLOCK // max(len(triangles), 1))
    for first in range(0, len(points), step):
        found[first : first + step] = _to_nearest(points[first : first + step], triangles)
    return found


def _to_nearest(points: Float, triangles: Float) -> Float:
    place, corners = points[:, None], [triangles[None, :, i] for i in range(3)]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = normal / np.maximum(size, 1e-15)
    within = np.broadcast_to(size[..., 0] > 1e-15, (len(points), len(triangles)))
    nearest = np.full(within.shape, np.inf)
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        edge, reach = end - start, place - start
        share = np.clip((reach * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=2), 1e-30), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(reach - share[..., None] * edge, axis=2))
        within = within & ((np.cross(np.broadcast_to(edge, reach.shape), reach) * normal).sum(axis=2) >= 0.0)
    above = np.abs(((place - corners[0]) * normal).sum(axis=2))
    return np.where(within, above, nearest).min(axis=1)
