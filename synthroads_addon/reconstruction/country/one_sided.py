"""Where pavement is wider than usual on one side, as beside a lay-by: which of its edges keeps the road's course.

An axis is made of lines, arcs and clothoids, whose curvature changes slowly; an edge that leaves the road for a bay
does so over a taper, with a kink at either end. So the axis lies half of the usual width within one of the edges, or
within one after the other where bays on both sides overlap, and wherever its curvature changes least.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float, Int
from ..edges import FARTHEST, Pavement, usual_place
from ..lines import Line
from ..path import SPACING, CloudPath, path_through
from ..profiles import STRETCH
from ..smoothing import ORDER, fill_gaps, penalised_curve, robust_scale

_WIDER = 0.2
"""Width beyond the usual one, m, from which on an edge may have left its course. Chosen: grass wanders by less, and the
middle by half of it."""
_TIMES_SCATTER = 3.0
"""The same in scatters of the width, where brightness shows it less exactly. Chosen: three deviations."""
_FEWEST = 4
"""Stretches that must show both edges. Chosen: a third difference has four values."""
_ROAD_KINK = 0.06
"""Third difference, m, of an axis' places by stretch that is usual. Chosen: that of a clothoid of 30 m to a radius of
60 m."""
_LEAST_SCATTER = 0.02
"""Scatter of an edge from stretch to stretch, m, at least. Chosen: no pavement's edge is as straight as a line."""
_REFERENCE_WAVELENGTH = 120.0
"""Wavelength of which half of the pavement's middle's swings is kept in the line that edges are measured from, m.
Chosen: longer than most bays; shorter than a road's curve."""
_COURSE_WAVELENGTH = 40.0
"""The same of the axis that the edges show. Chosen: longer than edges' faults, shorter than any curve."""
_FAULT = 3
"""Stretches whose median an edge is. Chosen: an entrance moves a single one."""
_STEEPEST = 0.2
"""Slope of an edge against the path at most, m/m. Chosen: half of a lane over a taper of 10 m."""
_AROUND = 14
"""Stretches before and behind a wider part in which the course is judged as well. Chosen: 70 m, as long as a bay."""
_LONGEST_CHANGE = 8
"""Stretches from where one edge leaves the road's course to where the other one comes back to it, at most. Chosen: two
tapers of 20 m."""
_CHANGE, _SUPPORT = 15.0, 2
"""Cost of a course that changes from one edge to the other, and stretches of a run that it lies by each at least.
Chosen: less than what a bay costs if the wrong edge is followed; what is shorter is a fault at the run's end."""
_BETWEEN = 2.0
"""Cost of each stretch in which the axis lies by neither edge. Chosen: twice what one by an edge costs on average."""
_SAME_PLACE = 0.5
"""Distance of two places of the axis, m, that needn't be told apart. Chosen: doubts begin at this distance of lines."""
_CLEARER, _LEAST_CLEAR = 0.2, 8.0
"""Share of its own cost, and cost, by which the best course must be better than one that lies elsewhere. Chosen: a
likelihood of exp(-4) of the other one, and more where the best one isn't good."""
_MISFIT = 2.0
"""Cost by stretch from which on even the best course isn't one. Chosen: four times what it costs beside a bay."""
_RIGHT, _BOTH, _LEFT, _NEITHER = range(4)
"""Edges that show the axis."""


@dataclass(frozen=True)
class _Edges:
    """Edges of the pavement in K stretches, and what a course along them costs.

    Attributes:
        axis: (4, K) offsets, m, of the axis by the right edge, both, the left edge; by neither it is that by both.
        scatter: of an edge, m.
    """

    axis: Float
    scatter: float

    def course(self, labels: Int, part: slice) -> tuple[Float, float]:
        """Return the smooth course (N,), m, of an axis that some edges show on a part of the road, and its cost.

        The cost is that of smoothing: squared distances from the edges in scatters, and squared third differences, by
        which the curvature doesn't change linearly, in `_ROAD_KINK`.

        Args:
            labels: (K,) edges that show the axis.
            part: stretches of the part, N.
        """
        label = labels[part]
        weight = np.array([1.0, 2.0, 1.0, 0.0])[label] / self.scatter**2
        offsets = self.axis[label, np.arange(part.start, part.stop)]
        course = penalised_curve(offsets, weight, 1.0 / _ROAD_KINK**2)
        kinks = float(np.square(np.diff(course, 3)).sum()) / _ROAD_KINK**2
        cost = float((weight * np.square(offsets - course)).sum()) + kinks
        return course, cost + _BETWEEN * float((label == _NEITHER).sum())


@dataclass(frozen=True)
class OneSided:
    """Where a single carriageway's axis lies between the edges of its pavement, in each of K stretches.

    Attributes:
        share: (K,) 0 where the right edge keeps its course, 1 where the left one does, between them where neither does
            or both do.
        excess: (K,) width beyond the usual one, m; 0 where it is the usual one.
        axis: (K,) offsets of the axis, m, as the edges show it.
        width: usual width, m.
        is_open: (K,) where the pavement is wider, and which edge keeps its course isn't clear.
    """

    share: Float
    excess: Float
    axis: Float
    width: float
    is_open: Bool

    @property
    def shift(self) -> Float:
        """Return how far (K,), m, the pavement's middle lies to the left of the axis."""
        return (0.5 - self.share) * self.excess

    def course(self, path: CloudPath, stations: Float) -> CloudPath:
        """Return the path that offsets at stations (K,), m, are of, moved to the axis and smoothed in the plane."""
        penalty = _whittaker(_COURSE_WAVELENGTH)
        points = np.column_stack(
            [penalised_curve(values, np.ones(len(stations)), penalty) for values in path.place(stations, self.axis).T]
        )
        station, offset = path.project(points)
        return path.shift_by(np.interp(path.stations, station, offset))

    def straight(self, edges: tuple[Line, Line]) -> tuple[Line, Line]:
        """Return the right and the left edge less bays: half of the usual width beside the axis."""
        right, left = edges
        is_wide = self.excess > 0.0
        by_right, by_left = is_wide & (self.share == 0.0), is_wide & (self.share == 1.0)
        neither = is_wide & ~by_right & ~by_left
        return (
            _replaced(right, left, by_left, neither, -self.width),
            _replaced(left, right, by_right, neither, self.width),
        )


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
    right, left = (_sloping_edge(pavement, begin, sign, reach) for sign in (-1, 1))
    return one_sided(profiles.path, profiles.middles, right, left)


def _sloping_edge(pavement: Pavement, begin: Float, sign: int, reach: float) -> Float:
    """Return the pavement's edge (K,), m, as `Pavement.edge` does, measured along its own course.

    A path that follows the middle of the pavement runs askew to both edges beside a taper.
    """
    edge = pavement.edge(begin, sign, reach).offsets
    if not np.isfinite(edge).any():
        return edge
    course = ndimage.median_filter(fill_gaps(edge), _FAULT, mode="nearest")
    slope = np.clip(np.gradient(course, STRETCH * SPACING), -_STEEPEST, _STEEPEST)
    return pavement.edge(begin, sign, reach, slope).offsets


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
    excess = fill_gaps(ndimage.median_filter(fill_gaps(width), _FAULT, mode="nearest")) - usual_width
    scatter = robust_scale(excess[np.abs(excess) < _WIDER])
    is_wide = ndimage.binary_dilation(excess > max(_WIDER, _TIMES_SCATTER * scatter)) & (excess > 0.0)
    share, is_open = np.full(len(width), 0.5), np.zeros(len(width), dtype=bool)
    if is_wide.any():
        share, is_open = _best_course(_edges_of(path, stations, np.array([right, left]), usual_width), is_wide)
    is_near = is_seen & (np.abs(width - usual_width - excess) < _SAME_PLACE)
    excess = np.where(is_wide, np.maximum(np.where(is_near, width - usual_width, excess), 0.0), 0.0)
    middle = ndimage.median_filter(fill_gaps(0.5 * (right + left)), _FAULT, mode="nearest")
    return OneSided(share, excess, middle - (0.5 - share) * excess, usual_width, is_open)


def _edges_of(path: CloudPath, stations: Float, edges: Float, usual_width: float) -> _Edges:
    """Return the edges (2, K), m, to the right and the left of a path, measured from a smooth line along the pavement.

    From the path they can't be judged: it may have the kinks which an edge doesn't have.
    """
    edges = np.array([ndimage.median_filter(fill_gaps(edge), _FAULT, mode="nearest") for edge in edges])
    middle = path.place(stations, edges.mean(axis=0))
    penalty = _whittaker(_REFERENCE_WAVELENGTH)
    reference = path_through(
        np.column_stack([penalised_curve(values, np.ones(len(stations)), penalty) for values in middle.T])
    )
    places, _ = reference.project(middle)
    offsets = []
    for edge in edges:
        station, offset = reference.project(path.place(stations, edge))
        order = np.argsort(station, kind="stable")
        offsets.append(np.interp(places, station[order], offset[order]))
    right, left = offsets[0] + 0.5 * usual_width, offsets[1] - 0.5 * usual_width
    # A third difference of independent values has sqrt(20) of their deviation.
    scatter = max(robust_scale(np.diff([right, left], 3).ravel()) / np.sqrt(20.0), _LEAST_SCATTER)
    both = 0.5 * (right + left)
    return _Edges(np.array([right, both, left, both]), scatter)


def _whittaker(wavelength: float) -> float:
    """Return the penalty of third differences by stretch of which a wavelength, m, keeps half of its amplitude."""
    return float((wavelength / (2.0 * np.pi * STRETCH * SPACING)) ** (2 * ORDER))


def _best_course(edges: _Edges, is_wide: Bool) -> tuple[Float, Bool]:
    """Return where between the edges the best course lies (K,), as in `OneSided`, and where others are about as good.

    Args:
        edges: of the pavement.
        is_wide: (K,) mask of the stretches in which it is wider than usual.
    """
    labels, share = np.where(is_wide, _NEITHER, _BOTH), np.full(len(is_wide), 0.5)
    is_open = np.zeros(len(is_wide), dtype=bool)
    runs = [run for (run,) in ndimage.find_objects(ndimage.label(is_wide)[0])]
    # Twice: at first nothing is known of the other runs.
    for _ in range(2 if len(runs) > 1 else 1):
        for run in runs:
            part = slice(max(0, run.start - _AROUND), min(len(is_wide), run.stop + _AROUND))
            within = slice(run.start - part.start, run.stop - part.start)
            courses, costs, choices = [], [], []
            # A bay that the cloud doesn't hold whole may end as it likes there: a change of edges explains anything.
            at_end = run.start < _SUPPORT or run.stop > len(is_wide) - _SUPPORT
            for choice, extra in _choices(run.stop - run.start, not at_end):
                labels[run] = choice
                course, cost = edges.course(labels, part)
                courses.append(course[within])
                costs.append(cost + extra)
                choices.append(choice)
            best = int(np.argmin(costs))
            labels[run] = choices[best]
            limit = costs[best] * (1.0 + _CLEARER) + _LEAST_CLEAR
            rivals = [course for course, cost in zip(courses, costs, strict=True) if cost < limit]
            apart = np.max([np.abs(course - courses[best]) for course in rivals], axis=0)
            is_open[run] = (apart > _SAME_PLACE) | (costs[best] > _MISFIT * (part.stop - part.start))
            share[run] = _share(edges.axis[:, run], courses[best], choices[best])
    return share, is_open


def _choices(count: int, may_change: bool) -> Iterator[tuple[Int, float]]:
    """Yield the edges that may show the axis in a run of a number of stretches (N,), with what each choice costs."""
    for label in (_RIGHT, _BOTH, _LEFT):
        yield np.full(count, label), 0.0
    if not may_change:
        return
    for first, second in ((_RIGHT, _LEFT), (_LEFT, _RIGHT)):
        for end in range(_SUPPORT, count - _SUPPORT + 1):
            for begin in range(end, min(end + _LONGEST_CHANGE, count - _SUPPORT) + 1):
                choice = np.full(count, _NEITHER)
                choice[:end], choice[begin:] = first, second
                yield choice, _CHANGE


def _share(axis: Float, course: Float, labels: Int) -> Float:
    """Return how far (N,), 0 to 1, a course lies on the way from its place by the right edge to that by the left one.

    Args:
        axis: (4, N) offsets of the axis by edge, m.
        course: (N,) m.
        labels: (N,) edges that show it.
    """
    way = axis[_LEFT] - axis[_RIGHT]
    share = np.clip((course - axis[_RIGHT]) / np.where(np.abs(way) > 1e-9, way, 1.0), 0.01, 0.99)
    return np.where(labels == _RIGHT, 0.0, np.where(labels == _LEFT, 1.0, np.where(labels == _BOTH, 0.5, share)))
