"""Lanes of files as strips of carriageways: where their borders are, against the formulas of the standard."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road_files.lanes.corners import rounded_points
from tests.helpers.roads.lane_files import LENGTH, border, cubic, lane, lanes, road_file, section, taken, width
from tests.helpers.roads.written_lines import opendrive, xodr_road

MILLIMETRE = 1e-3
AT = np.array([12.0, 50.0, 95.0, 104.0, 150.0, 191.0])
"""Three stations in each of two sections."""


def distances(path: Path, side: str, station: np.ndarray = AT) -> np.ndarray:
    """Return the distances of a carriageway's boundaries, from the inside out, without verges of the scenario's."""
    _, geometry, report = taken(path)
    assert not report["whole"]["surface_lost"], report["whole"]
    return geometry.sections[side].distances(station)[:, :-1]


def test_widths_of_several_cubics_and_a_lane_offset_that_bends(tmp_path: Path) -> None:
    """The offset moves the lanes, not the line; records count from their section's start."""
    offset = Polynomial([0.3, 0.0, 6e-4, -4e-6])
    first, second = Polynomial([3.5]), Polynomial([3.5, 0.0, 3e-3, -4e-5])
    outer = Polynomial([3.25, 0.002])
    inner = width(0.0, 3.5) + width(40.0, *second.coef)
    here = section(0.0, right=lane(-1, inner) + lane(-2, width(0.0, *outer.coef)))
    there = section(100.0, right=lane(-1, width(0.0, 3.0)) + lane(-2, width(0.0, 3.0, 0.001)))
    rest = lanes(cubic("laneOffset", "s", 0.0, *offset.coef), here, there)
    found = distances(road_file(tmp_path, rest), "right")
    one = np.where(AT < 40.0, first(AT), second(AT - 40.0))
    one = np.where(AT < 100.0, one, 3.0)
    two = np.where(AT < 100.0, outer(AT), 3.0 + 0.001 * (AT - 100.0))
    edges = np.cumsum(np.column_stack([-offset(AT), one, two]), axis=1)
    assert found.shape == edges.shape
    assert np.abs(found - edges).max() < MILLIMETRE


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_borders_on_the_right_may_be_positive(tmp_path: Path, sign: float) -> None:
    right = lane(-1, border(0.0, sign * 3.4, sign * 0.001)) + lane(-2, border(0.0, sign * 7.0, 0.0, sign * 1e-5))
    left = lane(1, border(0.0, 3.2))
    path = road_file(tmp_path, lanes(section(0.0, left, right)))
    found = distances(path, "right")
    assert np.abs(found - np.column_stack([0.0 * AT, 3.4 + 0.001 * AT, 7.0 + 1e-5 * AT**2])).max() < MILLIMETRE
    assert np.abs(distances(path, "left") - [0.0, 3.2]).max() < MILLIMETRE


def test_borders_beside_widths(tmp_path: Path) -> None:
    """A border is counted from the line, whatever lies inside of it."""
    right = lane(-1, width(0.0, 3.5, 0.002)) + lane(-2, border(0.0, -7.5))
    found = distances(road_file(tmp_path, lanes(section(0.0, "", right))), "right")
    assert np.abs(found - np.column_stack([0.0 * AT, 3.5 + 0.002 * AT, 0.0 * AT + 7.5])).max() < MILLIMETRE


def test_lanes_of_one_direction_on_both_sides_of_the_line(tmp_path: Path) -> None:
    """Lanes 1 and 2 of the right lie left of the line: traffic is still that of the right carriageway."""
    right = lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 3.5))
    path = road_file(tmp_path, lanes(cubic("laneOffset", "s", 0.0, 3.5), section(0.0, "", right)))
    parameters, geometry, _ = taken(path)
    assert list(geometry.sections) == ["right"]
    assert parameters.carriageway("right").inner_offset == -3.5
    assert distances(path, "right")[0].tolist() == pytest.approx([-3.5, 0.0, 3.5])
    left, _ = geometry.offsets(AT)[0, :2]
    assert left == pytest.approx(3.5)


def test_two_ways_meet_at_the_centre_lane(tmp_path: Path) -> None:
    shift = Polynomial([0.0, 0.0, 3e-4, -1e-6])
    rest = lanes(
        cubic("laneOffset", "s", 0.0, *shift.coef),
        section(0.0, lane(1, width(0.0, 3.25)), lane(-1, width(0.0, 3.5))),
    )
    path = road_file(tmp_path, rest)
    _, geometry, _ = taken(path)
    offsets = geometry.offsets(AT)
    names = [strip.kind for strip in geometry.strips]
    middle = names.index("median")
    assert np.abs(offsets[:, middle] - shift(AT)).max() < MILLIMETRE
    assert np.abs(offsets[:, middle] - offsets[:, middle + 1]).max() < MILLIMETRE
    assert np.abs(offsets[:, middle - 1] - shift(AT) - 3.25).max() < MILLIMETRE


def test_a_section_that_says_one_side_keeps_the_other(tmp_path: Path) -> None:
    whole = section(0.0, lane(1, width(0.0, 3.0)), lane(-1, width(0.0, 3.0)))
    right = section(100.0, "", lane(-1, width(0.0, 3.4)), more='singleSide="true"')
    path = road_file(tmp_path, lanes(whole, right))
    _, geometry, _ = taken(path)
    assert geometry.sections["left"].distances(AT)[:, 1].tolist() == pytest.approx([3.0] * len(AT))
    assert geometry.sections["right"].distances(AT)[:, 1].tolist() == pytest.approx([3.0] * 3 + [3.4] * 3)


def test_types_become_strips(tmp_path: Path) -> None:
    kinds = ("median", "shoulder", "driving", "entry", "border", "stop", "shoulder")
    widths = (2.0, 0.5, 3.75, 3.5, 0.25, 2.5, 1.5)
    right = "".join(lane(-n, width(0.0, w), kind) for n, (kind, w) in enumerate(zip(kinds, widths, strict=True), 1))
    parameters, geometry, _ = taken(road_file(tmp_path, lanes(section(0.0, "", right))))
    road = parameters.carriageway("right")
    assert road.inner_offset == 2.0
    assert [lane.width for lane in road.lanes] == [3.5, 3.75]
    strips = road.inner_edge_strip_width, road.outer_edge_strip_width, road.hard_shoulder_width, road.verge_width
    assert strips == (0.5, 0.25, 2.5, 1.5)
    assert geometry.sections["right"].kinds[-2:] == ("hard_shoulder", "verge")


def test_a_lane_that_ends_is_none_from_there_on(tmp_path: Path) -> None:
    """Its width runs out in the first section; the outer lane is the same one in both."""
    gone = width(0.0, 3.5) + width(60.0, 3.5, 0.0, -3.0 * 3.5 / 40.0**2, 2.0 * 3.5 / 40.0**3)
    before = section(0.0, "", lane(-1, gone) + lane(-2, width(0.0, 3.25)))
    after = section(100.0, "", lane(-1, width(0.0, 3.25)))
    parameters, geometry, report = taken(road_file(tmp_path, lanes(before, after)))
    assert len(parameters.carriageway("right").lanes) == 2
    share = np.clip((AT - 60.0) / 40.0, 0.0, 1.0)
    inner = 3.5 * (1.0 - 3.0 * share**2 + 2.0 * share**3)
    edges = geometry.sections["right"].lane_boundaries(AT)
    assert np.abs(edges[:, 1] - inner).max() < MILLIMETRE
    assert np.abs(edges[:, 0] - inner - 3.25).max() < MILLIMETRE
    assert report["whole"]["approximated"] == []


def test_widths_that_jump_do_so_over_five_centimetres(tmp_path: Path) -> None:
    before = section(0.0, "", lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 3.0)))
    after = section(100.0, "", lane(-1, width(0.0, 3.5)))
    _, geometry, report = taken(road_file(tmp_path, lanes(before, after)))
    (row,) = report["whole"]["approximated"]
    assert (row["kind"], row["deviation"], row["station"]) == ("lane widths", 3.0, 100.0)
    there = geometry.sections["right"].lane_boundaries(np.array([100.0, 100.05]))
    assert there[:, 0].tolist() == pytest.approx([6.5, 3.5])


@pytest.mark.parametrize(
    ("rest", "rule", "text"),
    [
        (section(0.0, "", lane(-1, width(0.0, 3.5), "sidewalk")), "RHT", "no lane for traffic"),
        (
            section(0.0, "", "".join(lane(-n, width(0.0, 3.0)) for n in range(1, 10))),
            "RHT",
            r"lanes on the right is 9: must be at most 8 lanes",
        ),
        (section(0.0, "", lane(-1, '<width sOffset="0" a="x"/>')), "RHT", "width a is 'x': must be a finite number"),
    ],
)
def test_what_a_set_cant_hold_is_one_line(tmp_path: Path, rest: str, rule: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        taken(road_file(tmp_path, lanes(rest), rule))


@pytest.mark.parametrize(("rule", "traffic"), [("RHT", 1), ("LHT", -1)])
def test_the_side_that_traffic_keeps_to_is_taken_over(tmp_path: Path, rule: str, traffic: int) -> None:
    parameters, _, _ = taken(road_file(tmp_path, lanes(section(0.0, "", lane(-1, width(0.0, 3.5)))), rule))
    right = parameters.carriageway("right")
    assert right is not None
    assert right.traffic == traffic


def test_stations_are_those_of_the_curve_where_it_is_longer_than_said(tmp_path: Path) -> None:
    """The file gives the curve 200 m; it is 2 % longer: lanes change where the share of it is the same."""
    right = lane(-1, width(0.0, 3.0) + width(100.0, 3.5))
    shape = '<paramPoly3 pRange="normalized" aU="0" bU="204" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>'
    path = road_file(tmp_path, lanes(section(0.0, "", right)), shape=shape)
    _, geometry, _ = taken(path)
    assert geometry.length == pytest.approx(1.02 * LENGTH, abs=1e-6)
    there = geometry.sections["right"].lane_boundaries(np.array([101.9, 102.1]))
    assert there[:, 0].tolist() == pytest.approx([3.0, 3.5])


def test_exits_and_entries_of_others_are_told_with_their_stretch(tmp_path: Path) -> None:
    both = lane(-1, width(0.0, 3.5))
    ramp = both + lane(-2, width(0.0, 0.0, 0.035), "exit")
    after = both + lane(-2, width(0.0, 3.5), "offRamp")
    path = road_file(tmp_path, lanes(section(0.0, "", both), section(50.0, "", ramp), section(150.0, "", after)))
    parameters, _, report = taken(path)
    (carriageway,) = parameters.of_type(Carriageway).values()
    assert len(carriageway.lanes) == 2
    (row,) = report["whole"]["left_out"]
    assert (row["kind"], row["count"], row["stretches"]) == ("turnouts", 1, [[50.0, 200.0]])
    assert "turnouts" in next(line for line in report["summary"] if "50.0 to 200.0 m" in line)
    assert not report["whole"]["surface_lost"]


def test_roads_that_a_junction_joins_are_told(tmp_path: Path) -> None:
    rest = lanes(section(0.0, "", lane(-1, width(0.0, 3.5))))
    roads = [
        xodr_road([(0.0, long, (0.0, 0.0, 0.3), "<line/>")], rest, name, number)
        for number, (name, long) in enumerate((("main", 200.0), ("ramp", 80.0), ("further", 90.0)), 1)
    ]
    joined = '<connection id="0" incomingRoad="1" linkedRoad="2"/>'
    joined += '<connection id="1" incomingRoad="1" connectingRoad="3"/>'
    other = '<connection id="2" incomingRoad="3" linkedRoad="1"/>'
    path = opendrive(tmp_path / "a.xodr", [*roads, f'<junction id="7">{joined}{other}</junction>'])
    _, _, report = taken(path)
    (row,) = [row for row in report["whole"]["left_out"] if row["kind"] == "roads of junctions"]
    assert (row["count"], row["why"]) == (2, "--axis-name takes one: ramp, further")


@pytest.mark.parametrize(
    ("outside", "kinds"),
    [
        (("stop", "border"), ("lane", "hard_shoulder", "verge")),
        (("border", "border"), ("lane", "outer_edge_strip", "verge")),
        (("shoulder", "border", "biking"), ("lane", "hard_shoulder", "verge")),
    ],
)
def test_a_border_outside_of_all_that_is_paved_is_the_verge(
    tmp_path: Path, outside: tuple[str, ...], kinds: tuple[str, ...]
) -> None:
    more = "".join(lane(-2 - n, width(0.0, 2.0), kind) for n, kind in enumerate(outside))
    _, geometry, report = taken(road_file(tmp_path, lanes(section(0.0, "", lane(-1, width(0.0, 3.5)) + more))))
    right = geometry.sections["right"]
    assert right.kinds == kinds
    assert right.distances(np.array([100.0]))[0, 2] == pytest.approx(3.5 + 2.0 * (3 if "biking" in outside else 1))
    assert not report["whole"]["surface_lost"]


@pytest.mark.parametrize(("begin", "wide", "message"), [(0.0, 93.0, "width is 93.0"), (LENGTH, 3.5, r"width\.points")])
def test_what_a_parameter_set_cannot_hold_is_refused_in_one_line(
    tmp_path: Path, begin: float, wide: float, message: str
) -> None:
    """A lane wider than a road; a plan that begins where the lanes, which bend, end."""
    rest = lanes(section(0.0, "", lane(-1, width(0.0, wide, 0.0, 1e-5))))
    road = xodr_road([(begin, LENGTH, (10.0, 20.0, 0.3), "<line/>")], rest)
    with pytest.raises(InputError, match=f"{message}.*must be within the limits of a parameter set") as found:
        taken(opendrive(tmp_path / "a.xodr", [road], "<geoReference>EPSG:25832</geoReference>"))
    assert str(found.value).isprintable()


def test_a_file_without_roads_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file has no road or alignment"):
        taken(opendrive(tmp_path / "a.xodr", []))


def test_coordinates_beyond_all_maps_are_refused(tmp_path: Path) -> None:
    rest = lanes(section(0.0, "", lane(-1, width(0.0, 3.5))))
    road = xodr_road([(0.0, 200.0, (3e8, 0.0, 0.3), "<line/>")], rest)
    with pytest.raises(InputError, match=r"coordinates, m is \[.*\]: must be at most 1e\+08"):
        taken(opendrive(tmp_path / "a.xodr", [road]))


def test_points_whose_rounded_stations_are_one() -> None:
    assert rounded_points([(1.0, 2.0), (1.0 + 1e-12, 3.0), (4.0, 5.0)]) == [(1.0, 2.0), (4.0, 5.0)]


def test_a_turnout_of_our_own_that_has_lost_its_ramp_is_told(tmp_path: Path) -> None:
    def noted(strip: str) -> str:
        return f'<userData code="strip" value="{strip}"/><userData code="instance" value="7"/>'

    right = lane(-1, width(0.0, 3.5) + noted("lane")) + lane(-2, width(0.0, 3.5) + noted("turnout_lane"), "exit")
    _, _, report = taken(road_file(tmp_path, lanes(section(0.0, "", right))))
    (row,) = report["whole"]["left_out"]
    assert row["kind"] == "turnouts"
    assert report["whole"]["surface_lost"]
