"""One exit, entry or emergency bay more on a road that is there, changed, or deleted, with all that belongs to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.random_streams import stream
from ...road.guidelines import EXIT_SEQUENCE, EXIT_SIGN_ROOM, GORE_SIGN, is_single
from ...road.objects import RoadObject, Side
from ...road.parameters import RoadParameters
from ...road.section import Carriageway, Turnout
from ...road.things.beacon import ConstructionBeacon
from ...road.things.overpass import Overpass
from ...road.things.sign import TrafficSign
from ...road.things.temporary_barrier import TemporaryBarrier
from ...scenario.road import StatedTurnout, TurnoutLimits
from ..placing.construction import TURNOUT_ROOM
from ..placing.layout import Layout
from ..placing.signs import TABLE_BEHIND_ENTRY, plan_gore_sign, plan_signs_before_exit, plan_signs_behind_entry
from ..placing.site import PlacementSite
from ..placing.structures import ABUTMENT_DISTANCE
from ..section import lay_ramp, stated_turnout
from .paint import with_markings, without_markings
from .roadside import Furnishing
from .room import NAMES, guideline_reasons, ramp_reasons, room_reasons
from .site import carriageway_ids, free_ids, furnished_layout, ramp_limits, scenario_of, site_of

_LIMITS = TurnoutLimits()
"""Sizes of turnouts where none are given: those of a scenario."""
_TABLE = "453"
"""Sign behind an entry: the table of distances."""
_REACH_OF_SIGNS = 30.0
"""So far from where it belongs, m, a table behind an entry is the entry's. Chosen: it is put up to 20 m away."""


class ChangedRoad(NamedTuple):
    """A road after an exit, entry or bay was placed, changed or deleted.

    Attributes:
        parameters: the road.
        name: id of the turnout.
        notes: sentences on what moved, was opened or left out, and on what the user is to add.
    """

    parameters: RoadParameters
    name: str
    notes: tuple[str, ...]


def with_turnout(
    parameters: RoadParameters, place: StatedTurnout, limits: TurnoutLimits = _LIMITS, name: str = ""
) -> ChangedRoad:
    """Return a road with one more exit, entry or emergency bay, with its markings, signs, and what makes way for it.

    Args:
        parameters: the road.
        place: kind, side, station, and the sizes that are to differ from the least of limits and guidelines.
        limits: of the sizes.
        name: its id; the next free one of its kind if empty.

    Raises:
        InputError: it doesn't fit there; one line names the reason and what helps.

    Example:
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario, StatedTurnout
        >>> none = {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}
        >>> road = sample_road(RoadScenario(length=900.0, turnouts=none), seed=7)
        >>> with_turnout(road, StatedTurnout(kind="exit", station=300.0)).name
        'exit-right'
    """
    side = place.side
    carriageways = carriageway_ids(parameters)
    if is_single(parameters.design_class) or side not in carriageways:
        what = parameters.design_class if side in carriageways else f"the {side} side"
        raise InputError("Exit or Bay", None, f"{what} has no carriageway with exits and bays: they are for motorways")
    carriageway = parameters.objects[carriageways[side]]
    assert isinstance(carriageway, Carriageway)
    scenario = scenario_of(parameters, limits)
    ramps = ramp_limits(parameters, scenario, carriageway)
    name = name or free_ids(parameters.objects, f"{place.kind.replace('_', '-')}-{side}")
    turnout = stated_turnout(scenario, ramps, place).model_copy(update={"carriageway": carriageways[side]})
    turnout = lay_ramp(limits, turnout, carriageway, stream(parameters.metadata.seed or 0, "ramp surface", name))
    known = parameters.of_type(Turnout)
    before = site_of(parameters, scenario, known)
    now = site_of(parameters, scenario, known | {name: turnout})
    others = {key: item for key, item in known.items() if item.carriageway == carriageways[side]}
    reasons = [*room_reasons(turnout, carriageway.traffic, before.length, others), *ramp_reasons(turnout.ramp, ramps)]
    if turnout.ramp is None and not ramps.room_for_bay:
        reasons.append("the terrain has no room for a bay: make it wider (half_width)")
    reasons += _obstacles(parameters, now, side, now.turnouts[name])
    if reasons:
        raise InputError("Station", place.station, reasons[0])
    widened = _replaced(parameters, _behind_turnouts(parameters, name, turnout))
    objects = with_markings(widened, now, side, name, now.turnouts[name])
    layout = furnished_layout(parameters, now, side)
    missing = _plan_signs(layout, side, now.turnouts[name], name)
    work = Furnishing(
        furnished_layout(parameters, before, side), layout, side, _stretch(now, name), name, NAMES[place.kind]
    )
    objects = work.follow(objects)
    notes = (
        *guideline_reasons(turnout, parameters.design_class, others),
        *missing,
        *_advice(turnout, carriageway),
        *work.notes,
    )
    return ChangedRoad(_numbered(parameters, objects), name, notes)


def without_turnout(parameters: RoadParameters, name: str) -> ChangedRoad:
    """Return a road without one of its exits, entries or bays, its ramp, markings and signs; the edge closes behind it.

    Args:
        parameters: the road.
        name: id of the turnout.

    Raises:
        InputError: the road has no such turnout.
    """
    known = parameters.of_type(Turnout)
    if name not in known:
        raise InputError("Exit or Bay", name, f"must be one of {', '.join(known)}" if known else "the road has none")
    turnout = known[name]
    side = next(key for key, value in carriageway_ids(parameters).items() if value == turnout.carriageway)
    scenario = scenario_of(parameters, _LIMITS)
    before = site_of(parameters, scenario, known)
    now = site_of(parameters, scenario, {key: item for key, item in known.items() if key != name})
    objects = without_markings(parameters, before, side, name, before.turnouts[name])
    objects = {key: item for key, item in objects.items() if key != name}
    for key in _own_things(parameters, before, side, name):
        objects.pop(key, None)
    rest = _replaced(parameters, objects)
    work = Furnishing(
        furnished_layout(parameters, before, side),
        furnished_layout(rest, now, side),
        side,
        _stretch(before, name),
        name,
        NAMES[turnout.kind],
    )
    return ChangedRoad(_numbered(parameters, work.follow(objects)), name, tuple(work.notes))


def with_changed_turnout(
    parameters: RoadParameters, name: str, place: StatedTurnout, limits: TurnoutLimits = _LIMITS
) -> ChangedRoad:
    """Return a road with one of its exits, entries or bays elsewhere or with other sizes; its signs keep their texts.

    Args:
        parameters: the road.
        name: id of the turnout.
        place: what it is to be.
        limits: of sizes that the place doesn't state.

    Raises:
        InputError: the road has no such turnout, or it doesn't fit there; the road is as it was.
    """
    signs = parameters.of_type(TrafficSign)
    rest, _, notes = without_turnout(parameters, name)
    texts = {item.code: item.text for key, item in signs.items() if key not in rest.objects}
    changed = with_turnout(rest, place, limits, name)
    numbers = {key: item.instance for key, item in parameters.objects.items()}
    objects: dict[str, RoadObject] = {}
    for key, item in changed.parameters.objects.items():
        update: dict[str, Any] = {"instance": numbers[key]} if key in numbers else {}
        if key not in rest.objects and isinstance(item, TrafficSign):
            text = texts.get(item.code, ())
            update |= {"text": text} if len(text) == len(item.text) else {}
        objects[key] = item.model_copy(update=update) if update else item
    return ChangedRoad(_numbered(parameters, objects), name, (*notes, *changed.notes))


def place_of(parameters: RoadParameters, name: str) -> StatedTurnout:
    """Return one of a road's turnouts as it would be stated, with all of its sizes.

    Raises:
        InputError: the road has no such turnout.
    """
    turnout = parameters.of_type(Turnout).get(name)
    if turnout is None:
        raise InputError("Exit or Bay", name, "must be the id of an exit, entry or bay of the road")
    side = next(key for key, value in carriageway_ids(parameters).items() if value == turnout.carriageway)
    sizes: dict[str, Any] = {
        "taper_length": turnout.taper_in_length or turnout.taper_out_length,
        "lane_length": turnout.lane_length,
        "lane_width": turnout.lane_width,
    }
    if turnout.ramp is not None:
        sizes |= {"ramp_length": turnout.ramp.length, "ramp_clothoid": turnout.ramp.clothoid_parameter}
    return StatedTurnout(kind=turnout.kind, side=side, station=max(turnout.start_station, 0.0), **sizes)


def _behind_turnouts(parameters: RoadParameters, name: str, turnout: Turnout) -> dict[str, RoadObject]:
    """Return a road's objects with one more turnout behind its other ones, or its carriageways."""
    objects = dict(parameters.objects)
    last = max(number for number, item in enumerate(objects.values()) if isinstance(item, Turnout | Carriageway))
    items = list(objects.items())
    return dict([*items[: last + 1], (name, turnout), *items[last + 1 :]])


def _stretch(site: PlacementSite, name: str) -> tuple[float, float]:
    """Return the stations (m) between which a turnout changes its carriageway's edge."""
    return site.shape(site.turnouts[name]).range()


def _obstacles(parameters: RoadParameters, site: PlacementSite, side: Side, turnout: Turnout) -> Iterator[str]:
    """Yield what stands in the way of a turnout and can't be moved: zones, lanes that begin or end, bridges."""
    start, end = site.shape(turnout).range()
    section = site.sections[side]
    sign = section.carriageway.sign
    zone = [
        item
        for item in parameters.objects.values()
        if isinstance(item, ConstructionBeacon | TemporaryBarrier) and sign * item.offset > 0.0
    ]
    marks = [
        float(getattr(item, field))
        for item in zone
        for field in ("station", "start_station", "end_station")
        if hasattr(item, field)
    ]
    if marks and min(marks) - TURNOUT_ROOM < end and max(marks) + TURNOUT_ROOM > start:
        yield (
            f"a construction zone lies from {min(marks):.0f} to {max(marks):.0f} m: choose a station farther than "
            f"{TURNOUT_ROOM:.0f} m from it, or delete its beacons"
        )
    for number, lane in enumerate(section.carriageway.lanes, 1):
        if isinstance(lane.width, tuple):
            for first, second in zip(lane.width, lane.width[1:], strict=False):
                if (
                    first.width != second.width
                    and first.station < turnout.end_station
                    and second.station > turnout.start_station
                ):
                    yield (
                        f"lane {number} begins or ends from {first.station:.0f} to {second.station:.0f} m: choose a "
                        "station beside which no lane does"
                    )
    for name, bridge in parameters.of_type(Overpass).items():
        blocks = list(bridge.footprint())
        low, high = min(block.start for block in blocks), max(block.end for block in blocks)
        if low > end or high < start:
            continue
        abutment = bridge.left_abutment if side == "left" else -bridge.right_abutment
        edge = float(section.road_edge(np.linspace(max(low, start), min(high, end), 9)).max())
        if edge + ABUTMENT_DISTANCE > abutment:
            yield f"{name} crosses the road at station {bridge.station:.0f} m: choose another station, or move it"


def _plan_signs(layout: Layout, side: Side, turnout: Turnout, name: str) -> list[str]:
    """Plan the signs that belong to one turnout by the rules: before and in the gore of an exit, behind an entry.

    Returns:
        sentences on the signs that have no room where they belong.
    """
    roadside, rng = layout.sides[side], layout.site.stream("placed turnout", name)
    if turnout.kind == "exit":
        plan_gore_sign(layout, roadside, turnout)
        plan_signs_before_exit(layout, roadside, turnout, rng)
    elif turnout.kind == "entry":
        plan_signs_behind_entry(layout, roadside, turnout, None, rng)
    else:
        return []
    there = {str(request.fields["code"]): request.station for request in roadside.requests}
    begin = layout.site.begin(turnout)
    places = {_TABLE: roadside.ahead(begin, turnout.length + TABLE_BEHIND_ENTRY)}
    if turnout.kind == "exit":
        places = {code: roadside.ahead(begin, -distance) for distance, code in EXIT_SEQUENCE.items()}
    return [
        f"sign {code} has no room at station {station:.0f} m: add it by Add > SynthRoads > Traffic Sign"
        for code, station in places.items()
        if 0.0 <= station <= layout.length and code not in there
    ]


def _own_things(parameters: RoadParameters, site: PlacementSite, side: Side, name: str) -> Iterator[str]:
    """Yield the ids of the signs and barriers that stand there because of a turnout."""
    turnout, sign = site.turnouts[name], site.carriageways[side].sign
    traffic, begin = site.carriageways[side].traffic, site.begin(site.turnouts[name])
    shape = site.shape(turnout)
    shared = [site.begin(item) for item in site.turnouts_of_kind(side, "exit") if item is not turnout]
    for key, item in parameters.objects.items():
        if key.startswith((f"{name}-guardrail", f"{name}-concrete-barrier")):
            yield key
        if not isinstance(item, TrafficSign) or sign * item.offset < 0.0:
            continue
        code, ahead = item.code.split("-")[0], traffic * (begin - item.station)
        if turnout.kind == "exit":
            distance = next((key for key, known in EXIT_SEQUENCE.items() if known == item.code), None)
            is_announcement = distance is not None and abs(ahead - distance) <= EXIT_SIGN_ROOM + 1.0
            serves_others = distance is not None and any(
                abs(traffic * (other - item.station) - distance) <= EXIT_SIGN_ROOM + 1.0 for other in shared
            )
            nose, end = sorted((shape.nose_station(), shape.nose_station(turnout.ramp.length if turnout.ramp else 0.0)))
            if (is_announcement and not serves_others) or (code == GORE_SIGN and nose <= item.station <= end):
                yield key
        elif turnout.kind == "entry" and code == _TABLE:
            behind = -ahead - turnout.length - TABLE_BEHIND_ENTRY
            if abs(behind) <= _REACH_OF_SIGNS:
                yield key


def _advice(turnout: Turnout, carriageway: Carriageway) -> Iterator[str]:
    """Yield what a turnout has by the rules that isn't placed with it."""
    if turnout.kind == "emergency_bay":
        yield "no sign stands before the bay: add one by Add > SynthRoads > Traffic Sign"
    if turnout.ramp is not None and carriageway.hard_shoulder_width == 0.0:
        yield "the carriageway has no hard shoulder: the lane joins its edge strip"


def _replaced(parameters: RoadParameters, objects: Mapping[str, RoadObject]) -> RoadParameters:
    return parameters.model_copy(update={"objects": dict(objects)})


def _numbered(parameters: RoadParameters, objects: Mapping[str, RoadObject]) -> RoadParameters:
    """Return a road with other objects, those that are new with the next free instance numbers, checked as a whole."""
    last = max(item.instance for item in parameters.objects.values())
    numbered: dict[str, RoadObject] = {}
    for key, item in objects.items():
        known = parameters.objects.get(key)
        if known is not None and type(known) is type(item):
            numbered[key] = item.model_copy(update={"instance": known.instance})
        else:
            last += 1
            numbered[key] = item.model_copy(update={"instance": last})
    return RoadParameters.from_dict(_replaced(parameters, numbered).to_dict())
