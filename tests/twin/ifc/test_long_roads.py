"""See that a place of a long road costs what one of a short road does: else models took the square of the length."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import PointObject
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.cover import MarkingFilms
from synthroads_addon.road.section import Arrow, Carriageway, Hatching, LineMarking, Pothole, Turnout
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.surfaces import surface_points

_END = 4000.0
"""Station, m, up to which both roads are the same."""
LENGTH = 12000.0


def calls(function: Callable[[], Any]) -> int:
    """Return how many functions of Python and of C a function calls in all."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    function()  # what is worked out once for a road is worked out
    sys.setprofile(note)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


def is_near(item: Any, names: set[str]) -> bool:
    """Return whether an object belongs to the beginning of a road, given its turnouts there."""
    if isinstance(item, Turnout):
        return item.start_station < _END
    if isinstance(item, LineMarking | Hatching) and item.turnout is not None:
        return item.turnout in names
    return not isinstance(item, PointObject | Arrow) or item.station < _END


@pytest.fixture(scope="module")
def roads() -> tuple[RoadGeometry, RoadGeometry]:
    """A road with potholes, turnouts, signs and arrows all along it, and the same with those of its beginning alone."""
    road = sample_road(RoadScenario(length=LENGTH), 3)
    objects: dict[str, Any] = {}
    for name, item in road.objects.items():
        objects[name] = item
        if isinstance(item, Carriageway):
            holes = [
                Pothole(station=s, offset=-5.0, length=0.5, width=0.4, depth=0.03) for s in np.arange(3.0, LENGTH, 9.0)
            ]
            pavement = item.pavement.model_copy(update={"potholes": tuple(holes)})
            objects[name] = item.model_copy(update={"pavement": pavement})
    kept = {"instance": 10**6, "carriageway": "carriageway-right", "kind": "straight", "color": "white"}
    for number, station in enumerate(np.arange(100.0, LENGTH, 100.0).tolist()):
        objects[f"arrow-{number}"] = Arrow(station=station, offset=-6.0, **kept)
    near = {name for name, item in objects.items() if isinstance(item, Turnout) and is_near(item, set())}
    first: dict[str, Any] = {}
    for name, item in objects.items():
        if is_near(item, near):
            first[name] = item
        if isinstance(item, Carriageway):
            holes = [hole for hole in item.pavement.potholes if hole.station < _END]
            pavement = item.pavement.model_copy(update={"potholes": tuple(holes)})
            first[name] = item.model_copy(update={"pavement": pavement})
    return _geometry(road, objects), _geometry(road, first)


def _geometry(road: RoadParameters, objects: dict[str, Any]) -> RoadGeometry:
    return RoadGeometry(road.model_copy(update={"objects": objects}))


def test_a_surface_point_costs_the_same_on_a_long_road(roads: tuple[RoadGeometry, RoadGeometry]) -> None:
    """Of damages, turnouts and objects only those near it are looked at."""
    long, short = roads
    assert len(long.parameters.objects) > len(short.parameters.objects) + 500
    for side in ("left", "right"):
        assert len(long.sections[side].turnouts) > len(short.sections[side].turnouts) > 0
    station, offset = np.array([200.0, 203.0, 206.5]), np.array([-5.0, -5.1, -40.0])
    points = [surface_points(road, station, offset) for road in roads]
    np.testing.assert_array_equal(*points)
    assert calls(lambda: surface_points(long, station, offset)) == calls(lambda: surface_points(short, station, offset))


def test_a_crack_is_cut_by_the_painted_areas_near_it_alone(roads: tuple[RoadGeometry, RoadGeometry]) -> None:
    films = [MarkingFilms(road, "right") for road in roads]
    assert len(films[0]._areas) > len(films[1]._areas) + 10
    crack = np.array([[200.0, -6.0], [201.0, -6.0], [201.0, -5.9], [200.0, -5.9]])
    counts = [calls(lambda film=film: list(film._cut_by_areas(crack))) for film in films]  # type: ignore[misc]
    assert counts[0] == counts[1]
