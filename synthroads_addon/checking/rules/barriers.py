"""Rules for barriers (RPS): where they must stand, and how."""

import math
from collections.abc import Iterator
from itertools import islice, product
from typing import Any

import numpy as np

from ...road.guidelines import (
    BARRIER_DISTANCE,
    BARRIER_GAP,
    EMBANKMENT_HEIGHT,
    EMBANKMENT_RUN,
    OBSTACLE_LEAD,
    OBSTACLE_POST,
    OBSTACLE_TAIL,
    SHORTEST_BARRIER,
)
from ...road.surroundings import Vegetation
from ...road.things.noise_barrier import NoiseBarrier
from .edges import Edges
from .obstacles import Bool
from .rule import SAME_STATION, Finding, Road, Rule, above, at_least, below, gaps
from .side_roads import mouth_spans

#: Barriers of embankments may end so far before the corners of a side road's mouth, m.
BESIDE_MOUTH = 3.0
#: Beside a village, where the ground comes to the road's height, barriers of embankments may end so far before it, m.
LEVEL_BESIDE_VILLAGE = 5.0 + SAME_STATION


def _gaps(road: Road, edges: Edges, protecting: Bool, start: float, end: float) -> Iterator[tuple[float, float]]:
    """Yield the stretches (m) between two stations along which none of the barriers of a mask (B,) stands.

    None is asked for beside a ramp, which a barrier of one offset cannot follow, and in tunnels.
    """
    ramps = [turnout.ramp_span for turnout in edges.turnouts if turnout.turnout.ramp]
    return gaps(road.barriers.spans(protecting) + ramps + road.tunnels, start, end, BARRIER_GAP)


def _median_barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of a carriageway without a barrier that faces it in the median."""
    if len(road.sides) < 2 or road.single:
        return
    barriers = road.barriers
    middle_stations = 0.5 * barriers.start + 0.5 * barriers.end
    is_in_median = np.ones(len(barriers.offset), dtype=bool)
    for edges in road.sides.values():
        is_in_median &= edges.sign * barriers.offset <= edges.inner(middle_stations)
    for name, edges in road.sides.items():
        spans = barriers.spans(is_in_median & barriers.faces[:, 0 if edges.sign > 0 else 1]) + road.tunnels
        for start, end in gaps(spans, 0.0, road.length, BARRIER_GAP):
            text = f"The median has no barrier towards this carriageway for {end - start:.1f} m (RPS)."
            yield Finding(name, start, end - start, 0.0, text)


def _embankment_barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch beside a high, steep embankment without an outer barrier."""
    terrain = road.terrain
    if terrain is None or not above(terrain.embankment_height, EMBANKMENT_HEIGHT):
        return
    if not below(terrain.batter_slope, EMBANKMENT_RUN):
        return
    level = [(start - LEVEL_BESIDE_VILLAGE, end + LEVEL_BESIDE_VILLAGE) for start, end in road.villages]
    for name, edges in road.sides.items():
        # In a side road's mouth there can be none.
        mouths = [(start - BESIDE_MOUTH, end + BESIDE_MOUTH) for start, end in mouth_spans(road, name)]
        open_stretches = _gaps(road, edges, road.protecting[name].outer, 0.0, road.length)
        for start, end in (piece for stretch in open_stretches for piece in gaps([*level, *mouths], *stretch)):
            text = (
                f"The embankment is {terrain.embankment_height:.1f} m high and 1 : {terrain.batter_slope:g} steep, and "
                f"{end - start:.1f} m beside it are without barrier (RPS)."
            )
            yield Finding(name, start, end - start, 0.0, text)


def _curve_barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch outside of a tight curve without an outer barrier."""
    below_radius = road.limits.tight_curve * road.limits.radius
    curves = [run for run in road.runs if not run.straight and below(run.radius, below_radius)]
    for run, (name, edges) in product(curves, road.sides.items()):
        if edges.sign * run.curvature > 0.0:
            continue
        for start, end in _gaps(road, edges, road.protecting[name].outer, run.start, run.end):
            text = (
                f"The curve's radius of {run.radius:.0f} m is below {below_radius:.0f} m, and {end - start:.1f} m "
                "of its outer side are without barrier (RPS)."
            )
            yield Finding(name, start, end - start, 0.0, text)


def _obstacles(road: Road) -> Iterator[tuple[int, str]]:
    """Yield (index in `Road.bodies`, what it is) of every foot that a vehicle must not run into."""
    for i, (name, block) in enumerate(zip(road.bodies.names, road.bodies.items, strict=True)):
        thing: Any = road.parameters.objects[name]
        if road.in_village(float(road.bodies.station[i])):  # in built-up areas the RPS ask for none
            continue
        if getattr(thing, "stock", False):  # new and widened roads alone come under the RPS
            continue
        if block.part == "foot" and thing.obstacle and above(getattr(thing, "post_diameter", np.inf), OBSTACLE_POST):
            yield i, thing.obstacle


def _is_across(road: Road, side: str, index: int) -> bool:
    """Return whether a body stands across the oncoming traffic of the one carriageway, so that it isn't in the way."""
    return road.single and not road.positions.outer[side][index]


def _missing_barrier(road: Road, edges: Edges, index: int, reach: tuple[float, float]) -> tuple[float, float] | None:
    """Return (m, first station) that barriers lack between a carriageway and a body beside it; None if none lack.

    Args:
        road: the road.
        edges: the carriageway.
        index: which body.
        reach: m that the barriers begin before it and end behind it, in the direction of traffic.
    """
    body, facing = road.bodies.items[index], road.protecting[edges.name]
    nearest_distance, farthest_distance = edges.distances(body.low, body.high)
    is_outside = road.positions.outer[edges.name][index]
    is_between = (
        facing.outer & (facing.distance < nearest_distance)
        if is_outside
        else facing.inner & (facing.distance > farthest_distance)
    )
    lead, tail = reach if edges.traffic > 0 else reach[::-1]
    start, end = max(body.start - lead, 0.0), min(body.end + tail, road.length)
    missing_stretches = list(_gaps(road, edges, is_between, start, end))
    return (
        (math.fsum(end - start for start, end in missing_stretches), missing_stretches[0][0])
        if missing_stretches
        else None
    )


def _obstacle_barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each obstacle near a carriageway before which barrier is missing."""
    limit, source = road.limits.obstacle_distance, road.cite("obstacle_distance")
    for i, obstacle in _obstacles(road):
        for side, edges in road.sides.items():
            distance = road.positions.clearance[side][i]
            if distance < 0.0 or not below(distance, limit) or _is_across(road, side, i):
                continue
            if missing := _missing_barrier(road, edges, i, (OBSTACLE_LEAD, OBSTACLE_TAIL)):
                text = (
                    f"The {obstacle} stands {distance:.2f} m from {side} and {missing[0]:.1f} m "
                    f"of the barrier in front of it are missing; nearer than {limit} m it is needed ({source})."
                )
                yield Finding(road.bodies.names[i], missing[1], missing[0], 0.0, text)


def _noise_barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each noise barrier before which barrier is missing."""
    limit = road.limits.obstacle_distance
    for i in road.bodies.of(NoiseBarrier, part="barrier"):
        for side, edges in road.sides.items():
            distance = road.positions.clearance[side][i]
            if distance < 0.0 or not road.positions.outer[side][i]:
                continue
            reach = (OBSTACLE_LEAD, OBSTACLE_TAIL) if below(distance, limit) else (0.0, 0.0)
            if missing := _missing_barrier(road, edges, i, reach):
                text = (
                    f"The noise barrier stands {distance:.2f} m from {side} and {missing[0]:.1f} m of the barrier in "
                    "front of it are missing (RPS)."
                )
                yield Finding(road.bodies.names[i], missing[1], missing[0], 0.0, text)


def _tree_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stand of trees so near that a barrier must stand before it, where none does."""
    least_distance = road.limits.obstacle_distance
    for name, plants in road.of(Vegetation).items():
        if plants.kind != "tree" or plants.density == 0.0:
            continue
        for edges in road.sides.values():
            distance = edges.verge + plants.band_start
            if (
                plants.side not in ("both", edges.carriageway.side)
                or distance < 0.0
                or not below(distance, least_distance)
            ):
                continue
            is_before_trees = road.protecting[edges.name].outer & (road.barriers.clearance < distance)
            stretch = plants.start_station, min(plants.end_station, road.length)
            for start, _ in islice(_gaps(road, edges, is_before_trees, *stretch), 1):
                text = (
                    f"Trees stand {distance:.2f} m from the {edges.carriageway.side} paved edge with no barrier in "
                    f"front; {least_distance} m are needed ({road.cite('obstacle_distance')})."
                )
                yield Finding(name, start, distance, least_distance, text)


def _barrier_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each barrier that stands too near to the paved edge."""
    barriers = road.barriers
    for i, name in enumerate(barriers.names):
        distance = barriers.clearance[i]
        if distance >= 0.0:
            text = f"The barrier stands {distance:.2f} m from the paved edge; {BARRIER_DISTANCE} m are needed (RPS)."
            yield from at_least(name, barriers.where[i], distance, BARRIER_DISTANCE, text)


def _barrier_length(road: Road) -> Iterator[Finding]:
    """Yield a finding for each barrier, wholly on the road, that is too short."""
    barriers = road.barriers
    for i, name in enumerate(barriers.names):
        start, end = barriers.start[i], barriers.end[i]
        if start > 0.0 and below(end, road.length):
            text = f"The barrier is {end - start:.1f} m long; {SHORTEST_BARRIER:.0f} m are needed (RPS)."
            yield from at_least(name, start, end - start, SHORTEST_BARRIER, text)


RULES = (
    Rule("median-barrier", "The median has a barrier throughout", "m", "RPS", "confirmed", _median_barrier),
    Rule("embankment-barrier", "Embankments have barriers", "m", "RPS", "unconfirmed", _embankment_barrier),
    Rule("curve-barrier", "Tight curves have barriers outside", "m", "RPS", "unconfirmed", _curve_barrier),
    Rule("obstacle-barrier", "Obstacles have a barrier in front", "m", "RPS", "unconfirmed", _obstacle_barrier),
    Rule("noise-barrier", "Noise barriers have a barrier in front", "m", "RPS", "confirmed", _noise_barrier),
    Rule("tree-distance", "Trees keep clear of the pavement", "m", "RPS", "unconfirmed", _tree_distance),
    Rule("barrier-distance", "Barriers keep clear of the pavement", "m", "RPS", "unconfirmed", _barrier_distance),
    Rule("barrier-length", "Shortest barrier", "m", "RPS", "unconfirmed", _barrier_length),
)
