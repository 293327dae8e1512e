"""Drawn interchanges: within their limits, refused where there is no room, and without any effect on other roads."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.network.network import network_of
from synthroads_addon.road.objects import PointObject
from synthroads_addon.road.other_roads.parts import ConnectingRamp, CrossingRoad
from synthroads_addon.road.section import Turnout
from synthroads_addon.road.structures.bridge import Bridge
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.roads.interchanges import diamond

SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 5, 8))]


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_drawn_lies_within_its_limits(seed: int) -> None:
    road, limits = diamond(seed), RoadScenario(interchange={"kind": "diamond"}).interchange
    (crossing,), (bridge,) = road.of_type(CrossingRoad).values(), road.of_type(Overpass).values()
    ramps = road.of_type(ConnectingRamp).values()
    assert len(ramps) == len(road.of_type(Turnout)) == 4
    middle = crossing.length / 2.0
    grades = [
        100.0 * (b.elevation - a.elevation) / (b.station - a.station)
        for a, b in zip(crossing.vertical[:-1], crossing.vertical[1:], strict=True)
    ]
    seen = {
        "design_speed": [ramp.design_speed for ramp in ramps],
        "radius": [1.0 / max(abs(e.curvature_end) for e in ramp.horizontal[2:]) for ramp in ramps],
        "grade": [grades[0], -grades[2]],
        "crest_radius": [point.radius for point in crossing.vertical[1:3]],
        "distance": [abs(ramp.mouth_station - middle) for ramp in ramps],
        "lane_width": [ramp.lane_width for ramp in ramps],
        "corner_radius": [radius for ramp in ramps for radius in (ramp.near_radius, ramp.far_radius)],
        "clearance": [bridge.clearance],
    }
    for name, values in seen.items():
        interval = getattr(limits, name)
        assert min(values) >= interval.minimum - 1e-6, name
        assert max(values) <= interval.maximum + 1e-6, name
    assert grades[1] == 0.0


def test_without_one_a_road_is_the_same_whatever_its_limits() -> None:
    plain = sample_road(RoadScenario(length=400.0), 7)
    other = sample_road(RoadScenario(length=400.0, interchange={"radius": {"minimum": 50.0, "maximum": 60.0}}), 7)
    assert plain.to_json() == other.to_json()


def test_other_bridges_lie_before_and_behind_an_interchange() -> None:
    fields = {"kind": "half_clover", "crossing": "under"}
    scenario = RoadScenario(length=2800.0, interchange=fields, bridges={"per_km": {"minimum": 2.0, "maximum": 2.0}})
    road = sample_road(scenario, 1)
    turnouts, bridges = road.of_type(Turnout).values(), road.of_type(Bridge)
    start, end = min(item.start_station for item in turnouts), max(item.end_station for item in turnouts)
    own = bridges.pop("interchange-bridge")
    assert start < own.cap_start < own.cap_end < end
    assert len(bridges) > 1
    assert all(item.cap_end < start or item.cap_start > end for item in bridges.values())
    assert check(road) == []


def test_nothing_stands_on_a_ramp() -> None:
    geometry = RoadGeometry(diamond())
    roads = network_of(geometry)
    items = [item for item in diamond().objects.values() if isinstance(item, PointObject)]
    items = [item for item in items if not isinstance(item, Overpass)]
    places = geometry.alignment.place(
        np.array([item.station for item in items]), np.array([item.offset for item in items])
    )
    boundaries = geometry.offsets(np.array([item.station for item in items]))
    offset = np.array([item.offset for item in items])
    beside = (offset > boundaries[:, 0]) | (offset < boundaries[:, -1])
    assert not (roads.paves(places) & beside).any()


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"length": 700.0}, "road.length"),
        ({"cross_section": "RQ11"}, "interchange.kind"),
        ({"traffic_side": "left"}, "interchange.kind"),
        ({"turnouts": {"places": [{"kind": "exit", "station": 500.0}]}}, "interchange.kind"),
        (
            {"length": 1800.0, "interchange": {"kind": "diamond", "distance": {"minimum": 45, "maximum": 45}}},
            "distance",
        ),
    ],
)
def test_an_interchange_that_cannot_be_is_refused(fields: dict[str, object], field: str) -> None:
    scenario = RoadScenario.from_dict({"length": 1800.0, "interchange": {"kind": "diamond"}, **fields})
    with pytest.raises(InputError, match=field):
        sample_road(scenario, 1)


def test_ramps_are_drawn_within_their_limits() -> None:
    """Loops, crossfalls, edge strips and the distance of parallel mouths take the limits' values, here one each."""
    values = {"loop_radius": 52.0, "loop_crossfall": 5.0, "curve_crossfall": 3.0, "edge_strip_width": 0.6}
    values |= {"ramp_spacing": 27.0}
    settings = [f'road.interchange.{k}={{"minimum": {v}, "maximum": {v}}}' for k, v in values.items()]
    road = sample_road(load_scenario("half-clover-1500m", settings).road, 1)
    ramps = road.of_type(ConnectingRamp)
    assert {ramp.edge_strip_width for ramp in ramps.values()} == {0.6}
    tightest = {name: max(abs(e.curvature_start) for e in ramp.horizontal) for name, ramp in ramps.items()}
    loops = [name for name, curvature in tightest.items() if curvature == pytest.approx(1.0 / 52.0)]
    assert len(loops) == 2
    for name, ramp in ramps.items():
        steepest = max(abs(point.crossfall_percent) for point in ramp.crossfall)
        assert steepest == pytest.approx(5.0 if name in loops else 3.0), name
    for side in {ramp.mouth_side for ramp in ramps.values()}:
        stations = sorted(ramp.mouth_station for ramp in ramps.values() if ramp.mouth_side == side)
        assert np.diff(stations) == pytest.approx([27.0]), side
