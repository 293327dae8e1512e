"""Base of the checker's rules: rule, finding, and the road as arrays.

Nothing here or in the rules is shared with the sampler but the table of limits, so that an error in one shows in the
other. Geometry is worked out anew from the parameter set, and no valid set makes a rule fail with an error: stations
out of order, overlapping roundings and elements without length are findings.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...road.guidelines import GUIDELINE_OF_CLASS, LIMITS, SignRole, TrafficSide, is_single
from ...road.objects import ObjectT
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.section import Carriageway, Turnout
from ...road.streets.street_side import StreetSide
from ...road.structures.tunnel import Tunnel
from ...road.surroundings import Terrain
from ...road.things.sign import TrafficSign
from ...road.things.traffic_island import TrafficIsland
from .edges import Edges, Float, TurnoutEdges
from .lines import names_beside_others
from .obstacles import Barriers, Bodies, BodyPositions, Bool, ProtectingBarriers, Signs

Sure = Literal["confirmed", "derived", "unconfirmed", "definition"]

#: Values may miss a limit by this share of it: what is written exactly at a limit passes.
TOLERANCE = 1e-6
#: Curvatures that differ by less than this (1/m), or by `TOLERANCE` of them, are the same: files hold rounded numbers.
SAME_CURVATURE = 1e-9
#: Curvatures below this (1/m) are straight: a radius over 10 000 km.
STRAIGHT = 1e-7
#: Stations nearer than this (m) are the same.
SAME_STATION = 1e-3
#: Length before and behind a tunnel over which verges come to its walkways' width, and barriers end, m. Chosen.
BESIDE_TUNNEL = 10.0
#: Crossfalls that differ by less than this (%) don't run off.
SAME_CROSSFALL = 1e-6


class Finding(NamedTuple):
    """Finding of a rule: a `Violation` without the rule's id and unit."""

    object: str
    station: float
    value: float
    limit: float
    text: str


@dataclass(frozen=True)
class Violation:
    """A broken rule: where, and by how much.

    Attributes:
        rule: stable id of the rule, e.g. ``radius-minimum``.
        object: id of the object in the set.
        station: where, m.
        value, limit: what was found and what is allowed, in `unit`.
        unit: unit of both.
        text: one sentence for people, with the guideline.
    """

    rule: str
    object: str
    station: float
    value: float
    limit: float
    unit: str
    text: str


@dataclass(frozen=True)
class Rule:
    """A rule of the checker: what is required, by which source, and the function that finds violations.

    Attributes:
        id: short stable name.
        title: what is required, for people.
        unit: unit of value and limit.
        source: guideline, or what else it follows from.
        sure: ``confirmed`` (secondary sources print it), ``derived`` (computed from what they print),
            ``unconfirmed`` (common knowledge, not found in print), ``definition`` (a set that breaks it is faulty).
        find: function that yields the findings.
    """

    id: str
    title: str
    unit: str
    source: str
    sure: Sure
    find: Callable[[Road], Iterable[Finding]]


@dataclass(frozen=True)
class CurvatureRun:
    """A stretch of constant curvature: neighbouring lines or arcs of the same curvature count as one.

    Attributes:
        start, end: stations, m.
        curvature: 1/m, positive to the left.
        first, last: indices of its elements.
    """

    start: float
    end: float
    curvature: float
    first: int
    last: int

    @property
    def straight(self) -> bool:
        """Return whether it is a straight."""
        return abs(self.curvature) < STRAIGHT

    @property
    def length(self) -> float:
        """Return the length, m."""
        return self.end - self.start

    @property
    def radius(self) -> float:
        """Return the radius, m; infinite on a straight."""
        return 1.0 / abs(self.curvature) if self.curvature else np.inf


class Road:
    """A parameter set as arrays, as the rules read it.

    Attributes:
        axis: id of the alignment.
        terrain: the terrain, if there is one.
        limits: limits of the design class.
        guideline: the guideline with the design class, for people.
        guideline_name: the same without the class.
        single: whether both directions share one carriageway.
        two_seconds: m travelled in two seconds at the class's speed.
        lengths, k0, k1: (E,) lengths (m) and curvatures (1/m) at both ends of the horizontal elements.
        starts: (E + 1,) stations of their borders; `length` is the last.
        constant: (E,) whether an element is a line or an arc.
        runs: stretches of constant curvature in order.
        vertical: the profile.
        sides: the carriageways' edges, by the carriageway's id.
        marks: (M,) increasing stations at which an edge of the pavement bends or steps.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self.parameters = parameters
        self.design_class = parameters.design_class
        self.limits = LIMITS[self.design_class]
        self._guideline = GUIDELINE_OF_CLASS[self.design_class]
        self.guideline = f"{self._guideline.name}, {self._guideline.classes[self.design_class].citation}"
        self.guideline_name = self._guideline.name
        self.single = is_single(self.design_class)
        self.two_seconds = self.limits.speed / 3.6 * 2.0
        self._by_type: dict[builtins.type, dict[str, Any]] = {}
        for name, item in parameters.objects.items():
            self._by_type.setdefault(type(item), {})[name] = item
        self.axis, alignment = next(iter(self.of(AlignmentObject).items()))
        self.terrain = next(iter(self.of(Terrain).values()), None)
        rows = [(e.length, e.curvature_start, e.curvature_end) for e in alignment.horizontal]
        self.lengths, self.k0, self.k1 = np.array(rows, dtype=np.float64).T
        self.starts = np.concatenate(([0.0], np.cumsum(np.maximum(self.lengths, 0.0))))
        self.length = float(self.starts[-1])
        self.constant: Bool = same_curvature(self.k0, self.k1)
        self.runs = self._runs()
        self.vertical = Vertical(alignment)
        turnouts = self.of(Turnout)
        self.sides: dict[str, Edges] = {}
        for name, carriageway in self.of(Carriageway).items():
            widenings = {key: turnout for key, turnout in turnouts.items() if turnout.carriageway == name}
            self.sides[name] = Edges(name, carriageway, widenings, self.length)
        self.marks = np.unique(np.concatenate([np.empty(0), *(edges.marks for edges in self.sides.values())]))

    @property
    def traffic_side(self) -> TrafficSide:
        """Return the side that the guideline's traffic keeps to, and how sure that is."""
        return self._guideline.traffic

    @property
    def delineator_rule(self) -> str:
        """Return the guideline that asks for delineators; empty if none does."""
        return self._guideline.delineator_rule

    def sign_of(self, role: SignRole) -> str | None:
        """Return the code of the guideline's sign for a purpose, or None if it names none."""
        return self._guideline.sign_roles.get(role)

    def color_of(self, kind: str) -> str:
        """Return the colour that the guideline has for a kind of line: one between the directions is ``centre``."""
        colors = {"centre": self._guideline.centre_line_color, "outer_edge": self._guideline.edge_line_color}
        return colors.get(kind, "white")

    def binds(self, quantity: str) -> bool:
        """Return whether the road's guideline has a quantity as a limit, not as a default of the sampler's."""
        row = self._guideline.quantities.get(quantity)
        return row is not None and row.use == "limit"

    def cite(self, quantity: str, of_class: bool = False) -> str:
        """Return what a quantity is from, for people: guideline, design class if wanted, source, how sure.

        Of a quantity that the guideline doesn't have, that is the guideline itself.
        """
        row = self._guideline.quantities.get(quantity)
        if row is None:
            return self._guideline.name
        name = row.guideline or self._guideline.name
        if of_class:
            name += f", {self._guideline.classes[self.design_class].citation}"
        return f"{name}: {row.source}; {row.sure}" if row.source else name

    def of(self, kind: builtins.type[ObjectT]) -> dict[str, ObjectT]:
        """Return the objects of one class by id, in the order of the file."""
        return self._by_type.get(kind, {})

    @cached_property
    def beside_others(self) -> frozenset[str]:
        """The ids of what stands beside a ramp or a crossing road, not beside the main road."""
        clearance: dict[str, float] = {}
        for name, distance in zip(self.bodies.names, self.positions.nearest.tolist(), strict=True):
            clearance[name] = min(distance, clearance.get(name, distance))
        return names_beside_others(self.parameters, clearance)

    @cached_property
    def villages(self) -> list[tuple[float, float]]:
        """Return the stretches (m) with street sides, joined where they meet: the open road's furniture ends there."""
        stretches: list[tuple[float, float]] = []
        for start, end in sorted((item.start_station, item.end_station) for item in self.of(StreetSide).values()):
            if stretches and start <= stretches[-1][1] + SAME_STATION:
                stretches[-1] = stretches[-1][0], max(stretches[-1][1], end)
            else:
                stretches.append((start, end))
        return stretches

    @cached_property
    def tunnels(self) -> list[tuple[float, float]]:
        """Return the stretches (m) in tunnels, with what makes way for their walls and walkways beside them."""
        return [
            (item.start_station - BESIDE_TUNNEL, item.end_station + BESIDE_TUNNEL) for item in self.of(Tunnel).values()
        ]

    def in_village(self, station: float) -> bool:
        """Return whether a station (m) lies in a village."""
        return any(start <= station <= end for start, end in self.villages)

    @cached_property
    def on_islands(self) -> dict[str, str]:
        """Return the ids of the signs that stand on traffic islands, each with its island's."""
        islands = self.of(TrafficIsland).items()
        return {
            name: island_name
            for name, sign in self.of(TrafficSign).items()
            for island_name, island in islands
            if abs(sign.station - island.station) < island.length / 2.0
            and abs(sign.offset - island.offset) < island.width / 2.0
        }

    def each(self, *kinds: builtins.type) -> Iterator[tuple[str, Any]]:
        """Yield the objects, with their ids, whose class is one of some classes or derives from one."""
        for kind, items in self._by_type.items():
            if issubclass(kind, kinds):
                yield from items.items()

    @property
    def turnouts(self) -> Iterator[tuple[Edges, TurnoutEdges]]:
        """Yield (carriageway's edges, turnout's edges) for all turnouts."""
        return ((edges, turnout) for edges in self.sides.values() for turnout in edges.turnouts)

    @cached_property
    def crossfalls(self) -> dict[str, Crossfall]:
        """Return the carriageways' crossfall, by the carriageway's id."""
        return {name: Crossfall(edges.carriageway, self.length) for name, edges in self.sides.items()}

    @cached_property
    def bodies(self) -> Bodies:
        """Return the boxes that all things of the road stand in."""
        return Bodies(self.parameters)

    @cached_property
    def positions(self) -> BodyPositions:
        """Return where the bodies are in relation to the carriageways."""
        return BodyPositions(self.bodies, self.sides, self.marks)

    @cached_property
    def barriers(self) -> Barriers:
        """Return the guardrails and concrete barriers."""
        return Barriers(self.parameters, self.bodies, self.positions)

    @cached_property
    def signs(self) -> Signs:
        """Return the traffic signs, kilometre boards and traffic lights."""
        return Signs(self.parameters, self.bodies, self.positions)

    @cached_property
    def protecting(self) -> dict[str, ProtectingBarriers]:
        """Return which of the barriers protect the traffic of each carriageway, by the carriageway's id."""
        return {name: ProtectingBarriers(self.barriers, name, edges) for name, edges in self.sides.items()}

    def _runs(self) -> list[CurvatureRun]:
        """Return the stretches of constant curvature in order: neighbouring elements of one curvature as one."""
        runs: list[CurvatureRun] = []
        for i in np.flatnonzero(self.constant).tolist():
            curvature = float(0.5 * (self.k0[i] + self.k1[i]))
            first_element = i
            if runs and runs[-1].last == i - 1 and bool(same_curvature(self.k1[i - 1], self.k0[i])):
                previous_run = runs.pop()
                first_element, curvature = previous_run.first, previous_run.curvature
            runs.append(
                CurvatureRun(float(self.starts[first_element]), float(self.starts[i + 1]), curvature, first_element, i)
            )
        return runs

    def is_cut(self, run: CurvatureRun) -> bool:
        """Return whether the road's begin or end cuts a run, so that its true length is unknown."""
        return run.first == 0 or run.last == len(self.lengths) - 1


class Vertical:
    """The vertical profile as arrays; points whose station isn't past all before are left out (a rule finds them).

    Attributes:
        station, radius: (P,) m.
        grades: (P + 1,) m/m before, between and after the points; the outer ones repeat their neighbour.
        tangents: (P,) tangent lengths of the roundings, m.
    """

    def __init__(self, alignment: AlignmentObject) -> None:
        points = np.array([(p.station, p.elevation, p.radius) for p in alignment.vertical], dtype=np.float64)
        self.station, elevation, self.radius = points[indices_of_increase(points[:, 0])].T
        inner_grades = np.diff(elevation) / np.diff(self.station)
        self.grades = (
            np.concatenate((inner_grades[:1], inner_grades, inner_grades[-1:])) if len(inner_grades) else np.zeros(2)
        )
        self.tangents = 0.5 * self.radius * np.abs(np.diff(self.grades))


class Crossfall:
    """A carriageway's crossfall on the road as arrays; points whose station isn't past all before are left out.

    Attributes:
        station: (N,) m: the road's begin, the points on it, its end.
        percent: (N,) crossfall there.
        runs_off: (N - 1,) whether it changes from one to the next.
        slope: (N - 1,) % per m.
    """

    def __init__(self, carriageway: Carriageway, length: float) -> None:
        points = np.array([(p.station, p.crossfall_percent) for p in carriageway.crossfall])
        station, percent = points[indices_of_increase(points[:, 0])].T
        is_on_road = (station > 0.0) & (station < length)
        self.station = np.concatenate(([0.0], station[is_on_road], [length]))
        self.percent = np.interp(self.station, station, percent)
        percent_change = np.diff(self.percent)
        self.runs_off: Bool = np.abs(percent_change) > SAME_CROSSFALL
        self.slope = percent_change / np.diff(self.station)


def same_curvature(a: Float | float, b: Float | float) -> Bool:
    """Return a mask of where two curvatures (1/m) count as equal."""
    tolerance = SAME_CURVATURE + TOLERANCE * np.maximum(np.abs(a), np.abs(b))
    return np.asarray(np.abs(np.subtract(a, b)) <= tolerance)


def indices_of_increase(station: Float) -> NDArray[np.intp]:
    """Return the indices of the stations that lie past all stations before them."""
    largest_before = np.concatenate(([-np.inf], np.maximum.accumulate(station)[:-1]))
    return np.flatnonzero(station > largest_before)


def out_of_order(stations: Iterable[float]) -> Iterator[tuple[int, float, float]]:
    """Yield (number from 1, station, largest one before) of the stations that don't lie past all before them."""
    largest_before = -np.inf
    for number, station in enumerate(stations, start=1):
        if station <= largest_before:
            yield number, station, largest_before
        largest_before = max(largest_before, station)


def below(value: float, limit: float) -> bool:
    """Return whether a value falls short of a limit by more than the relative tolerance."""
    return bool(value < limit - TOLERANCE * max(abs(limit), TOLERANCE))


def above(value: float, limit: float) -> bool:
    """Return whether a value exceeds a limit by more than the relative tolerance."""
    return below(-value, -limit)


def at_least(item: str, station: float, value: float, limit: float, text: str) -> Iterator[Finding]:
    """Yield one finding if a value falls short of its limit, else none."""
    if below(value, limit):
        yield Finding(item, station, value, limit, text)


def at_most(item: str, station: float, value: float, limit: float, text: str) -> Iterator[Finding]:
    """Yield one finding if a value exceeds its limit, else none."""
    if above(value, limit):
        yield Finding(item, station, value, limit, text)


def stretches(mask: Bool) -> Iterator[tuple[int, int]]:
    """Yield the (first, last) index of every run of neighbouring True values in a mask."""
    if not mask.any():
        return
    borders = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    for run_start, run_end in borders.reshape(-1, 2).tolist():
        yield run_start, run_end - 1


def gaps(
    ranges: Iterable[tuple[float, float]], start: float, end: float, least_length: float = SAME_STATION
) -> Iterator[tuple[float, float]]:
    """Yield the parts of start..end (m) that no range covers and that are longer than `least_length`."""
    covered_up_to = start
    for range_start, range_end in [*sorted(ranges), (end, end)]:
        if range_start > covered_up_to + least_length and covered_up_to < end - least_length:
            yield covered_up_to, min(range_start, end)
        covered_up_to = max(covered_up_to, range_end)
