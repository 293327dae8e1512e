"""How fast a caster is by itself, and whether two casters agree: what the scan's own speed is held against."""

from __future__ import annotations

import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scanning.scene.caster import Caster, FacePlanes
from ...scanning.scene.mesh import SceneMesh

Float = NDArray[np.float64]
Faces = NDArray[np.int32]
Rays = NDArray[np.float32]

CHUNK = 2**17
"""Rays that one call casts: no other number is faster."""


@dataclass(frozen=True)
class Rate:
    """Rate at which rays were cast, by wall clock and by processor time.

    Attributes:
        rays_per_second: by the clock.
        rays_per_processor_second: by the time that all cores together spent, which other work hardly touches.
    """

    rays_per_second: float
    rays_per_processor_second: float


@dataclass(frozen=True)
class Agreement:
    """Agreement of two casters on the same rays.

    Attributes:
        same: share of the rays for which both find the same face, or both none.
        gap: how far (m) the worst of the other rays is from a tie, 0 if there are none: it passes an edge of either
            face at this distance, or meets both faces at ranges that differ by it (where surfaces cross). A caster
            can't be blamed for taking either face of a tie; 0.1 mm is far more than rounding makes.
    """

    same: float
    gap: float


def bare_rate(
    caster: Caster,
    origins: Rays,
    directions: Rays,
    maximum_range: float,
    threads: int = 1,
    chunk: int = CHUNK,
    repeats: int = 3,
) -> Rate:
    """Return the rate at which a caster alone casts N rays, in chunks on some threads: the best of the repeats."""
    parts = [slice(start, start + chunk) for start in range(0, len(origins), chunk)]
    best, least = np.inf, np.inf
    with ThreadPoolExecutor(threads) as pool:
        run = map if threads == 1 else pool.map
        for _ in range(repeats):
            clock, processor = time.perf_counter(), time.process_time()
            _exhaust(run(lambda part: caster.cast(origins[part], directions[part], maximum_range), parts))
            best = min(best, time.perf_counter() - clock)
            least = min(least, time.process_time() - processor)
    return Rate(len(origins) / best, len(origins) / least)


def _exhaust(results: Iterable[Faces]) -> None:
    for _ in results:
        pass


def agreement(mesh: SceneMesh, origins: Rays, directions: Rays, found: Faces, expected: Faces) -> Agreement:
    """Return the agreement of the faces (N,) that two casters found for the same rays (N, 3); -1 is none."""
    differ = np.flatnonzero(found != expected)
    if not len(differ):
        return Agreement(1.0, 0.0)
    start, along = origins[differ].astype(np.float64), directions[differ].astype(np.float64)
    planes = FacePlanes(mesh)
    gaps, ranges = [], []
    for faces in (found[differ], expected[differ]):
        gaps.append(_edge_distances(mesh, start, along, faces))
        ranges.append(np.where(faces >= 0, planes.intersect(faces, start.T, along.T)[0], np.inf))
    with np.errstate(invalid="ignore"):
        gaps.append(np.abs(ranges[0] - ranges[1]))
    return Agreement(1.0 - len(differ) / len(origins), float(np.nanmin(gaps, axis=0).max()))


def _edge_distances(mesh: SceneMesh, origins: Float, directions: Float, faces: Faces) -> Float:
    """Return the distance (N,), m, of each ray's line to the nearest edge of its face; infinity for face -1."""
    corners = mesh.vertices[mesh.triangles[faces]].astype(np.float64)
    distance = np.full(len(faces), np.inf)
    for i in range(3):
        # Seen along the ray, the line is a point and the edge a segment in the plane across it.
        begin = _perpendicular(corners[:, i] - origins, directions)
        edge = _perpendicular(corners[:, (i + 1) % 3] - corners[:, i], directions)
        length = np.einsum("ij,ij->i", edge, edge)
        share = np.clip(-np.einsum("ij,ij->i", begin, edge) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        distance = np.minimum(distance, np.linalg.norm(begin + share[:, None] * edge, axis=1))
    return np.where(faces >= 0, distance, np.inf)


def _perpendicular(vectors: Float, directions: Float) -> Float:
    """Return the components (N, 3) of vectors that are perpendicular to unit directions (N, 3)."""
    return vectors - np.einsum("ij,ij->i", vectors, directions)[:, None] * directions
