"""Horizontal and vertical alignment from a seed, within the RAA by construction: nothing is drawn and rejected.

Horizontally, arcs are joined by a straight with its two clothoids, by two clothoids of an S-curve, or by the one
clothoid of an egg curve. Parts are appended while the road is long enough for all of them at their least lengths; what
length is left is shared out among straights and arcs. Clothoids are never cut: the road begins and ends on a straight
or an arc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scenario import Interval, RoadScenario
from ..schema import rounded
from .crossfall import run_off_length
from .limits import LIMITS, LONGEST_STRAIGHT, STANDARD_CROSS_SECTIONS, DesignLimits
from .model import HorizontalElement, VerticalPoint

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


@dataclass
class _Part:
    """An element in the making; straights and arcs can still grow."""

    length: float
    start: float
    end: float

    @property
    def grows(self) -> bool:
        return self.start == self.end


class HorizontalSampler:
    """Draws one chain of elements."""

    def __init__(self, scenario: RoadScenario, rng: np.random.Generator) -> None:
        self.scenario, self.rng = scenario, rng
        self.limits: DesignLimits = LIMITS[scenario.design_class]
        self.radii = radius_limits(scenario)
        self.shortest_arc = 2.0 * self.limits.speed / 3.6
        self.parts: list[_Part] = []
        self.turned = 0.0

    def draw(self) -> tuple[HorizontalElement, ...]:
        """Return elements whose lengths add up to the scenario's length."""
        first = 0.0 if self.rng.random() < 0.35 else self._sign() / self._radius(None)
        self.parts = [_Part(min(_SHORTEST_END, self.scenario.length), first, first)]
        while (joint := self._joint()) and self._length(joint) + self._length(self.parts) <= self.scenario.length:
            # What was the end has a neighbour now: it gets its full least length.
            self.parts += joint
            self.turned += sum(part.length * (part.start + part.end) / 2 for part in joint)
        self._share_out()
        return self._elements()

    def _joint(self) -> list[_Part]:
        """Return what could follow: clothoids and the next straight or arc, the last at an end's least length."""
        last = self.parts[-1]
        if last.start == 0.0:
            return self._arc_after_straight(last)
        kind = self.rng.choice(["straight", "s", "egg"], p=[0.25, 0.5, 0.25])
        if kind == "straight":
            return [self._grown(last), self._clothoid(last.start, 0.0), _Part(_SHORTEST_END, 0.0, 0.0)]
        radius = self._radius(1.0 / abs(last.start))
        small, large = sorted((radius, 1.0 / abs(last.start)))
        if kind == "egg" and large / small >= _EGG_RATIO:
            curvature = math.copysign(1.0 / radius, last.start)
            return [self._grown(last), self._egg(last.start, curvature), _Part(_SHORTEST_END, curvature, curvature)]
        curvature = -math.copysign(1.0 / radius, last.start)
        a, b = self._s_curve(last.start, curvature)
        return [self._grown(last), a, b, _Part(_SHORTEST_END, curvature, curvature)]

    def _grown(self, last: _Part) -> _Part:
        """Return what an arc lacks to its least length now that it isn't the road's end any more."""
        lacking = max(0.0, self.shortest_arc - last.length) if len(self.parts) > 1 else 0.0
        return _Part(lacking, last.start, last.end)

    def _arc_after_straight(self, last: _Part) -> list[_Part]:
        before = next((part.start for part in reversed(self.parts[:-1]) if part.start), 0.0)
        radius = self._radius(1.0 / abs(before) if before else None)
        curvature = self._sign() / radius
        same = before * curvature > 0
        least = (STRAIGHT_SAME_DIRECTION if same else _SHORTEST_STRAIGHT) if before else 0.0
        lacking = _Part(max(0.0, least - last.length), 0.0, 0.0)
        return [lacking, self._clothoid(0.0, curvature), _Part(_SHORTEST_END, curvature, curvature)]

    def _sign(self) -> float:
        """Return a direction to turn to; the farther the road has turned, the likelier back again."""
        left = 0.5 - np.clip(0.4 * self.turned, -0.45, 0.45)
        return 1.0 if self.rng.random() < left else -1.0

    def _radius(self, before: float | None) -> float:
        """Draw a radius that is balanced with the one before; even in the logarithm, as small ones matter more."""
        low, high = self.radii.minimum, self.radii.maximum
        if before is not None:
            # Beyond this no pair of clothoids has R/3 <= A <= R on both sides and parameters within 1.5 of each other.
            low, high = max(low, before / _WIDEST_RATIO), min(high, before * _WIDEST_RATIO)
        if before is not None and self.scenario.design_class != "EKA3":
            low = max(low, before / BALANCE if before < BALANCED_BELOW else min(_BALANCED_FROM, before / BALANCE))
            high = min(high, before * BALANCE) if before < BALANCED_BELOW else high
        # Wide curves need long clothoids (R/9 and more): on what is left of the road only narrower ones have room.
        room = self.scenario.length - self._length(self.parts)
        high = min(high, 2.0 * room)
        return rounded(math.exp(self.rng.uniform(math.log(low), math.log(max(low, high)))), 6)

    def _clothoid(self, start: float, end: float) -> _Part:
        """Return the transition between a straight and an arc."""
        return _Part(self._transition(max(abs(start), abs(end)), start, end), start, end)

    def _transition(self, curvature: float, start: float, end: float) -> float:
        """Draw the length A^2 / R of a clothoid with R/3 <= A <= R that leaves room for the crossfall's run-off."""
        radius = 1.0 / curvature
        least = max(max(self.limits.clothoid, radius / 3.0) ** 2 / radius, self._run_off(start, end))
        return self.rng.uniform(least, max(least, min(radius, 2.0 * least)))

    def _s_curve(self, start: float, end: float) -> tuple[_Part, _Part]:
        """Return two clothoids back to back, whose parameters differ by at most 1.5."""
        lengths = [self._transition(abs(k), *pair) for k, pair in ((start, (start, 0.0)), (end, (0.0, end)))]
        lengths = [max(length, self._run_off(start, end) / 2.0) for length in lengths]
        a = [math.sqrt(length / abs(k)) for length, k in zip(lengths, (start, end), strict=True)]
        short = int(a[0] > a[1])
        a[short] = max(a[short], max(a) / 1.5)
        return _Part(a[0] ** 2 * abs(start), start, 0.0), _Part(a[1] ** 2 * abs(end), 0.0, end)

    def _egg(self, start: float, end: float) -> _Part:
        """Return the clothoid of an egg curve: A between a third of the wider and the whole of the tighter radius."""
        change = abs(end - start)
        small, large = 1.0 / max(abs(start), abs(end)), 1.0 / min(abs(start), abs(end))
        least = max(self.limits.clothoid, large / 3.0, math.sqrt(self._run_off(start, end) / change), 0.6 * small)
        return _Part(self.rng.uniform(least, max(least, small)) ** 2 * change, start, end)

    def _run_off(self, start: float, end: float) -> float:
        section = STANDARD_CROSS_SECTIONS[self.scenario.cross_section]
        return run_off_length(self.scenario.design_class, section.paved_width / 2.0, start, end)

    @staticmethod
    def _length(parts: list[_Part]) -> float:
        return sum(part.length for part in parts)

    def _share_out(self) -> None:
        """Give the length that is left to straights and arcs, within the longest straight and turn."""
        self.parts = _merged(self.parts)
        spare = self.scenario.length - self._length(self.parts)
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
                open_ = np.array([i for i, part in enumerate(growing) if part.start], dtype=int)
                if not len(open_):
                    allowed = f"{LONGEST_STRAIGHT:.0f} m is the longest straight, and radii leave no room for a curve"
                    raise InputError("road.length", self.scenario.length, allowed)
                given[open_] += left / len(open_)
                break
            given[open_] += np.minimum(room[open_] - given[open_], left / len(open_))
        for part, extra in zip(growing, given, strict=True):
            part.length += float(extra)

    def _room(self, part: _Part) -> float:
        longest = LONGEST_STRAIGHT if part.start == 0.0 else max(_LONGEST_TURN / abs(part.start), self.shortest_arc)
        return max(0.0, longest - part.length)

    def _elements(self) -> tuple[HorizontalElement, ...]:
        """Round lengths and curvatures; the last length takes what rounding leaves."""
        parts = [part for part in self.parts if part.length > 1e-6]
        lengths = [rounded(part.length) for part in parts[:-1]]
        lengths.append(rounded(self.scenario.length - sum(lengths)))
        curvatures = [(rounded(part.start, 12), rounded(part.end, 12)) for part in parts]
        return tuple(HorizontalElement.between(n, *k) for n, k in zip(lengths, curvatures, strict=True))


def radius_limits(scenario: RoadScenario) -> Interval:
    """Return the radii that may be drawn; raise `InputError` where the scenario asks for less than its class allows."""
    least = LIMITS[scenario.design_class].radius
    if scenario.radius is None:
        return Interval(minimum=least, maximum=max(WIDEST_RADIUS, least))
    if scenario.radius.minimum < least:
        raise InputError(
            "road.radius.minimum", scenario.radius.minimum, f"{scenario.design_class} allows {least} m and more"
        )
    return scenario.radius


def _merged(parts: list[_Part]) -> list[_Part]:
    """Return parts with neighbours of one constant curvature joined."""
    result: list[_Part] = []
    for part in parts:
        if result and part.grows and result[-1].grows and result[-1].start == part.start:
            result[-1].length += part.length
        else:
            result.append(part)
    return result


def sample_profile(scenario: RoadScenario, rng: np.random.Generator) -> tuple[VerticalPoint, ...]:
    """Draw grades and roundings: a point of intersection every 300 to 900 m, elevation 0 at the road's middle.

    Each rounding has half of the shorter of its two tangents; a grade changes by no more than the least radius allows
    within it.
    """
    limits = LIMITS[scenario.design_class]
    grades_allowed = grade_limits(scenario)
    stations = _intersections(scenario.length, rng)
    grades = [rounded(rng.uniform(grades_allowed.minimum, grades_allowed.maximum))]
    radii = []
    for before, here, after in zip(stations[:-2], stations[1:-1], stations[2:], strict=True):
        # The first and last span have no rounding at the road's end: they can give their whole length.
        spans = [
            (here - before) / (1 if before == stations[0] else 2),
            (after - here) / (1 if after == stations[-1] else 2),
        ]
        tangent = min(spans)
        low = max(grades_allowed.minimum, grades[-1] - 200.0 * tangent / limits.crest)
        high = min(grades_allowed.maximum, grades[-1] + 200.0 * tangent / limits.sag)
        grades.append(rounded(rng.uniform(low, high)))
        change = abs(grades[-1] - grades[-2]) / 100.0
        least = limits.crest if grades[-1] < grades[-2] else limits.sag
        largest = max(least, min(2.0 * tangent / max(change, 1e-9), 5.0 * least))
        radii.append(rounded(rng.uniform(least, largest)) if change > 0 else 0.0)
    elevations = np.concatenate([[0.0], np.cumsum(np.diff(stations) * np.array(grades) / 100.0)])
    elevations -= np.interp(scenario.length / 2.0, stations, elevations)
    radii = [0.0, *radii, 0.0]
    return tuple(
        VerticalPoint(station=station, elevation=rounded(z), radius=radius)
        for station, z, radius in zip(stations, elevations, radii, strict=True)
    )


def grade_limits(scenario: RoadScenario) -> Interval:
    """Return the grades (%) that may be drawn; raise `InputError` where the scenario exceeds those of its class."""
    steepest = LIMITS[scenario.design_class].grade_percent
    if scenario.grade_percent is None:
        return Interval(minimum=-steepest, maximum=steepest)
    asked = max(abs(scenario.grade_percent.minimum), abs(scenario.grade_percent.maximum))
    if asked > steepest:
        raise InputError("road.grade_percent", asked, f"{scenario.design_class} allows {steepest} %")
    return scenario.grade_percent


def _intersections(length: float, rng: np.random.Generator) -> list[float]:
    """Return stations of the points of intersection, the road's ends included."""
    spans = max(2, round(length / rng.uniform(300.0, 900.0)))
    shares = rng.uniform(0.7, 1.3, spans)
    stations = np.concatenate([[0.0], np.cumsum(shares) / shares.sum()]) * length
    return [rounded(station) for station in stations[:-1]] + [rounded(length)]
