"""Trees that stand alone: their measures in the model, and their solids beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.road.things.body import LEVEL
from synthroads_addon.road.things.tree import Tree
from tests.helpers.roads.thing_variants import straight_road
from tests.helpers.scenes.furnished_road import FurnishedRoad

MEASURES: list[dict[str, Any]] = [
    {"species": "maple", "height": 12.0, "trunk_diameter": 0.5, "crown_diameter": 8.0, "crown_bottom": 4.6},
    {"species": "poplar", "height": 20.0, "trunk_diameter": 0.8, "crown_diameter": 5.0, "crown_bottom": 3.0},
]


@pytest.mark.parametrize("measures", MEASURES)
def test_the_model_has_the_measures_of_its_solids(measures: dict[str, Any]) -> None:
    data = {"tree": {"type": "Tree", "station": 50.0, "offset": -16.0, "rotation_deg": 0.0, **measures}}
    road = FurnishedRoad(straight_road(data), ["avenue_trees"], detail=1.0)
    if "tree" not in road.model.objects:
        pytest.fail("the tree isn't built")
    mesh = scene_mesh(objects=[road.model.objects["tree"]])
    names = np.array(mesh.materials)[mesh.material]
    bark = mesh.vertices[np.unique(mesh.triangles[names == f"{measures['species']}_bark"])].astype(np.float64)
    foot = bark[:, 2].min() + 0.02 * measures["height"]
    assert mesh.vertices[:, 2].max() - foot == pytest.approx(measures["height"], abs=0.02 * measures["height"])
    # The trunk at half a metre: as thick as its solid there, but for the wider foot of the model.
    tree = Tree.from_dict({"instance": 1, "station": 50.0, "offset": -16.0, **data["tree"]})
    trunk, crown = (body.sections for body in tree.bodies(LEVEL))
    assert np.ptp(trunk[0][:, 0]) == pytest.approx(measures["trunk_diameter"], rel=1e-6)
    assert crown[..., 2].max() == pytest.approx(measures["height"])
    assert crown[..., 2].min() == pytest.approx(measures["crown_bottom"])
    assert 0.9 * measures["crown_diameter"] < np.ptp(crown[..., 0]) <= measures["crown_diameter"] + 1e-9
    leaves = mesh.vertices[np.unique(mesh.triangles[names == f"{measures['species']}_leaves"])].astype(np.float64)
    low, high = leaves.min(axis=0), leaves.max(axis=0)
    assert high[0] - low[0] == pytest.approx(measures["crown_diameter"], rel=0.3)
    assert low[2] - foot > 0.55 * measures["crown_bottom"]
