"""Stretches of a path: a sample in place of all of it, or what a section of the road is scanned from."""

from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import Float
from .path import Path, Strip, epoch_of


@dataclass(frozen=True)
class PathStretches:
    """A path reduced to some of its stretches, or moved to another local frame; see `platforms.path.Path`.

    Attributes:
        path: the whole path.
        strips: its stretches: each has the index of the strip that it is of.
        origin: (3,) where the local frame begins in the path's, m.
    """

    path: Path
    strips: tuple[Strip, ...]
    origin: Float = field(default_factory=lambda: np.zeros(3))

    @property
    def knot_spacing(self) -> float:
        """Return the whole path's time between knots, s."""
        return self.path.knot_spacing

    @property
    def typical_range(self) -> float:
        """Return the whole path's usual range, m."""
        return self.path.typical_range

    @property
    def epoch(self) -> float:
        """Return what the whole path's times count from, s."""
        return epoch_of(self.path)

    @property
    def share(self) -> float:
        """Return the share of the whole path's duration that the stretches take, 0 to 1."""
        return sum(strip.duration for strip in self.strips) / sum(strip.duration for strip in self.path.strips)

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return the whole path's positions (K, 3), m, in this frame, and rotations (K, 3, 3), at times (K,)."""
        strip_of_path = next(candidate for candidate in self.path.strips if candidate.index == strip.index)
        position, rotation = self.path.pose(strip_of_path, time)
        return position - self.origin, rotation


def spread_stretches(path: Path, count: int, duration: float) -> PathStretches:
    """Return a path of ``count`` stretches of a duration (s) on each strip, spread evenly from end to end.

    A strip that isn't longer than all its stretches together stays as it is.
    """
    strips: list[Strip] = []
    for strip in path.strips:
        if strip.duration <= count * duration:
            strips.append(strip)
            continue
        starts = strip.start_time + np.linspace(0.0, strip.duration - duration, count)
        strips += [Strip(strip.index, float(start), duration) for start in starts]
    return PathStretches(path, tuple(strips))


def scatter_stretches(
    path: Path, count: int, duration: float, phase: float = 0.5, largest_share: float = 0.25
) -> PathStretches:
    """Return a path of ``count`` stretches of a duration (s), spread evenly over all strips taken together.

    Args:
        path: of one strip or more.
        count: of stretches.
        duration: of each; less where they would be more than `largest_share` of the path, or longer than a strip.
        phase: where each lies in its share of the path, 0 to 1: other phases give other stretches.
        largest_share: largest share of the path that they take together.
    """
    ends = np.cumsum([strip.duration for strip in path.strips])
    duration = min(duration, largest_share * float(ends[-1]) / count)
    strips: list[Strip] = []
    for place in (np.arange(count) + phase) / count * ends[-1]:
        number = min(int(np.searchsorted(ends, place, side="right")), len(ends) - 1)
        strip = path.strips[number]
        length = min(duration, strip.duration)
        time_in_strip = float(place - (ends[number] - strip.duration))
        start = strip.start_time + min(max(time_in_strip - length / 2.0, 0.0), strip.duration - length)
        strips.append(Strip(strip.index, start, length))
    return PathStretches(path, tuple(strips))
