"""Which rays come near a body that moves: whole bundles of neighbouring rays are ruled out before single rays are."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...base.arrays import Float, Index
from ..knots import Track

RAYS = 64
"""Rays of a bundle. Fewer make more bundles, more make wider ones; no result depends on it."""
_SLACK = 1e-6
"""Added to angles, rad: an arc cosine near 1 has a rounding error of 1e-8."""


@dataclass(frozen=True)
class Bundles:
    """N rays cut into B bundles of `RAYS` that follow on each other: each lies in a cone whose apex is a ball.

    Attributes:
        origins, directions: (3, N) of the rays, m and unit vectors.
        times: (N,) when they are cast, s.
        reach: (N,) how far they go, m.
        time, delay: (B,) middle of a bundle's times, and half their spread, s.
        apex, ball: (3, B) and (B,) middle and radius of the ball that holds its origins, m.
        axis, angle: (3, B) and (B,) the cone's axis, and its largest angle against a ray, rad.
        farthest: (B,) the longest reach, m.
    """

    origins: Float
    directions: Float
    times: Float
    reach: Float
    time: Float
    delay: Float
    apex: Float
    ball: Float
    axis: Float
    angle: Float
    farthest: Float

    @classmethod
    def gather(cls, origins: Float, directions: Float, times: Float, reach: Float) -> Self:
        """Group rays, in their order, into bundles, and find the cone and ball that bound each bundle."""
        starts = np.arange(0, len(times), RAYS)
        time, delay = _box(times[None], starts)
        apex, ball = _box(origins, starts)
        # All directions lie in a ball around the middle of their box: seen from the origin it has this angle.
        axis, spread = _box(directions, starts)
        length = np.sqrt(np.einsum("ib,ib->b", axis, axis))
        angle = np.where(spread < length, np.arcsin(np.minimum(spread / np.maximum(length, 1e-300), 1.0)), np.pi)
        axis /= np.maximum(length, 1e-300)
        farthest = np.maximum.reduceat(reach, starts)
        return cls(origins, directions, times, reach, time[0], delay, apex, ball, axis, angle + _SLACK, farthest)

    def rays_near(self, track: Track, centre: Float, radius: float) -> Index:
        """Return the indices of the rays that come nearer to a moving ball than its radius within their reach.

        Args:
            track: of the body.
            centre: (3,) of the ball in the body frame, m.
            radius: m.
        """
        way = track.way_of(centre)
        bundles = self._bundles_near(track, way, radius)
        rays = (bundles[:, None] * RAYS + np.arange(RAYS)).ravel()
        rays = rays[rays < len(self.times)]
        towards = track.along(way, self.times[rays]) - self.origins[:, rays]
        direction = self.directions[:, rays]
        ahead = dot(towards, direction)
        towards -= np.clip(ahead, 0.0, self.reach[rays]) * direction
        return rays[dot(towards, towards) <= radius**2]

    def _bundles_near(self, track: Track, way: Float, radius: float) -> Index:
        """Return the indices of the bundles whose cone touches a ball with centres ``way`` (3, K) at the knots."""
        towards = track.along(way, self.time) - self.apex
        fastest = float(np.sqrt(np.square(np.diff(way, axis=1)).sum(axis=0).max())) / track.spacing
        away = np.sqrt(np.einsum("ib,ib->b", towards, towards))
        room = radius + self.ball + fastest * self.delay
        ahead = np.einsum("ib,ib->b", towards, self.axis)
        off_axis = np.arccos(np.clip(ahead / np.maximum(away, 1e-300), -1.0, 1.0))
        seen_under = np.arcsin(np.minimum(room / np.maximum(away, 1e-300), 1.0))
        touched = (away <= room) | (off_axis <= self.angle + seen_under)
        return np.flatnonzero(touched & (away <= self.farthest + room))


def dot(a: Float, b: Float) -> Float:
    """Return the products (N,) of vectors (3, N): component by component, in an order that compiled loops have too."""
    result = a[0] * b[0]
    for i in (1, 2):
        result += a[i] * b[i]
    return np.asarray(result)


def _box(values: Float, starts: Index) -> tuple[Float, Float]:
    """Return the centres (C, B) of the bounding boxes of bundles of values (C, N), and their half diagonals (B,)."""
    low, high = (np.stack([ends.reduceat(row, starts) for row in values]) for ends in (np.minimum, np.maximum))
    return (low + high) / 2.0, np.sqrt(np.square(high - low).sum(axis=0)) / 2.0
