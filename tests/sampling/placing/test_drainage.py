"""Gutters and shafts of sampled roads."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.gutter import Gutter
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.road.things.shaft import Shaft
from synthroads_addon.sampling.placing.drainage import GUTTER
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.twin_roads import road

CURVED = {"length": 3000.0, "half_width": 60.0}
CUT = {"embankment_height": {"minimum": -5.0, "maximum": -2.0}}


def drained(seed: int, **limits: Any) -> RoadParameters:
    return road(seed, **CURVED, **limits)


@pytest.mark.parametrize("seed", [1, 2])
def test_gutters_are_where_a_carriageway_falls_towards_the_median(seed: int) -> None:
    parameters = drained(seed)
    geometry = RoadGeometry(parameters)
    station = np.arange(0.25, geometry.length, 0.5)
    found = 0
    for side, section in geometry.sections.items():
        gutters = [item for item in parameters.of_type(Gutter).values() if section.carriageway.sign * item.offset > 0.0]
        inside = np.any([(station > g.start_station) & (station < g.end_station) for g in gutters], axis=0)
        falls = section.carriageway.sign * geometry.crossfall(section.carriageway, station) > 0.0
        assert np.array_equal(inside, falls)
        found += len(gutters)
        for gutter in gutters:
            edge = section.distances(gutter.start_station)[0, 0]
            assert abs(gutter.offset) + GUTTER / 2.0 == pytest.approx(edge)
            assert gutter.kerb_side == ("left" if side == "right" else "right")
    assert found > 1


@pytest.mark.parametrize(("limits", "kind"), [({}, "manhole"), (CUT, "inlet")])
def test_shafts_stand_at_even_distances_in_swale_or_verge(limits: Any, kind: str) -> None:
    parameters = drained(3, turnouts={"exits": 0, "entries": 0, "emergency_bays": 0}, **limits)
    geometry, terrain = RoadGeometry(parameters), parameters.terrain
    assert terrain is not None
    for section in geometry.sections.values():
        sign = section.carriageway.sign
        shafts = sorted(
            (s for s in parameters.of_type(Shaft).values() if sign * s.offset > 0.0), key=lambda s: s.station
        )
        assert {shaft.kind for shaft in shafts} == {kind}
        apart = [b.station - a.station for a, b in pairwise(shafts)]
        assert min(apart) >= 50.0 - 20.0
        assert 50.0 <= float(np.mean(apart)) <= 80.0
        beyond = np.array([abs(s.offset) - section.road_edge(s.station)[0] for s in shafts])
        if kind == "inlet":
            assert beyond.min() > terrain.swale_width / 2.0 - 1e-6
            assert np.median(beyond) == pytest.approx(terrain.swale_width / 2.0)
        else:
            assert (beyond + section.carriageway.verge_width > 1.0).all()


@pytest.mark.parametrize(("design_class", "length", "seed"), [("EKA1A", 600.0, 12), ("EKA1B", 3000.0, 30005)])
def test_shafts_in_a_swale_stand_clear_of_a_noise_barrier(design_class: str, length: float, seed: int) -> None:
    """Two of the roads on which shafts reached 5 and 56 mm into one."""
    scenario = RoadScenario(design_class=design_class, cross_section="RQ43.5", length=length)
    parameters = sample_road(scenario, seed)
    assert parameters.of_type(NoiseBarrier)
    assert parameters.of_type(Shaft)
    assert check(parameters) == []


def test_there_are_none_where_none_are_wanted() -> None:
    parameters = drained(1, furniture={"gutters": False, "shafts": False})
    assert not parameters.of_type(Gutter)
    assert not parameters.of_type(Shaft)
