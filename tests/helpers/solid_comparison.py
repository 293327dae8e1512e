"""How far two descriptions of a solid thing lie apart: a mesh's triangles, and closed bodies with their fittings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
    corners = [triangles[None, :, i] for i in range(3)]
    place = points[:, None]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    size = np.linalg.norm(normal, axis=2)
    unit = normal / np.maximum(size, 1e-15)[..., None]
    above = np.abs(np.einsum("ijk,ijk->ij", place - corners[0], np.broadcast_to(unit, (1, *unit.shape[1:]))))
    within = size > 1e-15
    nearest = np.full(above.shape, np.inf)
    for i in range(3):
        start, end = corners[i], corners[(i + 1) % 3]
        edge, reach = end - start, place - start
        share = np.clip(
            np.einsum("ijk,ijk->ij", reach, edge + 0.0 * reach) / np.maximum((edge**2).sum(2), 1e-30), 0.0, 1.0
        )
        nearest = np.minimum(nearest, np.linalg.norm(reach - share[..., None] * edge, axis=2))
        within = within & (np.einsum("ijk,ijk->ij", np.cross(edge + 0.0 * reach, reach), unit + 0.0 * reach) >= 0.0)
    return np.where(within, above, nearest).min(axis=1)
