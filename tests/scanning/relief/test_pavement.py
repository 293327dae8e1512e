"""Heights of the pavement at points: those of the parameters, whatever the strength of the micro-relief."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.road.damage import DAMAGES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.outlines import CRACK_FILM, PATCH_FILM
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.scanning.relief.micro_relief import BeamEnds, MicroRelief, shift_by_relief
from synthroads_addon.scanning.relief.pavement import PavementRelief
from tests.helpers.clouds.random_points import make_points
from tests.helpers.effects.road_cases import base_road

FLAT = MicroRelief(np.array([0.0, 0.001]), np.array([0.1, 0.1]))


@pytest.fixture(scope="module")
def geometry() -> RoadGeometry:
    data = deepcopy(base_road({}))
    pavement = data["objects"]["right"]["pavement"]
    pavement["patches"][0]["height"], pavement["cracks"][0]["depth"] = -0.004, 0.015
    return RoadGeometry(RoadParameters.from_dict(data))


def places(geometry: RoadGeometry, station: np.ndarray, offset: np.ndarray) -> np.ndarray:
    local = np.column_stack([geometry.alignment.place(station, offset), np.zeros(len(station))])
    return local + geometry.parameters.transform.translate


def test_points_have_the_heights_of_the_surface(geometry: RoadGeometry) -> None:
    """Numbers say what a point is on; of patches and cracks the mesh's film is taken off."""
    rng, surface, relief = np.random.default_rng(4), PavementSurface(geometry), PavementRelief(geometry)
    station, offset = rng.uniform(16.0, 59.0, 2000), rng.uniform(-9.0, -6.5, 2000)
    right = geometry.parameters.carriageway("right")
    found = relief.heights(np.full(2000, right.instance), places(geometry, station, offset))
    assert found == pytest.approx(surface.height(station, offset), abs=1e-9)
    assert np.ptp(found) > 0.004
    kinds = {DAMAGES[kind]: number for number, kind in geometry.numbers.damages().items()}
    on_patch, on_crack = np.array([10.0]), np.array([20.0])
    for kind, film, station, offset in (
        ("patch", PATCH_FILM, on_patch, np.array([-4.0])),
        ("longitudinal crack", CRACK_FILM, on_crack, np.array([-6.1])),
    ):
        found = relief.heights(np.full(1, kinds[kind]), places(geometry, station, offset))
        assert found + film == pytest.approx(surface.height(station, offset), abs=1e-9), kind


def test_lines_lie_on_the_waves_and_verges_have_none(geometry: RoadGeometry) -> None:
    relief, parameters = PavementRelief(geometry), geometry.parameters
    dash = geometry.numbers.parts["line"].first
    edge = float(geometry.sections["right"].paved_edge(30.0)[0])
    place = places(geometry, np.array([30.0, 30.0]), np.array([-6.5, -edge - 0.5]))
    numbers = np.array([dash, parameters.carriageway("right").instance])
    waves = PavementSurface(geometry).waves(
        parameters.carriageway("right").pavement, place - parameters.transform.translate
    )
    assert relief.heights(numbers, place) == pytest.approx([waves[0], 0.0])
    assert relief.heights(np.array([999_999, 0]), place).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("strength", [0.5, 20.0])
def test_the_truth_has_the_pavement_s_height_and_not_the_relief(strength: float) -> None:
    count = 500
    position = np.random.default_rng(1).uniform(-9.0, 9.0, (count, 3)) * [1.0, 1.0, 0.0]
    points = replace(
        make_points(count),
        xyz=position.copy(),
        true_xyz=position.copy(),
        range=np.full(count, 30.0),
        true_range=np.full(count, 30.0),
        normal=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (count, 1)),
        incidence_deg=np.full(count, 60.0, np.float32),
        material=(np.arange(count) % 2).astype(np.uint16),
    )
    raised = np.where(np.arange(count) < 250, -0.004, 0.0)
    beam = np.tile([np.sqrt(0.75), 0.0, 0.5], (count, 1))
    shifted = shift_by_relief(points, BeamEnds(position, beam), FLAT, strength, 1, surface_heights=raised)
    bare = shift_by_relief(points, BeamEnds(position, beam), FLAT, strength, 1)
    assert shifted.true_xyz[:, 2] == pytest.approx(raised)
    assert shifted.true_range == pytest.approx(np.sqrt(30.0**2 - 30.0 * raised + raised**2))
    assert shifted.xyz[:, 2] == pytest.approx(bare.xyz[:, 2] + raised)
    assert np.all(bare.true_xyz == position)
    assert shifted.xyz[::2, 2] == pytest.approx(raised[::2])
