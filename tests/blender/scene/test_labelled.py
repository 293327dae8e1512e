"""A built road through USD and glTF and back, as `scan` reads scenes of others: no class, no instance is lost."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_scheme
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.scene.foreign import open_scene
from synthroads_addon.blender.scene.labelled import labelled_scene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.twin.scene.labelled import LabelledScene
from synthroads_addon.twin.scene.registry import ENTRIES, write_scene
from tests.helpers.scenes.small_road import open_small, small_parameters

LARGE = 4_000_000_003
"""Instance number beyond what a whole number with a sign holds in 32 bits, or a float exactly."""


@pytest.fixture(scope="module")
def built() -> tuple[LabelledScene, SceneMesh]:
    """A short road with barriers, a sign, posts and a car, and three sheets that share a mesh."""
    open_small()
    plain = bpy.data.meshes.new("plain")
    plain.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    for number in (501, 502, LARGE):
        sheet = bpy.data.objects.new(f"sheet {number}", plain)
        sheet.location = (number % 100, 30.0, 1.0)
        sheet.rotation_euler[2] = 0.3
        sheet.scale = (1.0, 2.0, 0.5)
        sheet["synthroads_class"], sheet["synthroads_instance"] = "road_sign", number - (2**32 if number > 2**31 else 0)
        bpy.context.collection.objects.link(sheet)
    bpy.context.view_layer.update()
    geometry = RoadGeometry(small_parameters())
    return labelled_scene(geometry, class_scheme("17"), title='a "road"'), scene_mesh()


def totals(mesh: SceneMesh) -> dict[tuple[int, int, str], tuple[float, int]]:
    """Return area, m2, and number of triangles by class, instance and material."""
    areas = mesh.areas()
    table: dict[tuple[int, int, str], tuple[float, int]] = {}
    names = [name.rsplit("#", 1)[0] for name in mesh.materials]
    keys = np.stack([mesh.class_id.astype(np.int64), mesh.instance_id.astype(np.int64), mesh.material.astype(np.int64)])
    unique, index = np.unique(keys, axis=1, return_inverse=True)
    for column, key in enumerate(unique.T.tolist()):
        rows = index.ravel() == column
        table[key[0], key[1], names[key[2]]] = (float(areas[rows].sum()), int(rows.sum()))
    return table


@pytest.mark.parametrize("name", ["usd", "gltf"])
def test_no_class_and_no_instance_is_lost(built: tuple[LabelledScene, SceneMesh], tmp_path: Path, name: str) -> None:
    scene, mesh = built
    write_scene(scene, name, tmp_path)
    empty_file()
    open_scene(tmp_path / ENTRIES[name].file)
    back, wanted = totals(scene_mesh()), totals(mesh)
    assert {key[:2] for key in back} == {key[:2] for key in wanted}
    assert {number for _, number, _ in wanted} >= {501, 502, LARGE}
    assert back.keys() == wanted.keys()
    for key, (area, count) in wanted.items():
        assert back[key] == (pytest.approx(area, rel=1e-4, abs=1e-6), count), key


@pytest.mark.parametrize("name", ["usd", "gltf"])
def test_places_stay_to_a_millimetre(built: tuple[LabelledScene, SceneMesh], tmp_path: Path, name: str) -> None:
    scene, mesh = built
    write_scene(scene, name, tmp_path)
    empty_file()
    open_scene(tmp_path / ENTRIES[name].file)
    assert np.abs(scene_mesh().vertex_bounds() - mesh.vertex_bounds()).max() < 1e-3


def test_the_same_scene_gives_the_same_bytes(built: tuple[LabelledScene, SceneMesh], tmp_path: Path) -> None:
    for name in ("usd", "gltf"):
        for folder in (tmp_path / "a", tmp_path / "b"):
            folder.mkdir(exist_ok=True)
            write_scene(built[0], name, folder)
        file = ENTRIES[name].file
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
