"""Base of all paths: strips, poses, and knots between which poses may be interpolated."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError

TURNAROUND = 10.0
"""Seconds between two strips. Chosen: tells strips apart by their times; real ones take longer."""
KNOT_ERROR = 2e-5
"""Largest error of interpolation between two knots, m, in the place of a point at `KNOT_RANGE` from the scanner.
Chosen: a hundredth of a good scanner's range noise."""
KNOT_RANGE = 100.0
"""Range at which a turn's error counts, m. Chosen: most points of a road are nearer."""

_SLOWEST_KNOTS = 0.25
"""Interval of knots where nothing turns or accelerates, s. Chosen: few knots, between which sway and bends would
show."""
_FASTEST_KNOTS = 1e-6
"""Least interval of knots, s. Chosen: that of pulses at 1 MHz."""
_MARGIN = 0.95
"""Share of `KNOT_ERROR` that is aimed at. Chosen: the error is estimated."""
_MOST_STRIPS = 65_536
"""Strips of a path: a point's strip is a number of 16 bits."""


@dataclass(frozen=True)
class Strip:
    """One pass along the road, or one position of a tripod.

    Attributes:
        index: number of the strip, from 0.
        start_time: time of its first pulse since the first strip's, s.
        duration: s.
        ends: whether nothing is known beyond its end, as of a recorded trajectory: where it is shorter than a line,
            only those pulses are fired that leave within it. Else a strip has one whole line at least.
    """

    index: int
    start_time: float
    duration: float
    ends: bool = False


def epoch_of(path: object) -> float:
    """Return what the times of points count from, s: 0, the scan's start, where a path says nothing else."""
    return float(getattr(path, "epoch", 0.0))


class Path(Protocol):
    """Interface of a scanner's path: its strips, and its position and orientation at any time."""

    @property
    def strips(self) -> tuple[Strip, ...]:
        """Return the strips in the order of time."""
        ...

    @property
    def knot_spacing(self) -> float:
        """Return the largest time between two knots of a strip, s.

        Between the poses at two of them, linear interpolation of position and rotation matrix errs less than
        `KNOT_ERROR` at `KNOT_RANGE`. It can be shorter than the time between two pulses, where knots don't pay.
        """
        ...

    @property
    def typical_range(self) -> float:
        """Return the usual distance (m) to what is scanned, to which the scale of intensities refers."""
        ...

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return the scanner's local positions (K, 3), m, and rotations (K, 3, 3), at times (K,) of a strip.

        Args:
            strip: one of `strips`.
            time: (K,) seconds since the first strip's start; a little beyond the strip's ends is allowed.

        Returns:
            local positions (K, 3), m, and rotations (K, 3, 3) from the scanner's frame (x forward, y left, z up) to
            the local one, its mounting included.
        """
        ...


def make_strips(durations: list[float]) -> tuple[Strip, ...]:
    """Return strips of these durations (s), `TURNAROUND` apart.

    Raises:
        InputError: there are more than a point cloud can number.
    """
    if len(durations) > _MOST_STRIPS:
        raise InputError("scan.platform", len(durations), f"at most {_MOST_STRIPS} strips or positions are possible")
    starts = np.concatenate(([0.0], np.cumsum(np.array(durations) + TURNAROUND)))
    return tuple(Strip(i, float(starts[i]), float(duration)) for i, duration in enumerate(durations))


def knot_spacing_for(bend: float, jump: float = 0.0) -> float:
    """Return the spacing of knots, s, at which linear interpolation of poses errs by at most `KNOT_ERROR`.

    Args:
        bend: largest second derivative by time of the place of a point at `KNOT_RANGE`, m/s2: between knots h apart
            linear interpolation errs by up to bend h^2 / 8.
        jump: largest jump of that place's velocity, m/s: it errs by up to jump h / 4.
    """
    # Both at once: bend h^2 / 8 + jump h / 4 = error, solved in the form that doesn't cancel.
    error = 8.0 * _MARGIN * KNOT_ERROR
    spacing = error / max(jump + np.sqrt(jump * jump + error * bend), 1e-300)
    return float(np.clip(spacing, _FASTEST_KNOTS, _SLOWEST_KNOTS))
