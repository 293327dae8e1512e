"""An interchange drawn on a motorway: a crossing road, and ramps from its exits and to its entries.

Everything is drawn from streams of its own, so that nothing else of a road depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ...base.errors import InputError
from ...base.random_streams import stream
from ...base.schema import round_value
from ...road.geometry import RoadGeometry
from ...road.objects import Side
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad
from ...road.section import Carriageway, Turnout
from ...road.structures.bridge import Bridge
from ...road.things.overpass import Overpass
from ...scenario.road import RoadScenario
from ..placing.draw import draw
from ..structures import CAP_TAPER, fit_verges
from .crossing import BRIDGE_ID, CROSSING_ID, CrossingValues, bridge_above, deck_width, road_above, road_below
from .quadrants import Quadrant, ramp_places
from .ramps import JoinedRamp, RampFitter, RampValues, direct_ramp, loop_ramp, ramp_length, turnout_of

_DRAWN = ("distance", "radius", "lane_width", "corner_radius", "design_speed")
"""Limits that a value of each ramp is drawn from, in order."""
_DRAWN_LAST = ("edge_strip_width", "curve_crossfall", "loop_radius", "loop_crossfall", "ramp_spacing")
"""Further ones, drawn when all of these are."""
_BESIDE_MOUTH = 60.0
"""Ground built beyond the farthest mouth, m; chosen."""
_BESIDE_LOOP = 40.0
"""Distance (m) of a loop's mouth from the motorway's centreline at most, without twice its radius."""
_END = 1.0
"""Distance of turnouts from the road's ends, m."""
_BESIDE_BRIDGE = 2.0
"""Distance of an exit's or entry's lane's ends from a bridge, m; chosen."""
_MOVES, _DRAWS = 4, 12
"""How often a crossing road is moved to where its interchange has room, and how often one is drawn that has."""


@dataclass(frozen=True)
class Interchange:
    """The objects of a drawn interchange, all of instance 1.

    Attributes:
        turnouts: exits and entries by id.
        bridge: id and object of the bridge: over the motorway, or the motorway's own.
        crossing: id and object of the crossing road.
        ramps: connecting ramps by id.
        carriageways: the road's by side, their verges as wide as the caps of its bridge.
    """

    turnouts: dict[str, Turnout]
    bridge: tuple[str, Overpass | Bridge]
    crossing: tuple[str, CrossingRoad]
    ramps: dict[str, ConnectingRamp]
    carriageways: dict[Side, Carriageway] = field(default_factory=dict)

    @property
    def overpass(self) -> Overpass | None:
        """Return the bridge that carries the crossing road; None where that passes below the motorway."""
        return self.bridge[1] if isinstance(self.bridge[1], Overpass) else None

    @property
    def structures(self) -> dict[str, Bridge]:
        """Return the motorway's bridge over the crossing road by id; none where that is above."""
        name, bridge = self.bridge
        return {name: bridge} if isinstance(bridge, Bridge) else {}

    @property
    def stretch(self) -> tuple[float, float]:
        """Return the stations (m) between which its exits and entries lie."""
        items = self.turnouts.values()
        return min(item.start_station for item in items), max(item.end_station for item in items)

    def objects(self) -> dict[str, Any]:
        """Return what carries the crossing road, that road and the ramps by id; no turnouts and structures."""
        carrying = {self.bridge[0]: self.overpass} if self.overpass else {}
        return {**carrying, **dict([self.crossing]), **self.ramps}


def with_room_for_interchange(scenario: RoadScenario) -> RoadScenario:
    """Return a scenario with room for its interchange, which has the only turnouts and the only bridge; or as it is."""
    limits = scenario.interchange
    if limits.kind == "none":
        return scenario
    turnouts = {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}
    farthest = limits.distance.maximum
    if limits.kind == "half_clover":
        farthest = _BESIDE_LOOP + 2.0 * limits.loop_radius.maximum + limits.ramp_spacing.maximum
    return scenario.model_copy(
        update={
            "half_width": max(scenario.half_width, farthest + _BESIDE_MOUTH),
            "turnouts": scenario.turnouts.model_copy(update=turnouts),
            "lane_changes": scenario.lane_changes.model_copy(update={"share": 0.0}),
            "furniture": scenario.furniture.model_copy(update={"overpass": 0.0}),
        }
    )


def sample_interchange(
    scenario: RoadScenario, seed: int, geometry: RoadGeometry, cap_width: float, ramp_fall: float = 2.5
) -> Interchange | None:
    """Return the interchange of a road without turnouts; None where none is wanted.

    Where what is drawn is too long for the road, others are drawn within the same limits.

    Args:
        scenario: limits of the interchange and of the bridge.
        seed: of everything drawn.
        geometry: the main road, with terrain and without turnouts.
        cap_width: width of the caps of a bridge of the road, m.
        ramp_fall: crossfall (%) of the ramps beside the main road, outwards.

    Raises:
        InputError: the road is too short for it, or a ramp doesn't fit between the limits.
    """
    if scenario.interchange.kind == "none":
        return None
    lengths, refusals = [], []
    for number in range(_DRAWS):
        rng = stream(seed, "interchange", *([str(number)] if number else []))
        draft = _Draft(scenario, rng, geometry, cap_width, ramp_fall)
        try:
            interchange, needed = draft.placed()
        except InputError as refusal:
            refusals.append(refusal)
            continue
        if interchange is not None:
            return interchange
        lengths.append(needed)
    if not lengths:
        raise refusals[0]
    length = np.ceil(min(lengths) / 10.0) * 10.0
    text = f"an interchange of this form needs about {length:.0f} m here: make the road longer"
    raise InputError("road.length", round(geometry.length, 1), text)


class _Draft:
    """An interchange that is drawn, at whatever station its crossing road is put.

    Attributes:
        limits, geometry: limits, and the main road.
        places: of its ramps.
        values: drawn values of the ramps by their places' names.
    """

    def __init__(
        self,
        scenario: RoadScenario,
        rng: np.random.Generator,
        geometry: RoadGeometry,
        cap_width: float,
        ramp_fall: float,
    ) -> None:
        limits = scenario.interchange
        self.limits, self.geometry, self._scenario, self._cap_width = limits, geometry, scenario, cap_width
        carriageways = {item.side: item for item in geometry.parameters.of_type(Carriageway).values()}
        self._carriageways = carriageways
        self.places = ramp_places(limits, carriageways)
        clearance, grade = draw(rng, limits.clearance), draw(rng, limits.grade) / 100.0
        self._crossing = CrossingValues(clearance, grade, draw(rng, limits.crest_radius))
        drawn: dict[str, dict[str, Any]] = {}
        for place in self.places:
            drawn[place.name] = {name: draw(rng, getattr(limits, name)) for name in _DRAWN}
            is_stop = rng.random() < limits.stop_lines
            priority: Literal["none", "stop", "give_way"] = "stop" if is_stop else "give_way"
            drawn[place.name]["priority"] = "none" if place.kind == "entry" else priority
        self.values: dict[str, RampValues] = {}
        spacing: dict[Side, float] = {}
        for place in self.places:
            values = drawn[place.name]
            last: dict[str, Any] = {name: draw(rng, getattr(limits, name)) for name in _DRAWN_LAST}
            crossfall, loop_crossfall = last.pop("curve_crossfall"), last.pop("loop_crossfall")
            loop_radius, drawn_spacing = last.pop("loop_radius"), last.pop("ramp_spacing")
            if limits.kind == "half_clover":
                values["spacing"] = spacing.setdefault(place.side, drawn_spacing)
            if place.is_loop:
                values["radius"], crossfall = loop_radius, loop_crossfall
            self.values[place.name] = RampValues(**values, **last, crossfall=crossfall, turnout_fall=ramp_fall)
        self._bridge_rng = rng

    def placed(self) -> tuple[Interchange | None, float]:
        """Return the interchange where it has room, and the length (m) of road that it needs; None without room.

        Its crossing road is in the middle of the road, or moved from there as far as it must be.
        """
        state = self._bridge_rng.bit_generator.state
        station, needed = round_value(self.geometry.length / 2.0, 3), 0.0
        for _ in range(_MOVES):
            self._bridge_rng.bit_generator.state = state
            interchange = self.at(station)
            (start, end), length = interchange.stretch, self.geometry.length
            if start >= _END and end <= length - _END:
                return interchange, needed
            needed = end - start + 2.0 * _END
            if needed > length:
                break
            station = round_value(station + (length - end - start) / 2.0, 3)
        return None, needed

    def at(self, station: float) -> Interchange:
        """Return the interchange whose crossing road crosses at a station (m), whether it has room there or not.

        Raises:
            InputError: a ramp doesn't fit between the limits.
        """
        geometry, carriageways = self.geometry, self._carriageways
        bridge: Overpass | Bridge
        if self.limits.crossing == "over":
            bridge, crossing = road_above(self._with_lanes(station), station, self._crossing)
            half = deck_width() / 2.0 + _BESIDE_BRIDGE
        else:
            terrain = geometry.terrain
            assert terrain is not None
            clearance, slope = self._crossing.clearance, terrain.batter_slope
            bridge = bridge_above(self._scenario, self._bridge_rng, station, slope, clearance)
            carriageways = {
                side: fit_verges(item, [bridge], self._cap_width, 0.0) for side, item in carriageways.items()
            }
            geometry = _changed(geometry, {f"carriageway-{s}": item for s, item in carriageways.items()})
            crossing = road_below(_changed(geometry, {BRIDGE_ID: bridge}), station, bridge, self._crossing)
            half = bridge.cap_end - station + CAP_TAPER + _BESIDE_BRIDGE
        joined: dict[str, JoinedRamp] = {}
        loops: dict[Side, JoinedRamp] = {}
        for place in self.places:
            values = self.values[place.name]
            if place.is_loop:
                own = ramp_length(geometry.sections[place.side])
                fitter = RampFitter(geometry, crossing, place, values)
                farthest = own + fitter.turnout.lane_length - half
                loops[place.side] = joined[place.name] = loop_ramp(fitter, half + own, farthest)
                continue
            loop = loops.get(place.side)
            if loop is not None:
                values = replace(values, distance=loop.distance + values.spacing)
            joined[place.name] = direct_ramp(RampFitter(geometry, crossing, place, values), loop)
        return Interchange(
            {name: fit.turnout for name, fit in joined.items()},
            (BRIDGE_ID, bridge),
            (CROSSING_ID, crossing),
            {f"ramp-{name}": fit.ramp for name, fit in joined.items()},
            carriageways,
        )

    def _with_lanes(self, station: float) -> RoadGeometry:
        """Return the main road with the lanes of loops' exits and entries where the crossing road is above it."""
        lanes = {place.name: self._lane_at(place, station) for place in self.places if place.is_loop}
        return _changed(self.geometry, lanes) if lanes else self.geometry

    def _lane_at(self, place: Quadrant, station: float) -> Turnout:
        """Return the exit or entry of a loop whose lane passes below the crossing road at a station (m)."""
        turnout = turnout_of(self.geometry, place, self.values[place.name])
        before = turnout.taper_in_length if place.kind == "exit" else ramp_length(self.geometry.sections[place.side])
        if place.ahead * (1.0 if place.kind == "exit" else -1.0) < 0.0:
            before = turnout.length - before - turnout.lane_length
        return turnout.model_copy(update={"start_station": station - before - turnout.lane_length / 2.0})


def _changed(geometry: RoadGeometry, objects: dict[str, Any]) -> RoadGeometry:
    """Return a road's geometry with some objects changed, or some more."""
    parameters = geometry.parameters
    return RoadGeometry(parameters.model_copy(update={"objects": {**parameters.objects, **objects}}))
