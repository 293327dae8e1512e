"""Rate of a caster alone, which a scan's rate is compared with, and agreement of two casters."""

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
"""Rays of one call: measured as the fastest number."""


@dataclass(frozen=True)
class Rate:
    """Rate at which rays were cast, by wall clock and by processor time.

    Attributes:
        rays_per_second: rays by wall-clock time.
        rays_per_processor_second: rays by the time that all cores together spent, which other work hardly affects.
    """

    rays_per_second: float
    rays_per_processor_second: float


@dataclass(frozen=True)
class Agreement:
    """Agreement of two casters on the same rays.

    Attributes:
        same: share of the rays for which both find the same face, or both none.
        gap: largest distance (m) from a tie among the other rays, 0 if there are none. A ray's distance from a tie is
            the least of its distances from the edges of both faces, and of the difference between its ranges to both
            (where surfaces cross). Either face of a tie is right; rounding makes far less than 0.1 mm.
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
    least_clock_seconds = least_processor_seconds = np.inf
    with ThreadPoolExecutor(threads) as pool:
        run = map if threads == 1 else pool.map
        for _ in range(repeats):
            clock, processor = time.perf_counter(), time.process_time()
            _exhaust(run(lambda part: caster.cast(origins[part], directions[part], maximum_range), parts))
            least_clock_seconds = min(least_clock_seconds, time.perf_counter() - clock)
            least_processor_seconds = min(least_processor_seconds, time.process_time() - processor)
    return Rate(len(origins) / least_clock_seconds, len(origins) / least_processor_seconds)


def _exhaust(results: Iterable[Faces]) -> None:
    """Consume all results, so that lazy ones are computed."""
    for _ in results:
        pass


def agreement(
    mesh: SceneMesh, origins: Rays, directions: Rays, caster_faces: Faces, reference_faces: Faces
) -> Agreement:
    """Return the agreement of the faces (N,) that two casters report for the same rays (N, 3); -1 is none."""
    differing_rays = np.flatnonzero(caster_faces != reference_faces)
    if not len(differing_rays):
        return Agreement(1.0, 0.0)
    start, direction = origins[differing_rays].astype(np.float64), directions[differing_rays].astype(np.float64)
    planes = FacePlanes(mesh)
    gaps, ranges = [], []
    for faces in (caster_faces[differing_rays], reference_faces[differing_rays]):
        gaps.append(_edge_distances(mesh, start, direction, faces))
        ranges.append(np.where(faces >= 0, planes.intersect(faces, start.T, direction.T)[0], np.inf))
    with np.errstate(invalid="ignore"):
        gaps.append(np.abs(ranges[0] - ranges[1]))  # NaN where both faces are missed: ignored by nanmin
    return Agreement(1.0 - len(differing_rays) / len(origins), float(np.nanmin(gaps, axis=0).max()))


def _edge_distances(mesh: SceneMesh, origins: Float, directions: Float, faces: Faces) -> Float:
    """Return the distance (N,), m, of each ray's line to the nearest edge of its face; infinity for face -1."""
    corners = mesh.vertices[mesh.triangles[faces]].astype(np.float64)
    distance = np.full(len(faces), np.inf)
    for i in range(3):
        # Projected along the ray, the ray is a point (the origin) and the edge a segment from `begin` along `edge`:
        # the nearest point of the segment is begin + share edge, share = -begin . edge / |edge|^2, clipped to 0..1.
        begin = _perpendicular(corners[:, i] - origins, directions)
        edge = _perpendicular(corners[:, (i + 1) % 3] - corners[:, i], directions)
        length = np.einsum("ij,ij->i", edge, edge)
        share = np.clip(-np.einsum("ij,ij->i", begin, edge) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        distance = np.minimum(distance, np.linalg.norm(begin + share[:, None] * edge, axis=1))
    return np.where(faces >= 0, distance, np.inf)


def _perpendicular(vectors: Float, directions: Float) -> Float:
    """Return the components (N, 3) of vectors that are perpendicular to unit directions (N, 3)."""
    return vectors - np.einsum("ij,ij->i", vectors, directions)[:, None] * directions
