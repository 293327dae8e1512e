"""Convex outlines cut by convex outlines, both counter-clockwise, in stations and offsets."""

from collections.abc import Iterable, Iterator

import numpy as np

from ...base.arrays import Bool, Float

_TOUCHES = 1e-9
"""Distance (m) up to which a corner lies on an edge."""


def edges_of(outline: Float) -> Float:
    """Return normal and distance (K, 3) of each edge of a convex outline (K, 2): inside where all are below 0, m."""
    directions = np.roll(outline, -1, axis=0) - outline
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-12)[:, None]
    normal = np.column_stack([directions[:, 1], -directions[:, 0]])
    return np.column_stack([normal, np.einsum("ij,ij->i", normal, outline)])


def covers(edges: Float, station: Float, offset: Float) -> Bool:
    """Return which places (N,) lie within a convex outline, given by its edges (K, 3)."""
    distances = np.column_stack([station, offset]) @ edges[:, :2].T - edges[:, 2]
    return np.asarray((distances <= 0.0).all(axis=1))


def split_outline(outline: Float, area: Float) -> tuple[Float | None, list[Float]]:
    """Return the piece of a convex outline (K, 2) within a convex area (M, 2), None if none is, and those outside."""
    # Each edge of the area cuts off what lies beyond it; what is left after all edges lies within.
    outer_pieces: list[Float] = []
    for edge in edges_of(area):
        outer_piece, outline = _clip(outline, -edge), _clip(outline, edge)
        if len(outer_piece) > 2:
            outer_pieces.append(outer_piece)
        if len(outline) < 3:
            return None, outer_pieces
    return outline, outer_pieces


def subtract(outline: Float, areas: Iterable[Float]) -> list[Float]:
    """Return the convex pieces of a convex outline (K, 2) that none of some convex areas (M, 2) covers."""
    remaining_pieces = [outline]
    for area in areas:
        remaining_pieces = [piece for part in remaining_pieces for piece in _outside(part, area)]
    return remaining_pieces


def _outside(outline: Float, area: Float) -> Iterator[Float]:
    """Yield an outline whole if it doesn't meet an area, else its pieces outside."""
    if not meet(outline, area):
        yield outline
        return
    inner_piece, outer_pieces = split_outline(outline, area)
    yield from (outline,) if inner_piece is None else outer_pieces


def meet(outline: Float, area: Float) -> bool:
    """Return whether the boxes around two outlines overlap."""
    return bool((outline.min(axis=0) < area.max(axis=0)).all() and (outline.max(axis=0) > area.min(axis=0)).all())


def _clip(outline: Float, edge: Float) -> Float:
    """Return the part of a convex outline (K, 2) on the inner side of an edge (normal and distance).

    Sutherland and Hodgman's clipping at one line; empty if nothing lies inside.
    """
    if not len(outline):
        return outline
    distances = outline @ edge[:2] - edge[2]
    distances[np.abs(distances) < _TOUCHES] = 0.0
    if (distances >= 0.0).all():
        return np.empty((0, 2))
    corners = []
    for i, corner in enumerate(outline):
        previous_distance = distances[i - 1]
        if previous_distance * distances[i] < 0.0:
            corners.append(
                outline[i - 1] + (corner - outline[i - 1]) * (previous_distance / (previous_distance - distances[i]))
            )
        if distances[i] <= 0.0:
            corners.append(corner)
    return np.array(corners).reshape(-1, 2)
