"""Materials of several roads in one file: each road has those of its own seed, variation and weather."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.materials import LOOK, constants, scene_name
from synthroads_addon.blender.model.build import BuildTarget, RoadModel
from synthroads_addon.blender.model.roads import ROAD, renew_ids
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.views import pictures
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.materials.table import entry_of
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.scene_hash import lines
from tests.helpers.scenes.small_road import build_small, small_parameters
from tests.helpers.scenes.sparse_scanner import sparse_scanner

PARTS = ("road", "guardrails")
LINE = {"type": "LineMarking", "carriageway": "right", "kind": "lane", "width": 0.15, "dash_length": 0.0}
LINE |= {"gap_length": 0.0, "start_station": 0.0, "end_station": 40.0}
BESIDE = BuildTarget(beside=True)
WET = {"wetness": 0.9, "seed": 9, "asphalt_brightness": 0.8, "paint_wear": 0.6}


def parameters(wetness: float = 0.0, seed: int = 4, **variation: float) -> RoadParameters:
    """Return a short road with a marking, of a seed, wetness and variation of its materials."""
    road = small_parameters(40.0, line=LINE)
    update = {
        "environment": Environment(wetness=wetness),
        "materials": MaterialVariation(**variation),
        "metadata": road.metadata.model_copy(update={"seed": seed}),
    }
    return road.model_copy(update=update)


def used_by(model: RoadModel) -> set[str]:
    """Return the names in the scene of the materials on a road's faces."""
    mesh = scene_mesh(objects=list(model.objects.values()))
    return {mesh.materials[index] for index in np.unique(mesh.material)}


def described() -> list[str]:
    """Return all that the file says of its materials."""
    return [line for line in lines() if line.startswith("materials[") and ".users" not in line]


def show_only(model: RoadModel) -> None:
    """Make a road the current one, and hide all others."""
    bpy.context.view_layer.objects.active = model.root
    for item in bpy.context.scene.objects:
        item.hide_viewport = item.hide_render = item not in {model.root, *model.objects.values()}
    for item in model.objects.values():
        item.hide_viewport = item.hide_render = "synthroads_support" in item


def seen(model: RoadModel, folder: Path) -> dict[str, np.ndarray]:
    """Return what a scan and a renderer see of a road: points, colours, layers and intensities; pixels."""
    show_only(model)
    scan = {"device": sparse_scanner(folder, 20.0), "platform": {"speed": 40.0}, "rays_per_pulse": 1}
    cloud = {"formats": ["npz"], "attributes": ["roughness", "specular"]}
    data = {"fidelity": "draft", "outputs": ["cloud"], "scan": scan, "cloud": cloud, "colour": {"source": "nodes"}}
    scan_scene(SceneScan(Scenario.from_dict(data), folder / "scan", overwrite=True))
    with open_cloud(folder / "scan" / "cloud.npz") as reader:
        blocks = list(reader.blocks())
    names = ("xyz", "rgb", "intensity", "roughness", "specular")
    found = {name: np.concatenate([getattr(block, name) for block in blocks]) for name in names}
    middle = np.array(model.root.matrix_world.translation)
    pictures.light(Environment())
    pictures.camera(middle + [5.0, -2.0, 6.0], middle + [20.0, -6.0, 0.0])
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 2, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 96, 54, 100
    scene.render.image_settings.file_format, scene.render.filepath = "PNG", str(folder / "seen.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(folder / "seen.png"))
    found["picture"] = np.array(image.pixels)
    bpy.data.images.remove(image)
    return found


@pytest.mark.slow
def test_a_road_is_seen_the_same_after_one_with_other_seed_wear_and_wetness_is_built(tmp_path: Path) -> None:
    """Byte for byte; the other one looks otherwise, as it does alone in a file."""
    first = build_small(parameters(), parts=PARTS)
    before, mean = seen(first, tmp_path), constants(["asphalt"])["asphalt"]
    second = build_small(parameters(**WET), parts=PARTS, place=BESIDE)
    after = seen(first, tmp_path)
    assert {name for name in before if before[name].tobytes() != after[name].tobytes()} == set()
    assert constants(["asphalt"])["asphalt"] == mean
    other = seen(second, tmp_path)
    assert other["rgb"].mean() < 0.9 * before["rgb"].mean()
    assert other["roughness"].mean() < 0.8 * before["roughness"].mean()
    assert len(other["intensity"]) == len(before["intensity"]) > 1000
    empty_file()
    alone = seen(build_small(parameters(**WET), parts=PARTS), tmp_path)
    assert {name for name in alone if alone[name].tobytes() != other[name].tobytes()} == set()


def test_both_roads_in_one_scan_have_their_own_materials() -> None:
    first = build_small(parameters(), parts=PARTS)
    second = build_small(parameters(**WET), parts=PARTS, place=BESIDE)
    assert used_by(first) == {"asphalt", "verge", "median", "paint_white", "galvanised_steel", "reflector"}
    differ = {name for name in used_by(second) if name != entry_of(name)}
    assert {entry_of(name) for name in used_by(second)} == used_by(first)
    assert {entry_of(name) for name in differ} == {"asphalt", "verge", "paint_white"}
    whole = scene_mesh()
    assert used_by(first) | used_by(second) <= set(whole.materials)
    means = constants(whole.materials)
    for name in differ:
        assert means[name].base_color != means[entry_of(name)].base_color


def test_to_build_a_road_again_leaves_no_materials_behind_and_those_of_others_as_they_are() -> None:
    """Its own have their usual names again; those that the user named or uses stay."""
    first = build_small(parameters(), parts=PARTS)
    second = build_small(parameters(**WET), parts=PARTS, place=BESIDE)
    kept = described()
    count = len(bpy.data.materials)
    for seed in (11, 12, 4):
        first = build_small(parameters(seed=seed), parts=PARTS, place=BuildTarget(first.road_id))
        assert used_by(first) == {"asphalt", "verge", "median", "paint_white", "galvanised_steel", "reflector"}
        assert len(bpy.data.materials) == count
    assert described() == kept
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.data.materials.append(bpy.data.materials["SR asphalt"])
    build_small(parameters(seed=13), parts=PARTS, place=BuildTarget(first.road_id))
    assert len(bpy.data.materials) == count + 1
    assert {line for line in kept if "SR asphalt]" in line} <= set(described())
    assert used_by(second) <= {scene_name(item) for item in bpy.data.materials}


def test_roads_that_look_alike_share_and_copies_and_appended_ones_keep_theirs(tmp_path: Path) -> None:
    file = tmp_path / "road.blend"
    bpy.data.libraries.write(str(file), {build_small(parameters(**WET), parts=PARTS).collection})
    empty_file()
    first = build_small(parameters(), parts=PARTS)
    count = len(bpy.data.materials)
    build_small(parameters(), parts=PARTS, place=BESIDE)
    assert len(bpy.data.materials) == count
    for item in (first.root, *first.objects.values()):
        item.hide_viewport = False
        item.select_set(True)
    bpy.ops.object.duplicate()
    with bpy.data.libraries.load(str(file)) as (source, wanted):
        wanted.collections = source.collections
    bpy.context.scene.collection.children.link(wanted.collections[0])
    renew_ids()
    before, appended = described(), wanted.collections[0].all_objects
    build_small(parameters(seed=21), parts=PARTS, place=BuildTarget(first.road_id))
    assert set(before) <= set(described())
    root = next(item for item in appended if ROAD in item)
    assert {item.name for item in bpy.data.materials if LOOK in item} > {"SR asphalt", "SR asphalt.001"}
    names = [item.name for item in bpy.data.materials]
    build_small(parameters(**WET | {"seed": 22}), parts=PARTS, place=BuildTarget(str(root[ROAD])))
    assert {item.name for item in bpy.data.materials} < set(names)
    assert {line for line in before if "SR asphalt]" in line} <= set(described())
