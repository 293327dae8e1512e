"""Horizontal and vertical alignment from a seed, within the RAA by construction: nothing is drawn and rejected.

Horizontally, arcs are joined by a straight with its two clothoids, by two clothoids of an S-curve, or by the one
clothoid of an egg curve. Parts are appended while the road is long enough for all of them at their least lengths; what
length is left is shared out among straights and arcs. Clothoids are never cut: the road begins and ends on a straight
or an arc.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..base.schema import round_value
from ..road.crossfall import run_off_length
from ..road.guidelines import LIMITS, LONGEST_STRAIGHT, DesignLimits
from ..road.parameters import HorizontalElement, VerticalPoint
from ..scenario.road import RoadScenario
from .section import bounds, cross_section_of

_Pair = tuple[float, float]
Lengths = tuple[list[float], list[float]]
"""Least and drawn lengths of the clothoids of a joint, m."""

WIDEST_RADIUS = 5000.0
"""Largest radius that is drawn where the scenario doesn't say otherwise, m."""
BALANCED_BELOW, BALANCE = 1500.0, 1.5
"""Consecutive radii differ by at most this ratio where the smaller is below this radius (m)."""
_BALANCED_FROM = BALANCED_BELOW * (1.0 + 1e-6)  # rounding the curvature must not take a radius below it
STRAIGHT_SAME_DIRECTION = 400.0
"""Least length of a straight between two curves of the same direction, m."""
_SHORTEST_STRAIGHT = 60.0
_SHORTEST_END = 20.0
_EGG_RATIO = 1.2
_WIDEST_RATIO = 3.0
_LONGEST_TURN = 0.9
"""Angle of an arc beyond which no length is given to it while others can take it, rad."""

HIGHEST_CLIMB = 120.0
"""Height above or below the road's begin from which it no longer climbs or falls, m."""


def _widest_radius(room: float) -> float:
    """Return the largest radius whose least clothoid, A = R/3, fits into a length ``room``, both m."""
    return 9.0 * room


@dataclass
class _AlignmentPart:
    """A horizontal element in the making, with the curvatures at its ends; straights and arcs can still grow."""

    length: float
    start: float
    end: float

    @property
    def grows(self) -> bool:
        return self.start == self.end


class HorizontalSampler:
    """Draws the horizontal alignment of a road: one chain of lines, arcs and clothoids."""

    def __init__(self, scenario: RoadScenario, rng: np.random.Generator) -> None:
        self.design_class, self.length, self.rng = scenario.design_class, scenario.length, rng
        self.limits: DesignLimits = LIMITS[scenario.design_class]
        self.radii = bounds(scenario.radius) if scenario.radius else (self.limits.radius, WIDEST_RADIUS)
        self.half_width = cross_section_of(scenario).paved_width / 2.0
        self.shortest_arc = 2.0 * self.limits.speed / 3.6
        self.parts: list[_AlignmentPart] = []
        self.room = 0.0
        self.turned = 0.0

    def draw(self) -> tuple[HorizontalElement, ...]:
        """Return the drawn elements, whose lengths add up to the scenario's length."""
        first = 0.0 if self._may_begin_straight() and self.rng.random() < 0.35 else self._turn() / self._radius(None)
        self.parts = [_AlignmentPart(min(_SHORTEST_END, self.length), first, first)]
        self.room = self.length - self.parts[0].length
        while joint := self._next_parts():
            self.parts += joint
            self.room -= math.fsum(part.length for part in joint)
            self.turned += math.fsum(part.length * (part.start + part.end) / 2 for part in joint)
        self._distribute_length()
        return self._elements()

    def _may_begin_straight(self) -> bool:
        """Return whether the road may begin straight: as it is all straight or a curve can follow."""
        return self.length <= LONGEST_STRAIGHT or _widest_radius(self.length - 3.0 * _SHORTEST_END) > self.radii[0]

    def _next_parts(self) -> list[_AlignmentPart]:
        """Return the next parts, clothoids and a straight or arc of an end's least length; none without room.

        What was the end has a neighbour then: it gets what it lacks to its full least length. Nothing follows where the
        road has no room for it.
        """
        last = self.parts[-1]
        if last.start == 0.0:
            return self._arc_after_straight(last)
        lacking = max(0.0, self.shortest_arc - last.length) if len(self.parts) > 1 else 0.0
        grown = _AlignmentPart(lacking, last.start, last.start)
        room = self.room - lacking - _SHORTEST_END
        chance = self.rng.random()
        drawn = "straight" if chance < 0.25 else "egg" if chance < 0.5 else "s"
        for kind in dict.fromkeys((drawn, "s", "egg", "straight")):
            if kind == "straight":
                joint = self._clothoids([(last.start, 0.0)], self._transition(last.start, 0.0), room)
            else:
                joint = self._arc_after_arc(kind, last.start, room)
            if joint:
                end = joint[-1].end
                return [grown, *joint, _AlignmentPart(_SHORTEST_END, end, end)]
        return []

    def _arc_after_straight(self, last: _AlignmentPart) -> list[_AlignmentPart]:
        before = next((part.start for part in reversed(self.parts[:-1]) if part.start), 0.0)
        sign = self._turn()
        least = (STRAIGHT_SAME_DIRECTION if before * sign > 0.0 else _SHORTEST_STRAIGHT) if before else 0.0
        lacking = max(0.0, least - last.length)
        room = self.room - lacking - _SHORTEST_END
        if not (radius := self._radius(1.0 / abs(before) if before else None, room)):
            return []
        curvature = sign / radius
        joint = self._clothoids([(0.0, curvature)], self._transition(0.0, curvature), room)
        end = _AlignmentPart(_SHORTEST_END, curvature, curvature)
        return [_AlignmentPart(lacking, 0.0, 0.0), *joint, end] if joint else []

    def _arc_after_arc(self, kind: str, start: float, room: float) -> list[_AlignmentPart]:
        """Return the clothoids of an S-curve ("s") or egg curve ("egg") after a curvature; none without room."""
        least = self._least_length(start, 0.0) if kind == "s" else 0.0
        if not (radius := self._radius(1.0 / abs(start), room - least)):
            return []
        if kind == "s":
            end = -math.copysign(1.0 / radius, start)
            return self._clothoids([(start, 0.0), (0.0, end)], self._s_curve(start, end), room)
        end = math.copysign(1.0 / radius, start)
        alike = max(start / end, end / start) < _EGG_RATIO
        return [] if alike else self._clothoids([(start, end)], self._egg(start, end), room)

    def _clothoids(self, curvatures: list[_Pair], lengths: Lengths, room: float) -> list[_AlignmentPart]:
        """Return clothoids with lengths between the least and the drawn ones, as the room (m) allows; else none.

        Every rule for lengths is linear in them, so that what lies between two sets that keep it keeps it as well.
        """
        least, drawn = lengths
        spare, asked = room - math.fsum(least), math.fsum(drawn) - math.fsum(least)
        if spare < 0.0:
            return []
        share = min(1.0, spare / asked) if asked > 0.0 else 0.0
        fitting = [a + (b - a) * share for a, b in zip(least, drawn, strict=True)]
        return [_AlignmentPart(length, *pair) for length, pair in zip(fitting, curvatures, strict=True)]

    def _turn(self) -> float:
        """Return 1 (left) or -1 at random; the farther the road has turned, the likelier back again."""
        left = 0.5 - min(0.45, max(-0.45, 0.4 * self.turned))
        return 1.0 if self.rng.random() < left else -1.0

    def _radius(self, before: float | None, room: float = math.inf) -> float:
        """Draw a radius (m) balanced with the one before and whose clothoid has room; 0 where there is none.

        It is even in the logarithm, as small radii matter more.
        """
        low, high = self.radii
        if before is not None:
            # Beyond this no pair of clothoids has R/3 <= A <= R on both sides and parameters within 1.5 of each other.
            low, high = max(low, before / _WIDEST_RATIO), min(high, before * _WIDEST_RATIO)
        if before is not None and self.design_class != "EKA3":
            low = max(low, before / BALANCE if before < BALANCED_BELOW else min(_BALANCED_FROM, before / BALANCE))
            high = min(high, before * BALANCE) if before < BALANCED_BELOW else high
        if room < math.inf:
            low, high = max(low, self.limits.clothoid**2 / max(room, 1.0)), min(high, _widest_radius(room))
        if low > high:
            return 0.0
        return round_value(math.exp(self.rng.uniform(math.log(low), math.log(high))), 6)

    def _least_length(self, start: float, end: float) -> float:
        """Return the least length (m) of a clothoid from a straight to an arc: A >= R/3, and the run-off's."""
        radius = 1.0 / max(abs(start), abs(end))
        return max(max(self.limits.clothoid, radius / 3.0) ** 2 / radius, self._run_off(start, end))

    def _transition(self, start: float, end: float, crossing: float = 0.0) -> Lengths:
        """Return the least length and a drawn one, m, of a clothoid between a straight and an arc; A <= R."""
        radius = 1.0 / max(abs(start), abs(end))
        least = max(crossing, self._least_length(start, end))
        return [least], [self.rng.uniform(least, max(least, min(radius, 2.0 * least)))]

    def _s_curve(self, start: float, end: float) -> Lengths:
        """Return least and drawn lengths (m) of an S-curve's two clothoids, of parameters within 1.5 of each other."""
        crossing = self._run_off(start, end) / 2.0
        first, second = self._transition(start, 0.0, crossing), self._transition(0.0, end, crossing)
        least, drawn = (self._limit_ratio(a + b, start, end) for a, b in zip(first, second, strict=True))
        return least, drawn

    @staticmethod
    def _limit_ratio(lengths: list[float], start: float, end: float) -> list[float]:
        """Return an S-curve's clothoid lengths, that of the smaller parameter A raised to what the ratio allows."""
        a = [length / abs(k) for length, k in zip(lengths, (start, end), strict=True)]
        least = max(a) / 1.5**2
        return [max(square, least) * abs(k) for square, k in zip(a, (start, end), strict=True)]

    def _egg(self, start: float, end: float) -> Lengths:
        """Return least and drawn length (m) of an egg's clothoid: A from a third of the wider to the tighter radius.

        Short ones are left out: they would hardly turn.
        """
        change = abs(end - start)
        small, large = 1.0 / max(abs(start), abs(end)), 1.0 / min(abs(start), abs(end))
        least = max(self.limits.clothoid, large / 3.0, math.sqrt(self._run_off(start, end) / change), 0.6 * small)
        return [least**2 * change], [self.rng.uniform(least, max(least, small)) ** 2 * change]

    def _run_off(self, start: float, end: float) -> float:
        return run_off_length(self.design_class, self.half_width, start, end)

    def _distribute_length(self) -> None:
        """Lengthen straights and arcs, in place, to the road's length, within the longest straight and turn."""
        self.parts = _merge_parts(self.parts)
        spare = self.length - math.fsum(part.length for part in self.parts)
        growing = [part for part in self.parts if part.grows]
        room = np.array([self._room(part) for part in growing])
        weights = self.rng.uniform(0.2, 1.0, len(growing)) * np.minimum(room, spare + 1e-9)
        given = np.minimum(room, spare * weights / max(weights.sum(), 1e-12))
        for _ in range(len(growing)):
            left = spare - given.sum()
            if left <= 1e-9:
                break
            open_ = np.flatnonzero(room - given > 1e-9)
            if not len(open_):
                arcs = np.array([i for i, part in enumerate(growing) if part.start], dtype=int)
                given[arcs] += left / len(arcs)
                break
            given[open_] += np.minimum(room[open_] - given[open_], left / len(open_))
        for part, extra in zip(growing, given, strict=True):
            part.length += float(extra)

    def _room(self, part: _AlignmentPart) -> float:
        longest = LONGEST_STRAIGHT if part.start == 0.0 else max(_LONGEST_TURN / abs(part.start), self.shortest_arc)
        return max(0.0, longest - part.length)

    def _elements(self) -> tuple[HorizontalElement, ...]:
        """Return the parts as elements, rounded; the last length takes what rounding leaves."""
        parts = [part for part in self.parts if part.length > 1e-6]
        lengths = [round_value(part.length) for part in parts[:-1]]
        lengths.append(round_value(self.length - math.fsum(lengths)))
        curvatures = [(round_value(part.start, 12), round_value(part.end, 12)) for part in parts]
        return tuple(HorizontalElement.between(n, *k) for n, k in zip(lengths, curvatures, strict=True))


def _merge_parts(parts: list[_AlignmentPart]) -> list[_AlignmentPart]:
    """Return parts with neighbouring straights or arcs of one curvature joined."""
    result: list[_AlignmentPart] = []
    for part in parts:
        if result and part.grows and result[-1].grows and result[-1].start == part.start:
            result[-1].length += part.length
        else:
            result.append(part)
    return result


def sample_profile(scenario: RoadScenario, rng: np.random.Generator) -> tuple[VerticalPoint, ...]:
    """Return drawn points of vertical intersection, 300 to 900 m apart; elevation 0 at the road's middle.

    Each rounding has half of the shorter of its two tangents; a grade changes by no more than the least radius allows
    within it. Long roads turn back to the height they came from.
    """
    limits = LIMITS[scenario.design_class]
    steepest = limits.grade_percent
    lowest, highest = bounds(scenario.grade_percent) if scenario.grade_percent else (-steepest, steepest)
    stations = _intersection_stations(scenario.length, rng)
    grades = [round_value(rng.uniform(lowest, highest))]
    radii: list[float] = []
    climbed = 0.0
    for before, here, after in zip(stations[:-2], stations[1:-1], stations[2:], strict=True):
        # The first and last span have no rounding at the road's end: they can give their whole length.
        span_before = (here - before) / (1 if before == stations[0] else 2)
        tangent = min(span_before, (after - here) / (1 if after == stations[-1] else 2))
        climbed += grades[-1] / 100.0 * (here - before)
        low = max(lowest, grades[-1] - 200.0 * tangent / limits.crest)
        high = min(highest, grades[-1] + 200.0 * tangent / limits.sag)
        if climbed > HIGHEST_CLIMB:
            high = max(low, min(high, 0.0))
        elif climbed < -HIGHEST_CLIMB:
            low = min(high, max(low, 0.0))
        grades.append(round_value(rng.uniform(low, high)))
        change = abs(grades[-1] - grades[-2]) / 100.0
        least = limits.crest if grades[-1] < grades[-2] else limits.sag
        largest = max(least, min(2.0 * tangent / max(change, 1e-9), 5.0 * least))
        radii.append(round_value(rng.uniform(least, largest)) if change > 0 else 0.0)
    elevations = np.concatenate([[0.0], np.cumsum(np.diff(stations) * np.array(grades) / 100.0)])
    elevations -= np.interp(scenario.length / 2.0, stations, elevations)
    rows = zip(stations, elevations, [0.0, *radii, 0.0], strict=True)
    return tuple(VerticalPoint(station=station, elevation=round_value(z), radius=radius) for station, z, radius in rows)


def _intersection_stations(length: float, rng: np.random.Generator) -> list[float]:
    """Return drawn stations (m) of the points of vertical intersection, the road's ends included."""
    spans = max(2, round(length / rng.uniform(300.0, 900.0)))
    shares = rng.uniform(0.7, 1.3, spans)
    stations = np.concatenate([[0.0], np.cumsum(shares) / shares.sum()]) * length
    return [round_value(station) for station in stations[:-1]] + [round_value(length)]
