"""Strays: few places far from all others, and no places of a scene or cloud of any usual kind."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.cloud import strays as module
from synthroads_addon.cloud.strays import Strays


def around(middle: tuple[float, float, float], count: int = 5000, size: float = 300.0) -> np.ndarray:
    return np.array(middle) + np.random.default_rng(1).uniform(-size, size, (count, 3))


def of(*parts: np.ndarray) -> Strays:
    strays = Strays()
    for part in parts:
        strays.add(part)
    return strays


@pytest.mark.parametrize("stray", [(1e6, 0.0, 0.0), (0.0, 0.0, -1e6), (-1e8, 1e8, 1e8), (5000.0, 0.0, 0.0)])
def test_a_place_far_from_all_others_strays(stray: tuple[float, float, float]) -> None:
    body = around((0.0, 0.0, 0.0))
    strays = of(body[:2000], np.array([stray]), body[2000:])
    assert strays.count() == 1
    assert strays.belongs(body).all()
    assert not strays.belongs(np.array([stray])).any()


def test_nothing_strays_from_roads_stretches_of_roads_and_clouds_of_few_points() -> None:
    road = np.column_stack([np.linspace(0.0, 30_000.0, 20_000), np.zeros((20_000, 2))])
    assert of(road).count() == 0
    assert of(around((0.0, 0.0, 0.0)), around((9e5, 5e6, 0.0), 100)).count() == 0  # two stretches, one of them short
    assert of(np.array([[0.0, 0.0, 0.0], [1e6, 1e6, 0.0]])).count() == 0
    assert of(np.zeros((0, 3))).count() == 0


def test_places_scattered_over_a_country_take_bounded_time_and_are_all_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST_CUBES", 500)
    places = np.random.default_rng(2).uniform(-1e6, 1e6, (20_000, 3))
    strays = of(*np.split(places, 20))
    assert len(strays._keys) <= 500
    assert strays._counts.sum() == len(places)
    assert strays.count() == 0


def test_it_does_not_matter_how_places_come_in_blocks() -> None:
    places = np.concatenate([around((0.0, 0.0, 0.0)), around((1e5, 0.0, 0.0), 7), around((0.0, 3e5, 0.0), 4000)])
    whole, parts = of(places), of(*np.array_split(places, 13))
    assert whole.count() == parts.count() == 7
    np.testing.assert_array_equal(whole.belongs(places), parts.belongs(places))
