"""Poses of a platform or a vehicle between knots: exact at these, linear between."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, Self

import numpy as np

from ..base.arrays import Bool, Float, Index

_AT_ONCE = 1024
"""Knots whose poses are worked out at once: for so many it takes hardly longer than for a few."""
_KEPT = 6
"""So many times `_AT_ONCE` knots are kept, for the blocks that are being scanned and those that follow."""
NODES = 6
"""Poses from which those between the middle two are worked out, by the polynomial through them."""
NODE_ERROR = 225.0 / 46_080.0
"""Largest error of that polynomial over the sixth derivative times the sixth power of the nodes' spacing."""


@dataclass(frozen=True)
class Track:
    """Poses of a body at evenly spaced times (knots), linearly interpolated between them.

    Between two knots position and rotation matrix are linear: for knots that are near enough the matrix stays a
    rotation within rounding (its error is an eighth of the squared angle between two knots).

    Attributes:
        begin: time of the first knot, s.
        spacing: s between two.
        rotation: (9, K) matrices from the body frame to the local one, row by row.
        position: (3, K) m.
        present: (K,) whether it is there at all.
    """

    begin: float
    spacing: float
    rotation: Float
    position: Float
    present: Bool

    @classmethod
    def between(cls, pose: Callable[[Float], Any], begin: float, end: float, spacing: float, every: int = 1) -> Self:
        """Return the track of a body's poses at the knots that span two times.

        Knots are whole multiples of the spacing, so that no result depends on where a block begins.

        Args:
            pose: ``pose(time (K,)) -> (rotation (K, 3, 3), position (K, 3), present (K,))``.
            begin, end: times, s.
            spacing: s between two knots.
            every: the pose is worked out at each knot whose number is a multiple of this (a node), and between nodes
                by polynomials through `NODES` of them: for poses that bend fast and smoothly.
        """
        first_knot, last_knot = _knot_numbers(begin, end, spacing)
        if every == 1:
            return cls._at_knots(pose, first_knot, last_knot, spacing)
        # A cell is the stretch from one node to the next; each needs NODES // 2 - 1 more nodes on both sides of it.
        first_node = first_knot // every
        cells = last_knot // every - first_node + 1
        margin = NODES // 2 - 1
        nodes = cls._at_knots(pose, first_node - margin, first_node + cells + margin, spacing * every)
        # Of the knots of all cells those from the first to the last one.
        window = slice(first_knot - first_node * every, last_knot + 1 - first_node * every)
        present_at_begin = nodes.present[margin : margin + cells]
        present_at_end = nodes.present[margin + 1 : margin + 1 + cells]
        present = np.repeat(present_at_begin & present_at_end, every)
        return cls(
            first_knot * spacing,
            spacing,
            _refine(nodes.rotation, every)[:, window],
            _refine(nodes.position, every)[:, window],
            present[window],
        )

    @classmethod
    def _at_knots(cls, pose: Callable[[Float], Any], first_knot: int, last_knot: int, spacing: float) -> Self:
        """Return the track of the poses at two knots and all between, numbered in multiples of the spacing (s)."""
        times = np.arange(first_knot, last_knot + 1) * spacing
        rotation, position, present = pose(times)
        count = len(times)
        return cls(
            float(times[0]),
            spacing,
            np.ascontiguousarray(np.reshape(rotation, (count, 9)).T),
            np.ascontiguousarray(np.transpose(position)),
            np.asarray(present, dtype=bool),
        )

    def at(self, times: Float) -> tuple[Float, Float, Bool]:
        """Return interpolated rotations (9, N), positions (3, N) and presence (N,) at times within the track."""
        index, share = _locate(self, times)
        rotation = _interpolate(self.rotation, index, share)
        position = _interpolate(self.position, index, share)
        if self.present.all():
            return rotation, position, np.ones(len(times), dtype=bool)
        return rotation, position, self.present[index] & self.present[index + 1]

    def way_of(self, point: Float) -> Float:
        """Return the local positions (3, K), m, at the knots, of a point (3,) fixed in the body frame."""
        return np.asarray(np.einsum("ijk,j->ik", self.rotation.reshape(3, 3, -1), point) + self.position)

    def interpolate(self, way: Float, times: Float) -> Float:
        """Interpolate values (C, K), one for each knot, at times (N,) within the track; return them (C, N)."""
        return _interpolate(way, *_locate(self, times))

    def swept_box(self, centre: Float, radius: float) -> Float | None:
        """Return the box (2, 3), m, that a sphere fixed to the body sweeps through; None where the body is never there.

        Args:
            centre: (3,) of the sphere in the body frame, m.
            radius: m.
        """
        present_knots = np.flatnonzero(self.present)
        if not len(present_knots):
            return None
        centre_way = self.way_of(centre)[:, present_knots]
        return np.array([centre_way.min(axis=1) - radius, centre_way.max(axis=1) + radius])


class PoseCache:
    """Cache of one body's poses at knots, for all blocks that ask for the same ones; thread-safe.

    Args:
        pose: see `Track.between`.
    """

    def __init__(self, pose: Callable[[Float], Any]) -> None:
        @lru_cache(maxsize=_KEPT)
        def stretch(number: int, spacing: float) -> Track:
            """Return the track of the stretch of `_AT_ONCE` knots with this number."""
            return Track._at_knots(pose, number * _AT_ONCE, (number + 1) * _AT_ONCE - 1, spacing)

        self._stretch = stretch

    def track(self, begin: float, end: float, spacing: float) -> Track:
        """Return the track of poses at knots that span two times, s, from cached stretches."""
        first_knot, last_knot = _knot_numbers(begin, end, spacing)
        first_stretch = first_knot // _AT_ONCE
        stretches = [self._stretch(number, spacing) for number in range(first_stretch, last_knot // _AT_ONCE + 1)]
        knots = slice(first_knot - first_stretch * _AT_ONCE, last_knot + 1 - first_stretch * _AT_ONCE)
        names = ("rotation", "position", "present")
        joined_arrays = (np.concatenate([getattr(part, name) for part in stretches], axis=-1) for name in names)
        return Track(first_knot * spacing, spacing, *(array[..., knots] for array in joined_arrays))


def track_knots(begin: float, end: float, spacing: float) -> Float:
    """Return the times (K,) of the knots, at least two, that span two times, s: whole multiples of ``spacing``."""
    first_knot, last_knot = _knot_numbers(begin, end, spacing)
    return np.arange(first_knot, last_knot + 1) * spacing


def _knot_numbers(begin: float, end: float, spacing: float) -> tuple[int, int]:
    """Return the first and the last of the knots that span two times, as multiples of ``spacing``."""
    first_knot = int(np.floor(begin / spacing))
    return first_knot, max(int(np.ceil(end / spacing)), first_knot + 1)


def _locate(track: Track, times: Float) -> tuple[Index, Float]:
    """Return the indices (N,) of the knots before times (N,), and the shares (N,) of the way to the next."""
    position = (times - track.begin) / track.spacing
    index = np.clip(position.astype(np.intp), 0, track.position.shape[1] - 2)
    position -= index
    return index, position


def _interpolate(values: Float, index: Index, share: Float) -> Float:
    """Return values (C, N), interpolated linearly at shares (N,) of the way from knot ``index`` to the next."""
    result, begin = np.empty((len(values), len(index))), np.empty(len(index))
    # Row by row, which is thrice as fast as all at once.
    for number, (row, step) in enumerate(zip(values, np.diff(values, axis=1), strict=True)):
        np.take(step, index, out=result[number], mode="clip")
        result[number] *= share
        result[number] += np.take(row, index, out=begin, mode="clip")
    return result


@lru_cache(maxsize=64)
def _node_weights(every: int) -> Float:
    """Return the weights (every, NODES) of evenly spaced nodes at each knot between the middle two.

    They are Lagrange's basis polynomials: of node j the product of (x - x_m) / (x_j - x_m) over all other nodes m.
    """
    # In units of the nodes' spacing, from the node before the knots.
    knot_shares, node_places = np.arange(every) / every, np.arange(NODES) - (NODES // 2 - 1)
    weights = np.ones((every, NODES))
    for node, other in product(range(NODES), repeat=2):
        if node != other:
            weights[:, node] *= (knot_shares - node_places[other]) / (node_places[node] - node_places[other])
    return weights


def _refine(values: Float, every: int) -> Float:
    """Return values (C, N) at nodes as values (C, (N + 1 - NODES) * every) at the knots from the third node on."""
    weights = _node_weights(every)
    cells = values.shape[1] + 1 - NODES
    result = np.empty((len(values), cells, every))
    # Knots in rows and cells in columns: rows are longer so, and sums of long rows faster.
    total, part = np.empty((2, every, cells))
    for row, refined in zip(values, result, strict=True):
        total[:] = 0.0
        for node in range(NODES):
            total += np.multiply(weights[:, node, None], row[node : node + cells], out=part)
        refined[:] = total.T
    return result.reshape(len(values), -1)
