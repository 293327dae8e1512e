"""Free assets out of .blend, .glb and .obj files."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
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
    model = build_road(parameters, 0.02, 0.0, ("terrain", "assets"))
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
    build_road(parameters.model_copy(update={"objects": objects}), 0.02, 0.0, ("road", "assets"))
    assert len([item for item in bpy.data.meshes if item.name.startswith(("Box", "Cube"))]) == 1
    build_road(parameters, 0.02, 0.0, ("road",))
    assert not [item for item in bpy.data.objects if item.name.startswith("box-")]


def test_faults_are_named(tmp_path: Path) -> None:
    (tmp_path / "box.glb").write_bytes(b"no glTF at all")
    with pytest.raises(InputError, match=r"box\.glb"):
        build_road(road_with(library(tmp_path, "box.glb")), 0.02, 0.0, ("road", "assets"))
    save_cube(tmp_path / "box.blend")
    with pytest.raises(InputError, match="holds no such object"):
        build_road(road_with(library(tmp_path, "box.blend", object="Ball")), 0.02, 0.0, ("road", "assets"))
    with pytest.raises(InputError, match="has no such asset"):
        build_road(road_with(library(tmp_path, "box.blend"), name="ball"), 0.02, 0.0, ("road", "assets"))
