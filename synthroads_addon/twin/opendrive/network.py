"""Crossing roads and ramps: their `road` elements, and the junctions at which ramps join crossing roads."""

from __future__ import annotations

from dataclasses import dataclass

from ...road.geometry import RoadGeometry
from ...road.network.crossing import Crossing
from ...road.network.network import Network, network_of
from ...road.objects import Side
from ..speeds import SpeedLimits
from .junctions import RampCut, RampEnd, begin_of_side, write_junctions
from .lanes import write_lanes
from .marks import RoadMarks
from .numbers import FreeIds
from .ramps import begin_of_ramp, cut_span, is_exit, ramp_end, ramp_road
from .sections import LanePlan
from .surface import CONNECTOR, elevation_profile, lateral_profile, plan_view, road_frames
from .xml import Element, Value, add_user_data, element

RURAL_SPEED = 100
"""Speed limit of crossing roads, km/h: the general one outside of built-up areas (StVO)."""


@dataclass(frozen=True)
class SideCut:
    """A place at which a ramp goes on from a carriageway.

    Attributes:
        side: of the carriageway.
        place: what is written there.
    """

    side: Side
    place: RampCut


def write_network(root: Element, geometry: RoadGeometry, numbers: FreeIds) -> list[SideCut]:
    """Add crossing roads and ramps with the junctions between them; return where ramps go on from the main road.

    Args:
        root: of the file.
        geometry: the main road.
        numbers: free ids.
    """
    network = network_of(geometry)
    cuts: list[SideCut] = []
    for name, crossing in network.crossings.items():
        ends = _ramps(network, crossing, cuts, numbers)
        _crossing_road(root, name, crossing, numbers, ends)
        root.extend(end.road for end in ends.values())
    return cuts


def _ramps(network: Network, crossing: Crossing, cuts: list[SideCut], numbers: FreeIds) -> dict[str, RampEnd]:
    """Return the ramps of a crossing road by id, and add to the cuts where they begin."""
    ends = {}
    for name in crossing.ramps:
        joint = network.joints[name]
        last = ramp_end(joint, begin_of_side(crossing.mouths[name]))
        road = ramp_road(network, joint, (CONNECTOR, last), joint.ramp.instance, "-1", name)
        connector = ramp_road(
            network, joint, (begin_of_ramp(network, joint)[0], CONNECTOR), numbers.take(), "-1", f"{name}-begin"
        )
        leaves = is_exit(network.geometry, joint)
        ends[name] = RampEnd(road, leaves)
        place = RampCut(f"{name}-junction", cut_span(joint), joint.cut.ahead > 0.0, leaves, connector, road)
        cuts.append(SideCut(joint.side, place))
    return ends


def _crossing_road(root: Element, name: str, crossing: Crossing, numbers: FreeIds, ends: dict[str, RampEnd]) -> None:
    """Add the `road` elements of a crossing road, divided at its mouths, with the turns to and from its ramps."""
    geometry = crossing.geometry
    frame = road_frames(geometry)[0]
    attributes: dict[str, Value] = {"junction": "-1", "length": geometry.length, "rule": "RHT"}
    road = element(root, "road", {"name": name, "id": crossing.instance, **attributes})
    kind = element(road, "type", {"s": 0.0, "type": "rural", "country": "DE"})
    element(kind, "speed", {"max": RURAL_SPEED, "unit": "km/h"})
    plan_view(road, geometry)
    elevation_profile(road, frame)
    lateral_profile(road, frame)
    plan = LanePlan(frame)
    write_lanes(road, plan, {side: SpeedLimits(geometry, side) for side in frame.sides}, RoadMarks(plan))
    for item in road.iter("userData"):
        if item.attrib["code"] == "instance":
            item.set("value", str(crossing.instance))
    objects = element(road, "objects")
    if crossing.bridge:
        start, end = crossing.bridge
        bridge: dict[str, Value] = {"s": start, "length": end - start, "id": numbers.take(), "type": "concrete"}
        element(objects, "bridge", {**bridge, "name": crossing.road.bridge})
    element(road, "signals")
    add_user_data(road, "instance", crossing.instance)
    write_junctions(root, road, plan, numbers, ends)
