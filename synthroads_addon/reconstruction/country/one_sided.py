"""Where pavement is wider than usual on one side, as beside a lay-by: which of its edges keeps the road's course.

An axis is made of lines, arcs and clothoids, whose curvature changes slowly; an edge that leaves the road for a bay does
so over a taper, with a kink at either end. So the axis lies half of the usual width within one of the edges, or, where
bays on both sides overlap, somewhere between these two places, and wherever its curvature changes least.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float
from ..edges import FARTHEST, Pavement, usual_place
from ..lines import Line
from ..path import SPACING, CloudPath
from ..profiles import STRETCH
from ..smoothing import fill_gaps, robust_scale, smooth

_WIDER = 0.2
"""Width beyond the usual one, m, from which on an edge may have left its course. Chosen: grass wanders by less, and the
middle by half of it."""
_TIMES_SCATTER = 3.0
"""The same in scatters of the width, where brightness shows it less exactly. Chosen: three deviations."""
_FEWEST = 4
"""Stretches that must show both edges. Chosen: a third difference has four values."""
_ROAD_KINK = 0.2
"""Third difference, m, of an axis' places by stretch that is usual. Chosen: a clothoid of 30 m to a radius of 60 m has
0.07, the kink of a taper of 20 m to a bay of 3.3 m has 0.8."""
_LEAST_SCATTER = 0.01
"""Scatter of an edge from stretch to stretch, m, at least. Chosen: that of the points of a single stretch."""
_USUAL_STD = 0.1
"""Deviation of an edge in a stretch that is no fault, m. Chosen: a bin."""
_SHARES = np.linspace(0.0, 1.0, 13)
"""Places between those by the right edge (0) and by the left edge (1) that are tried, in shares of the way. Chosen: 0.3
m apart beside a bay."""
_BETWEEN = 0.05
"""Cost of a stretch, m2, in which neither edge keeps its course. Chosen: a bay of 90 m costs as much as the kinks that
the middle of both edges has beside it."""
_SAME_PLACE = 0.5
"""Distance of two places of the axis, m, that needn't be told apart. Chosen: doubts begin at this distance of lines."""
_CLEARER, _LEAST_CLEAR = 0.35, 0.15
"""Share of its own cost, and m2, by which the best course must be better than one that lies elsewhere. Chosen: a tenth
of what the kinks of a taper to a bay cost."""


@dataclass(frozen=True)
class OneSided:
    """Where a single carriageway's axis lies between the edges of its pavement, in each of K stretches.

    Attributes:
        share: (K,) 0 where the right edge keeps its course, 1 where the left one does, between them where neither does
            or both do.
        excess: (K,) width beyond the usual one, m; 0 where it is the usual one.
        width: usual width, m.
        is_open: (K,) where the pavement is wider, and which edge keeps its course isn't clear.
    """

    share: Float
    excess: Float
    width: float
    is_open: Bool

    @property
    def shift(self) -> Float:
        """Return how far (K,), m, the pavement's middle lies to the left of the axis."""
        return (0.5 - self.share) * self.excess

    def straight(self, edges: tuple[Line, Line]) -> tuple[Line, Line]:
        """Return the right and the left edge less bays: half of the usual width beside the axis."""
        right, left = edges
        is_wide = self.excess > 0.0
        by_right, by_left = is_wide & (self.share == 0.0), is_wide & (self.share == 1.0)
        neither = is_wide & ~by_right & ~by_left
        return _replaced(right, left, by_left, neither, -self.width), _replaced(left, right, by_right, neither, self.width)


def _replaced(edge: Line, other: Line, beside_other: Bool, unknown: Bool, distance: float) -> Line:
    """Return an edge that lies beside another one in the stretches of a mask, and isn't seen in those of another one.

    Args:
        edge, other: edges of the pavement.
        beside_other: (K,) mask.
        unknown: (K,) mask.
        distance: to the left of the other edge, m.
    """
    measured = np.where(beside_other, other.measured + distance, np.where(unknown, np.nan, edge.measured))
    return replace(edge, measured=measured, offsets=np.where(beside_other, other.offsets + distance, edge.offsets))


def find_one_sided(pavement: Pavement, low: float, high: float) -> OneSided | None:
    """Return which edge of a carriageway's pavement keeps its course; None if one of them is hardly seen.

    Args:
        pavement: cross profiles with their share of pavement.
        low, high: usual offsets of the pavement's right and left edge, m.
    """
    profiles = pavement.profiles
    begin, reach = np.full(profiles.stretches, 0.5 * (low + high)), 0.5 * (high - low) + FARTHEST
    right, left = (pavement.edge(begin, sign, reach).offsets for sign in (-1, 1))
    return one_sided(profiles.path, profiles.middles, right, left)


def one_sided(path: CloudPath, stations: Float, right: Float, left: Float) -> OneSided | None:
    """Return where the axis lies between two edges; None if fewer than `_FEWEST` stretches show both.

    Args:
        path: that the offsets are measured from.
        stations: (K,) along it, m.
        right, left: offsets (K,) of the edges, m; NaN where one isn't seen.
    """
    width = left - right
    is_seen = np.isfinite(width)
    usual_width = usual_place(width)
    if usual_width is None or is_seen.sum() < _FEWEST:
        return None
    smooth_right, smooth_left = _smooth(right), _smooth(left)
    excess = smooth_left - smooth_right - usual_width
    scatter = robust_scale(excess[np.abs(excess) < _WIDER])
    is_wide = ndimage.binary_dilation(excess > max(_WIDER, _TIMES_SCATTER * scatter)) & (excess > 0.0)
    share, is_open = np.full(len(width), 0.5), np.zeros(len(width), dtype=bool)
    if is_wide.any():
        share, is_open = _best_course(path, stations, np.array([smooth_right, smooth_left]), usual_width, is_wide)
    is_near = is_seen & (np.abs(width - usual_width - excess) < _SAME_PLACE)
    seen_excess = np.where(is_near, width - usual_width, excess)
    return OneSided(share, np.where(is_wide, np.maximum(seen_excess, 0.0), 0.0), usual_width, is_open)


def _smooth(edge: Float) -> Float:
    """Return an edge's offsets (K,), m, smoothed as much as they scatter, bridged where it isn't seen."""
    is_seen = np.isfinite(edge)
    third = np.diff(edge, 3)
    # A third difference of independent values has sqrt(20) of their deviation.
    scatter = max(robust_scale(third[np.isfinite(third)]) / np.sqrt(20.0), _LEAST_SCATTER)
    # Whittaker's smoothing weighs scatter^2 against kinks^2: lambda = (wavelength / (2 pi spacing))^6 is their ratio.
    wavelength = 2.0 * np.pi * STRETCH * SPACING * (scatter / _ROAD_KINK) ** (1.0 / 3.0)
    smooth_edge = smooth(edge, is_seen.astype(np.float64), STRETCH * SPACING, wavelength, usual_std=_USUAL_STD)
    return fill_gaps(np.where(is_seen, smooth_edge.values, np.nan))


def _best_course(
    path: CloudPath, stations: Float, edges: Float, usual_width: float, is_wide: Bool
) -> tuple[Float, Bool]:
    """Return where between both edges the axis' best course lies, as in `OneSided`, and where others are as good.

    Args:
        path: that the offsets are measured from.
        stations: (K,) along it, m.
        edges: (2, K) offsets of the right and the left edge, m.
        usual_width: of the pavement, m.
        is_wide: (K,) mask of the stretches in which it is wider.
    """
    right, left = edges[0] + 0.5 * usual_width, edges[1] - 0.5 * usual_width
    shares = [_SHARES if wide else np.array([0.5]) for wide in is_wide]
    offsets = [one + share * (other - one) for one, other, share in zip(right, left, shares, strict=True)]
    places = [path.place(np.full(len(row), station), row) for station, row in zip(stations, offsets, strict=True)]
    between = [np.where((row == 0.0) | (row == 1.0) | ~wide, 0.0, _BETWEEN) for row, wide in zip(shares, is_wide, strict=True)]
    costs = _course_costs(places, between)
    share, is_open = np.full(len(stations), 0.5), np.zeros(len(stations), dtype=bool)
    for number in np.flatnonzero(is_wide):
        best = int(costs[number].argmin())
        share[number] = shares[number][best]
        others = costs[number][np.abs(offsets[number] - offsets[number][best]) > _SAME_PLACE]
        least = float(costs[number][best])
        is_open[number] = len(others) > 0 and float(others.min()) - least < _CLEARER * least + _LEAST_CLEAR
    return share, is_open


def _course_costs(places: list[Float], costs: list[Float]) -> list[Float]:
    """Return for each of K stretches the cost (P,), m2, of the best course through each of its places.

    The cost of a course is the sum of its squared third differences, which are 0 where the curvature changes linearly
    with the stretches, and of its places' costs. The least one by place is found from both ends (Viterbi 1967).

    Args:
        places: of each stretch (P, 2), m.
        costs: of each stretch (P,), m2.
    """
    # A state is the places of three stretches in a row; `steps[k]` is the cost of going on from them to the next one.
    steps = []
    for first, second, third, fourth, cost in zip(places, places[1:], places[2:], places[3:], costs[3:], strict=False):
        difference = (
            fourth
            - 3.0 * third[:, None]
            + 3.0 * second[:, None, None]
            - first[:, None, None, None]
        )
        steps.append(np.square(difference).sum(axis=-1) + cost)
    forward = [costs[0][:, None, None] + costs[1][:, None] + costs[2]]
    for step in steps:
        forward.append((forward[-1][..., None] + step).min(axis=0))
    backward = [np.zeros(forward[-1].shape)]
    for step in reversed(steps):
        backward.append((step + backward[-1][None]).min(axis=3))
    totals = [there + back for there, back in zip(forward, reversed(backward), strict=True)]
    ends = [totals[0].min(axis=(1, 2)), totals[0].min(axis=(0, 2))]
    return [*ends, *(total.min(axis=(0, 1)) for total in totals)]
