"""Scenes far from their origin: the steps of single precision are told, or too coarse to scan."""

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.scan_scene import route_site
from synthroads_addon.scanning.platforms.over_scene import SceneRoute
from synthroads_addon.scanning.scene.map_coordinates import rounding_warnings, shift_of, step_at, to_scene_axes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.files.map_meshes import FACES, GROUND


def ground(place: tuple[float, float, float]) -> SceneMesh:
    count = len(FACES)
    return SceneMesh(
        vertices=(GROUND + place).astype(np.float32),
        triangles=FACES.astype(np.int32),
        class_id=np.zeros(count, np.uint8),
        instance_id=np.zeros(count, np.uint32),
        material=np.zeros(count, np.uint16),
        materials=("asphalt",),
        origin=np.zeros(3),
    )


def test_steps_double_with_the_distance() -> None:
    assert [step_at(at) for at in (10_000.0, -40_000.0, 294_000.0, 5_628_000.0)] == [2**-10, 2**-8, 2**-5, 0.5]


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ((0.0, 0.0, 0.0), []),
        ((10_000.0, 0.0, 0.0), []),
        ((0.0, -40_000.0, 0.0), ["coordinates of up to 40,000 m are held in steps of 4 mm"]),
    ],
)
def test_steps_are_told(place: tuple[float, float, float], told: list[str]) -> None:
    assert rounding_warnings(ground(place), "ground.glb") == told


def test_the_panel_refuses_map_coordinates_before_it_scans() -> None:
    with pytest.raises(InputError, match=r"the open scene: coordinates .* steps of 0\.5 m there: move it near the"):
        route_site(
            Scenario(), ScenarioInputs.read(Scenario()), SceneRoute("extent"), ground((294_000.0, 5_628_000.0, 0.0))
        )


def test_whole_metres_are_subtracted_where_the_scene_is_far() -> None:
    low, high = [294_000.2, -5.0, 700.0], [294_010.0, 5.0, 710.0]
    assert shift_of(np.array([low, high])).tolist() == [294_005.0, 0.0, 0.0]
    shift = np.array([1.0, 2.0, 3.0])
    assert to_scene_axes(shift, ".obj", None).tolist() == [1.0, -3.0, 2.0]
    assert to_scene_axes(shift, ".obj", "z").tolist() == to_scene_axes(shift, ".ply", None).tolist() == [1.0, 2.0, 3.0]
