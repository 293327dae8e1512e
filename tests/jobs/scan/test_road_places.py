"""Stations, offsets and roads of points: those that own mathematics finds by the parameters alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.files import PRESETS
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.other_roads.parts import ConnectingRamp, CrossingRoad
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scenario.scenario import Scenario, load_scenario

MILLIMETRE = 1e-3
POINTS = 1000
STEP = 0.02
"""Length (m) of the pieces of the axes that the own mathematics looks for feet on."""
PLATFORMS: dict[str, tuple[str, dict[str, Any]]] = {
    "uav": ("polygon_mirror", {"kind": "uav", "height": 60.0, "speed": 20.0, "lateral_offsets": [0.0]}),
    "mobile": ("rotating_mirror", {"kind": "vehicle", "speed": 25.0}),
    "tripod": ("rotating_mirror", {"kind": "tripod", "station_spacing": 250.0, "turn_seconds": 20.0}),
}
FIELDS = {"uav": 80.0, "mobile": 360.0, "tripod": 100.0}
"""Fields of view, deg."""


def polyline(axis: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stations, places and headings of an axis by the trapezoid rule on its headings' Simpson sums."""
    station, heading = [np.zeros(1)], [np.array([np.deg2rad(axis["start_heading_deg"])])]
    places = [np.array([[axis["start_x"], axis["start_y"]]], dtype=np.float64)]
    for element in axis["horizontal"]:
        length, k0, k1 = element["length"], element["curvature_start"], element["curvature_end"]
        count = max(2, int(np.ceil(length / STEP)))
        u = np.linspace(0.0, length, count + 1)
        middle = (u[1:] + u[:-1]) / 2.0

        def turned(at: np.ndarray, k0: float = k0, k1: float = k1, length: float = length) -> np.ndarray:
            return heading[-1][-1] + k0 * at + (k1 - k0) / length * at**2 / 2.0

        parts = [np.stack([np.cos(turned(at)), np.sin(turned(at))], axis=1) for at in (u[:-1], middle, u[1:])]
        pieces = (length / count / 6.0) * (parts[0] + 4.0 * parts[1] + parts[2])
        places.append(places[-1][-1] + np.cumsum(pieces, axis=0))
        station.append(station[-1][-1] + u[1:])
        heading.append(turned(u)[1:])
    return np.concatenate(station), np.concatenate(places), np.concatenate(heading)


def foot(line: tuple[np.ndarray, np.ndarray, np.ndarray], point: np.ndarray) -> tuple[float, float]:
    """Return station and offset of a point (2,): from the nearest place of the line along the tangent there."""
    station, places, heading = line
    nearest = int(np.hypot(*(places - point).T).argmin())
    vector = point - places[nearest]
    forward = np.array([np.cos(heading[nearest]), np.sin(heading[nearest])])
    along, across = float(vector @ forward), float(forward[0] * vector[1] - forward[1] * vector[0])
    bend = 0.0
    if 0 < nearest < len(station) - 1:
        bend = float(heading[nearest + 1] - heading[nearest - 1]) / float(station[nearest + 1] - station[nearest - 1])
    return float(station[nearest]) + along / (1.0 - bend * across), across


def device(folder: Path, platform: str) -> str:
    """Return the file of a sparse scanner for a platform."""
    data = json.loads((PRESETS / "devices" / "riegl-vz-600i.json").read_text())
    pattern = {"type": PLATFORMS[platform][0]} | ({"centre_from_nadir_deg": 100.0} if platform == "tripod" else {})
    mode = {"pulse_rate_khz": 0.5, "field_of_view_deg": FIELDS[platform], "maximum_range": 300.0}
    file = folder / f"{platform}.json"
    file.write_text(json.dumps(data | {"pattern": pattern, "modes": [mode], "lines_per_second": [4.0, 420.0]}))
    return str(file)


def scanned(road: RoadParameters, folder: Path, **scenario: Any) -> dict[str, PointBlock]:
    """Return the points of a sparse scan of a road by each platform."""
    clouds, scene = {}, None
    for name, (_, platform) in PLATFORMS.items():
        scan = {"device": device(folder, name), "lines_per_second": 10.0, "rays_per_pulse": 1, "platform": platform}
        data: dict[str, Any] = {
            "fidelity": "draft",
            "vegetation_detail": 0.2,
            "scan": scan,
            "colour": {"source": "material"},
            "cloud": {"attributes": ["road", "noise_free"]},
        }
        job = Scenario.from_dict(data | scenario)
        before, scene = scene, RoadScene.of(job, RoadGeometry(road))
        if before is None:
            scene.build()
        else:
            scene.model, scene.scene = before.model, before.scene
        blocks = CollectedBlocks()
        record(scene.plan(), blocks)
        clouds[name] = concatenate([block.points for block in blocks.results])
    return clouds


def check(road: RoadParameters, points: PointBlock) -> np.ndarray:
    """Check the places of a thousand points of a cloud, evenly from all roads; return the roads of these."""
    data = road.to_dict()["objects"]
    lines = {road.alignment.instance: polyline(next(d for d in data.values() if d["type"] == "Alignment"))}
    others = {
        item.instance: name for name, item in road.objects.items() if isinstance(item, ConnectingRamp | CrossingRoad)
    }
    lines |= {number: polyline(data[name]) for number, name in others.items()}
    number = points.array("road_id")
    assert set(np.unique(number).tolist()) <= set(lines)
    rng = np.random.default_rng(7)
    by_road = [rng.permutation(np.flatnonzero(number == each)) for each in np.unique(number)]
    rows = np.concatenate([part[: POINTS // len(by_road)] for part in by_road])
    xy = points.array("true_xyz")[:, :2] - np.array(road.transform.translate[:2])
    for row in rows.tolist():
        station, offset = foot(lines[int(number[row])], xy[row])
        assert abs(station - points.array("station")[row]) < MILLIMETRE, (row, number[row])
        assert abs(offset - points.array("offset")[row]) < MILLIMETRE, (row, number[row])
    own = np.isin(points.instance_id, list(others))
    assert (points.instance_id[own] == number[own]).all()
    return number[rows]


@pytest.mark.any_blender
def test_points_of_an_interchange_know_their_roads(tmp_path: Path) -> None:
    scenario = load_scenario("interchange-1300m")
    assert "road" in scenario.cloud.attributes
    road = sample_road(scenario.road, scenario.seed)
    bridge = next(iter(road.of_type(CrossingRoad).values())).bridge
    for name, points in scanned(road, tmp_path).items():
        roads = check(road, points)
        expected = {road.alignment.instance, *(item.instance for item in road.of_type(CrossingRoad).values())}
        expected |= {item.instance for item in road.of_type(ConnectingRamp).values()}
        # From the motorway some ramps are hidden behind embankments.
        assert set(roads.tolist()) == expected if name == "uav" else len(set(roads.tolist())) >= 3
        deck = points.instance_id == road.objects[bridge].instance
        assert deck.any()
        crossing = next(iter(road.of_type(CrossingRoad).values()))
        assert (points.array("road_id")[deck] == crossing.instance).all()
        counts = np.unique(points.array("road_id"), return_counts=True)
        print(name, len(points.xyz), dict(zip(*(v.tolist() for v in counts), strict=True)))


@pytest.mark.any_blender
@pytest.mark.parametrize("name", ["bridge-300m", "tunnel-300m"])
def test_points_on_bridges_and_in_tunnels_count_along_the_road(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    road = sample_road(scenario.road, scenario.seed)
    for points in scanned(road, tmp_path).values():
        assert set(check(road, points).tolist()) == {road.alignment.instance}
