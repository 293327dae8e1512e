"""Rules for turnouts (RAA): exits, entries and emergency bays."""

from collections.abc import Iterable, Iterator
from itertools import pairwise, product

from ...road.guidelines import (
    EMERGENCY_BAY_LENGTH,
    EMERGENCY_BAY_TAPER,
    EMERGENCY_BAY_WIDTH,
    TURNOUT_GAP,
    TURNOUT_LANE_WIDTH,
    TURNOUT_TAPER,
)
from ...road.section import Turnout
from .edges import NOSE_BEFORE_END, TurnoutEdges
from .rule import SAME_STATION, Finding, Road, Rule, above, at_least
from .section import lane_tapers

_NAMES = {"emergency_bay": "emergency bay", "bus_bay": "bus bay", "layby": "layby", "exit": "exit", "entry": "entry"}


def _clip_to_road(road: Road, station: float) -> float:
    """Return a station (m) moved to the nearer end of the road if it lies beyond it."""
    return min(max(station, 0.0), road.length)


def _find_small(road: Road, of_bays: bool, field: str, least_value: float, text: str) -> Iterator[Finding]:
    """Yield findings for bays, or for exits and entries, with a length or width below the least (m)."""
    for name, turnout in road.of(Turnout).items():
        if turnout.kind == "emergency_bay" if of_bays else turnout.ramp is not None:
            value = getattr(turnout, field)
            sentence = text.format(kind=_NAMES[turnout.kind], value=value, least=least_value)
            yield from at_least(name, _clip_to_road(road, turnout.start_station), value, least_value, sentence)


def _lane_length(road: Road) -> Iterator[Finding]:
    """Return an iterator over findings for exits and entries with too short a lane."""
    text = "The {kind}'s lane is {value:.1f} m long; {least:.0f} m are needed (RAA)."
    return _find_small(road, False, "lane_length", road.limits.turnout_lane_length, text)


def _lane_width(road: Road) -> Iterator[Finding]:
    """Return an iterator over findings for exits and entries with too narrow a lane."""
    text = "The {kind}'s lane is {value:.2f} m wide; {least} m are needed (RAA)."
    return _find_small(road, False, "lane_width", TURNOUT_LANE_WIDTH, text)


def _bay_width(road: Road) -> Iterator[Finding]:
    """Return an iterator over findings for emergency bays that are too narrow."""
    text = "The {kind} is {value:.2f} m wide; {least} m are needed (RAA)."
    return _find_small(road, True, "lane_width", EMERGENCY_BAY_WIDTH, text)


def _bay_length(road: Road) -> Iterator[Finding]:
    """Return an iterator over findings for emergency bays that are too short."""
    text = "The {kind} is {value:.1f} m long; {least:.0f} m are needed (RAA)."
    return _find_small(road, True, "lane_length", EMERGENCY_BAY_LENGTH, text)


def _taper(road: Road) -> Iterator[Finding]:
    """Yield a finding for each turnout with too short a taper."""
    for name, turnout in road.of(Turnout).items():
        if turnout.kind in ("bus_bay", "layby"):
            continue
        least_length = TURNOUT_TAPER if turnout.ramp else EMERGENCY_BAY_TAPER
        shortest_taper = min(taper for taper in (turnout.taper_in_length, turnout.taper_out_length) if taper > 0.0)
        text = (
            f"The {_NAMES[turnout.kind]}'s taper is {shortest_taper:.1f} m long; {least_length:.0f} m are needed (RAA)."
        )
        yield from at_least(name, _clip_to_road(road, turnout.start_station), shortest_taper, least_length, text)


def _nose(road: Road) -> Iterator[Finding]:
    """Yield a finding for each ramp that ends before, or hardly behind, its nose."""
    for _, edges in road.turnouts:
        if ramp := edges.turnout.ramp:
            needed_length = edges.natural_nose + NOSE_BEFORE_END
            text = f"The ramp is {ramp.length:.1f} m long; {needed_length:.1f} m are needed to reach its nose."
            yield from at_least(
                edges.name, _clip_to_road(road, edges.station(edges.tip)), ramp.length, needed_length, text
            )


def _consecutive(turnouts: Iterable[TurnoutEdges]) -> Iterator[tuple[TurnoutEdges, TurnoutEdges]]:
    """Return an iterator over the pairs of turnouts that follow one another, by station."""
    return pairwise(sorted(turnouts, key=lambda item: item.turnout.start_station))


def _gap(road: Road) -> Iterator[Finding]:
    """Yield a finding for each turnout that begins too near behind another one of its carriageway."""
    for side in road.sides.values():
        for earlier, later in _consecutive(side.turnouts):
            begin = later.turnout.start_station
            gap = begin - earlier.turnout.end_station
            text = f"The turnout begins {gap:.1f} m behind {earlier.name}; {TURNOUT_GAP:.0f} m are needed (RAA)."
            yield from at_least(later.name, _clip_to_road(road, begin), gap, TURNOUT_GAP, text)


def _interchange(road: Road) -> Iterator[Finding]:
    """Yield a finding for each exit, or entry, too near behind another one of its carriageway."""
    least_spacing = road.limits.interchange_spacing
    for side, kind in product(road.sides.values(), ("exit", "entry")):
        for earlier, later in _consecutive(item for item in side.turnouts if item.turnout.kind == kind):
            begin = later.turnout.start_station
            spacing = begin - earlier.turnout.start_station
            text = f"The {kind} lies {spacing:.0f} m behind {earlier.name}; {least_spacing:.0f} m are needed (RAA)."
            yield from at_least(later.name, _clip_to_road(road, begin), spacing, least_spacing, text)


def _range(road: Road) -> Iterator[Finding]:
    """Yield a finding for each turnout that begins before the road or ends behind it."""
    for name, turnout in road.of(Turnout).items():
        start, end = turnout.start_station, turnout.end_station
        if start < -SAME_STATION:
            text = f"The {_NAMES[turnout.kind]} begins at {start:.3f} m, before the road."
            yield Finding(name, start, start, 0.0, text)
        elif above(end, road.length):
            text = f"The {_NAMES[turnout.kind]} ends at {end:.3f} m; the road ends at {road.length:.3f} m."
            yield Finding(name, end, end, road.length, text)


def _lane_change(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch along which a lane begins or ends beside a turnout."""
    for side, item in road.turnouts:
        for lane, begin, end in lane_tapers(road, side):
            overlap_start, overlap_end = max(begin, item.turnout.start_station), min(end, item.turnout.end_station)
            if overlap_end > overlap_start + SAME_STATION:
                kind = _NAMES[item.turnout.kind]
                text = f"Lane {lane + 1} begins or ends beside the {kind} for {overlap_end - overlap_start:.1f} m."
                yield Finding(item.name, overlap_start, overlap_end - overlap_start, 0.0, text)


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
