"""The landscape: continuous at the terrain's edge, without gaps, with the shares that are said, clear of the road."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.landscape.parcels import KINDS, Parcels, parcels_of
from synthroads_addon.road.landscape.relief import LandRelief
from synthroads_addon.road.landscape.trees import LandTrees, land_trees
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Landscape
from synthroads_addon.road.terrain import surface_elevation
from tests.helpers.roads.furnished_data import road_data

LANDSCAPE = {"type": "Landscape", "reach": 1500.0, "seed": 4, "villages": [{"x": 400.0, "y": 600.0}]}


def road(**fields: Any) -> tuple[RoadGeometry, Landscape]:
    parameters = RoadParameters.from_dict(road_data({"land": LANDSCAPE | fields}))
    return RoadGeometry(parameters), next(iter(parameters.of_type(Landscape).values()))


@cache
def made() -> tuple[RoadGeometry, Landscape, Parcels, LandRelief, LandTrees]:
    geometry, landscape = road()
    parcels, relief = parcels_of(geometry, landscape), LandRelief(geometry, landscape)
    return geometry, landscape, parcels, relief, land_trees(geometry, landscape, parcels, relief)


def test_at_its_edge_the_terrain_goes_on() -> None:
    geometry, _, _, relief, _ = made()
    station = np.linspace(0.0, geometry.length, 40)
    for side in (-1.0, 1.0):
        offset = np.full(40, side * relief.half_width)
        plan = geometry.alignment.place(station, offset)
        known = surface_elevation(geometry, station, offset)
        assert np.abs(relief.elevation_beside(plan, station, offset) - known).max() < 1e-6
        beside = geometry.alignment.place(station, offset + side * 2.0)
        assert np.abs(relief.elevation(beside) - known).max() < 0.1


def test_hills_have_their_height_far_out() -> None:
    geometry, landscape = road(hill_height=30.0, reach=9000.0)
    rng = np.random.default_rng(1)
    plan = rng.uniform(-9000.0, 9000.0, (4000, 2))
    far = plan[np.abs(geometry.alignment.project(plan)[1]) > 2000.0]
    assert np.std(LandRelief(geometry, landscape).elevation(far)) == pytest.approx(30.0, rel=0.25)


def test_parcels_cover_the_land_without_gaps() -> None:
    geometry, landscape, parcels, _, _ = made()
    middle = geometry.alignment.position(np.array([geometry.length / 2.0]))[0]
    assert parcels.area.min() > 0.0
    assert parcels.area.sum() == pytest.approx((2.0 * landscape.reach) ** 2, rel=1e-6)
    plan = middle + np.random.default_rng(2).uniform(-0.7, 0.7, (3000, 2)) * landscape.reach
    assert (parcels.of_points(plan) >= 0).all()
    away = np.linalg.norm(parcels.middle - middle, axis=1)
    assert parcels.area[away < 500.0].mean() < 0.6 * parcels.area[away > 1000.0].mean()


@pytest.mark.parametrize("share", [0.0, 0.25, 0.6])
def test_forest_and_meadow_have_their_shares(share: float) -> None:
    parcels = parcels_of(*road(forest_share=share, meadow_share=0.3))
    for kind, wanted in (("forest", share), ("meadow", 0.3)):
        found = parcels.area[parcels.kind == KINDS.index(kind)].sum() / parcels.area.sum()
        assert wanted - 0.03 < found <= wanted


def test_trees_stand_in_forests_clear_of_road_and_villages() -> None:
    geometry, landscape, _, relief, trees = made()
    station, offset = geometry.alignment.project(trees.foot[:, :2])
    built = (station > 0.0) & (station < geometry.length)
    assert len(trees.foot) > 1000
    assert np.abs(offset[built]).min() > relief.half_width
    village = landscape.villages[0]
    assert np.linalg.norm(trees.foot[:, :2] - (village.x, village.y), axis=1).min() > village.radius
    assert trees.foot[:, 2] == pytest.approx(relief.elevation(trees.foot[:, :2]))


def test_shares_above_all_of_the_land_are_refused() -> None:
    with pytest.raises(InputError, match="must not be more than 1 together"):
        road(forest_share=0.7, meadow_share=0.4)
