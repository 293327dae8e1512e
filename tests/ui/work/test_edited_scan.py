"""Roads that were edited, scanned and exported from the panel: the cloud against the truth that is written with it."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import laspy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import modifier_input
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import Place, build_road
from synthroads_addon.blender.model.roads import ROAD
from synthroads_addon.blender.model.store import objects_of, recall_parameters, roads
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.ui.panels import panels
from synthroads_addon.ui.work import edited, follow
from synthroads_addon.ui.work.scan import requested_scan
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import choose, settings, small_pictures  # noqa: F401
from tests.helpers.scenes.scene_hash import lines
from tests.helpers.scenes.small_road import PARTS, TOLERANCE, build_small, open_small, small_parameters
from tests.helpers.scenes.sparse_scanner import sparse_scanner

pytestmark = pytest.mark.usefixtures("small_pictures")

NEAR = 0.0015
"""From a point to the surface that it is of: half of the 1 mm that coordinates are written in, in three axes, m."""


def scan(folder: Path, name: str, scanner: str) -> Path:
    """Scan the shown road from the panel, without noise; return the folder of the files."""
    panel = bpy.context.scene.synthroads
    choose(panel, **{"scan.device": scanner, "scan.relief": 0.0, "scan.traffic_speed_factor": 0.0})
    choose(panel, **{"scan.own_rays_per_pulse": True, "scan.rays_per_pulse": "1", "colour.source": "material"})
    choose(panel, **{"scan.platform.lateral_offsets": "0", "scan.platform.speed": 20.0, "overwrite": True})
    panel.outputs = {"parameters", "cloud"}
    panel.output = str(folder / name)
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    return folder / name


def points_by_instance(folder: Path) -> dict[int, np.ndarray]:
    """Return the cloud's points (N, 3) by instance number, map coordinates."""
    cloud = laspy.read(folder / "cloud.laz")
    numbers = np.asarray(cloud["instance_id"])
    return {int(number): cloud.xyz[numbers == number] for number in np.unique(numbers)}


def foreign(folder: Path) -> set[int]:
    """Check that the points of everything that the written parameters know lie on it; return the other numbers."""
    parameters, unknown = read_parameters(folder / "parameters.json"), set()
    empty_file()
    build_road(parameters, TOLERANCE, 0.0, PARTS)
    mesh, numbers = scene_mesh(), RoadGeometry(parameters).numbers
    known = 0
    for number, points in points_by_instance(folder).items():
        if numbers.owner(number) is None:
            unknown.add(number)
            continue
        triangles = mesh.triangles[mesh.instance_id == number]
        assert len(triangles), numbers.name_of(number)
        tree = BVHTree.FromPolygons(mesh.vertices.tolist(), triangles.tolist())
        away = [tree.find_nearest(Vector(point))[3] for point in (points - mesh.origin)[:: 1 + len(points) // 300]]
        assert max(away) < NEAR, (numbers.name_of(number), max(away))
        known += 1
    assert known > 5
    return unknown


def test_edits_of_all_kinds_are_in_the_cloud_and_in_the_truth(tmp_path: Path) -> None:
    model = open_small()
    model.objects["sign"].location = (2.0, 1.5, 0.3)
    model.objects["rail-right"].location = (0.7, 1.2, 0.0)
    bpy.data.objects.remove(model.objects["Delineators"])
    copy = model.objects["sign"].copy()
    copy.data = copy.data.copy()
    model.collection.objects.link(copy)
    copy.location = (-12.0, -6.0, 0.0)
    model.objects["rail-left"].scale = (1.0, 1.0, 1.3)
    model.root.location = (3.0, -5.0, 2.0)
    bpy.context.view_layer.update()
    files = scan(tmp_path, "edited", sparse_scanner(tmp_path, 60.0))
    written, before = read_parameters(files / "parameters.json"), small_parameters()
    assert set(before.objects) ^ set(written.objects) == {"rail-left", "post-1", "post-2", "sign-2"}
    shift = np.array(written.transform.translate) - np.array(before.transform.translate)
    assert np.allclose(shift, (3.0, -5.0, 2.0), atol=0.001)
    report = json.loads((files / "report.json").read_text())
    assert [entry["object"] for entry in report["edited_by_hand"]] == ["rail-left"]
    assert foreign(files) == {0}
    cloud = laspy.read(files / "cloud.laz")
    strange = np.asarray(cloud["instance_id"]) == 0
    assert set(np.asarray(cloud["class_id"])[strange].tolist()) == {class_id("guardrail")}


def other_lines(own: set[str]) -> list[str]:
    """Return what the file says of all objects, meshes and collections but some; places in the window left out."""
    kept = ("objects[", "meshes[", "collections[")
    return [line for line in lines() if line.startswith(kept) and line.split("]")[0].split("[")[1] not in own]


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
    renamed = build_small(small_parameters(60.0), place=Place(beside=True)).root
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
        build_small(small_parameters(length), place=Place(str(root[ROAD])))
        own |= names_of(root)
        kept = [line for line in before if _name(line) not in own]
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


def _name(line: str) -> str:
    return line.split("]", maxsplit=1)[0].split("[")[1]


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
    model.objects["car"].location = (2.0, 1.0, 0.0)
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
    rail.location = (0.7, 1.2, 0.0)
    bpy.context.view_layer.update()
    assert follow.follow(bpy.context.scene) == ["rail-right"]
    assert modifier_input(rail.modifiers[0], "Offset") > before + 0.5
    assert follow.follow(bpy.context.scene) == []
