"""Roads of one carriageway: pairs of lines between the directions, the nearest standard section, planes and roofs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.cloud import read_road_cloud
from synthroads_addon.reconstruction.country.pairs import join_pairs
from synthroads_addon.reconstruction.country.standards import (
    SINGLE_CROSS_SECTIONS,
    Direction,
    joined_falls,
    nearest_single,
    single_class,
    unlined_section,
)
from synthroads_addon.reconstruction.lines import Line
from synthroads_addon.reconstruction.reconstruct import reconstruct
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import LIMITS, design_class_of
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.clouds.road_clouds import cloud_of, write

STATIONS: Float = 5.0 * np.arange(40) + 2.5


def line(offset: float | Float, width: float = 0.12, dash: float = 0.0) -> Line:
    """Return a line at an offset or offsets (40,), m, solid or with 4 m dashes, with a centimetre of noise."""
    noise = np.random.default_rng(7).normal(0.0, 0.01, len(STATIONS))
    measured = np.asarray(offset, dtype=float) + noise
    zeros = np.zeros(len(STATIONS))
    return Line(STATIONS, measured, measured, zeros + 0.01, zeros, zeros, 0.0, 200.0, width, dash=dash, gap=2.0 * dash)


@pytest.mark.parametrize("apart", [0.38, 0.88])
def test_two_lines_between_the_directions_are_one_axis(apart: float) -> None:
    right, left = line(-0.5 * apart), line(0.5 * apart)
    right.measured[10:20] = np.nan  # where one isn't seen the other one tells
    left.measured[30:] = np.nan
    (joined,) = join_pairs([left, right], -4.25, 4.25)
    assert joined.pair == (right, left)
    assert joined.apart == pytest.approx(apart, abs=0.01)
    assert np.abs(joined.measured).max() < 0.05


def test_two_worn_lines_that_are_seldom_seen_together_are_a_pair() -> None:
    """Of both 40 % are left, in patches that pass for dashes of no usual pattern."""
    rng = np.random.default_rng(4)
    worn = []
    for offset, dash in ((-0.44, 6.2), (0.44, 3.1)):
        one = line(offset, dash=dash)
        one.measured[rng.random(len(STATIONS)) < 0.7] = np.nan
        worn.append(replace(one, offsets=np.full(len(STATIONS), offset)))
    seen = [np.isfinite(one.measured) for one in worn]
    assert (seen[0] & seen[1]).sum() < 0.5 * max(mask.sum() for mask in seen)
    (joined,) = join_pairs(worn, -4.25, 7.5)
    assert joined.pair == tuple(worn)
    assert joined.apart == pytest.approx(0.88, abs=0.01)
    assert np.nanmax(np.abs(joined.measured)) < 0.05


def test_lines_that_are_no_pair_stay_apart() -> None:
    edge = [line(3.3), line(3.8)]  # an edge line and a seam
    dashes = [line(-0.4, dash=4.0), line(0.4, dash=4.0)]
    parting = [line(np.linspace(-0.2, -1.4, 40)), line(np.linspace(0.2, 1.4, 40))]
    for lines in (edge, dashes, parting, [line(-0.4), line(0.4, width=0.5)]):
        assert join_pairs(lines, -4.0, 4.0) == lines


@pytest.mark.parametrize("name", SINGLE_CROSS_SECTIONS)
def test_each_standard_section_is_its_own_nearest(name: str) -> None:
    """Also read against the stations, with widths some centimetres off, and where an edge isn't seen."""
    row = SINGLE_CROSS_SECTIONS[name]
    rng = np.random.default_rng(3)
    directions = [
        Direction(
            tuple(lane + rng.uniform(-0.03, 0.03) for lane in row.of_side(side).lanes[::-1]),
            row.inner_edge_strip,
            row.outer_edge_strip,
            row.edge_line,
        )
        for side in ("left", "right")
    ]
    assert nearest_single(directions, row.centre_line)[0] == name
    assert nearest_single(directions[::-1], row.centre_line)[1] < 0.07
    assert single_class(name, 1e-3) == design_class_of(name, "EKL1")
    assert single_class(name, 0.1) == design_class_of(name, "EKL1"), "no class has such radii: the section's stays"


def test_a_road_without_lines_has_the_lanes_of_the_section_as_wide() -> None:
    assert unlined_section([2.8, 2.7], 0.15) == SINGLE_CROSS_SECTIONS["W5.5"]
    assert unlined_section([3.0, 3.0], 0.15) is None


def test_planes_and_roofs_are_told() -> None:
    fall = np.linspace(-0.05, 0.06, 40)
    noise = np.random.default_rng(2).normal(0.0, 0.001, 40)
    form, plane = joined_falls({-1: fall + noise, 1: fall - noise})
    assert form == "plane"
    assert plane[1] == pytest.approx(fall)
    assert plane[-1] == pytest.approx(fall)
    flat = np.full(40, 0.025)
    form, roof = joined_falls({-1: flat + noise, 1: -flat + noise})
    assert form == "roof"
    assert roof[-1] == pytest.approx(-roof[1])
    assert joined_falls({-1: flat, 1: np.zeros(40)})[0] == ""


@pytest.mark.parametrize(("section", "lines"), [("RQ15.5", 2), ("RQ9", 0)])
def test_a_country_road_comes_back_as_one(tmp_path_factory: pytest.TempPathFactory, section: str, lines: int) -> None:
    """Its class, its section, its lanes either way and the lines between them; nothing is doubted."""
    design_class = design_class_of(section, "EKL1")
    limits = {"cross_section": section, "design_class": design_class, "length": 160.0, "half_width": 20.0}
    truth = sample_road(RoadScenario.from_dict(limits), 5)
    path = write(tmp_path_factory.mktemp("country") / "cloud.laz", cloud_of(truth, 10.0, 1))
    result = reconstruct(read_road_cloud(path))
    road, measured = result.parameters, result.measured.section
    assert (measured.nearest, road.design_class) == (section, design_class)
    row = SINGLE_CROSS_SECTIONS[section]
    lanes = sorted(len(side.lanes) for side in measured.sides.values())
    assert lanes == sorted(len(row.of_side(side).lanes) for side in ("left", "right"))
    for side in measured.sides.values():
        assert side.inner_strip.value == pytest.approx(row.inner_edge_strip, abs=0.05)
        assert side.strip.value == pytest.approx(row.outer_edge_strip, abs=0.12)
    markings = road.of_type(LineMarking).values()
    assert sum(marking.kind == "inner_edge" for marking in markings) == lines
    if lines:  # dashes are too short to be measured with as few points
        assert all(marking.width == LIMITS[design_class].narrow_line for marking in markings)
    assert {road.carriageway(side).rotation_axis for side in ("left", "right")} == {"centreline"}
    assert result.measured.surface_form == "plane"
    assert not result.judgement.doubts


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_layby_beside_a_narrow_road_moves_its_axis_nowhere(
    tmp_path_factory: pytest.TempPathFactory, side: str
) -> None:
    """No line shows the axis, and the pavement's middle lies 1.6 m beside it there; nothing is doubted."""
    limits = {"cross_section": "W5.5", "design_class": "EKL4", "length": 220.0, "half_width": 20.0}
    limits |= {"furniture": {"entrances_per_km": {"minimum": 0.0, "maximum": 0.0}}}
    limits |= {"turnouts": {"bus_bays": 0.0, "laybys": 0.0}}
    road = sample_road(RoadScenario.from_dict(limits), 5)
    turnout = {"type": "Turnout", "instance": 900, "carriageway": f"carriageway-{side}", "kind": "layby"}
    turnout |= {"start_station": 70.0, "taper_in_length": 20.0, "lane_length": 40.0, "taper_out_length": 20.0}
    turnout |= {"lane_width": 3.3, "edge_strip_width": 0.0, "shoulder_width": 0.0}
    data = json.loads(road.to_json())
    data["objects"]["layby"] = turnout
    truth = RoadParameters.from_dict(data, source="road with a lay-by")
    path = write(tmp_path_factory.mktemp("layby") / "cloud.laz", cloud_of(truth, 10.0, 1))
    result = reconstruct(read_road_cloud(path))
    points = RoadGeometry(result.parameters).alignment.position(np.arange(5.0, 215.0))
    shift = np.array(result.parameters.transform.translate[:2]) - np.array(truth.transform.translate[:2])
    offset = RoadGeometry(truth).alignment.project(points + shift)[1]
    assert np.abs(offset).max() < 0.1
    assert not result.judgement.doubts
