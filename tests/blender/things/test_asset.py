"""Free assets out of .blend, .glb and .obj files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.asset import Asset
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario


def save_cube(path: Path) -> None:
    """Write a cube of 1 m that stands on the origin."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 0.5))
    bpy.context.object.name = "Box"
    if path.suffix == ".blend":
        bpy.data.libraries.write(str(path), {bpy.context.object})
    elif path.suffix == ".glb":
        bpy.ops.export_scene.gltf(filepath=str(path))
    else:
        bpy.ops.wm.obj_export(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def road_with(library: Path, **changes: object) -> RoadParameters:
    parameters = sample_road(RoadScenario.from_dict({"length": 120.0, "vehicles": NO_CARS, "furniture": BARE}), 1)
    asset = Asset(
        instance=900, station=60.0, offset=-25.0, library=str(library), name="box", class_name="utility", scale=2.0
    )
    objects = parameters.objects | {"box-1": asset.model_copy(update=changes)}
    return parameters.model_copy(update={"objects": objects})


NO_CARS = {"per_km": {"minimum": 0.0, "maximum": 0.0}}
BARE = {"signs": False, "gantries": 0.0, "overpass": 0.0}


def library(folder: Path, file: str, **more: object) -> Path:
    place = {
        "side": "both",
        "distance": {"minimum": 5.0, "maximum": 6.0},
        "per_km": {"minimum": 1.0, "maximum": 1.0},
    }
    box = {"file": file, "class_name": "utility", "placement": place, **more}
    path = folder / "library.json"
    path.write_text(json.dumps({"type": "AssetLibrary", "version": "1.0", "assets": {"box": box}}))
    return path


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".obj"])
def test_an_asset_stands_on_the_ground_with_its_class_and_instance(tmp_path: Path, suffix: str) -> None:
    save_cube(tmp_path / f"box{suffix}")
    parameters = road_with(library(tmp_path, f"box{suffix}"))
    model = build_road(BuildRequest(parameters, 0.02, 0.0, ("terrain", "assets")))
    mesh = scene_mesh()
    chosen = mesh.instance_id == 900
    assert set(mesh.class_id[chosen]) == {class_id("utility")}
    corners = mesh.vertices[mesh.triangles[chosen]].reshape(-1, 3)
    assert np.allclose(np.ptp(corners[:, 2]), 2.0, atol=1e-3)
    geometry = RoadGeometry(parameters)
    station, offset = geometry.alignment.project(corners[:, :2].astype(np.float64))
    assert np.isclose((station.min() + station.max()) / 2.0, 60.0, atol=0.05)
    assert np.isclose((offset.min() + offset.max()) / 2.0, -25.0, atol=0.05)
    ground = mesh.vertices[mesh.triangles[mesh.class_id == class_id("ground")]].reshape(-1, 3)
    near = ground[np.linalg.norm(ground[:, :2] - corners[:, :2].mean(axis=0), axis=1) < 4.0]
    assert near[:, 2].min() - 0.1 < corners[:, 2].min() < near[:, 2].max() + 0.1
    assert "box-1" in model.objects


def test_copies_share_one_collection_and_go_with_the_road(tmp_path: Path) -> None:
    save_cube(tmp_path / "box.blend")
    parameters = road_with(library(tmp_path, "box.blend"))
    objects = dict(parameters.objects)
    for number in range(5):
        objects[f"box-{number + 2}"] = objects["box-1"].model_copy(
            update={"instance": 901 + number, "station": 10.0 + 10.0 * number}
        )
    build_road(BuildRequest(parameters.model_copy(update={"objects": objects}), 0.02, 0.0, ("road", "assets")))
    assert len([item for item in bpy.data.meshes if item.name.startswith(("Box", "Cube"))]) == 1
    build_road(BuildRequest(parameters, 0.02, 0.0, ("road",)))
    assert not [item for item in bpy.data.objects if item.name.startswith("box-")]


def test_faults_are_named(tmp_path: Path) -> None:
    (tmp_path / "box.glb").write_bytes(b"no glTF at all")
    with pytest.raises(InputError, match=r"box\.glb"):
        build_road(BuildRequest(road_with(library(tmp_path, "box.glb")), 0.02, 0.0, ("road", "assets")))
    save_cube(tmp_path / "box.blend")
    with pytest.raises(InputError, match="has no object of this name"):
        build_road(
            BuildRequest(road_with(library(tmp_path, "box.blend", object="Ball")), 0.02, 0.0, ("road", "assets"))
        )
    with pytest.raises(InputError, match="has no asset of this name"):
        build_road(BuildRequest(road_with(library(tmp_path, "box.blend"), name="ball"), 0.02, 0.0, ("road", "assets")))


# What of a file stands beside the road


def _cube(name: str, size: float = 1.0, collection: bpy.types.Collection | None = None) -> bpy.types.Object:
    half = size / 2.0
    corners = [(x, y, z + half) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(item)
    return item


def _units(system: str, scale: float, size: float) -> None:
    bpy.context.scene.unit_settings.system = system
    bpy.context.scene.unit_settings.scale_length = scale
    _cube("Box", size)


def _helper(how: str) -> None:
    """A box of 1 m in a hull of 6 m that renders don't show."""
    _cube("Box")
    part = bpy.data.collections.new("Hulls")
    bpy.context.scene.collection.children.link(part)
    hull = _cube("UCX_Box", 6.0, part)
    if how == "object":
        hull.hide_render = True
    elif how == "collection":
        part.hide_render = True
    elif how == "excluded":
        bpy.context.view_layer.layer_collection.children["Hulls"].exclude = True
    elif how == "camera":
        hull.visible_camera = False


def _shown_in_renders(how: str) -> None:
    """A box of 1 m and 3 m high, of which the viewport doesn't show all."""
    item = _cube("Box")
    if how == "array":
        made = item.modifiers.new("Array", "ARRAY")
        made.count, made.show_viewport = 3, False
        made.use_relative_offset, made.relative_offset_displace = True, (0.0, 0.0, 1.0)
        return
    top = _cube("Top")
    top.location.z = 2.0
    top.hide_viewport = how == "screen"
    top.hide_set(how == "eye")


def _two_scenes() -> None:
    _cube("Box")
    spare = bpy.data.scenes.new("Spare")
    other = bpy.data.objects.new("Draft", bpy.data.meshes["Box"].copy())
    spare.collection.objects.link(other)
    other.hide_render = True
    other.scale = (9.0, 9.0, 9.0)


KINDS: dict[str, tuple[Any, tuple[float, float, float]]] = {
    "metres": (lambda: _units("METRIC", 1.0, 2.0), (2.0, 2.0, 2.0)),
    "centimetres": (lambda: _units("METRIC", 0.01, 200.0), (2.0, 2.0, 2.0)),
    "millimetres": (lambda: _units("METRIC", 0.001, 2000.0), (2.0, 2.0, 2.0)),
    "feet": (lambda: _units("IMPERIAL", 0.3048, 10.0), (3.048, 3.048, 3.048)),
    "no units": (lambda: _units("NONE", 0.01, 2.0), (2.0, 2.0, 2.0)),
    "hidden hull": (lambda: _helper("object"), (1.0, 1.0, 1.0)),
    "hidden collection": (lambda: _helper("collection"), (1.0, 1.0, 1.0)),
    "excluded collection": (lambda: _helper("excluded"), (1.0, 1.0, 1.0)),
    "unseen by cameras": (lambda: _helper("camera"), (1.0, 1.0, 1.0)),
    "shown hull": (lambda: _helper("shown"), (6.0, 6.0, 6.0)),
    "array in renders": (lambda: _shown_in_renders("array"), (1.0, 1.0, 3.0)),
    "off in the viewport": (lambda: _shown_in_renders("screen"), (1.0, 1.0, 3.0)),
    "an eye that is shut": (lambda: _shown_in_renders("eye"), (1.0, 1.0, 3.0)),
    "two scenes": (_two_scenes, (1.0, 1.0, 1.0)),
}
"""Files by what is in them, and the size of what stands, m."""


def _saved(path: Path, build: Any) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build()
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def _size_of_asset(library_path: Path) -> np.ndarray:
    parameters = road_with(library_path, scale=1.0, rotation_deg=0.0)
    build_road(BuildRequest(parameters, 0.02, 0.0, ("terrain", "assets")))
    mesh = scene_mesh()
    corners = mesh.vertices[mesh.triangles[mesh.instance_id == 900]].reshape(-1, 3).astype(np.float64)
    heading = RoadGeometry(parameters).alignment.heading(np.array([60.0]))[0] - np.pi / 2.0
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    corners[:, :2] = corners[:, :2] @ turn.T
    return np.ptp(corners, axis=0)


@pytest.mark.any_blender
@pytest.mark.parametrize("kind", KINDS)
def test_of_a_file_stands_what_its_renders_show_in_metres(kind: str, tmp_path: Path) -> None:
    build, size = KINDS[kind]
    _saved(tmp_path / "box.blend", build)
    before = {name: len(getattr(bpy.data, name)) for name in ("scenes", "worlds", "cameras")}
    assert np.allclose(_size_of_asset(library(tmp_path, "box.blend")), size, atol=1e-3)
    assert {name: len(getattr(bpy.data, name)) for name in before} == before


def test_an_object_that_is_named_stands_even_if_it_is_hidden(tmp_path: Path) -> None:
    _saved(tmp_path / "box.blend", lambda: _helper("object"))
    size = _size_of_asset(library(tmp_path, "box.blend", object="UCX_Box"))
    assert np.allclose(size, 6.0, atol=1e-3)


def test_a_file_that_shows_nothing_is_refused(tmp_path: Path) -> None:
    def hidden() -> None:
        _cube("Box").hide_render = True

    _saved(tmp_path / "box.blend", hidden)
    with pytest.raises(InputError, match="has no object that renders show"):
        _size_of_asset(library(tmp_path, "box.blend"))


def test_a_library_that_the_file_links_already_stays(tmp_path: Path) -> None:
    _saved(tmp_path / "box.blend", lambda: _cube("Box"))
    with bpy.data.libraries.load(str(tmp_path / "box.blend"), link=True) as (_, wanted):
        wanted.objects = ["Box"]
    assert np.allclose(_size_of_asset(library(tmp_path, "box.blend")), 1.0, atol=1e-3)
    assert len(bpy.data.libraries) == 1
    assert [item.name for item in bpy.data.scenes if item.library is not None] == []
