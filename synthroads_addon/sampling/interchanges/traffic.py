"""Traffic on an interchange's ramps and crossing road: it leaves and enters the motorway, or waits at mouths."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...base.schema import round_value
from ...road.lanes import ramp_way
from ...road.network.network import Joint, network_of
from ...road.surroundings import RampVehicle
from ...road.things.vehicles import VEHICLE_TYPES
from ..placing.draw import draw
from ..placing.site import PlacementSite
from ..surroundings import draw_looks, queue_vehicles

_BEFORE_LINE = 2.2
"""Distance (m) from the crossing road's edge to the front of the first that waits: behind the line; chosen."""
_WAITING_GAP = 2.0
"""Distance (m) between vehicles that wait; chosen."""
_MOST_WAITING = 3
_RAMP_SPEED = (0.75, 1.0)
"""Speeds on ramps as a share of their design speed; chosen."""
_CROSSING_SPEED = (50.0, 80.0)
"""Speeds on crossing roads, km/h; chosen."""
_KMH = 3.6


def interchange_traffic(site: PlacementSite) -> Iterator[tuple[str, RampVehicle]]:
    """Yield (id, vehicle) of the traffic on ramps and crossing roads; their instance numbers are 1.

    On an exit's ramp some wait at the mouth, or others drive.
    """
    network, limits = network_of(site.geometry), site.scenario.interchange
    for name, joint in network.joints.items():
        rng = site.stream("interchange", "traffic", name)
        per_km, heavy_share = draw(rng, limits.vehicles_per_km), draw(rng, site.scenario.vehicles.trucks)
        waits = rng.random() < limits.waiting
        if per_km <= 0.0:
            continue
        if network.leaves(joint) and joint.ramp.priority != "none" and waits:
            yield from _waiting(site, name, joint, rng, heavy_share)
            continue
        way = ramp_way(site.geometry, name)
        speed = joint.ramp.design_speed / _KMH * rng.uniform(*_RAMP_SPEED)
        stretch = [0.0, way.stop - _BEFORE_LINE]
        traffic = 1 if network.leaves(joint) else -1
        yield from _driving(name, 0, per_km, heavy_share, (speed, speed), stretch, traffic, rng)
    for name, crossing in network.crossings.items():
        for lane, traffic in ((0, 1), (1, -1)):
            rng = site.stream("interchange", "traffic", name, lane)
            per_km, heavy_share = draw(rng, limits.vehicles_per_km), draw(rng, site.scenario.vehicles.trucks)
            low, high = (speed / _KMH for speed in _CROSSING_SPEED)
            stretch = [0.0, crossing.road.length]
            yield from _driving(name, lane, per_km, heavy_share, (low, high), stretch, traffic, rng)


def _driving(
    road: str,
    lane: int,
    per_km: float,
    heavy_share: float,
    speeds: tuple[float, float],
    stretch: list[float],
    traffic: int,
    rng: np.random.Generator,
) -> Iterator[tuple[str, RampVehicle]]:
    """Yield (id, vehicle) of those that drive on a lane.

    Args:
        road, lane: of the lane.
        per_km: vehicles per km.
        heavy_share: share of heavy ones.
        speeds: lowest and highest, m/s.
        stretch: stations between which they are at the time 0, m.
        traffic: 1 where they drive with the stations, -1 against them.
        rng: random numbers of the lane.
    """
    count = int(per_km * (stretch[1] - stretch[0]) / 1000.0 + rng.random())
    looks = draw_looks(rng, rng.random(count) < heavy_share)
    lengths = [VEHICLE_TYPES[model].length for model, _ in looks]
    # The hindmost first, which is the slowest: nobody overtakes.
    drawn = sorted(rng.uniform(*speeds, count).tolist())
    places = queue_vehicles(rng, lengths, stretch, traffic)
    for number, (station, speed, (model, color)) in enumerate(zip(places, drawn, looks, strict=False), 1):
        yield (
            f"vehicle-{road}-{lane}-{number}",
            RampVehicle(
                instance=1,
                model=model,
                carriageway=road,
                lane=lane,
                station=round_value(station),
                speed=round_value(speed),
                color=color,
            ),
        )


def _waiting(
    site: PlacementSite, name: str, joint: Joint, rng: np.random.Generator, heavy_share: float
) -> Iterator[tuple[str, RampVehicle]]:
    """Yield (id, vehicle) of those that wait at an exit's mouth, the foremost first."""
    way = ramp_way(site.geometry, name)
    count = int(rng.integers(1, _MOST_WAITING + 1))
    looks = draw_looks(rng, rng.random(count) < heavy_share)
    front = way.stop - _BEFORE_LINE
    for number, (model, color) in enumerate(looks, 1):
        length = VEHICLE_TYPES[model].length
        station = front - length / 2.0
        front -= length + _WAITING_GAP
        yield (
            f"vehicle-{name}-0-{number}",
            RampVehicle(
                instance=1, model=model, carriageway=name, lane=0, station=round_value(station), speed=0.0, color=color
            ),
        )
