"""Horizontal and vertical alignment from a seed, within the guideline by construction: nothing is drawn and rejected.

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
from ..road.guidelines import LIMITS, DesignLimits
from ..road.other_roads.axis import HorizontalElement, VerticalPoint
from ..scenario.road import RoadScenario
from .section import bounds, lever_of

_Pair = tuple[float, float]
Lengths = tuple[list[float], list[float]]
"""Least and drawn lengths of the clothoids of a joint, m."""

BALANCED_BELOW = 1500.0
"""Consecutive radii differ by at most the class's ratio where the smaller is below this radius (m)."""
_BALANCED_FROM = BALANCED_BELOW * (1.0 + 1e-6)  # rounding the curvature must not take a radius below it
_SHORTEST_STRAIGHT = 60.0
_SHORTEST_END = 20.0
_EGG_RATIO = 1.2
_WIDEST_RATIO = 3.0
_LONGEST_TURN = 0.9
"""Angle of an arc beyond which no length is given to it while others can take it, rad."""

_MARGIN = 1.0 + 1e-6  # rounding the radius must not take a tangent below the shortest
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
        """Return whether the part is a straight or an arc, not a clothoid."""
        return self.start == self.end


class HorizontalSampler:
    """Draws the horizontal alignment of a road: one chain of lines, arcs and clothoids."""

    def __init__(self, scenario: RoadScenario, rng: np.random.Generator) -> None:
        self.design_class, self.length, self.rng = scenario.design_class, scenario.length, rng
        self.limits: DesignLimits = LIMITS[scenario.design_class]
        self.radii = (
            bounds(scenario.radius)
            if scenario.radius
            else (self.limits.drawn_radius_least, self.limits.drawn_radius_largest)
        )
        self.half_width = lever_of(scenario)
        self.shortest_arc = self.limits.shortest_arc
        self.parts: list[_AlignmentPart] = []
        self.room = 0.0
        self.turned = 0.0

    def draw(self) -> tuple[HorizontalElement, ...]:
        """Return the drawn elements, whose lengths add up to the scenario's length."""
        first_curvature = (
            0.0 if self._may_begin_straight() and self.rng.random() < 0.35 else self._turn() / self._radius(None)
        )
        self.parts = [_AlignmentPart(min(_SHORTEST_END, self.length), first_curvature, first_curvature)]
        self.room = self.length - self.parts[0].length
        while joint := self._next_parts():
            self.parts += joint
            self.room -= math.fsum(part.length for part in joint)
            self.turned += math.fsum(part.length * (part.start + part.end) / 2 for part in joint)
        self._distribute_length()
        return self._elements()

    def _may_begin_straight(self) -> bool:
        """Return whether the road may begin straight: as it is all straight or a curve can follow."""
        return (
            self.length <= self.limits.straight_longest
            or _widest_radius(self.length - 3.0 * _SHORTEST_END) > self.radii[0]
        )

    def _next_parts(self) -> list[_AlignmentPart]:
        """Return the next parts, clothoids and a straight or arc of an end's least length; none without room.

        What was the end has a neighbour then: it gets what it lacks to its full least length. Nothing follows where the
        road has no room for it.
        """
        last_part = self.parts[-1]
        if last_part.start == 0.0:
            return self._arc_after_straight(last_part)
        missing_length = max(0.0, self.shortest_arc - last_part.length) if len(self.parts) > 1 else 0.0
        lengthening = _AlignmentPart(missing_length, last_part.start, last_part.start)
        room = self.room - missing_length - _SHORTEST_END
        chance = self.rng.random()
        drawn_kind = "straight" if chance < 0.25 else "egg" if chance < 0.5 else "s"
        for kind in dict.fromkeys((drawn_kind, "s", "egg", "straight")):
            if kind == "straight":
                joint = self._clothoids([(last_part.start, 0.0)], self._transition(last_part.start, 0.0), room)
            else:
                joint = self._arc_after_arc(kind, last_part.start, room)
            if joint:
                end = joint[-1].end
                return [lengthening, *joint, _AlignmentPart(_SHORTEST_END, end, end)]
        return []

    def _arc_after_straight(self, straight: _AlignmentPart) -> list[_AlignmentPart]:
        """Return what makes a straight long enough, a clothoid, and the begin of an arc; none without room."""
        curvature_before = next((part.start for part in reversed(self.parts[:-1]) if part.start), 0.0)
        sign = self._turn()
        least_straight = self._least_straight(curvature_before, sign)
        missing_length = max(0.0, least_straight - straight.length)
        room = self.room - missing_length - _SHORTEST_END
        if not (radius := self._radius(1.0 / abs(curvature_before) if curvature_before else None, room)):
            return []
        curvature = sign / radius
        joint = self._clothoids([(0.0, curvature)], self._transition(0.0, curvature), room)
        end = _AlignmentPart(_SHORTEST_END, curvature, curvature)
        return [_AlignmentPart(missing_length, 0.0, 0.0), *joint, end] if joint else []

    def _arc_after_arc(self, kind: str, start: float, room: float) -> list[_AlignmentPart]:
        """Return the clothoids of an S-curve ("s") or egg curve ("egg") after a curvature; none without room."""
        least_length = self._least_length(start, 0.0) if kind == "s" else 0.0
        if not (radius := self._radius(1.0 / abs(start), room - least_length)):
            return []
        if kind == "s":
            end = -math.copysign(1.0 / radius, start)
            return self._clothoids([(start, 0.0), (0.0, end)], self._s_curve(start, end), room)
        end = math.copysign(1.0 / radius, start)
        is_alike = max(start / end, end / start) < _EGG_RATIO
        return [] if is_alike else self._clothoids([(start, end)], self._egg(start, end), room)

    def _least_straight(self, curvature_before: float, sign: float) -> float:
        """Return the least length (m) of a straight between a curvature (1/m) and a curve to a side, 1 left, -1 right.

        The smaller radius isn't known yet: that before the straight is no smaller.
        """
        if not curvature_before:
            return 0.0
        if curvature_before * sign <= 0.0:
            return _SHORTEST_STRAIGHT
        return max(_SHORTEST_STRAIGHT, self.limits.straight_between(1.0 / abs(curvature_before)))

    def _clothoids(self, curvatures: list[_Pair], lengths: Lengths, room: float) -> list[_AlignmentPart]:
        """Return clothoids with lengths between the least and the drawn ones, as the room (m) allows; else none.

        Every rule for lengths is linear in them, so that what lies between two sets that keep it keeps it as well.
        """
        least_lengths, drawn_lengths = lengths
        spare_room, wish = room - math.fsum(least_lengths), math.fsum(drawn_lengths) - math.fsum(least_lengths)
        if spare_room < 0.0:
            return []
        share = min(1.0, spare_room / wish) if wish > 0.0 else 0.0
        fitted_lengths = [a + (b - a) * share for a, b in zip(least_lengths, drawn_lengths, strict=True)]
        return [_AlignmentPart(length, *pair) for length, pair in zip(fitted_lengths, curvatures, strict=True)]

    def _turn(self) -> float:
        """Return 1 (left) or -1 at random; the farther the road has turned, the likelier back again."""
        left_probability = 0.5 - min(0.45, max(-0.45, 0.4 * self.turned))
        return 1.0 if self.rng.random() < left_probability else -1.0

    def _radius(self, radius_before: float | None, room: float = math.inf) -> float:
        """Draw a radius (m) balanced with the one before and whose clothoid has room; 0 where there is none.

        It is even in the logarithm, as small radii matter more.
        """
        smallest, largest = self.radii
        if radius_before is not None:
            # Beyond this no pair of clothoids has R/3 <= A <= R on both sides and parameters within 1.5 of each other.
            smallest, largest = (
                max(smallest, radius_before / _WIDEST_RATIO),
                min(largest, radius_before * _WIDEST_RATIO),
            )
        if radius_before is not None and self.limits.radius_ratio < math.inf:
            smallest = max(
                smallest,
                radius_before / self.limits.radius_ratio
                if radius_before < BALANCED_BELOW
                else min(_BALANCED_FROM, radius_before / self.limits.radius_ratio),
            )
            largest = (
                min(largest, radius_before * self.limits.radius_ratio) if radius_before < BALANCED_BELOW else largest
            )
        if room < math.inf:
            smallest, largest = (
                max(smallest, self.limits.clothoid**2 / max(room, 1.0)),
                min(largest, _widest_radius(room)),
            )
        if smallest > largest:
            return 0.0
        return round_value(math.exp(self.rng.uniform(math.log(smallest), math.log(largest))), 6)

    def _least_length(self, start: float, end: float) -> float:
        """Return the least length (m) of a clothoid from a straight to an arc: A >= R/3, and the run-off's."""
        radius = 1.0 / max(abs(start), abs(end))
        return max(max(self.limits.clothoid, radius / 3.0) ** 2 / radius, self._run_off(start, end))

    def _transition(self, start: float, end: float, crossing_run_off: float = 0.0) -> Lengths:
        """Return the least length and a drawn one, m, of a clothoid between a straight and an arc; A <= R."""
        radius = 1.0 / max(abs(start), abs(end))
        least_length = max(crossing_run_off, self._least_length(start, end))
        return [least_length], [self.rng.uniform(least_length, max(least_length, min(radius, 2.0 * least_length)))]

    def _s_curve(self, start: float, end: float) -> Lengths:
        """Return least and drawn lengths (m) of an S-curve's two clothoids, of parameters within 1.5 of each other."""
        crossing = self._run_off(start, end) / 2.0
        first_clothoid, second_clothoid = self._transition(start, 0.0, crossing), self._transition(0.0, end, crossing)
        least_lengths, drawn_lengths = (
            self._limit_ratio(a + b, start, end) for a, b in zip(first_clothoid, second_clothoid, strict=True)
        )
        return least_lengths, drawn_lengths

    @staticmethod
    def _limit_ratio(lengths: list[float], start: float, end: float) -> list[float]:
        """Return an S-curve's clothoid lengths, that of the smaller parameter A raised to what the ratio allows.

        A clothoid from a straight to the curvature k has A^2 = length / |k|; the larger A is at most 1.5 times the
        other.
        """
        squared_parameters = [length / abs(k) for length, k in zip(lengths, (start, end), strict=True)]
        least_square = max(squared_parameters) / 1.5**2
        return [max(square, least_square) * abs(k) for square, k in zip(squared_parameters, (start, end), strict=True)]

    def _egg(self, start: float, end: float) -> Lengths:
        """Return least and drawn length (m) of an egg's clothoid: A from a third of the wider to the tighter radius.

        Short ones are left out: they would hardly turn.
        """
        curvature_change = abs(end - start)
        small_radius, large_radius = 1.0 / max(abs(start), abs(end)), 1.0 / min(abs(start), abs(end))
        least_parameter = max(
            self.limits.clothoid,
            large_radius / 3.0,
            math.sqrt(self._run_off(start, end) / curvature_change),
            0.6 * small_radius,
        )
        return [least_parameter**2 * curvature_change], [
            self.rng.uniform(least_parameter, max(least_parameter, small_radius)) ** 2 * curvature_change
        ]

    def _run_off(self, start: float, end: float) -> float:
        """Return the least length (m) in which the crossfall can change between two curvatures (1/m)."""
        return run_off_length(self.design_class, self.half_width, start, end)

    def _distribute_length(self) -> None:
        """Lengthen straights and arcs, in place, to the road's length, within the longest straight and turn."""
        self.parts = _merge_parts(self.parts)
        spare_length = self.length - math.fsum(part.length for part in self.parts)
        growing_parts = [part for part in self.parts if part.grows]
        room = np.array([self._room(part) for part in growing_parts])
        # The spare length is first given by random weights, then evenly to the parts that still have room; what none of
        # them can take makes the arcs longer than their longest turn.
        weights = self.rng.uniform(0.2, 1.0, len(growing_parts)) * np.minimum(room, spare_length + 1e-9)
        extra_lengths = np.minimum(room, spare_length * weights / max(weights.sum(), 1e-12))
        for _ in range(len(growing_parts)):
            rest = spare_length - extra_lengths.sum()
            if rest <= 1e-9:
                break
            open_parts = np.flatnonzero(room - extra_lengths > 1e-9)
            if not len(open_parts):
                arcs = np.array([i for i, part in enumerate(growing_parts) if part.start], dtype=int)
                extra_lengths[arcs] += rest / len(arcs)
                break
            extra_lengths[open_parts] += np.minimum(
                room[open_parts] - extra_lengths[open_parts], rest / len(open_parts)
            )
        for part, extra_length in zip(growing_parts, extra_lengths, strict=True):
            part.length += float(extra_length)

    def _room(self, part: _AlignmentPart) -> float:
        """Return by how much (m) a straight or arc may still be lengthened."""
        longest_length = (
            self.limits.straight_longest
            if part.start == 0.0
            else max(_LONGEST_TURN / abs(part.start), self.shortest_arc)
        )
        return max(0.0, longest_length - part.length)

    def _elements(self) -> tuple[HorizontalElement, ...]:
        """Return the parts as elements, rounded; the last length takes what rounding leaves."""
        parts = [part for part in self.parts if part.length > 1e-6]
        lengths = [round_value(part.length) for part in parts[:-1]]
        lengths.append(round_value(self.length - math.fsum(lengths)))
        curvatures = [(round_value(part.start, 12), round_value(part.end, 12)) for part in parts]
        return tuple(HorizontalElement.between(n, *k) for n, k in zip(lengths, curvatures, strict=True))


def _merge_parts(parts: list[_AlignmentPart]) -> list[_AlignmentPart]:
    """Return parts with neighbouring straights or arcs of one curvature joined."""
    merged_parts: list[_AlignmentPart] = []
    for part in parts:
        if merged_parts and part.grows and merged_parts[-1].grows and merged_parts[-1].start == part.start:
            merged_parts[-1].length += part.length
        else:
            merged_parts.append(part)
    return merged_parts


def sample_profile(scenario: RoadScenario, rng: np.random.Generator) -> tuple[VerticalPoint, ...]:
    """Return drawn points of vertical intersection, 300 to 900 m apart; elevation 0 at the road's middle.

    Each rounding has half of the shorter of its two tangents; a grade changes by no more than the least radius allows
    within it, and not at all where the tangents would be too short. Long roads turn back to the height they came from.
    """
    limits = LIMITS[scenario.design_class]
    steepest_grade = limits.grade_percent
    lowest_grade, highest_grade = (
        bounds(scenario.grade_percent) if scenario.grade_percent else (-steepest_grade, steepest_grade)
    )
    stations = _intersection_stations(scenario.length, rng)
    grades = [round_value(rng.uniform(lowest_grade, highest_grade))]
    radii: list[float] = []
    climb = 0.0
    for station_before, station_of_point, station_after in zip(
        stations[:-2], stations[1:-1], stations[2:], strict=True
    ):
        # The first and last span have no rounding at the road's end: they can give their whole length.
        span_before = (station_of_point - station_before) / (1 if station_before == stations[0] else 2)
        tangent = min(span_before, (station_after - station_of_point) / (1 if station_after == stations[-1] else 2))
        climb += grades[-1] / 100.0 * (station_of_point - station_before)
        if tangent < limits.vertical_tangent:
            grades.append(grades[-1])
            radii.append(0.0)
            continue
        least_grade = max(lowest_grade, grades[-1] - 200.0 * tangent / limits.crest)
        largest_grade = min(highest_grade, grades[-1] + 200.0 * tangent / limits.sag)
        if climb > HIGHEST_CLIMB:
            largest_grade = max(least_grade, min(largest_grade, 0.0))
        elif climb < -HIGHEST_CLIMB:
            least_grade = min(largest_grade, max(least_grade, 0.0))
        grades.append(round_value(rng.uniform(least_grade, largest_grade)))
        grade_change = abs(grades[-1] - grades[-2]) / 100.0
        least_radius = limits.crest if grades[-1] < grades[-2] else limits.sag
        least_radius = max(least_radius, 2.0 * limits.vertical_tangent * _MARGIN / max(grade_change, 1e-9))
        largest_radius = max(least_radius, min(2.0 * tangent / max(grade_change, 1e-9), 5.0 * least_radius))
        radii.append(round_value(rng.uniform(least_radius, largest_radius)) if grade_change > 0 else 0.0)
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
