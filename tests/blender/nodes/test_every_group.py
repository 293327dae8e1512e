"""Every node group: made again from its text, and snapshots of what groups make, alone and on a small road."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.model.build import RoadModel, build_road
from synthroads_addon.blender.model.library import user_groups
from synthroads_addon.blender.nodes.strip import strip_group
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.things.sign.sign import sign_group
from synthroads_addon.road.parameters import RoadParameters
from tests.blender.nodes.test_axis import arc, corners, empty, give, meshes_of
from tests.blender.nodes.test_nodes import WRITE, all_groups
from tests.helpers.effects.road_cases import TURNOUTS, base_road, objects_of
from tests.helpers.scenes.tree_text import tree_from_text, tree_text

ON_A_ROAD = ("Hatching", "Arrow", "Gantry", "TrafficSign", "Vegetation", "Vehicle", "NoiseBarrier")
PLANTS = (("shrub", "hazel", 0.02), ("tree", "birch", 0.02), ("grass", "meadow", 0.5))
"""Kind, species, plants per m2."""
GEOMETRY = Path(__file__).parent / "snapshots" / "geometry.json"
RELEASE = f"{bpy.app.version[0]}.{bpy.app.version[1]}"


def text_again(group: bpy.types.NodeTree) -> tuple[str, str]:
    """Return a group's text, and that of the group that is made from it."""
    text = tree_text(group)
    again = tree_from_text(text)
    second = tree_text(again).replace(json.dumps(again.name), json.dumps(group.name), 1)
    bpy.data.node_groups.remove(again)
    return text, second


@pytest.mark.parametrize("make", [strip_group, sign_group])
def test_a_group_is_made_again_from_its_text(make: Any) -> None:
    """The same text, and the same mesh to the bit."""
    group = make()
    text, second = text_again(group)
    assert second == text
    meshes = []
    for tree in (group, tree_from_text(text)):
        item = arc(50)
        give(item, tree)
        meshes.append(corners(*meshes_of(item)))
    assert len(meshes[0]) > 50
    assert np.array_equal(*meshes)


@pytest.mark.slow
def test_every_group_is_made_again_from_its_text() -> None:
    groups = {group.name: group for group in all_groups()}
    assert len(groups) > 50
    for name, group in groups.items():
        text, second = text_again(group)
        assert second == text, name


def numbers_at(places: np.ndarray[Any, Any], faces: int) -> dict[str, Any]:
    """Return counts, bounds (m) and a digest of coordinates (N, 3) in mm."""
    rounded = np.round(places * 1000.0).astype(np.int64)
    return {
        "vertices": len(places),
        "faces": faces,
        "low": places.min(axis=0).round(3).tolist(),
        "high": places.max(axis=0).round(3).tolist(),
        "digest": {RELEASE: hashlib.sha256(rounded.tobytes()).hexdigest()[:12]},
    }


def numbers_of(group: bpy.types.NodeTree) -> dict[str, Any] | None:
    """Return the numbers of what a group makes of its defaults, along an arc if it wants a curve; None of nothing."""
    inputs = {item.name for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"}
    item = arc() if inputs & {"Curve", "Backbone"} else empty()
    if item.type == "MESH":
        item.data.vertices.add(1)
    give(item, group)
    meshes = meshes_of(item)
    places = [corners(mesh).astype(np.float64) for mesh in meshes if len(mesh.vertices)]
    made = numbers_at(np.concatenate(places), sum(len(mesh.polygons) for mesh in meshes)) if places else None
    bpy.data.objects.remove(item)
    return made


def small_road() -> RoadModel:
    """Build a road of 60 m that has what groups can't make of their defaults: ground, plants, paint, writing."""
    objects = {kind.lower(): item for kind in ON_A_ROAD for item in objects_of(kind).values() if item["type"] == kind}
    for kind, species, density in PLANTS:
        objects[f"{species}-1"] = objects["vegetation"] | {"kind": kind, "species": species, "density": density}
    data = base_road({"exit": {"type": "Turnout", **TURNOUTS["exit"]}} | objects)
    for number, item in enumerate(data["objects"].values(), 1):
        item["instance"] = number
    return build_road(BuildRequest(RoadParameters.from_dict(data), 0.02))


def names_in(groups: Iterable[bpy.types.NodeTree]) -> set[str]:
    """Return the names of groups and of all that are in them."""
    found: dict[str, bpy.types.NodeTree] = {}
    waiting = list(groups)
    while waiting:
        group = waiting.pop()
        if group.name not in found:
            found[group.name] = group
            waiting += [node.node_tree for node in group.nodes if node.type == "GROUP" and node.node_tree]
    return set(found)


def _makes_geometry(name: str) -> bool:
    outputs = (item for item in bpy.data.node_groups[name].interface.items_tree if item.item_type == "SOCKET")
    return next(item for item in outputs if item.in_out == "OUTPUT").socket_type == "NodeSocketGeometry"


@pytest.mark.slow
def test_what_groups_make_is_as_their_snapshot() -> None:
    """Every group is among them, or in one that is.

    Counts and bounds agree in both Blenders; digests are each release's own, as its sines and cosines are.
    """
    known: dict[str, Any] = json.loads(GEOMETRY.read_text(encoding="utf-8")) if GEOMETRY.exists() else {}
    names = [group.name for group in all_groups() if "(older)" not in group.name]
    alone = {name: numbers_of(bpy.data.node_groups[name]) for name in names if _makes_geometry(name)}
    made = {name: found for name, found in alone.items() if found is not None}
    assert {group.name for _, group in user_groups()} <= made.keys()
    shown = names_in(bpy.data.node_groups[name] for name in made)
    model = small_road()
    for role, item in model.objects.items():
        mesh = scene_mesh(objects=[item])
        if len(mesh):
            made[f"model: {role}"] = numbers_at(mesh.vertices.astype(np.float64), len(mesh))
            shown |= names_in(modifier.node_group for modifier in item.modifiers if modifier.type == "NODES")
    assert set(names) <= shown, "groups whose geometry nothing shows"
    if WRITE in os.environ:
        for name, numbers in made.items():
            numbers["digest"] = known.get(name, {}).get("digest", {}) | numbers["digest"]
        GEOMETRY.write_text(json.dumps(made, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        known = made
    assert set(made) == set(known)
    for name, numbers in made.items():
        wanted = known[name]
        assert (numbers["vertices"], numbers["faces"]) == (wanted["vertices"], wanted["faces"]), name
        for bound in ("low", "high"):
            assert numbers[bound] == pytest.approx(wanted[bound], abs=2e-3), name
        assert numbers["digest"][RELEASE] == wanted["digest"].get(RELEASE), name
