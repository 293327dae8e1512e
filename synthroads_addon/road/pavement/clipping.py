"""Convex outlines cut by convex outlines, both counter-clockwise, in stations and offsets."""

from collections.abc import Iterable, Iterator

import numpy as np

from ...base.arrays import Bool, Float

_TOUCHES = 1e-9
"""Distance (m) up to which a corner lies on an edge."""


def edges_of(outline: Float) -> Float:
    """Return normal and distance (K, 3) of each edge of a convex outline (K, 2): inside where all are below 0, m."""
    along = np.roll(outline, -1, axis=0) - outline
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    return np.column_stack([normal, np.einsum("ij,ij->i", normal, outline)])


def covers(edges: Float, station: Float, offset: Float) -> Bool:
    """Return which places (N,) lie within a convex outline, given by its edges (K, 3)."""
    across = np.column_stack([station, offset]) @ edges[:, :2].T - edges[:, 2]
    return np.asarray((across <= 0.0).all(axis=1))


def split_outline(outline: Float, area: Float) -> tuple[Float | None, list[Float]]:
    """Return the piece of a convex outline (K, 2) within a convex area (M, 2), None if none is, and those outside."""
    outside: list[Float] = []
    for edge in edges_of(area):
        beyond, outline = _clip(outline, -edge), _clip(outline, edge)
        if len(beyond) > 2:
            outside.append(beyond)
        if len(outline) < 3:
            return None, outside
    return outline, outside


def subtract(outline: Float, areas: Iterable[Float]) -> list[Float]:
    """Return the convex pieces of a convex outline (K, 2) that none of some convex areas (M, 2) covers."""
    left = [outline]
    for area in areas:
        left = [piece for part in left for piece in _outside(part, area)]
    return left


def _outside(outline: Float, area: Float) -> Iterator[Float]:
    """Yield an outline whole if it doesn't meet an area, else its pieces outside."""
    if not meet(outline, area):
        yield outline
        return
    inside, outside = split_outline(outline, area)
    yield from (outline,) if inside is None else outside


def meet(outline: Float, area: Float) -> bool:
    """Return whether the boxes around two outlines overlap."""
    return bool((outline.min(axis=0) < area.max(axis=0)).all() and (outline.max(axis=0) > area.min(axis=0)).all())


def _clip(outline: Float, edge: Float) -> Float:
    """Return the part of a convex outline (K, 2) on the inner side of an edge (normal and distance)."""
    if not len(outline):
        return outline
    across = outline @ edge[:2] - edge[2]
    across[np.abs(across) < _TOUCHES] = 0.0
    if (across >= 0.0).all():
        return np.empty((0, 2))
    corners = []
    for i, corner in enumerate(outline):
        before = across[i - 1]
        if before * across[i] < 0.0:
            corners.append(outline[i - 1] + (corner - outline[i - 1]) * (before / (before - across[i])))
        if across[i] <= 0.0:
            corners.append(corner)
    return np.array(corners).reshape(-1, 2)
