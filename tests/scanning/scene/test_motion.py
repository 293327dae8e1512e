"""Vehicles in motion: on their lanes, on the surface, at their speeds, in at the beginning after out at the end."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.lane_lines import LaneLine
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.road.things.vehicles import CHASSIS, VEHICLE_GAP, VEHICLE_LANE_WIDTH, VEHICLE_TYPES
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.motion import OVERHANG, LaneMotion, LinearMotion, lane_motions, lane_passes
from synthroads_addon.scenario.road import RoadScenario

Float = NDArray[np.float64]
Data = dict[str, Any]

LENGTH = 700.0
LANE_END = 420.0
"""Station at which the inner lane of the right carriageway begins to close."""


def bend(kind: str, length: float, start: float, end: float) -> Data:
    return {"kind": kind, "length": length, "curvature_start": start, "curvature_end": end}


def vehicle(side: str, lane: int, station: float, model: str = "car", speed: float = 30.0) -> Data:
    item = {"type": "Vehicle", "model": model, "carriageway": side, "lane": lane, "station": station, "speed": speed}
    return item | {"color": [0.4, 0.4, 0.4]}


def road(vehicles: Data | None = None, ruts: bool = False) -> RoadGeometry:
    """Return an S-curve over a crest, its crossfall running off, whose right carriageway loses its inner lane."""
    closing = [(0.0, 3.5), (LANE_END, 3.5), (LANE_END + 100.0, 0.0), (LENGTH, 0.0)]
    points = [{"station": station, "width": width} for station, width in closing]
    lanes = {"left": [{"width": 3.75}, {"width": 3.5}], "right": [{"width": 3.75}, {"width": points}]}
    bends = [bend("arc", 150.0, 1 / 350, 1 / 350), bend("clothoid", 150.0, 1 / 350, -1 / 400)]
    objects: Data = {
        "axis": {
            "type": "Alignment",
            "start_x": 12.0,
            "start_y": -7.0,
            "start_heading_deg": 200.0,
            "horizontal": [*bends, bend("arc", 250.0, -1 / 400, -1 / 400), bend("line", 150.0, 0.0, 0.0)],
            "vertical": [
                {"station": 0.0, "elevation": 3.0},
                {"station": 350.0, "elevation": 24.0, "radius": 4000.0},
                {"station": LENGTH, "elevation": 8.0},
            ],
        },
        "median": {"type": "Median"},
    }
    tracks = {"lane": 0, "start_station": 90.0, "end_station": 260.0, "depth": 0.02}
    hole = {"station": 60.0, "offset": -9.5, "length": 0.8, "width": 0.8, "depth": 0.08}
    holes = {"left": [], "right": [hole]}
    for side in ("left", "right"):
        objects[side] = {
            "type": "Carriageway",
            "side": side,
            "inner_offset": 2.0,
            "hard_shoulder_width": 3.0,
            "outer_edge_strip_width": 0.75,
            "inner_edge_strip_width": 0.75,
            "verge_width": 1.5,
            "lanes": lanes[side],
            "crossfall": [{"station": 150.0, "crossfall_percent": -6.0}, {"station": 300.0, "crossfall_percent": 5.0}],
            "pavement": {"ruts": [tracks], "potholes": holes[side]} if ruts else {},
        }
    objects |= vehicles or {"right-car": vehicle("right", 0, 50.0)}
    for number, item in enumerate(objects.values(), 1):
        item["instance"] = number
    metadata = {"identifier": "hand-made", "seed": 0, "generator": "a hand"}
    metadata["referenceSystem"] = "https://www.opengis.net/def/crs/EPSG/0/25832"
    head = {"type": "RoadParameters", "version": "1.0", "metadata": metadata, "design_class": "EKA1A"}
    head["transform"] = {"translate": [294000.0, 5628000.0, 180.0]}
    return RoadGeometry(RoadParameters.from_dict(head | {"objects": objects}))


ROAD = road()
SIDES_AND_LANES = [(side, lane) for side in ("left", "right") for lane in (0, 1)]


def line_of(geometry: RoadGeometry, side: str, lane: int) -> LaneLine:
    carriageway = geometry.parameters.objects[side]
    assert isinstance(carriageway, Carriageway)
    return LaneLine(geometry, carriageway, lane)


def motion_of(geometry: RoadGeometry, name: str, factor: float = 1.0) -> LaneMotion:
    item = geometry.parameters.objects[name]
    assert isinstance(item, Vehicle)
    return LaneMotion(geometry, item, factor)


def single(side: str, lane: int, station: float, model: str = "car", speed: float = 30.0) -> LaneMotion:
    """Return the motion of the one vehicle on the road."""
    return motion_of(road({"it": vehicle(side, lane, station, model, speed)}), "it")


class TestLaneLine:
    @pytest.mark.parametrize(("side", "lane"), SIDES_AND_LANES)
    def test_distance_is_the_length_of_the_lanes_line(self, side: str, lane: int) -> None:
        line = line_of(ROAD, side, lane)
        station = np.linspace(0.0, LENGTH, 100_001)
        boundaries = ROAD.sections[side].lane_boundaries(station)  # type: ignore[index]
        offset = line.carriageway.sign * boundaries[:, lane : lane + 2].mean(axis=1)
        points = ROAD.point(station, offset)[:, :2]
        walked = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
        chosen = np.arange(0, len(station), 997)
        assert np.abs(line.distance(station[chosen]) - walked[chosen]).max() < 1e-5
        assert abs(walked[-1] - LENGTH) > 0.1

    @given(distance=st.floats(0.0, 1.0), which=st.sampled_from(SIDES_AND_LANES))
    def test_station_inverts_distance(self, distance: float, which: tuple[str, int]) -> None:
        line = line_of(ROAD, *which)
        end = line.distance(np.array([LENGTH]))
        wanted = distance * end
        assert line.distance(line.station(wanted)) == pytest.approx(wanted, abs=1e-6)

    def test_height_is_the_surfaces(self) -> None:
        rutted = road(ruts=True)
        rng = np.random.default_rng(1)
        station = rng.uniform(0.0, LENGTH, 2000)
        for side, lane in SIDES_AND_LANES:
            line = line_of(rutted, side, lane)
            boundaries = rutted.sections[side].lane_boundaries(station)  # type: ignore[index]
            share = rng.uniform(0.0, 1.0, len(station))
            across = boundaries[:, lane] * share + boundaries[:, lane + 1] * (1.0 - share)
            offset = line.carriageway.sign * across
            difference = line.height(station, offset) - rutted.elevation(station, offset)
            in_pothole = (np.abs(station - 60.0) < 0.4) & (np.abs(offset + 9.5) < 0.4)
            assert np.abs(difference[~in_pothole]).max() < 1e-9
        assert line_of(rutted, "right", 0).height(np.array([60.0]), np.array([-9.5])) == pytest.approx(
            rutted.elevation(60.0, -9.5) + 0.08
        )

    def test_height_is_the_surfaces_on_sampled_roads(self) -> None:
        geometry = RoadGeometry(sample_road(RoadScenario(length=800.0), 11))
        for item in geometry.parameters.of_type(Vehicle).values():
            line = line_of(geometry, item.carriageway, item.lane)
            station = np.linspace(0.0, geometry.length, 500)
            offset = line.offset(station)
            low = geometry.elevation(station, offset)
            assert (line.height(station, offset) - low).max() < 0.3  # a pothole's greatest depth
            assert np.median(np.abs(line.height(station, offset) - low)) < 1e-9

    def test_where_a_lane_can_be_driven_on(self) -> None:
        line = line_of(ROAD, "right", 1)
        end = LANE_END + 100.0 * (3.5 - VEHICLE_LANE_WIDTH) / 3.5
        assert line.range_at(100.0) == pytest.approx((0.0, end))
        assert line_of(ROAD, "left", 1).range_at(100.0) == (0.0, LENGTH)


class TestOnItsLane:
    @pytest.mark.parametrize(("side", "lane"), SIDES_AND_LANES)
    @pytest.mark.parametrize("model", VEHICLE_TYPES)
    def test_its_middle_keeps_to_the_centre_at_any_time(self, model: str, side: str, lane: int) -> None:
        motion = single(side, lane, 200.0, model)
        time = np.random.default_rng(2).uniform(0.0, 200.0, 3000)
        _, place, present = motion.pose(time)
        station, offset = ROAD.alignment.project(place[present, :2])
        boundaries = ROAD.sections[side].lane_boundaries(station)  # type: ignore[index]
        centre = motion.line.carriageway.sign * boundaries[:, lane : lane + 2].mean(axis=1)
        assert np.abs(offset - centre).max() < 1e-5
        assert present.mean() > 0.9

    @pytest.mark.parametrize(("side", "lane"), SIDES_AND_LANES)
    def test_it_drives_at_its_speed_with_the_traffic(self, side: str, lane: int) -> None:
        motion = single(side, lane, 200.0, speed=33.3)
        time = np.arange(0.0, 60.0, 0.05)
        step = 1e-4
        (_, now, here), (_, then, there) = motion.pose(time), motion.pose(time + step)
        driven = np.hypot(*(then - now)[here & there, :2].T) / step
        assert driven == pytest.approx(33.3, rel=1e-5)
        stations = motion.station(time), motion.station(time + step)
        assert (np.sign(stations[1] - stations[0])[here & there] == (1 if side == "right" else -1)).all()

    @pytest.mark.parametrize("model", VEHICLE_TYPES)
    @pytest.mark.parametrize("side", ["left", "right"])
    def test_its_wheels_stand_on_the_surface(self, model: str, side: str) -> None:
        motion = single(side, 0, 100.0, model)
        time = np.linspace(0.0, 30.0, 500)
        rotation, place, present = motion.pose(time)
        front, rear, track = CHASSIS[model]
        gaps = []
        for along in (front, rear):
            pair = []
            for beside in (-track, track):
                wheel = rotation @ np.array([along, beside, 0.0]) + place
                height = ROAD.elevation(*ROAD.alignment.project(wheel[:, :2]))
                pair.append((wheel[:, 2] - height)[present])
            gaps.append(np.mean(pair, axis=0))
            # The road is twisted, and a vehicle isn't: the crossfall changes by 11 % over 150 m, and in a curve of
            # 350 m on a grade of 6 % what is level across the front axle isn't across the other.
            twist = (front - rear) / 2.0 * (0.11 / 150.0 + 0.06 / 350.0) * track
            assert np.abs(pair).max() < twist + 2e-4
        assert np.abs(gaps).max() < 1e-4

    def test_it_looks_along_its_lane(self) -> None:
        """The chord between its axles' places lies on the lane's line, also where lanes close."""
        motion = single("right", 1, 100.0)
        time = np.linspace(0.0, 13.0, 800)
        rotation, place, present = motion.pose(time)
        half = (CHASSIS["car"].front - CHASSIS["car"].rear) / 2.0
        for along in (-half, half):
            point = (rotation @ np.array([along, 0.0, 0.0]) + place)[present]
            station, offset = ROAD.alignment.project(point[:, :2])
            # The chord bulges from a curve of 350 m by 2.5 mm, and over the kinks where the lane begins to close.
            assert np.abs(offset - motion.line.offset(station)).max() < 0.025
        there = LANE_END + 15.0
        heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]) - ROAD.alignment.heading(motion.station(time))
        turned = np.arctan2(np.sin(heading), np.cos(heading))
        in_taper = np.abs(motion.station(time) - there) < 5.0
        assert in_taper.any()
        # It closes towards the median: the lane's centre moves to the left by half its width.
        assert turned[in_taper] == pytest.approx(1.75 / 100.0, rel=0.03)

    @pytest.mark.parametrize("model", VEHICLE_TYPES)
    def test_rotations_are_rotations(self, model: str) -> None:
        rotation, _, _ = single("left", 1, 300.0, model).pose(np.linspace(0.0, 40.0, 200))
        assert rotation @ rotation.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (200, 1, 1)), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert (rotation[:, 2, 2] > 0.99).all()

    def test_at_the_time_0_it_is_at_its_station(self) -> None:
        for side, lane in SIDES_AND_LANES:
            motion = single(side, lane, 123.456)
            assert motion.station(np.zeros(1))[0] == 123.456
            assert motion.station(np.array([1e-9]))[0] == pytest.approx(123.456, abs=1e-6)

    @given(time=st.lists(st.floats(-10.0, 5000.0), min_size=1, max_size=5), factor=st.floats(0.01, 2.0))
    def test_the_factor_slows_time(self, time: list[float], factor: float) -> None:
        geometry = ROAD
        at = np.array(time)
        slowed, plain = motion_of(geometry, "right-car", factor), motion_of(geometry, "right-car")
        for ours, theirs in zip(slowed.pose(at), plain.pose(at * factor), strict=True):
            assert np.array_equal(ours, theirs)

    def test_poses_do_not_depend_on_how_many_are_asked_for(self) -> None:
        motion = single("left", 0, 300.0)
        time = np.linspace(0.0, 90.0, 1000)
        whole = motion.pose(time)
        parts = [motion.pose(time[start : start + 7]) for start in range(0, len(time), 7)]
        for i, values in enumerate(whole):
            assert np.array_equal(values, np.concatenate([part[i] for part in parts]))

    def test_between_knots_5_ms_apart_it_is_nearly_linear(self) -> None:
        geometry = RoadGeometry(sample_road(RoadScenario(length=600.0), 3))
        knots = np.arange(0.0, 60.0, 0.005)
        worst = 0.0
        for motion in lane_motions(geometry).values():
            half = VEHICLE_TYPES[motion.vehicle.model].length / 2.0
            (rotation, place, here), (turned, moved, there) = motion.pose(knots), motion.pose(knots[:-1] + 0.0025)
            present = here[1:] & here[:-1] & there
            for end in (-half, half):
                corner = np.array([end, 1.3, 3.0])
                at_knots, between = rotation @ corner + place, turned @ corner + moved
                error = np.abs((at_knots[1:] + at_knots[:-1]) / 2.0 - between)[present]
                worst = max(worst, float(error.max()))
        print(f"interpolated between knots 5 ms apart: {worst * 1000:.3f} mm off")
        assert worst < 1e-3


class TestInAgain:
    def test_who_leaves_comes_in_again_and_nothing_sticks_out(self) -> None:
        motion = single("right", 0, 600.0, "bus")
        time = np.arange(0.0, 120.0, 0.01)
        rotation, place, present = motion.pose(time)
        half = VEHICLE_TYPES["bus"].length / 2.0
        for end in (-half, half):
            station, _ = ROAD.alignment.project((rotation @ np.array([end, 0.0, 0.0]) + place)[present, :2])
            assert station.min() > -OVERHANG - 0.1
            assert station.max() < LENGTH + OVERHANG + 0.1
        jumps = np.flatnonzero(np.diff(motion.station(time)) < -100.0)
        assert len(jumps) >= 4
        assert not present[jumps].any()
        assert not present[jumps + 1].any()
        # Away for the time in which it passes an end with its own length, but for what may stick out.
        assert (~present).sum() * 0.01 / len(jumps) == pytest.approx((2 * half - 2 * OVERHANG) / 30.0, rel=0.1)
        assert np.diff(time[jumps]) == pytest.approx(np.diff(time[jumps])[0], abs=0.02)

    def test_a_lane_that_ends_is_a_road_that_ends(self) -> None:
        motion = single("right", 1, 50.0)
        time = np.arange(0.0, 100.0, 0.05)
        rotation, place, present = motion.pose(time)
        tip = (rotation @ np.array([VEHICLE_TYPES["car"].length / 2.0, 0.0, 0.0]) + place)[present]
        station, _ = ROAD.alignment.project(tip[:, :2])
        end = motion.line.range_at(50.0)[1]
        assert end - 5.0 < station.max() < end + OVERHANG + 0.1
        assert np.diff(motion.station(time)).min() < -300.0

    def test_on_a_road_shorter_than_itself_it_never_is(self) -> None:
        (way,) = lane_passes([2.0], [20.0], [16.5], 5.0)
        assert not way.at(np.linspace(0.0, 100.0, 1000))[1].any()

    @given(
        st.lists(
            st.tuples(st.floats(1.0, 60.0), st.floats(5.0, 45.0), st.sampled_from([2.2, 4.3, 16.5])),
            min_size=1,
            max_size=12,
        )
    )
    def test_nobody_drives_through_another(self, cars: list[tuple[float, float, float]]) -> None:
        """Vehicles that follow each other, the faster ahead, keep their gap for ever."""
        speed = sorted(v for _, v, _ in cars)
        start, place = [], 0.0
        for (free, _, length), before in zip(cars, [0.0, *(row[2] for row in cars)], strict=False):
            place += (before + length) / 2.0 + (VEHICLE_GAP + free if start else 0.0)
            start.append(place)
        length = [row[2] for row in cars]
        whole = place + length[-1] / 2.0 + 20.0
        ways = lane_passes(start, speed, length, whole)
        time = np.linspace(0.0, 20.0 * whole / speed[0], 4001)
        found = [way.at(time) for way in ways]
        for i, (a, here) in enumerate(found):
            for j in range(i):
                b, there = found[j]
                apart = np.abs(a - b)[here & there] - (length[i] + length[j]) / 2.0
                assert (apart > VEHICLE_GAP - 2.0 * OVERHANG - 1e-6).all()
        for way, (_, present) in zip(ways, found, strict=True):
            assert present[time > way.entry].any()
            assert way.entry >= way.leave

    def test_traffic_stays_about_as_dense(self) -> None:
        """On sampled roads over ten minutes."""
        shares = []
        for seed in range(4):
            motions = lane_motions(RoadGeometry(sample_road(RoadScenario(length=600.0), seed))).values()
            present = np.array([motion.pose(np.arange(60.0, 600.0, 0.5))[2] for motion in motions])
            shares.append(float(present.mean()))
        print(f"after a minute {', '.join(f'{share:.0%}' for share in shares)} of the vehicles are on the road")
        assert min(shares) > 0.65

    def test_of_sampled_traffic_nobody_drives_through_another(self) -> None:
        geometry = RoadGeometry(sample_road(RoadScenario(length=600.0), 5))
        time = np.arange(0.0, 300.0, 0.1)
        lanes: dict[tuple[str, int], list[tuple[Float, NDArray[np.bool_], float]]] = {}
        for motion in lane_motions(geometry).values():
            item = motion.vehicle
            size = VEHICLE_TYPES[item.model].length
            row = (motion.station(time), motion.pose(time)[2], size)
            lanes.setdefault((item.carriageway, item.lane), []).append(row)
        assert max(map(len, lanes.values())) > 2
        for rows in lanes.values():
            for i, (a, here, size) in enumerate(rows):
                for b, there, other in rows[:i]:
                    both = here & there
                    assert (np.abs(a - b)[both] > (size + other) / 2.0 + 0.9 * VEHICLE_GAP).all()


class TestStanding:
    def test_without_speed_it_stands(self) -> None:
        geometry = road({"it": vehicle("left", 0, 80.0, speed=0.0), "other": vehicle("left", 1, 80.0)})
        time = np.linspace(0.0, 1000.0, 50)
        for motion in (motion_of(geometry, "it"), motion_of(geometry, "other", 0.0)):
            assert motion.stands
            rotation, place, present = motion.pose(time)
            assert present.all()
            assert np.ptp(place, axis=0).max() == 0.0
            assert np.ptp(rotation, axis=0).max() == 0.0
        assert set(lane_motions(geometry)) == {"other"}
        assert lane_motions(geometry, 0.0) == {}

    @pytest.mark.parametrize("factor", [-1.0, float("nan"), float("inf")])
    def test_wrong_factors_are_refused(self, factor: float) -> None:
        with pytest.raises(InputError, match="speed_factor"):
            lane_motions(ROAD, factor)

    def test_a_lane_that_there_is_not_is_refused(self) -> None:
        with pytest.raises(InputError, match="lane"):
            lane_motions(road({"it": vehicle("left", 2, 80.0)}))


class TestElsewhere:
    def test_the_local_frame_may_have_another_origin(self) -> None:
        origin = np.array([100.0, -200.0, 7.0])
        time = np.linspace(0.0, 60.0, 100)
        plain, moved = (lane_motions(ROAD, origin=o)["right-car"].pose(time) for o in (np.zeros(3), origin))
        assert plain[1] - moved[1] == pytest.approx(np.tile(origin, (100, 1)), abs=1e-9)
        assert np.array_equal(plain[0], moved[0])

    @pytest.mark.parametrize("side", ["left", "right"])
    def test_one_that_was_moved_begins_there(self, side: str) -> None:
        motion = single(side, 0, 300.0)
        place = ROAD.point(500.0, 1.0)[0]
        moved = motion.from_elsewhere(place)
        assert moved.station(np.zeros(1))[0] == pytest.approx(500.0, abs=1e-6)
        time = np.linspace(0.1, 2.0, 20)
        assert moved.station(time) == pytest.approx(single(side, 0, 500.0).station(time), abs=1e-5)
        assert moved.pose(np.arange(0.0, 200.0, 0.5))[2].mean() > 0.9

    @pytest.mark.parametrize("motion", [LinearMotion((3.0, -4.0, 1.0), (5.0, 6.0, 7.0))])
    def test_straight_on(self, motion: LinearMotion) -> None:
        rotation, place, present = motion.pose(np.array([0.0, 2.0, -1.0]))
        assert place.tolist() == [[5.0, 6.0, 7.0], [11.0, -2.0, 9.0], [2.0, 10.0, 6.0]]
        assert np.array_equal(rotation, np.tile(np.eye(3), (3, 1, 1)))
        assert present.all()

    def test_velocities_that_are_not_finite_are_refused(self) -> None:
        with pytest.raises(InputError, match="velocity"):
            LinearMotion((0.0, np.nan, 1.0))


def test_every_vehicle_has_a_chassis_within_its_length() -> None:
    assert set(CHASSIS) == set(VEHICLE_TYPES)
    for model, (front, rear, track) in CHASSIS.items():
        kind = VEHICLE_TYPES[model]
        assert -kind.length / 2 < rear < front < kind.length / 2
        assert all(a < b for a, b in pairwise([0.0, track, kind.width / 2 + 0.05]))
