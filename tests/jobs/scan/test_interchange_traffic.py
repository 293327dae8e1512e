"""Traffic on ramps and the crossing road in clouds: each point lies on its vehicle, where that is at its time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.other_roads.guardrail import RampGuardrail
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import RampVehicle
from synthroads_addon.road.things.vehicles import VEHICLE_TYPES
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scanning.scene.motion import LaneMotion, lane_motions
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.road_cases import OF_ROADS
from tests.helpers.effects.scans import SCAN
from tests.helpers.roads.interchanges import diamond

BESIDE = 0.15
"""How far mirrors reach beyond a vehicle's size, m."""


def busy_roads() -> RoadParameters:
    """Return an interchange with the traffic and the guardrails of its ramps and its crossing road alone."""
    data: dict[str, Any] = diamond().to_dict()
    kept = {*OF_ROADS, "RampVehicle", "RampGuardrail"}
    return RoadParameters.from_dict(
        data | {"objects": {name: item for name, item in data["objects"].items() if item["type"] in kept}}
    )


@pytest.mark.any_blender
def test_points_of_vehicles_on_ramps_lie_on_them() -> None:
    road = busy_roads()
    platform = {"kind": "uav", "height": 60.0, "speed": 15.0, "lateral_offsets": [-60.0, 60.0]}
    scan = SCAN["scan"] | {"platform": platform, "noise": {"range_sigma": 0.0}}
    cloud = {"attributes": ["road", "noise_free"]}
    scenario = Scenario.from_dict(SCAN | {"scan": scan, "cloud": cloud, "vegetation_detail": 0.0})
    geometry = RoadGeometry(road)
    scene = RoadScene.of(scenario, geometry)
    scene.build()
    blocks = CollectedBlocks()
    record(scene.plan(), blocks)
    points = concatenate([block.points for block in blocks.results])
    xyz = points.array("true_xyz") - np.array(road.transform.translate)
    motions = lane_motions(geometry)
    driving, standing, roads = 0, 0, set()
    for name, vehicle in road.of_type(RampVehicle).items():
        passes = geometry.numbers.passes[name]
        again = points.instance_id.astype(np.int64) - passes.first
        is_again = (again >= 0) & (again % passes.step == 0) & (again < 50 * passes.step)
        rows = np.flatnonzero((points.instance_id == vehicle.instance) | is_again)
        if not len(rows):
            continue
        motion = motions[name] if vehicle.speed else LaneMotion(geometry, vehicle)
        rotation, place, present = motion.pose(points.gps_time[rows])
        assert present.all()
        body = np.einsum("kji,kj->ki", rotation, xyz[rows] - place)
        kind = VEHICLE_TYPES[vehicle.model]
        assert np.abs(body[:, 0]).max() < kind.length / 2.0 + BESIDE
        assert np.abs(body[:, 1]).max() < kind.width / 2.0 + 2.0 * BESIDE
        assert body[:, 2].min() > -0.05
        assert body[:, 2].max() < kind.height + BESIDE
        number = road.objects[vehicle.carriageway].instance
        assert set(points.array("road_id")[rows].tolist()) == {number}
        driving, standing = driving + (vehicle.speed > 0.0), standing + (vehicle.speed == 0.0)
        roads.add(vehicle.carriageway)
    assert driving >= 4
    assert standing >= 1
    assert "crossing-road" in roads
    rails = {rail.instance: rail for rail in road.of_type(RampGuardrail).values()}
    on_rails = np.isin(points.instance_id, list(rails))
    assert np.count_nonzero(on_rails) > 10
    for number, rail in rails.items():
        rows = np.flatnonzero(points.instance_id == number)
        assert (points.array("road_id")[rows] == road.objects[rail.road].instance).all()
        offset, station = points.array("offset")[rows], points.array("station")[rows]
        assert (np.abs(offset - rail.offset) < 0.45).all()
        assert ((station > rail.start_station - 0.2) & (station < rail.end_station + 0.2)).all()
