"""Scan lines of a cloud without times: how far consecutive pulses of a line lie apart.

Points of one line follow each other at one distance in one direction, those of neighbouring lines are shifted at random
along it. So among the differences of pairs of points, those within a narrow band along the lines have a peak at the
pulses' distance, in no other direction so high. Within blocks the direction of that band is sought first,
and the peak then; the median of the blocks that show one counts.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..base.arrays import AnyArray, Float

_BLOCK = 15.0
"""Longest edge of a block, m: within it lines are straight and parallel. Chosen: a scan line bends by a footprint or
less over it."""
_MOST_POINTS = 5000
"""Of a block: denser clouds have smaller blocks, as memory follows the pairs of points in one. Chosen: bounds the
work."""
_FEWEST, _MOST_BLOCKS, _FEWEST_BLOCKS = 300, 60, 3
"""Points of a block, and blocks that are looked at: at most, and at least with lines. Chosen: fewer points show no
peak; a median needs three."""
_BAND = 0.08
"""Half width of the band along the lines, of the points' usual distance. Chosen: narrower than any distance of lines,
wider than the pulses' noise."""
_NEAREST, _FARTHEST = 0.5, 1.8
"""Distances of consecutive pulses are sought between these shares of the points' usual distance. Chosen: the second
pulse after one is beyond."""
_DIRECTIONS, _BINS = 90, 52
"""Directions that are tried, and bins of the distance. Chosen: 2 degrees, over which a band's end moves by its width; a
fortieth of the usual distance."""
_CLEAR = 1.8
"""A block shows lines where its fullest direction holds so many times as many pairs as a usual one. Chosen: at random
directions differ by less."""


def pulse_step(place: Float, density: float, strips: int) -> float | None:
    """Return the distance of consecutive pulses on the ground, m; None where no lines show.

    Args:
        place: (N, 2 or more) points of all strips, m.
        density: of all strips together, 1/m2.
        strips: that overlap.
    """
    spacing = float(np.sqrt(strips / density))  # of points of one strip on a square lattice
    edge = min(_BLOCK, float(np.sqrt(_MOST_POINTS / density)))
    cell = np.floor(place[:, :2] / edge).astype(np.int64)
    _, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(owner.ravel(), kind="stable")
    blocks = [rows for rows in np.split(order, np.cumsum(count)[:-1]) if len(rows) >= _FEWEST]
    blocks = blocks[:: max(len(blocks) // _MOST_BLOCKS, 1)]
    by_block = [_step_of_block(place[rows, :2], spacing) for rows in blocks]
    steps = [step for step in by_block if step is not None]
    return float(np.median(steps)) if len(steps) >= _FEWEST_BLOCKS else None


def _step_of_block(place: AnyArray, spacing: float) -> float | None:
    """Return the distance of consecutive pulses in one block, m; None where it shows no lines.

    Args:
        place: (N, 2) points of the block, m.
        spacing: usual distance of neighbouring points, m.
    """
    local = place - place.mean(axis=0)
    pairs = cKDTree(local).query_pairs(_FARTHEST * spacing, output_type="ndarray")
    difference = local[pairs[:, 1]] - local[pairs[:, 0]]
    difference = difference[np.hypot(*difference.T) > _NEAREST * spacing]
    # Component across each direction: (dx, dy) . (-sin, cos).
    angle = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    across = np.abs(np.outer(difference[:, 0], -np.sin(angle)) + np.outer(difference[:, 1], np.cos(angle)))
    in_band = across < _BAND * spacing
    pairs_in_band = in_band.sum(axis=0)
    fullest_direction = int(pairs_in_band.argmax())
    if pairs_in_band[fullest_direction] < _CLEAR * max(float(np.median(pairs_in_band)), 1.0):
        return None
    # The peak of the distances in that direction, smoothed over five bins: an eighth of the spacing, as the pulses'
    # noise.
    length = np.hypot(*difference[in_band[:, fullest_direction]].T)
    count, edges = np.histogram(length, _BINS, (_NEAREST * spacing, _FARTHEST * spacing))
    density = np.convolve(count, np.ones(5), "same")
    return float((edges[:-1] + edges[1:])[int(density.argmax())] / 2.0)
