"""Places that the first epoch couldn't see, against rays of one's own from where its scanner stood."""

from __future__ import annotations

import json
import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from synthroads_addon.blender.files import empty_file
from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs
from synthroads_addon.jobs.generate import Job
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.changes.diff import diff_roads
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.epochs.seen import CELL
from synthroads_addon.scenario.scenario import load_scenario
from tests.jobs.epochs.test_things import road

Float = Any
STATION, OFFSET, HEIGHT = 30.0, -3.0, 1.8
"""Place of the tripod on the road, and its height above it, m."""
TRUCK = {"type": "ParkedVehicle", "model": "truck", "station": STATION, "offset": -9.0}
SETTINGS = [
    "road.length=60",
    "road.half_width=30",
    "colour.source=material",
    "colour.rgb=false",
    'outputs=["parameters","cloud"]',
    'cloud.formats=["npz"]',
    f"scan.platform.stations=[{STATION}]",
    f"scan.platform.lateral_offsets=[{OFFSET}]",
    f"scan.platform.height={HEIGHT}",
    "scan.platform.turn_seconds=12",
]
APART = 0.7
"""Edge of the cells of which one point each is looked at, m."""
_AROUND = 1.2
"""Distance from a place within which all is shadow, or light, m: more than the cells of places are off."""


def is_blocked(scanner: Float, points: Float, corners: Float) -> Float:
    """Return which points (N,) a triangle (T, 3, 3) hides from a scanner (Moeller and Trumbore)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    arm = scanner - corners[:, 0]
    turned = np.cross(arm, first)
    result = np.zeros(len(points), bool)
    for row, way in enumerate(points - scanner):
        across = np.cross(way, second)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / np.einsum("ij,ij->i", first, across)
            u = scale * np.einsum("ij,ij->i", arm, across)
            v = scale * (turned @ way)
            share = scale * np.einsum("ij,ij->i", second, turned)
        result[row] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (share > 1e-6) & (share < 1.0 - 1e-6)).any()
    return result


def test_what_a_parked_truck_hid_was_not_seen_before(tmp_path: Path) -> None:
    before, after = road(json.dumps(TRUCK)), road("null")
    changes = diff_roads(before.parameters, after.parameters)
    assert [change.kind for change in changes.changes] == ["parked"]
    parameters = tmp_path / "before.json"
    parameters.write_text(before.parameters.to_json(), encoding="utf-8")
    scenario = load_scenario("tripod-200m-even", SETTINGS)
    folder = tmp_path / "epochs"
    generate_epochs(EpochsJob(Job(scenario, folder, parameters=parameters, new_file=True), changes=(changes,)))
    first, second = (dict(np.load(folder / f"epoch-{number}" / "cloud.npz")) for number in (1, 2))
    scanner = tripod(before)
    # It stands where it is believed to: ranges are the distances of the points from there.
    error = np.linalg.norm(first["xyz"] - scanner, axis=1) - first["range"]
    assert np.abs(np.median(error)) < 0.01
    corners = truck_corners(before.parameters, scenario)
    near = np.flatnonzero(second["range"] < 25.0)
    _, rows = np.unique(np.floor(second["xyz"][near] / APART), axis=0, return_index=True)
    rows = near[rows]
    points, hidden = second["xyz"][rows], second["not_seen_before"][rows].astype(bool)
    lit = ~is_blocked(scanner, points, corners)
    # Rays below the truck light its shadow in places: what is deep in it has shadow all around.
    steps = np.array([(*step, 0.0) for step in product(np.linspace(-_AROUND, _AROUND, 9), repeat=2)])
    in_shadow = ~lit
    for step in steps:
        in_shadow[in_shadow] = is_blocked(scanner, points[in_shadow] + step, corners)
    in_light = lit & ~np.any(
        [is_blocked(scanner, points + step, corners) for step in steps[[0, 4, 36, 44, 80]]], axis=0
    )
    assert in_shadow.sum() > 50
    assert in_light.sum() > 1000
    assert hidden[in_shadow].mean() > 0.99
    assert hidden[in_light].mean() < 0.01
    # By its cloud: what is nearer to a return than a cell's edge was seen, what is farther than two wasn't.
    distance, _ = cKDTree(first["xyz"]).query(points)
    assert not hidden[distance < CELL].any()
    assert hidden[(distance > 2.0 * math.sqrt(3.0) * CELL) & ~lit].all()


def tripod(geometry: RoadGeometry) -> Float:
    """Return the tripod's place, map coordinates (3,), m."""
    station, offset = np.array([STATION]), np.array([OFFSET])
    plan = geometry.alignment.place(station, offset)[0]
    elevation = geometry.main_elevation(station, offset)[0]
    return np.array([*plan, elevation + HEIGHT]) + geometry.parameters.transform.translate


def truck_corners(parameters: RoadParameters, scenario: Any) -> Float:
    """Return the triangles (T, 3, 3) of the parked truck, map coordinates, m."""
    empty_file()
    scene = RoadScene.of(scenario, RoadGeometry(parameters))
    scene.build()
    mesh = scene.read().static
    chosen = mesh.triangles[mesh.instance_id == parameters.objects["thing"].instance]
    return mesh.vertices[chosen].astype(float) + mesh.origin
