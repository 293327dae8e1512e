"""Everything that stands on and beside a road that is being sampled: by the safety rules, or at random.

What needs much room, or has its station by a rule, is planned first: it reserves stretches of the road, and asks for
barriers. Then the barriers are built, and then what stands behind them, which so finds its distance from the road.
"""

from collections.abc import Iterator

import numpy as np

from ...road.objects import RoadObject
from ...road.things.delineator import Delineator
from .barriers import median_barriers, plan_noise_barrier, roadside_barriers
from .construction import construction_zones
from .country.avenues import plan_avenues
from .country.entrances import field_entrances
from .country.mouth_signs import mouth_signs, plan_priority_signs
from .delineators import delineator_stations, delineators
from .drainage import gutters
from .equipment import plan_periodic, plan_traffic_lights
from .layout import Layout
from .random import plan_random_equipment, plan_random_signs, random_front, random_median_barrier
from .registry import small_things
from .signs import median_signs, plan_exit_signs, plan_gore_signs, plan_other_signs
from .site import PlacementSite
from .structures import GantryPlan, OverpassPlan, gantries, overpass, plan_gantries, plan_overpass

Streams = dict[str, np.random.Generator]
"""The random numbers of each family of furniture."""
_FAMILIES = ("signs", "equipment", "structures", "barriers")


def place_furniture(site: PlacementSite) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of all furniture; every object has the instance number 1."""
    layout, streams = Layout(site), {name: site.stream("furniture", name) for name in _FAMILIES}
    by_rules = site.scenario.placement == "rules"
    if by_rules:
        _plan_fixed(layout, streams)
    bridge = plan_overpass(layout, streams["structures"])
    gantry_plans = plan_gantries(layout, streams["structures"])
    zones, zone_objects = construction_zones(layout, streams["structures"])
    yield from zone_objects.items()
    for side, roadside in layout.sides.items():
        noise_barrier = plan_noise_barrier(layout, roadside, streams["barriers"])
        if noise_barrier:
            yield f"noise-barrier-{side}", noise_barrier
    if by_rules and site.scenario.furniture.signs:
        plan_other_signs(layout, streams["signs"], zones)
    elif site.scenario.furniture.signs:
        plan_random_signs(layout, streams["signs"])
    if by_rules:
        plan_traffic_lights(layout, streams["equipment"])
    else:
        plan_random_equipment(layout, streams["equipment"])
    for item in small_things():
        if item.stream not in streams:
            streams[item.stream] = site.stream("furniture", item.stream)
        item.plan(layout, streams[item.stream])
    plan_priority_signs(layout)
    rows = plan_avenues(layout)
    yield from _barriers_by_rules(layout, streams) if by_rules else _barriers_at_random(layout, streams)
    for row in rows:
        yield from row.trees()
    yield from _objects_behind_barriers(layout, streams, gantry_plans, bridge)
    yield from mouth_signs(layout)


def _plan_fixed(layout: Layout, streams: Streams) -> None:
    """Place what has its station by a rule: gore signs, kilometre boards, phones, exit signs."""
    signs = layout.site.scenario.furniture.signs
    if signs:
        plan_gore_signs(layout)
    plan_periodic(layout, streams["equipment"])
    if signs:
        plan_exit_signs(layout, streams["signs"])


def _barriers_by_rules(layout: Layout, streams: Streams) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of barriers and delineators by the safety rules."""
    yield from median_barriers(layout, streams["barriers"])
    for roadside in layout.sides.values():
        yield from roadside_barriers(layout, roadside, streams["barriers"])
    for roadside in layout.sides.values():
        yield from field_entrances(layout, roadside, ())
    if layout.site.scenario.furniture.delineators:
        stations = delineator_stations(layout.site.alignment.horizontal)
        for roadside in layout.sides.values():
            yield from delineators(roadside, stations)


def _barriers_at_random(layout: Layout, streams: Streams) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of barriers and delineators at random."""
    yield from random_median_barrier(layout, streams["barriers"])
    for roadside in layout.sides.values():
        front = list(random_front(layout, roadside, streams["barriers"]))
        yield from front
        yield from field_entrances(
            layout, roadside, [item.station for _, item in front if isinstance(item, Delineator)]
        )


def _objects_behind_barriers(
    layout: Layout, streams: Streams, gantry_plans: list[GantryPlan], overpass_plan: OverpassPlan | None
) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of what stands behind the barriers: requests, median signs, gantries, overpass."""
    for roadside in layout.sides.values():
        yield from roadside.objects()
    yield from median_signs(layout)
    yield from gutters(layout)
    yield from gantries(layout, gantry_plans, streams["structures"])
    if overpass_plan and layout.site.interchange is None:
        yield "overpass", overpass(layout, overpass_plan, streams["structures"])
