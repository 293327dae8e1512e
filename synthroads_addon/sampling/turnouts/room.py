"""Whether an exit, entry or emergency bay fits where it is stated: reasons why not, each with what helps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from ...base.schema import round_value
from ...road.guidelines import (
    EMERGENCY_BAY_LENGTH,
    EMERGENCY_BAY_TAPER,
    EMERGENCY_BAY_WIDTH,
    LIMITS,
    TURNOUT_GAP,
    TURNOUT_LANE_WIDTH,
    TURNOUT_TAPER,
    is_single,
)
from ...road.objects import Side
from ...road.section import Ramp, Turnout
from ...road.turnout_geometry import BLEND, NOSE_BEFORE_END, STEP
from ...scenario.road import RoadScenario
from ..section import RampLimits, cross_section_of, stated_turnout

NAMES = {"exit": "exit", "entry": "entry", "emergency_bay": "emergency bay"}
"""Name in sentences of each kind of turnout."""


class TurnoutRoom(NamedTuple):
    """Lengths that a turnout takes below and above its lowest station, m, and which stations it may have.

    Attributes:
        before: below its lowest station, where the verge behind an entry's ramp comes back.
        behind: above it.
        first, last: lowest and highest allowed station; the first is the larger one where the road is too short.
    """

    before: float
    behind: float
    first: float
    last: float

    @classmethod
    def of(cls, turnout: Turnout, traffic: int, length: float) -> TurnoutRoom:
        """Return a turnout's room; traffic is +1 where it runs with the stations, the road's length in m."""
        blend = BLEND + STEP if turnout.ramp else 0.0
        has_ramp_above = (traffic > 0) == (turnout.kind == "exit")
        before, behind = (0.0, turnout.length + blend) if has_ramp_above else (blend, turnout.length)
        return cls(before, behind, round_value(before), round_value(length - behind))


def room_reasons(turnout: Turnout, traffic: int, length: float, others: Mapping[str, Turnout]) -> Iterator[str]:
    """Yield why a turnout has no room along the road, with what helps: the road's ends, and other turnouts.

    Args:
        turnout: where it is to be.
        traffic: +1 where its carriageway's traffic runs with the stations, else -1.
        length: of the road, m.
        others: turnouts of the same carriageway, by id.
    """
    kind, station = NAMES[turnout.kind], turnout.start_station
    room = TurnoutRoom.of(turnout, traffic, length)
    if room.last < room.first:
        needed = room.before + room.behind
        yield f"the {kind} takes {needed:.0f} m and the road is {length:.0f} m long: shorten it, or build a longer road"
        return
    if not room.first - 1e-6 <= station <= room.last + 1e-6:
        yield (
            f"the {kind} at station {station:.0f} m reaches beyond the road's end: choose a station from "
            f"{room.first:.0f} to {room.last:.0f} m"
        )
    for name, other in others.items():
        if other.start_station - TURNOUT_GAP < turnout.end_station and station < other.end_station + TURNOUT_GAP:
            before, behind = other.start_station - TURNOUT_GAP - turnout.length, other.end_station + TURNOUT_GAP
            choices = [f"at most {before:.0f} m"] * (before >= room.first)
            choices += [f"at least {behind:.0f} m"] * (behind <= room.last)
            help_text = f"choose a station of {' or '.join(choices)}" if choices else f"delete or move {name}"
            yield f"the {kind} is less than {TURNOUT_GAP:.0f} m from {name} (RAA): {help_text}"


def ramp_reasons(ramp: Ramp | None, ramps: RampLimits) -> Iterator[str]:
    """Yield why a ramp can't be: it doesn't reach its nose, or leaves the terrain."""
    if ramp is None:
        return
    least = ramps.nose(ramp.clothoid_parameter) + NOSE_BEFORE_END
    if ramp.length < least - 1e-6:
        yield (
            f"the ramp of {ramp.length:.0f} m doesn't reach {NOSE_BEFORE_END:.0f} m behind its nose: make it "
            f"{least:.0f} m long, or its A smaller"
        )
    wedge = ramp.length**3 / (6.0 * ramp.clothoid_parameter**2)
    if wedge > ramps.widest_wedge + 1e-6:
        yield (
            f"the ramp leaves the road by {wedge:.1f} m, and the terrain has room for "
            f"{max(ramps.widest_wedge, 0.0):.1f} m: shorten it, make its A larger, or the terrain wider (half_width)"
        )


def guideline_reasons(turnout: Turnout, design_class: str, others: Mapping[str, Turnout]) -> Iterator[str]:
    """Yield which sizes of a turnout are below those of the guidelines (RAA), and which distance to another one.

    Args:
        turnout: with its sizes.
        design_class: of the road.
        others: turnouts of the same carriageway, by id.
    """
    limits, kind = LIMITS[design_class], NAMES[turnout.kind]
    tapers = [taper for taper in (turnout.taper_in_length, turnout.taper_out_length) if taper > 0.0]
    values = {"taper": min(tapers), "lane's length": turnout.lane_length, "lane's width": turnout.lane_width}
    least = {
        "taper": TURNOUT_TAPER,
        "lane's length": limits.turnout_lane_length,
        "lane's width": TURNOUT_LANE_WIDTH,
    }
    if turnout.ramp is None:
        values = {"taper": values["taper"], "length": turnout.lane_length, "width": turnout.lane_width}
        least = {"taper": EMERGENCY_BAY_TAPER, "length": EMERGENCY_BAY_LENGTH, "width": EMERGENCY_BAY_WIDTH}
    for name, value in values.items():
        if value < least[name] - 1e-6:
            yield f"the {kind}'s {name} is {value:g} m: {least[name]:g} m are needed (RAA)"
    for name, other in others.items():
        spacing = abs(other.start_station - turnout.start_station)
        if other.kind == turnout.kind and turnout.ramp and spacing < limits.interchange_spacing - 1e-6:
            yield (
                f"the {kind} is {spacing:.0f} m from {name}: {limits.interchange_spacing:.0f} m are needed between two "
                "of a kind (RAA), choose another station"
            )


def stated_reasons(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each of a scenario's stated turnouts that has no room on or beside its road."""
    places = scenario.turnouts.places
    if not places:
        return
    if is_single(scenario.design_class):
        yield f"{scenario.design_class} has no exits, entries and bays: 0 places are allowed"
        return
    section = cross_section_of(scenario)
    ramps = RampLimits(scenario, section)
    done: dict[Side, dict[str, Turnout]] = {"left": {}, "right": {}}
    for number, place in enumerate(places):
        turnout = stated_turnout(scenario, ramps, place)
        traffic = 1 if place.side == "right" else -1
        reasons = [
            *room_reasons(turnout, traffic, scenario.length, done[place.side]),
            *ramp_reasons(turnout.ramp, ramps),
            *guideline_reasons(turnout, scenario.design_class, done[place.side]),
        ]
        if place.kind == "emergency_bay" and not ramps.room_for_bay:
            reasons.append(f"half_width {scenario.half_width:g} m has no room for a bay: make it larger")
        yield from (f"places[{number}]: {reason}" for reason in reasons)
        done[place.side][f"places[{number}]"] = turnout
