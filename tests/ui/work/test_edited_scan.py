"""Roads that were edited, scanned and exported from the panel: the cloud against the truth that is written with it."""

from __future__ import annotations

import re
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import modifier_input
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import BuildTarget
from synthroads_addon.blender.model.roads import ROAD
from synthroads_addon.blender.model.store import objects_of, recall_parameters, roads
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.ui.panels import panels
from synthroads_addon.ui.work import edited, follow
from synthroads_addon.ui.work.scan import requested_scan
from tests.helpers.scenes.cloud_truth import Written, scan
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import settings, small_pictures  # noqa: F401
from tests.helpers.scenes.scene_hash import lines
from tests.helpers.scenes.small_road import build_small, open_small, small_parameters
from tests.helpers.scenes.sparse_scanner import sparse_scanner

pytestmark = pytest.mark.usefixtures("small_pictures")


def test_edits_of_all_kinds_are_in_the_cloud_and_in_the_truth(tmp_path: Path) -> None:
    model = open_small()
    model.objects["sign"].location += Vector((2.0, 1.5, 0.3))
    model.objects["rail-right"].location += Vector((0.7, 1.2, 0.0))
    bpy.data.objects.remove(model.objects["Delineators"])
    copy = model.objects["sign"].copy()
    copy.data = copy.data.copy()
    model.collection.objects.link(copy)
    copy.location += Vector((-12.0, -6.0, 0.0))
    model.objects["rail-left"].scale = (1.0, 1.0, 1.3)
    model.root.location = (3.0, -5.0, 2.0)
    bpy.context.view_layer.update()
    files = scan(tmp_path, "edited", sparse_scanner(tmp_path, 60.0))
    written, before = read_parameters(files / "parameters.json"), small_parameters()
    assert set(before.objects) ^ set(written.objects) == {"rail-left", "post-1", "post-2", "sign-2"}
    shift = np.array(written.transform.translate) - np.array(before.transform.translate)
    assert np.allclose(shift, (3.0, -5.0, 2.0), atol=0.001)
    found = Written.read(files)
    assert found.by_hand() == {"rail-left"}
    assert found.foreign() == {0}
    assert found.classes_of({0}) == {class_id("guardrail")}


def other_lines(own: set[str]) -> list[str]:
    """Return what the file says of everything but some data-blocks, the panel's settings, and what is selected."""
    found = [(line, _BLOCK.match(line)) for line in lines() if not any(text in line for text in _NOT_COMPARED)]
    return [line for line, block in found if block and block["name"] not in own]


_NOT_COMPARED = (".synthroads", ".users = ")
"""Settings of the panel, and how often a material or node group is used, which follows from the road."""
_BLOCK = re.compile(r"(?P<kind>\w+)\[(?P<name>[^\]]*)\]")


def is_there(line: str) -> bool:
    """Return whether a line's data-block is there; node groups and materials go with the last road that uses them."""
    block = _BLOCK.match(line)
    assert block
    shared = {"node_groups": bpy.data.node_groups, "materials": bpy.data.materials}.get(block["kind"])
    return shared is None or block["name"] in shared


def names_of(root: bpy.types.Object) -> set[str]:
    """Return the names of a road's root, its parts, their meshes, and the collections that they are in."""
    items = [root, *objects_of(root, next(s for s in bpy.data.scenes if root.name in s.objects)).values()]
    return {item.name for item in items} | {item.data.name for item in items if item.data} | _collections(items)


def _collections(items: list[bpy.types.Object]) -> set[str]:
    return {collection.name for item in items for collection in item.users_collection}


@pytest.mark.slow
def test_three_roads_in_two_scenes_are_built_scanned_and_exported_one_by_one(tmp_path: Path) -> None:
    """One of them is renamed, one appended from another file."""
    scanner = sparse_scanner(tmp_path, 60.0)
    appended = tmp_path / "appended.blend"
    bpy.data.libraries.write(str(appended), {build_small(small_parameters(40.0)).collection})
    empty_file()
    build_small(small_parameters(50.0))
    first = bpy.context.scene
    renamed = build_small(small_parameters(60.0), place=BuildTarget(beside=True)).root
    renamed.name = "Ramp"
    with bpy.data.libraries.load(str(appended)) as (source, wanted):
        wanted.collections = source.collections
    second = bpy.data.scenes.new("Second")
    second.collection.children.link(wanted.collections[0])
    bpy.ops.mesh.primitive_cube_add(location=(0.0, 60.0, 0.0))
    found = [(scene, root) for scene in (first, second) for root in roads(scene)]
    lengths = {"SynthRoads Road": 50.0, "Ramp": 60.0, "SynthRoads Road.001": 40.0}
    assert {root.name: recall_parameters(root).alignment.length for _, root in found} == lengths
    for scene, root in found:
        name, length = root.name, lengths[root.name]
        bpy.context.window.scene = scene
        own = names_of(root)
        for item in scene.objects:  # only that road is to be met
            item.hide_viewport = item.hide_viewport or item.name not in own
        bpy.context.view_layer.objects.active = root
        before = other_lines(own)
        build_small(small_parameters(length), place=BuildTarget(str(root[ROAD])))
        own |= names_of(root)
        kept = [line for line in before if _BLOCK.match(line)["name"] not in own and is_there(line)]  # type: ignore[index]
        assert len(kept) > 1000
        assert other_lines(own) == kept
        files = scan(tmp_path, name, scanner)
        assert read_parameters(files / "parameters.json").alignment.length == length
        twin = tmp_path / f"{name} twin"
        twin.mkdir()
        assert bpy.ops.synthroads.export_twin(directory=str(twin), formats={"geojson"}) == {"FINISHED"}
        assert list(twin.iterdir())
        assert other_lines(own) == kept
        for item in scene.objects:
            item.hide_viewport = "synthroads_support" in item


def test_of_a_road_whose_surface_was_edited_only_the_cloud_is_written() -> None:
    model = open_small()
    panel = bpy.context.scene.synthroads
    panel.output, panel.outputs, panel.twin = "/tmp", {"parameters", "centerline", "cloud"}, {"geojson"}
    assert requested_scan(bpy.context).scenario.outputs == ("parameters", "cloud", "centerline")
    model.objects["Road"].modifiers.new("Bevel", "BEVEL")
    asked = requested_scan(bpy.context)
    assert asked.scenario.outputs == ("cloud",)
    assert asked.scenario.twin == ()
    assert "Bevel" in asked.edited.to_dict()["edited_by_hand"][0]["reason"]


def test_the_panel_names_what_was_edited_by_hand_and_offers_to_build() -> None:
    model = open_small()
    model.objects["sign"].scale = (1.0, 1.0, 1.2)
    model.objects["car"].location += Vector((2.0, 1.0, 0.0))
    bpy.context.view_layer.update()
    edited.edits.read(bpy.context.scene)
    road = next(c for c in panels.CLASSES if c.bl_idname == "SYNTHROADS_PT_road")
    text = "\n".join(drawn(road, bpy.context).lines)
    assert "label 'sign: it is" in text
    assert "1 × 1 × 1.2" in text
    assert "synthroads.build_edited" in text
    assert bpy.ops.synthroads.build_edited() == {"FINISHED"}
    edited.edits.read(bpy.context.scene)
    text = "\n".join(drawn(road, bpy.context).lines)
    assert "label 'sign: it is" in text
    assert "synthroads.build_edited" not in text


def test_a_moved_guardrail_follows_the_road_at_once() -> None:
    model = open_small()
    rail = model.objects["rail-right"]
    before = modifier_input(rail.modifiers[0], "Offset")
    rail.location += Vector((0.7, 1.2, 0.0))
    bpy.context.view_layer.update()
    assert follow.follow(bpy.context.scene) == ["rail-right"]
    assert modifier_input(rail.modifiers[0], "Offset") > before + 0.5
    assert follow.follow(bpy.context.scene) == []
