"""Edges of country roads: entrances join without a step, avenues leave room, boards stand outside of curves."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import STANDARD_CROSS_SECTIONS
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Turnout
from synthroads_addon.road.terrain import surface_elevation
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.field_entrance import COVER, FieldEntrance
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.tree import Tree
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.things import standing_frames

SECTIONS = [name for name, section in STANDARD_CROSS_SECTIONS.items() if section.single]
MANY: dict[str, Any] = {
    "turnouts": {"bus_bays": 0.7, "laybys": 0.7},
    "furniture": {"entrances_per_km": {"minimum": 8.0, "maximum": 12.0}, "town_signs": 1.0},
    "roadside": {"avenues": 1.0, "avenue_unprotected": 0.5},
    "ditch_width": {"minimum": 1.2, "maximum": 2.0},
    "embankment_height": {"minimum": 0.4, "maximum": 1.4},
}
"""Limits with much of all that stands beside country roads."""


def road(section: str, seed: int, **limits: Any) -> RoadParameters:
    return sample_road(RoadScenario.from_dict({"cross_section": section, "length": 900.0, **MANY, **limits}), seed)


@pytest.mark.parametrize("section", SECTIONS)
def test_with_much_beside_it_no_rule_is_broken(section: str) -> None:
    for seed in range(4):
        assert [violation.text for violation in check(road(section, seed))] == []


def test_much_of_all_is_there() -> None:
    items = [item for seed in range(8) for item in road("RQ9.5", seed).objects.values()]
    kinds = {item.kind for item in items if isinstance(item, Turnout)}
    assert kinds == {"bus_bay", "layby"}
    assert {item.code for item in items if isinstance(item, TrafficSign)} >= {"224", "310", "311", "418-10", "625-10"}
    entrances = [item for item in items if isinstance(item, FieldEntrance)]
    assert {item.head_walls for item in entrances} == {True, False}
    assert {item.pipe_diameter > 0.0 for item in entrances} == {True, False}
    assert {item.stock for item in items if isinstance(item, Tree)} == {True, False}


def test_no_tree_of_an_avenue_stands_where_a_signpost_does() -> None:
    """On one of a thousand roads where one did."""
    scenario = {"design_class": "EKL4", "cross_section": "W5.5", "length": 600.0}
    parameters = sample_road(RoadScenario.from_dict(scenario), 199)
    assert {"signpost-left-001", "avenue-left-011"} <= set(parameters.objects)
    assert check(parameters) == []


def test_roads_for_motor_vehicles_alone_have_no_entrances() -> None:
    assert not any(road("RQ15.5", seed).of_type(FieldEntrance) for seed in range(4))


@pytest.mark.parametrize("placement", ["rules", "random"])
def test_entrances_join_the_pavement_without_a_step_and_nothing_stands_in_them(placement: str) -> None:
    for seed in range(4):
        parameters = road("RQ11", seed, placement=placement)
        geometry = RoadGeometry(parameters)
        entrances = list(parameters.of_type(FieldEntrance).values())
        for frame, item in zip(standing_frames(geometry, entrances), entrances, strict=True):
            joining = [body for body in item.bodies(frame.place()) if body.part in ("track", "corner")]
            assert len(joining) == 3
            for body in joining:
                edge = frame.to_local(body.sections[:, 0])
                station, offset = geometry.alignment.project(edge[:, :2])
                # The pavement's edge itself, in plan and in height.
                assert np.abs(offset - item.offset).max() < 2e-3
                assert np.abs(edge[:, 2] - geometry.elevation(station, offset)).max() < 1e-3
                top = frame.to_local(body.sections[:, : body.sections.shape[1] // 2]).reshape(-1, 3)
                station, offset = geometry.alignment.project(top[:, :2])
                assert (top[:, 2] - surface_elevation(geometry, station, offset)).min() > -1e-3
        spans = [(item.station - item.reach(), item.station + item.reach(), item.offset > 0.0) for item in entrances]
        for thing in (*parameters.of_type(Delineator).values(), *parameters.of_type(TrafficSign).values()):
            assert not any(a < thing.station < b and left == (thing.offset > 0.0) for a, b, left in spans)
        for rail in parameters.of_type(Guardrail).values():
            for a, b, left in spans:
                assert left != (rail.offset > 0.0) or rail.end_station < a or rail.start_station > b


def test_a_pipe_lies_in_the_ditch_below_the_track() -> None:
    found = 0
    for seed in range(6):
        parameters = road("RQ11", seed)
        geometry = RoadGeometry(parameters)
        entrances = [item for item in parameters.of_type(FieldEntrance).values() if item.pipe_diameter]
        for frame, item in zip(standing_frames(geometry, entrances), entrances, strict=True):
            place, y = frame.place(), np.zeros(3)
            x = item.pipe_distance + np.array([-1.0, 0.0, 1.0])
            ground = place.ground(x, y)
            top = item.top(place, np.zeros(1), np.array([item.pipe_distance]))[0]
            assert ground[1] < ground[2]
            assert ground[1] + item.pipe_diameter < top - COVER
            pipes = [body for body in item.bodies(place) if body.part == "pipe"]
            assert len(pipes) == 1
            # Its ends stand out of the track and its earth.
            assert np.abs(pipes[0].sections[..., 1]).max() > item.width / 2.0
            found += 1
    assert found > 5


def test_avenues_stand_in_rows_beside_the_pavement() -> None:
    rows = 0
    for seed in range(6):
        parameters = road("RQ10.5", seed)
        for side in (1.0, -1.0):
            trees = sorted(
                (item for item in parameters.of_type(Tree).values() if side * item.offset > 0.0),
                key=lambda t: t.station,
            )
            if not trees:
                continue
            rows += 1
            assert len({tree.species for tree in trees}) == 1
            spacing = min(b.station - a.station for a, b in pairwise(trees))
            assert 6.0 < spacing < 16.0
            assert all(side * tree.offset - tree.trunk_diameter / 2.0 > 3.75 + 1.7 for tree in trees)
    assert rows > 4


def test_boards_stand_outside_of_curves_and_point_into_them() -> None:
    boards = 0
    for seed in range(6):
        parameters = road("RQ7.5", seed)
        curvature = RoadGeometry(parameters).alignment.curvature
        for sign in parameters.of_type(TrafficSign).values():
            if not sign.code.startswith("625"):
                continue
            boards += 1
            bend = float(curvature(np.array([sign.station]))[0])
            assert bend * sign.offset < 0.0
            is_left = (bend > 0.0) == (sign.rotation_deg == 0.0)
            assert sign.code == ("625-10" if is_left else "625-20")
    assert boards > 20
