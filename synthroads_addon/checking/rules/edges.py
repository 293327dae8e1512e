"""Where the edges of a carriageway lie along the road: of its lanes, its pavement, its turnouts and their ramps.

All distances are horizontal, from the centreline outwards, m: the carriageway's sign times them is the offset.
"""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...road.objects import AnyWidth
from ...road.section import Carriageway, Turnout

Float = NDArray[np.float64]
Offset = TypeVar("Offset", Float, float)

#: At the nose the unpaved ground between hard shoulder and ramp is this wide (m), and the ramp goes on this far (m).
NOSE_WIDTH, NOSE_BEFORE_END = 1.0, 10.0
#: Where the nose is rounded, m behind it, and the share of the ground's width there: half an ellipse with ten sides,
#: whose first two take 5 cm along the road.
_TURN = np.deg2rad([0.0, 18.0, 36.0, 54.0, 72.0, 90.0])
ROUNDING, ROUNDED = 0.05 * (1.0 - np.cos(_TURN)) / (1.0 - np.cos(_TURN[1])), np.sin(_TURN)
#: Stations that are looked at between two that matter, where a ramp bends away.
BETWEEN = 3


class WidthByStation:
    """A width as a function of the station, linear between its points.

    Attributes:
        constant: whether it is the same all along the road.
        station, width: (P,) its points, m; one of any station where it is constant.
    """

    def __init__(self, width: AnyWidth) -> None:
        self.constant = not isinstance(width, tuple)
        points = [(0.0, width)] if not isinstance(width, tuple) else [(p.station, p.width) for p in width]
        self.station, self.width = np.array(points, dtype=np.float64).T

    def __call__(self, station: Float) -> Float:
        """Return the widths (N,) at stations (N,), m."""
        if self.constant:
            return np.full(len(station), self.width[0])
        return np.interp(station, self.station, self.width)


class EdgeDistances(NamedTuple):
    """Distances of a carriageway's edges from the centreline at N stations, m.

    Attributes:
        inner: (N,) inner paved edge.
        lanes: (N, lanes + 1) boundaries of the lanes, from the outermost lane's outer one inwards.
        main: (N,) outer edge of the main road's pavement as if there were no turnouts.
        outer: (N,) outer edge of all pavement.
        gap_low, gap_high: (N,) edges of the unpaved ground between main road and ramp; both are `outer` without any.
    """

    inner: Float
    lanes: Float
    main: Float
    outer: Float
    gap_low: Float
    gap_high: Float

    @property
    def middle(self) -> Float:
        """Return the distance (N,) of the middle of the main road's pavement, m."""
        return 0.5 * (self.inner + self.main)

    def clearance(self, nearest: Float, farthest: Float) -> Float:
        """Return how far (N,), m, what lies between two distances is from the pavement; negative over it."""
        main_clearance = np.maximum(self.inner - farthest, nearest - self.gap_low)
        ramp_clearance = np.maximum(self.gap_high - farthest, nearest - self.outer)
        return np.minimum(main_clearance, ramp_clearance)


class TurnoutEdges:
    """Widths that a turnout adds to its carriageway, along the road.

    Along it counts w (m): for an exit from its beginning in the direction of traffic, for an entry backwards from its
    end; so both begin with their taper and end with their ramp. For an emergency bay it counts as for an exit.

    Attributes:
        name, turnout: the turnout with its id.
        taper, tip, nose, end: w where the lane has its full width, of the gore's tip (a bay's full width ends there),
            of the nose and of the end.
        natural_nose: where the nose would be were the ramp long enough, m behind the tip.
    """

    def __init__(self, name: str, turnout: Turnout, traffic: int, shoulder: WidthByStation) -> None:
        self.name, self.turnout = name, turnout
        ramp = turnout.ramp
        self._runs_forward = (traffic > 0) != (turnout.kind == "entry")
        self.taper = turnout.taper_out_length if turnout.kind == "entry" else turnout.taper_in_length
        self.tip = self.taper + turnout.lane_length
        self.natural_nose = 0.0
        self._wedge_divisor = np.inf
        if ramp is None:
            self.nose = self.end = turnout.length
            self._added = np.array([0.0, self.taper, self.tip, self.end]), turnout.lane_width * np.array([0.0, 1, 1, 0])
            return
        self.end = self.tip + ramp.length
        self._wedge_divisor = 6.0 * ramp.clothoid_parameter**2
        shoulder_at_tip = float(shoulder(np.array([self.station(self.tip)]))[0])
        self.natural_nose = float(np.cbrt(self._wedge_divisor * (shoulder_at_tip + NOSE_WIDTH)))
        self.nose = self.tip + min(self.natural_nose, ramp.length - NOSE_BEFORE_END)
        lane_widening = turnout.lane_width + turnout.edge_strip_width + turnout.shoulder_width
        ramp_width = ramp.lane_width + 2.0 * ramp.edge_strip_width
        marks = [0.0, self.taper, self.tip, self.nose, self.end]
        self._added = np.array(marks), np.array([0.0, lane_widening, lane_widening, ramp_width, ramp_width])

    def station(self, w: float) -> float:
        """Return the station at a distance w along the turnout (both m), for an entry backwards from its end."""
        return self.turnout.start_station + w if self._runs_forward else self.turnout.end_station - w

    def span(self, first_distance: float, last_distance: float) -> tuple[float, float]:
        """Return the stations of two distances w along the turnout, the lower one first, m."""
        a, b = self.station(first_distance), self.station(last_distance)
        return (a, b) if a <= b else (b, a)

    @property
    def ramp_span(self) -> tuple[float, float]:
        """Return the stations of the gore's tip and the ramp's end, the lower one first, m; empty for a bay."""
        return self.span(self.tip, self.end) if self.turnout.ramp else (np.inf, -np.inf)

    def marks(self) -> Float:
        """Return the stations (m, unsorted) at which the pavement's edge bends or steps, and some on its curves."""
        w = list(self._added[0])
        if self.turnout.ramp:
            parts = ((self.tip, self.nose), (self.nose, self.end))
            w += [a + (b - a) * i / (BETWEEN + 1) for a, b in parts for i in range(1, BETWEEN + 1)]
            w += list(self.nose + ROUNDING[1:])
        return np.array([self.station(distance) for distance in w])

    def widen(self, station: Float, edges: _WidthSums) -> None:
        """Add the turnout's widths at N stations to the carriageway's sums, in place."""
        start, end = self.turnout.start_station, self.turnout.end_station
        w = station - start if self._runs_forward else end - station
        rows = np.flatnonzero((w > 0.0) & (w <= self.end))
        if not len(rows):
            return
        w, full_shoulder = w[rows], edges.full[rows]
        edges.added[rows] += np.interp(w, *self._added)
        if self.turnout.ramp is None:
            return
        remaining_shoulder = np.maximum(1.0 - w / self.taper, 0.0) * full_shoulder
        x = np.maximum(w - self.tip, 0.0)
        wedge = x * x * x / self._wedge_divisor  # a clothoid leaves its tangent by x^3 / (6 A^2)
        edges.left[rows] = np.minimum(edges.left[rows], remaining_shoulder)
        edges.wedge[rows] += wedge
        gap_width = np.where(w >= self.nose, np.maximum(wedge - full_shoulder, 0.0), 0.0)
        bare_width = gap_width * np.interp(w - self.nose, ROUNDING, ROUNDED)
        edges.bare[rows] += bare_width
        edges.beside[rows] += (gap_width - bare_width) / 2.0


class _WidthSums(NamedTuple):
    """Sums of widths (N,) at N stations, m, which turnouts add to.

    Attributes:
        full: of the hard shoulder as the carriageway has it.
        left: of the hard shoulder that is left where it isn't part of the wedge.
        wedge: between the main road and a ramp, hard shoulder included.
        added: outside both.
        bare: of the unpaved ground within the wedge.
        beside: of the pavement between that ground and the ramp, where the nose is rounded.
    """

    full: Float
    left: Float
    wedge: Float
    added: Float
    bare: Float
    beside: Float


class Edges:
    """The edges of a carriageway as functions of the station.

    Attributes:
        name, carriageway: the carriageway with its id.
        sign, traffic: signs of its offsets, and of its traffic's direction along the stations.
        turnouts: its exits, entries and bays.
        lane_widths: of the lanes from outside to inside.
        verge: the least width of the verge as the carriageway has it, m.
        marks: (M,) increasing stations on the road at which an edge bends or steps, from its begin to its end.
        at_marks: the edges there.
    """

    def __init__(self, name: str, carriageway: Carriageway, turnouts: dict[str, Turnout], length: float) -> None:
        self.name, self.carriageway = name, carriageway
        self.sign, self.traffic = carriageway.sign, carriageway.traffic
        self._inner_offset = WidthByStation(carriageway.inner_offset)
        self._shoulder = WidthByStation(carriageway.hard_shoulder_width)
        self._inner_strip = WidthByStation(carriageway.inner_edge_strip_width)
        self._outer_strip = WidthByStation(carriageway.outer_edge_strip_width)
        self.lane_widths = [WidthByStation(lane.width) for lane in carriageway.lanes]
        self.verge = float(WidthByStation(carriageway.verge_width).width.min())
        widths = (self._inner_offset, self._shoulder, self._inner_strip, self._outer_strip, *self.lane_widths)
        self.turnouts = [TurnoutEdges(key, item, self.traffic, self._shoulder) for key, item in turnouts.items()]
        bends = [width.station for width in widths if not width.constant] + [t.marks() for t in self.turnouts]
        inner_bends = np.concatenate(bends) if bends else np.zeros(0)
        inner_bends = inner_bends[(inner_bends > 0.0) & (inner_bends < length)]
        self.marks = np.unique(np.concatenate(([0.0], inner_bends, [length])))
        self._constant = self._main(np.zeros(1)) if all(width.constant for width in widths) else None
        self.at_marks = self.at(self.marks)

    def at(self, station: Float) -> EdgeDistances:
        """Return the edges' distances at N stations."""
        count = len(station)
        parts = self._main(station) if self._constant is None else [np.repeat(x, count, axis=0) for x in self._constant]
        inner, lanes, strip_edge, shoulder = parts
        if not self.turnouts:
            main = strip_edge + shoulder
            return EdgeDistances(inner, lanes, main, main, main, main)
        sums = _WidthSums(shoulder, shoulder.copy(), *np.zeros((4, count)))
        for turnout in self.turnouts:
            turnout.widen(station, sums)
        ramp_edge_base = strip_edge + sums.left + sums.wedge
        outer, has_gap, ramp_edge = ramp_edge_base + sums.added, sums.bare > 0.0, ramp_edge_base - sums.beside
        gap_low, gap_high = np.where(has_gap, ramp_edge - sums.bare, outer), np.where(has_gap, ramp_edge, outer)
        return EdgeDistances(inner, lanes, strip_edge + shoulder, outer, gap_low, gap_high)

    def inner(self, station: Float) -> Float:
        """Return the distance (N,), m, of the inner paved edge from the centreline at N stations."""
        return self._inner_offset(station)

    def between(self, start: float, end: float) -> Float:
        """Return the stations (K,), m: the begin, the marks between it and the end, and the end."""
        marks_between = self.marks[(self.marks > start) & (self.marks < end)]
        return np.concatenate(([start], marks_between, [end]))

    def distances(self, lower_offset: Offset, higher_offset: Offset) -> tuple[Offset, Offset]:
        """Return the smaller and the larger distance from the centreline of what lies between two offsets, all m."""
        return (lower_offset, higher_offset) if self.sign > 0 else (-higher_offset, -lower_offset)

    def _main(self, station: Float) -> list[Float]:
        """Return inner edge, lane boundaries, outer edge of the outer edge strip, and width of the hard shoulder, m."""
        inner = self._inner_offset(station)
        widths = [inner + self._inner_strip(station), *(width(station) for width in reversed(self.lane_widths))]
        lanes = np.array(list(accumulate(widths))).T[:, ::-1]
        return [inner, lanes, lanes[:, 0] + self._outer_strip(station), self._shoulder(station)]
