"""Distances of changed things to the other epoch's evaluated model, against those of a library of meshes."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.changes.diff import diff_roads
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.epochs.truth import CODES, REACH, ChangedMesh, ChangePoints, EpochTruth
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import load_scenario

Float = Any
POINTS = 1500
TOLERANCE = 0.001
"""Largest error of a distance, m."""
KEPT = ("Alignment", "Median", "Carriageway", "LineMarking", "Terrain")
RAIL = {"type": "Guardrail", "start_station": 18.0, "end_station": 42.0, "offset": -14.7, "faces": "left"}
SIGN = {"type": "TrafficSign", "code": "274-120", "shape": "round", "width": 0.9, "height": 0.9}
SIGN |= {"station": 30.0, "offset": -16.0}
POST = {"type": "Delineator", "station": 30.0, "offset": -15.0}
TREE = {"type": "Tree", "height": 6.0, "crown_diameter": 3.0, "crown_bottom": 1.5, "trunk_diameter": 0.2, "seed": 4}
TREE |= {"station": 30.0, "offset": 21.0}
CAR = {"type": "ParkedVehicle", "station": 30.0, "offset": -12.4}
CASES: dict[str, tuple[str, dict[str, Any] | None, dict[str, Any] | None]] = {
    "bent": ("damaged", RAIL, {**RAIL, "dents": [{"station": 30.0, "length": 4.0, "depth": -0.4}]}),
    "turned": ("damaged", SIGN, {**SIGN, "rotation_deg": 35.0}),
    "leaning": ("damaged", POST, {**POST, "lean_deg": 18.0, "lean_direction_deg": 60.0}),
    "grown": ("grown", TREE, {**TREE, "height": 7.5}),
    "parked": ("parked", None, CAR),
}
"""Happening -> kind of the change, and the thing before and after."""


@cache
def road(data: str) -> RoadGeometry:
    """Return a motorway of 60 m with one thing, given as JSON, and a rail that stays; without it for null."""
    limits = load_scenario("rq31-600m", ["road.length=60", "road.half_width=30"])
    whole: Any = sample_road(limits.road, 3).to_dict()
    objects = {name: item for name, item in whole["objects"].items() if item["type"] in KEPT}
    number = max(item["instance"] for item in objects.values())
    objects["stays"] = {**RAIL, "offset": 14.7, "faces": "right", "instance": number + 1}
    if (item := json.loads(data)) is not None:
        objects["thing"] = {**item, "instance": number + 2}
    return RoadGeometry(RoadParameters.from_dict({**whole, "objects": objects}))


@cache
def evaluated(data: str) -> SceneMesh:
    """Return the evaluated scene of such a road."""
    settings = ["fidelity=draft", "vegetation_detail=0.3", "colour.source=material"]
    scene = RoadScene.of(load_scenario("rq31-600m", settings), road(data))
    empty_file()
    scene.build()
    return scene.read().static


def surface_points(mesh: SceneMesh, instance: int) -> Float:
    """Return points (N, 3) all over the triangles of an instance, map coordinates, m."""
    rng = np.random.default_rng(7)
    corners = (mesh.vertices[mesh.triangles[mesh.instance_id == instance]]).astype(float)
    edges = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    chosen = rng.choice(len(corners), POINTS, p=area / area.sum())
    u, v = rng.random((2, POINTS))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    return corners[chosen, 0] + u[:, None] * edges[chosen, 0] + v[:, None] * edges[chosen, 1] + mesh.origin


def library_distances(trimesh: Any, mesh: SceneMesh, points: Float, instances: Callable[[Float], Any]) -> Any:
    """Return distances (N,) from points to the nearest face of chosen instances, and heights (N,) above its plane."""
    kept = instances(mesh.instance_id)
    soup = trimesh.Trimesh(mesh.vertices.astype(float), mesh.triangles[kept], process=False)
    nearest, distance, face = trimesh.proximity.closest_point(soup, points - mesh.origin)
    corners = np.asarray(soup.triangles)[face]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return distance, np.einsum("ij,ij->i", points - mesh.origin - nearest, normal)


@pytest.mark.parametrize(
    ("form", "is_second"),
    [
        (form, is_second)
        for form, (_, *things) in CASES.items()
        for is_second in (False, True)
        if things[is_second] is not None
    ],
)
def test_distances_of_things_are_those_of_a_library(form: str, is_second: bool) -> None:
    reason = "needs trimesh: pip install trimesh rtree"
    trimesh = pytest.importorskip("trimesh", reason=reason)
    pytest.importorskip("rtree", reason=reason)
    kind, *things = CASES[form]
    texts = [json.dumps(item) for item in things]
    before, after = (road(text) for text in texts)
    own_text, other_text = texts[::-1] if is_second else texts
    own, other = (after, before) if is_second else (before, after)
    changes = diff_roads(before.parameters, after.parameters)
    assert [(change.kind, change.detail in (form, "")) for change in changes.changes] == [(kind, True)]
    mesh, other_mesh = evaluated(own_text), evaluated(other_text)
    truth = EpochTruth(before, after, changes, is_second, ChangedMesh.of(other_mesh, other, own, changes), strength=0.0)
    instance = own.parameters.objects["thing"].instance
    points = surface_points(mesh, instance)
    asked = ChangePoints(points, np.full(POINTS, instance), points.mean(axis=0) + (0.0, 0.0, 50.0), 500.0)
    got = truth.arrays(asked)
    is_changed = got["change"] == CODES[kind]
    assert is_changed.mean() > (0.1 if form == "bent" else 0.999)
    # What runs along the road, and plants, are compared with themselves; what stands, with all that is there.
    is_alone = form in ("bent", "grown")
    distance, above = library_distances(
        trimesh, other_mesh, points, lambda ids: ids == instance if is_alone else np.full(len(ids), True)
    )
    expected = np.minimum(distance, REACH)
    assert expected[is_changed].max() > 0.05
    assert np.abs(np.abs(got["change_distance"]) - expected)[is_changed].max() < TOLERANCE
    # Opposite a face, not an edge, the side is plain.
    is_plain = is_changed & (np.abs(np.abs(above) - distance) < 1e-6) & (np.abs(above) > 0.01)
    assert is_plain.sum() > 50
    agreement = np.sign(got["change_distance"]) == np.sign(above)
    assert agreement[is_plain].mean() > (0.97 if form == "grown" else 0.999)
