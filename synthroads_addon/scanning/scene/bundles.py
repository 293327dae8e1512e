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
        axis, direction_radius = _box(directions, starts)
        length = np.sqrt(np.einsum("ib,ib->b", axis, axis))
        angle = np.where(
            direction_radius < length, np.arcsin(np.minimum(direction_radius / np.maximum(length, 1e-300), 1.0)), np.pi
        )
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
        # From the point of each ray that is nearest to the ball's centre to this.
        offset = track.interpolate(way, self.times[rays]) - self.origins[:, rays]
        direction = self.directions[:, rays]
        nearest_range = np.clip(dot(offset, direction), 0.0, self.reach[rays])
        offset -= nearest_range * direction
        return rays[dot(offset, offset) <= radius**2]

    def _bundles_near(self, track: Track, way: Float, radius: float) -> Index:
        """Return the indices of the bundles whose cone touches a moving ball.

        Args:
            track: of the body.
            way: (3, K) centres of the ball at the track's knots, m.
            radius: of the ball, m.
        """
        offset = track.interpolate(way, self.time) - self.apex
        fastest = float(np.sqrt(np.square(np.diff(way, axis=1)).sum(axis=0).max())) / track.spacing  # m/s
        distance = np.sqrt(np.einsum("ib,ib->b", offset, offset))
        # One ball stands for all rays of a bundle: larger by where these begin, and by the body's way meanwhile.
        reach_of_ball = radius + self.ball + fastest * self.delay
        cosine = np.einsum("ib,ib->b", offset, self.axis) / np.maximum(distance, 1e-300)
        off_axis = np.arccos(np.clip(cosine, -1.0, 1.0))
        angular_radius = np.arcsin(np.minimum(reach_of_ball / np.maximum(distance, 1e-300), 1.0))
        touches_cone = (distance <= reach_of_ball) | (off_axis <= self.angle + angular_radius)
        return np.flatnonzero(touches_cone & (distance <= self.farthest + reach_of_ball))


def dot(a: Float, b: Float) -> Float:
    """Return the products (N,) of vectors (3, N): component by component, in an order that compiled loops have too."""
    result = a[0] * b[0]
    for i in (1, 2):
        result += a[i] * b[i]
    return np.asarray(result)


def _box(values: Float, starts: Index) -> tuple[Float, Float]:
    """Return the centres (C, B) of the bounding boxes of bundles of values (C, N), and their half diagonals (B,)."""
    lowest_corners, highest_corners = (
        np.stack([extreme.reduceat(row, starts) for row in values]) for extreme in (np.minimum, np.maximum)
    )
    return (lowest_corners + highest_corners) / 2.0, np.sqrt(
        np.square(highest_corners - lowest_corners).sum(axis=0)
    ) / 2.0
