"""The corridor's truth against the analytic road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ml.data.corridor import CORRIDOR, Truth, truths
from ml.data.frames import Frames, displace_frames, frames_along
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import WidthPoint
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.analytic_roads import parameters

COLUMN = {name: place for place, name in enumerate(CORRIDOR)}


def on_the_axis(truth: Truth) -> Frames:
    frames = frames_along(truth.axis, 7.0)
    return frames.select(slice(1, -1))


@pytest.mark.parametrize("section", ["RQ31", "RQ36", "RQ43.5"])
def test_whole_road_is_that_of_the_parameters(section: str) -> None:
    road = parameters(section)
    geometry = RoadGeometry(road)
    origin = np.array(road.transform.translate) + [100.0, -200.0, 3.0]
    truth = truths(road, "road", origin)[0]
    frames = on_the_axis(truth)
    there = truth.at(frames)
    np.testing.assert_allclose(there.center, 0.0, atol=1e-3)
    offsets = geometry.offsets(frames.station)
    paved = [index for index, strip in enumerate(geometry.strips) if strip.class_name == "road"]
    np.testing.assert_allclose(there.corridor[:, COLUMN["left_edge"]], offsets[:, paved[0]], atol=0.002)
    np.testing.assert_allclose(there.corridor[:, COLUMN["right_edge"]], offsets[:, paved[-1] + 1], atol=0.002)
    lanes = [strip for strip in geometry.strips if strip.kind == "lane"]
    np.testing.assert_allclose(there.corridor[:, COLUMN["lanes"]], len(lanes))
    widths = -np.diff(offsets, axis=1)[0, [strip.kind == "lane" for strip in geometry.strips]]
    np.testing.assert_allclose(there.corridor[:, COLUMN["lane_width"]], widths.mean(), atol=1e-9)
    np.testing.assert_allclose(there.corridor[:, COLUMN["heading"]], 0.0, atol=1e-3)
    height = geometry.profile.elevation(frames.station) + road.transform.translate[2] - origin[2]
    np.testing.assert_allclose(there.corridor[:, COLUMN["height"]], height, atol=1e-3)
    assert np.isinf(there.room).all()


def test_frames_beside_the_axis_and_turned_see_the_road_where_it_is() -> None:
    truth = truths(parameters(), "road")[0]
    exact = on_the_axis(truth)
    frames = displace_frames(exact, np.random.default_rng(3), 12.0, 2.0, 60.0)
    there = truth.at(frames)
    for name, line in (("left_edge", truth.left), ("right_edge", truth.right)):
        assert line is not None
        at = frames.at(there.corridor[:, COLUMN[name]])
        assert np.abs(line.project(at)[1]).max() < 1e-6
    assert np.abs(truth.axis.project(frames.at(there.center))[1]).max() < 1e-6
    np.testing.assert_allclose(
        there.corridor[:, COLUMN["heading"]], truth.axis.direction(there.station) - frames.direction, atol=1e-9
    )


@pytest.mark.parametrize("kind", ["road", "carriageway"])
def test_frames_against_the_road_see_it_turned_by_half(kind: str) -> None:
    for truth in truths(parameters(), kind):  # type: ignore[arg-type]
        frames = displace_frames(on_the_axis(truth), np.random.default_rng(3), 12.0, 2.0, 60.0)
        there = truth.at(frames)
        back = frames.reverse()
        turned = truth.at(back)
        np.testing.assert_allclose(turned.center[::-1], -there.center, atol=1e-9)
        for name, other in (("left_edge", "right_edge"), ("right_edge", "left_edge")):
            np.testing.assert_allclose(
                turned.corridor[::-1, COLUMN[name]], -there.corridor[:, COLUMN[other]], atol=1e-9
            )
        np.testing.assert_allclose(turned.corridor[::-1, 2:], there.corridor[:, 2:], atol=1e-9)
        np.testing.assert_allclose(turned.room[::-1, ::-1], there.room, atol=1e-6)
        np.testing.assert_allclose(turned.lines[::-1, ::-1], there.lines, atol=1e-6)


def test_carriageway_is_centred_on_its_lane_line() -> None:
    road = parameters("RQ25", "EKA3")
    geometry = RoadGeometry(road)
    found = truths(road, "carriageway")
    assert len(found) == 2
    for truth, side in zip(found, geometry.sections, strict=True):
        section = geometry.sections[side]
        sign = section.carriageway.sign
        vertices = truth.axis.points - np.array(road.transform.translate)
        station, offset = geometry.alignment.project(vertices[:, :2])
        boundaries = section.lane_boundaries(station)
        np.testing.assert_allclose(sign * offset, boundaries[:, 1], atol=1e-6)
        frames = on_the_axis(truth)
        there = truth.at(frames)
        outer, inner = boundaries[0, 0] - boundaries[0, 1], boundaries[0, 1] - boundaries[0, 2]
        left, right = (outer, inner) if sign > 0 else (inner, outer)
        np.testing.assert_allclose(there.lines, np.tile([left, right], (len(frames), 1)), atol=1e-6)
        # Outwards there is no end, inwards the middle of the median.
        np.testing.assert_allclose(there.room[:, 1 if sign > 0 else 0], boundaries[0, 1], atol=1e-6)
        assert np.isinf(there.room[:, 0 if sign > 0 else 1]).all()
        edge = section.paved_edge(station[:1])[0] - boundaries[0, 1]
        np.testing.assert_allclose(np.abs(there.corridor[:, 0 if sign > 0 else 1]), edge, atol=0.003)
        np.testing.assert_allclose(there.corridor[:, COLUMN["lanes"]], 2.0)
        np.testing.assert_allclose(there.corridor[:, COLUMN["lane_width"]], 3.375, atol=1e-9)


def test_three_lanes_have_no_middle_line() -> None:
    assert truths(parameters("RQ36"), "carriageway") == []


def dropped_lane() -> RoadParameters:
    """Return a road whose left carriageway loses its inner lane of three between 60 and 100 m."""
    road = parameters("RQ36")
    name, left = next((n, o) for n, o in road.objects.items() if getattr(o, "side", "") == "left")
    points = tuple(WidthPoint(station=s, width=w) for s, w in ((60.0, 3.5), (100.0, 0.0)))
    lanes = (*left.lanes[:-1], left.lanes[-1].model_copy(update={"width": points}))
    return road.model_copy(update={"objects": {**road.objects, name: left.model_copy(update={"lanes": lanes})}})


def test_where_a_lane_ends_their_number_is_unknown() -> None:
    road = dropped_lane()
    truth = truths(road, "road")[0]
    frames = on_the_axis(truth)
    lanes = truth.at(frames).corridor[:, COLUMN["lanes"]]
    before, behind = frames.station < 59.0, frames.station > 101.0
    tapering = (frames.station > 72.5) & (frames.station < 99.0)
    np.testing.assert_allclose(lanes[before], 6.0)
    np.testing.assert_allclose(lanes[behind], 5.0)
    assert np.isnan(lanes[tapering]).all()
    (carriageway,) = truths(road, "carriageway")
    ((first, last),) = carriageway.axis.parts
    assert abs((last - first) - 60.0) < 2.0


def test_ramps_leave_the_edge_unknown() -> None:
    scenario = RoadScenario.from_dict(
        {
            "length": 700.0,
            "design_class": "EKA3",
            "cross_section": "RQ25",
            "turnouts": {"exits": 1.0, "entries": 0.0, "emergency_bays": 0.0},
        }
    )
    road = sample_road(scenario, 1)
    geometry = RoadGeometry(road)
    truth = truths(road, "road")[0]
    frames = on_the_axis(truth)
    there = truth.at(frames)
    checked = 0
    for column, section in (("left_edge", geometry.sections["left"]), ("right_edge", geometry.sections["right"])):
        for shape in section.turnouts:
            beside = (frames.station > min(shape.gore_tip(), shape.nose_station()) + 2.0) & (
                frames.station < max(shape.gore_tip(), shape.nose_station()) - 2.0
            )
            assert np.isnan(there.corridor[beside, COLUMN[column]]).all()
            checked += int(beside.sum())
    assert checked > 0
    assert np.isfinite(there.corridor[:, :2]).mean() > 0.7


def test_a_gap_in_the_axis_leaves_everything_unknown() -> None:
    x = np.concatenate([np.arange(0.0, 31.0), np.arange(60.0, 91.0)])
    axis = MeasuredAxis(np.column_stack([x, 0.0 * x, 70.0 + 0.01 * x]), np.diff(x) < 2.0)
    truth = Truth.of_axis(axis, "carriageway")
    frames = Frames(np.array([[10.0, 1.0], [45.0, 1.0]]), np.zeros(2), np.array([10.0, 45.0]))
    there = truth.at(frames)
    np.testing.assert_allclose(there.center, [-1.0, np.nan])
    assert np.isnan(there.corridor[1]).all()
    assert np.isnan(there.corridor[0, :4]).all()
    np.testing.assert_allclose(there.corridor[0, 4:], [0.0, 70.1], atol=1e-9)
    assert np.isinf(there.room[0]).all()
    flat = Truth.of_axis(MeasuredAxis(axis.points[:, :2]), "road")
    assert np.isnan(flat.at(frames).corridor[0, COLUMN["height"]])
    edged = replace(truth, left=MeasuredAxis(axis.points + [0.0, 4.0, 0.0]))
    np.testing.assert_allclose(edged.at(frames).corridor[:, 0], [3.0, np.nan])
    moved = replace(truth, left=axis).translate([0.0, 5.0, 0.0])
    assert moved.left is not None
    np.testing.assert_allclose(moved.left.points[:, 1], 5.0)


def test_unknown_kinds_are_refused() -> None:
    with pytest.raises(InputError, match="must be one of road, carriageway"):
        truths(parameters(), "street")  # type: ignore[arg-type]


NARROW = {"lanes": [3.5, 3.5], "hard_shoulder": 0.0, "outer_edge_strip": 0.5, "inner_edge_strip": 0.5, "median": 2.5}


def test_carriageways_without_shoulders_are_roads_by_themselves() -> None:
    """Such are like rural roads; a motorway's, with its shoulder, isn't."""
    scenario = {"design_class": "EKA3", "length": 160.0, "turnouts": {"exits": 0.0, "entries": 0.0}}
    scenario["turnouts"] |= {"emergency_bays": 0.0}  # type: ignore[operator]
    limits = RoadScenario.from_dict(scenario | {"cross_section": NARROW, "lane_changes": {"share": 0.0}})
    found = truths(sample_road(limits, 3), "either")
    assert [truth.kind for truth in found] == ["road", "carriageway", "carriageway"]
    assert [truth.without_shoulders for truth in found] == [False, True, True]
    assert [truth.kind for truth in truths(parameters(), "either")] == ["road"]
    assert not any(truth.without_shoulders for truth in truths(parameters(), "carriageway"))
