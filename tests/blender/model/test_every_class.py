"""A road with something of every class: what is in the parameter set is in the scene, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.classes import classes
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.checking.checker import check
from synthroads_addon.materials.table import UNKNOWN
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.surroundings import Landscape
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import load_scenario

pytestmark = [pytest.mark.any_blender, pytest.mark.first_python]  # one long thing


@pytest.fixture(scope="module")
def parameters() -> RoadParameters:
    scenario = load_scenario("every-class-1500m")
    return sample_road(scenario.road, scenario.seed)


@pytest.fixture(scope="module")
def mesh(parameters: RoadParameters) -> SceneMesh:
    build_road(BuildRequest(parameters, 0.1, 0.1))
    return scene_mesh()


def test_the_road_keeps_every_rule(parameters: RoadParameters) -> None:
    assert check(parameters) == []


def test_all_17_classes_occur(mesh: SceneMesh) -> None:
    assert set(np.unique(mesh.class_id).tolist()) == {row.id for row in classes()}


def test_every_face_has_an_instance_of_the_set_and_a_material(parameters: RoadParameters, mesh: SceneMesh) -> None:
    numbers = InstanceNumbers(parameters)
    owners = {numbers.owner(number) for number in np.unique(mesh.instance_id).tolist()}
    assert owners <= set(parameters.objects)
    assert UNKNOWN not in {mesh.materials[i] for i in np.unique(mesh.material)}
    # Whatever stands in the set has faces, but for the axis, and the landscape that pictures alone show.
    missing = {
        name
        for name, item in parameters.objects.items()
        if name not in owners and not isinstance(item, AlignmentObject | Landscape)
    }
    assert missing == set()
