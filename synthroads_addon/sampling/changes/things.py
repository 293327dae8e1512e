"""Changes of things on and beside the road between two epochs: added, moved, hit, grown, cut, parked, set up."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from ...base.schema import round_value
from ...road.changes.change import Edit
from ...road.guidelines import CONSTRUCTION_LANE_WIDTH
from ...road.section import LineMarking
from ...road.surroundings import Vegetation
from ...road.things.beacon import ConstructionBeacon
from ...road.things.deformation import Dent
from ...road.things.delineator import Delineator
from ...road.things.guardrail import Guardrail
from ...road.things.hedge import Hedge
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.parked_vehicle import ParkedVehicle
from ...road.things.sign import TrafficSign
from ...road.things.temporary_barrier import TemporaryBarrier
from ...road.things.thing import StandingThing
from ...road.things.tree import Tree
from ...road.things.vehicles import VEHICLE_TYPES
from ..placing.construction import SHORTEST_ALONG, TAPER_OUT, TAPERS_IN, Zone, zone_equipment
from .drawing import DIGITS, Epoch

_POSTS = (Delineator, TrafficSign)
_ROOM = 4.0
"""Distance along the road, m, that something new keeps from what stands there; chosen."""
_DENT_LENGTHS = (2.0, 6.0)
"""Lengths of dents in rails, m; chosen."""
_FROM_ENDS = 14.0
"""Distance of dents from a rail's ends, m: behind its terminals of 12 m and half a short dent."""
_TALLEST = {"Vegetation": 60.0, "Tree": 50.0, "Hedge": 8.0}
"""Largest heights that the set allows, m."""
_PARKED = ("car", "estate", "van", "truck")
_FROM_LINE = 0.3
"""Distance of a parked vehicle from its edge line, m; chosen."""
_WIDEST_TURN = 2
_COLOURS = ((0.02, 0.02, 0.02), (0.6, 0.6, 0.62), (0.35, 0.02, 0.02), (0.03, 0.08, 0.3))
"""Paint of parked vehicles; chosen."""


def draw_added(epoch: Epoch) -> None:
    """Add posts and signs: each like one that is there, at another station."""
    models = [name for name, item in epoch.before.objects.items() if isinstance(item, _POSTS)]
    for _ in range(epoch.count(epoch.limits.things_per_km, epoch.limits.years)):
        if not models:
            return
        model: Any = epoch.before.objects[models[int(epoch.rng.random() * len(models))]]
        station = _free_station(epoch, model)
        if station is None:
            continue
        name = "delineator" if isinstance(model, Delineator) else "sign"
        epoch.note("added", [epoch.add_thing(f"{name}-new", model.model_copy(update={"station": station}))])


def _free_station(epoch: Epoch, model: StandingThing) -> float | None:
    """Return a drawn station (m) at which nothing stands on a thing's side of the road; None without room."""
    places = [
        item["station"]
        for item in epoch.objects.values()
        if "station" in item and item.get("offset", 0.0) * model.offset > 0.0
    ]
    ends = sorted({0.0, epoch.length, *places})
    gaps = [(a + _ROOM, b - _ROOM) for a, b in pairwise(ends) if b - a > 2.0 * _ROOM]
    if not gaps:
        return None
    start, end = gaps[int(epoch.rng.random() * len(gaps))]
    return round_value(start + epoch.rng.random() * (end - start), DIGITS)


def draw_removed(epoch: Epoch) -> None:
    """Take posts and signs away."""
    for _ in range(epoch.count(epoch.limits.things_per_km, epoch.limits.years)):
        if (name := epoch.choose(_POSTS)) is not None:
            epoch.note("removed", [epoch.remove_thing(name)])


def draw_moved(epoch: Epoch) -> None:
    """Move posts and signs along the road and away from it."""
    for _ in range(epoch.count(epoch.limits.things_per_km, epoch.limits.years)):
        distance, angle = epoch.value(epoch.limits.move_distance), 2.0 * math.pi * epoch.rng.random()
        name = epoch.choose(_POSTS)
        if name is None or distance <= 0.0:
            continue
        item: Any = epoch.before.objects[name]
        # Never towards the traffic.
        outward = math.copysign(abs(math.sin(angle)), item.offset) * distance
        station = round_value(min(max(item.station + distance * math.cos(angle), 0.0), epoch.length), DIGITS)
        edits = [epoch.field(name, "offset", round_value(item.offset + outward, DIGITS))]
        if station != item.station:
            edits.append(epoch.field(name, "station", station))
        epoch.note("moved", [edit for edit in edits if edit.before != edit.after])


def draw_hits(epoch: Epoch) -> None:
    """Hit things: bend rails, let posts lean, turn signs, and break panels out of noise barriers."""
    limits = epoch.limits
    for _ in range(epoch.count(limits.hits_per_km, limits.years)):
        _bend(epoch)
    for _ in range(epoch.count(limits.hits_per_km, limits.years)):
        turn = epoch.value(limits.turn_deg) * (1.0 if epoch.sometimes(0.5) else -1.0)
        name = epoch.choose(TrafficSign)
        if name is not None:
            rotation = epoch.objects[name].get("rotation_deg", 0.0)
            turned = round_value(math.remainder(rotation + turn, 360.0), DIGITS)
            epoch.note("damaged", [epoch.field(name, "rotation_deg", turned)], "turned")
    for _ in range(epoch.count(limits.hits_per_km, limits.years)):
        lean, direction = epoch.value(limits.lean_deg), round_value(360.0 * epoch.rng.random() - 180.0, 1)
        name = epoch.choose(_POSTS)
        if name is not None and getattr(epoch.before.objects[name], "lean_deg", None) is None:
            edits = [epoch.field(name, "lean_deg", lean), epoch.field(name, "lean_direction_deg", direction)]
            epoch.note("damaged", edits, "leaning")
    for _ in range(epoch.count(limits.hits_per_km, limits.years)):
        _break_panel(epoch)


def _bend(epoch: Epoch) -> None:
    """Bend a rail that is long enough, away from its beam."""
    long_rails = [
        name
        for name, rail in epoch.before.of_type(Guardrail).items()
        if min(rail.end_station, epoch.length) - max(rail.start_station, 0.0) > 2.0 * _FROM_ENDS and not rail.dents
    ]
    length = round_value(_DENT_LENGTHS[0] + epoch.rng.random() * (_DENT_LENGTHS[1] - _DENT_LENGTHS[0]), DIGITS)
    depth, place = epoch.value(epoch.limits.dent_depth), epoch.rng.random()
    name = epoch.choose(Guardrail, long_rails)
    if name is None or depth <= 0.0:
        return
    rail: Any = epoch.before.objects[name]
    start, end = max(rail.start_station, 0.0) + _FROM_ENDS, min(rail.end_station, epoch.length) - _FROM_ENDS
    station = round_value(start + place * (end - start), DIGITS)
    side = 1.0 if rail.faces == "right" else -1.0
    dent = Dent(station=station, length=length, depth=round_value(side * depth, DIGITS))
    epoch.note("damaged", [_first_dent(name, dent)], "bent")


def _first_dent(name: str, dent: Dent) -> Edit:
    """Return the edit that gives a rail its first dent."""
    return Edit(thing=name, path="dents.0", after=dent.to_dict())


def _break_panel(epoch: Epoch) -> None:
    """Break one panel out of a noise barrier."""
    share = epoch.rng.random()
    name = epoch.choose(NoiseBarrier)
    if name is None:
        return
    wall: Any = epoch.before.objects[name]
    bays = len(wall.element_ends(wall.post_spacing, epoch.length))
    bay = int(share * bays)
    if bay not in (wall.missing_panels or ()):
        panels = sorted([*(wall.missing_panels or ()), bay])
        epoch.note("damaged", [epoch.field(name, "missing_panels", panels)], "panel_missing")


def draw_growth(epoch: Epoch) -> None:
    """Let trees, shrubs and hedges grow, each stand by a height of its own."""
    for name, item in epoch.before.objects.items():
        is_plant = (isinstance(item, Vegetation) and item.kind != "grass") or isinstance(item, Tree)
        if not is_plant or epoch.is_used(name):
            continue
        growth = epoch.value(epoch.limits.growth, epoch.limits.years)
        _set_heights(epoch, "grown", name, lambda height, growth=growth: height + growth)


def draw_cutting(epoch: Epoch) -> None:
    """Cut stands of shrubs and hedges back, with a probability."""
    for name, item in epoch.before.objects.items():
        is_shrub = (isinstance(item, Vegetation) and item.kind == "shrub") or isinstance(item, Hedge)
        if not is_shrub or epoch.is_used(name) or not epoch.sometimes(epoch.limits.cut_back):
            continue
        share = epoch.value(epoch.limits.cut_height)
        _set_heights(epoch, "cut_back", name, lambda height, share=share: max(height * share, 0.3))


def _set_heights(epoch: Epoch, kind: Any, name: str, change: Any) -> None:
    """Give plants other heights, by a function of the former ones (m), and note it as a change of a kind."""
    data = epoch.objects[name]
    edits = []
    for field in ("height", "height_min", "height_max"):
        if field in data:
            height = round_value(min(change(data[field]), _TALLEST[data["type"]]), DIGITS)
            has_changed = height > data[field] if kind == "grown" else height < data[field]
            edits += [epoch.field(name, field, height)] if has_changed else []
    if edits:
        epoch.use(name)
        epoch.note(kind, edits)


def draw_parked(epoch: Epoch) -> None:
    """Park vehicles on hard shoulders, and let those that stood there go."""
    for name in list(epoch.before.of_type(ParkedVehicle)):
        if epoch.sometimes(0.5) and epoch.choose(ParkedVehicle, [name]):
            epoch.note("parked", [epoch.remove_thing(name)])
    for owner, item in epoch.carriageways().items():
        section = epoch.geometry.sections[item.side]
        if "hard_shoulder" not in section.kinds:
            continue
        for _ in range(epoch.count(epoch.limits.parked_per_km)):
            model = _PARKED[int(epoch.rng.random() * len(_PARKED))]
            kind, color = VEHICLE_TYPES[model], _COLOURS[int(epoch.rng.random() * len(_COLOURS))]
            start = epoch.stretch(f"shoulder {owner}", kind.length + 2.0, 1.0, epoch.length - 1.0)
            if start is None:
                continue
            station = round_value(start + kind.length / 2.0 + 1.0, DIGITS)
            number = section.kinds.index("hard_shoulder")
            inner, outer = section.distances(station)[0, number : number + 2].tolist()
            if outer - inner < kind.width + _FROM_LINE:
                continue
            offset = round_value(item.sign * (inner + _FROM_LINE + kind.width / 2.0), DIGITS)
            rotation = 0.0 if item.traffic > 0 else 180.0
            vehicle = ParkedVehicle(
                instance=1, station=station, offset=offset, rotation_deg=rotation, model=model, color=color
            )
            epoch.note("parked", [epoch.add_thing("parked-new", vehicle)])


def draw_zones(epoch: Epoch) -> None:
    """Set construction zones up, with a probability; take those away that are there."""
    standing = [
        name
        for name, item in epoch.before.objects.items()
        if isinstance(item, ConstructionBeacon | TemporaryBarrier)
        or (isinstance(item, LineMarking) and item.color == "yellow")
    ]
    if standing:
        epoch.note("construction_zone", [epoch.remove_thing(name) for name in standing], "taken_away")
        return
    edits: list[Edit] = []
    for owner, item in epoch.carriageways().items():
        if not epoch.sometimes(epoch.limits.construction_zones) or edits:
            continue
        section = epoch.geometry.sections[item.side]
        length = round_value(min(TAPERS_IN[0] + SHORTEST_ALONG + TAPER_OUT + 100.0 * epoch.rng.random(), epoch.length))
        start = epoch.stretch(f"zone {owner}", length)
        if start is None or section.constant_distances is None or length < TAPERS_IN[0] + SHORTEST_ALONG + TAPER_OUT:
            continue
        boundaries = section.lane_boundaries(start)[0].tolist()
        if len(boundaries) < 1 + _WIDEST_TURN or boundaries[1] - boundaries[2] < CONSTRUCTION_LANE_WIDTH:
            continue
        tapers = (TAPERS_IN[0], TAPER_OUT) if item.traffic > 0 else (TAPER_OUT, TAPERS_IN[0])
        stations = (start, start + tapers[0], start + length - tapers[1], start + length)
        edge = float(section.distances(start)[0, section.kinds.index("verge")])
        zone = Zone(stations, boundaries[1], edge)
        facing = 0.0 if item.traffic > 0 else 180.0
        edits += [epoch.add_thing(name, thing) for name, thing in zone_equipment(item.side, facing, zone, 0.003)]
    if edits:
        epoch.note("construction_zone", edits, "set_up")
