"""Every material that is shipped has a program, which gives what Cycles gives."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.cameras.calculator import reading_copy
from synthroads_addon.blender.materials import RoadMaterials, material
from synthroads_addon.materials.table import materials
from synthroads_addon.materials.textures import texture_sets
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from synthroads_addon.scanning.colour.colour import MATERIAL_LAYERS
from synthroads_addon.scanning.scene.surface_values import SurfaceInput
from tests.helpers.scenes.node_cases import material_deviations
from tests.helpers.scenes.texture_folder import checkerboard, halves, plain, write_set

CLOSEST = 1e-5
PLACES = 700
LAYERS = tuple(MATERIAL_LAYERS)


def _values(item: bpy.types.Material, size: float) -> dict[SurfaceInput, np.ndarray]:
    """Return what a material reads at places in a cube of a size (m), about as a road has it."""
    random = np.random.default_rng(11)
    with reading_copy(item, LAYERS) as copy:
        asked = sorted({what for what, _ in copy.readers})
    result = {}
    for what in asked:
        values = random.uniform(-1.0, 1.0, (PLACES, 4)).astype(np.float32)
        if what.name == "pavement":
            station, code = random.uniform(0.0, 2.0 * size, PLACES), random.integers(0, 5, PLACES)
            values[:, 0], values[:, 1] = station, 2.0 * values[:, 1]
            values[:, 2] = 100.0 * code + random.uniform(2.0, 4.0, PLACES)
        elif what.name == "pavement_shape":
            values = 5.0 + 0.1 * np.abs(values)
        elif what.kind == "position":
            values *= size
        elif what.kind == "attribute":
            values *= 20.0
        elif "normal" in what.kind:
            values[:, :3] /= np.linalg.norm(values[:, :3], axis=1, keepdims=True)
        result[what] = np.ascontiguousarray(values, np.float32)
    return result


@pytest.mark.parametrize("size", [30.0, 600.0, 30_000.0])
def test_every_material_of_the_table(size: float) -> None:
    names = list(materials())
    items = [material(name) for name in names]
    fed = [_values(item, size) for item in items]
    empty = [number for number, values in enumerate(fed) if not values]
    for number in empty:  # the same everywhere
        fed[number] = {SurfaceInput("position"): np.zeros((PLACES, 4), np.float32)}
    found = dict(zip(names, material_deviations(items, fed, LAYERS, varying=False), strict=True))
    assert len(found) > 70
    assert len(empty) < 20
    assert {name: apart for name, apart in found.items() if apart != pytest.approx(0.0, abs=CLOSEST)} == {}


@pytest.mark.parametrize("name", ["asphalt", "verge"])
def test_materials_with_a_roads_textures(name: str, tmp_path: Path) -> None:
    """Those of a pavement lie along the road, others by the place in the world."""
    write_set(tmp_path / name, 2.0, base_color=checkerboard(), roughness=halves(), normal=plain(120, 140, 250))
    (texture,) = texture_sets(str(tmp_path))[name]
    item = RoadMaterials(MaterialVariation(textures=(texture,)), Environment()).material(name)
    (apart,) = material_deviations([item], [_values(item, 40.0)], LAYERS)
    assert apart == pytest.approx(0.0, abs=CLOSEST)
