"""Rules for turnouts (RAA): exits, entries and emergency bays."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from ...road.guidelines import (
    EMERGENCY_BAY_LENGTH,
    EMERGENCY_BAY_TAPER,
    EMERGENCY_BAY_WIDTH,
    INTERCHANGE_SPACING,
    TURNOUT_GAP,
    TURNOUT_LANE_LENGTH,
    TURNOUT_LANE_WIDTH,
    TURNOUT_TAPER,
)
from ...road.section import Turnout
from .edges import NOSE_BEFORE_END, TurnoutEdges
from .rule import SAME_STATION, Finding, Road, Rule, above, below
from .section import lane_tapers

_NAMES = {"emergency_bay": "emergency bay", "exit": "exit", "entry": "entry"}


def _place(road: Road, turnout: Turnout) -> float:
    return float(min(max(turnout.start_station, 0.0), road.length))


def _too_small(road: Road, with_ramp: bool, field: str, least: float, text: str) -> Iterator[Finding]:
    """Yield the exits and entries, or the emergency bays, of which a length or width falls short of the least (m)."""
    for name, turnout in road.of(Turnout).items():
        value = getattr(turnout, field)
        if (turnout.ramp is not None) == with_ramp and below(value, least):
            sentence = text.format(kind=_NAMES[turnout.kind], value=value, least=least)
            yield Finding(name, _place(road, turnout), value, least, sentence)


def _lane_length(road: Road) -> Iterator[Finding]:
    text = "The {kind}'s lane is {value:.1f} m long; {least:.0f} m are needed (RAA)."
    yield from _too_small(road, True, "lane_length", TURNOUT_LANE_LENGTH[road.design_class], text)


def _lane_width(road: Road) -> Iterator[Finding]:
    text = "The {kind}'s lane is {value:.2f} m wide; {least} m are needed (RAA)."
    yield from _too_small(road, True, "lane_width", TURNOUT_LANE_WIDTH, text)


def _bay_width(road: Road) -> Iterator[Finding]:
    text = "The {kind} is {value:.2f} m wide; {least} m are needed (RAA)."
    yield from _too_small(road, False, "lane_width", EMERGENCY_BAY_WIDTH, text)


def _bay_length(road: Road) -> Iterator[Finding]:
    text = "The {kind} is {value:.1f} m long; {least:.0f} m are needed (RAA)."
    yield from _too_small(road, False, "lane_length", EMERGENCY_BAY_LENGTH, text)


def _taper(road: Road) -> Iterator[Finding]:
    for name, turnout in road.of(Turnout).items():
        least = TURNOUT_TAPER if turnout.ramp else EMERGENCY_BAY_TAPER
        shortest = min(taper for taper in (turnout.taper_in_length, turnout.taper_out_length) if taper > 0.0)
        if below(shortest, least):
            text = f"The {_NAMES[turnout.kind]}'s taper is {shortest:.1f} m long; {least:.0f} m are needed (RAA)."
            yield Finding(name, _place(road, turnout), shortest, least, text)


def _nose(road: Road) -> Iterator[Finding]:
    for _, edges in road.turnouts:
        ramp = edges.turnout.ramp
        needed = edges.natural_nose + NOSE_BEFORE_END
        if ramp is not None and below(ramp.length, needed):
            text = f"The ramp is {ramp.length:.1f} m long; {needed:.1f} m are needed to reach its nose."
            yield Finding(edges.name, _tip(road, edges), ramp.length, needed, text)


def _tip(road: Road, edges: TurnoutEdges) -> float:
    return float(min(max(edges.station(edges.tip), 0.0), road.length))


def _start(edges: TurnoutEdges) -> float:
    return edges.turnout.start_station


def _gap(road: Road) -> Iterator[Finding]:
    for side in road.sides.values():
        for before, after in pairwise(sorted(side.turnouts, key=_start)):
            gap = after.turnout.start_station - before.turnout.end_station
            if below(gap, TURNOUT_GAP):
                text = f"The turnout begins {gap:.1f} m behind {before.name}; {TURNOUT_GAP:.0f} m are needed (RAA)."
                yield Finding(after.name, _place(road, after.turnout), gap, TURNOUT_GAP, text)


def _interchange(road: Road) -> Iterator[Finding]:
    least = INTERCHANGE_SPACING[road.design_class]
    for side in road.sides.values():
        for kind in ("exit", "entry"):
            alike = [item for item in side.turnouts if item.turnout.kind == kind]
            for before, after in pairwise(sorted(alike, key=_start)):
                spacing = after.turnout.start_station - before.turnout.start_station
                if below(spacing, least):
                    text = f"The {kind} lies {spacing:.0f} m behind {before.name}; {least:.0f} m are needed (RAA)."
                    yield Finding(after.name, _place(road, after.turnout), spacing, least, text)


def _range(road: Road) -> Iterator[Finding]:
    for name, turnout in road.of(Turnout).items():
        start, end = turnout.start_station, turnout.end_station
        if start < -SAME_STATION:
            text = f"The {_NAMES[turnout.kind]} begins at {start:.3f} m, before the road."
            yield Finding(name, start, start, 0.0, text)
        elif above(end, road.length):
            text = f"The {_NAMES[turnout.kind]} ends at {end:.3f} m; the road ends at {road.length:.3f} m."
            yield Finding(name, end, end, road.length, text)


def _lane_change(road: Road) -> Iterator[Finding]:
    for side in road.sides.values():
        if not side.turnouts:
            continue
        for lane, begin, end in lane_tapers(road, side):
            for item in side.turnouts:
                low, high = max(begin, item.turnout.start_station), min(end, item.turnout.end_station)
                if high > low + SAME_STATION:
                    kind = _NAMES[item.turnout.kind]
                    text = f"Lane {lane + 1} begins or ends beside the {kind} for {high - low:.1f} m."
                    yield Finding(item.name, low, high - low, 0.0, text)


RULES = (
    Rule("turnout-lane-length", "Length of exits' and entries' lanes", "m", "RAA", "unconfirmed", _lane_length),
    Rule("turnout-lane-width", "Width of exits' and entries' lanes", "m", "RAA", "unconfirmed", _lane_width),
    Rule("turnout-taper", "Length of turnouts' tapers", "m", "RAA", "unconfirmed", _taper),
    Rule("bay-width", "Width of emergency bays", "m", "RAA", "confirmed", _bay_width),
    Rule("bay-length", "Length of emergency bays", "m", "RAA", "unconfirmed", _bay_length),
    Rule("ramp-nose", "Ramps reach their nose", "m", "", "definition", _nose),
    Rule("turnout-gap", "Distance between turnouts", "m", "RAA", "unconfirmed", _gap),
    Rule("interchange-spacing", "Distance between exits, or entries", "m", "RAA", "confirmed", _interchange),
    Rule("turnout-range", "Turnouts lie on the road's length", "m", "", "definition", _range),
    Rule("turnout-lane-change", "No lane begins or ends beside a turnout", "m", "", "definition", _lane_change),
)
