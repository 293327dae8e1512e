"""Every node group: made again from its text, and what those for users make of their defaults along a curve."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.model.library import user_groups
from synthroads_addon.blender.nodes.strip import strip_group
from synthroads_addon.blender.things.guardrail import guardrail_group
from tests.blender.nodes.test_axis import arc, corners, empty, give, meshes_of
from tests.blender.nodes.test_nodes import WRITE, all_groups
from tests.helpers.scenes.tree_text import tree_from_text, tree_text

GEOMETRY = Path(__file__).parent / "snapshots" / "geometry.json"
RELEASE = f"{bpy.app.version[0]}.{bpy.app.version[1]}"


def text_again(group: bpy.types.NodeTree) -> tuple[str, str]:
    """Return a group's text, and that of the group that is made from it."""
    text = tree_text(group)
    again = tree_from_text(text)
    second = tree_text(again).replace(json.dumps(again.name), json.dumps(group.name), 1)
    bpy.data.node_groups.remove(again)
    return text, second


@pytest.mark.parametrize("make", [strip_group, guardrail_group])
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


def numbers_of(group: bpy.types.NodeTree) -> dict[str, Any]:
    """Return counts, bounds (m) and a digest of coordinates in mm of what a group makes of its defaults."""
    inputs = {item.name for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"}
    item = arc() if inputs & {"Curve", "Backbone"} else empty()
    if item.type == "MESH":
        item.data.vertices.add(1)
    give(item, group)
    meshes = meshes_of(item)
    places = np.concatenate([corners(mesh) for mesh in meshes]).astype(np.float64)
    rounded = np.round(places * 1000.0).astype(np.int64)
    bpy.data.objects.remove(item)
    return {
        "vertices": len(places),
        "faces": sum(len(mesh.polygons) for mesh in meshes),
        "low": places.min(axis=0).round(3).tolist(),
        "high": places.max(axis=0).round(3).tolist(),
        "digest": {RELEASE: hashlib.sha256(rounded.tobytes()).hexdigest()[:12]},
    }


@pytest.mark.slow
def test_what_groups_make_is_as_their_snapshot() -> None:
    """Counts and bounds agree in both Blenders; digests are each release's own, as its sines and cosines are."""
    known: dict[str, Any] = json.loads(GEOMETRY.read_text(encoding="utf-8")) if GEOMETRY.exists() else {}
    made = {group.name: numbers_of(group) for _, group in user_groups()}
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
