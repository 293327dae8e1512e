"""Paths: where they run against independent quadrature, how they are turned, and the knots between poses."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from synthroads_addon.base.errors import InputError
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.axes.centerline import AxisContent
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.devices.shots import shot_count, shots
from synthroads_addon.scanning.platforms.guides import RoadGuide, SmoothedGuide
from synthroads_addon.scanning.platforms.moving import MovingPath
from synthroads_addon.scanning.platforms.path import KNOT_ERROR, TURNAROUND, Path, Strip
from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.platforms.registry import make_platform
from synthroads_addon.scanning.platforms.strip_line import Sway
from synthroads_addon.scanning.platforms.tripod import TripodPath
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import load_scenario

GAUSS = np.polynomial.legendre.leggauss(30)
WINDING = (
    (150.0, 0.0, 0.0),
    (80.0, 0.0, 1 / 300),
    (120.0, 1 / 300, 1 / 300),
    (60.0, 1 / 300, -1 / 400),
    (90.0, -1 / 400, -1 / 400),
    (70.0, -1 / 400, 0.0),
    (30.0, 0.0, 0.0),
)
ABRUPT = ((200.0, 0.0, 0.0), (150.0, 1 / 280, 1 / 280), (150.0, -1 / 280, -1 / 280), (100.0, 0.0, 1 / 350))
"""Curvatures that jump, as on a road without clothoids."""
HILLY = ((0.0, 10.0, 0.0), (200.0, 14.0, 3000.0), (450.0, 6.5, 4000.0), (600.0, 7.0, 0.0))
KINKED = ((0.0, 10.0, 0.0), (300.0, 22.0, 0.0), (600.0, 10.0, 0.0))


@cache
def parameters(
    elements: tuple[tuple[float, float, float], ...], vertical: tuple[tuple[float, float, float], ...] = HILLY
) -> RoadParameters:
    """Return a road of two carriageways on this axis."""
    axis = AlignmentObject(
        instance=1,
        start_x=-200.0,
        start_y=100.0,
        start_heading_deg=30.0,
        horizontal=tuple(HorizontalElement.between(*row) for row in elements),
        vertical=tuple(VerticalPoint(station=s, elevation=z, radius=r) for s, z, r in vertical),
    )
    scenario = load_scenario("rq31-600m-even").road.model_copy(update={"length": sum(row[0] for row in elements)})
    return sample_road(scenario, 1, "", axis)


def road(elements=WINDING, vertical=HILLY) -> RoadGuide:
    return RoadGuide(RoadGeometry(parameters(elements, vertical)))


@cache
def sampled_road(length: float) -> RoadGuide:
    return RoadGuide(RoadGeometry(sample_road(load_scenario("rq31-600m-even", [f"road.length={length}"]).road, 1)))


def path_of(guide=None, **platform) -> MovingPath | TripodPath:
    return make_platform(**platform).make_path(guide or road())


def times(strip: Strip, count: int = 50) -> np.ndarray:
    return strip.start_time + np.arange(count) * (strip.duration / (count - 1))


# --- An axis evaluated independently: elements one by one, headings in closed form, positions by Gauss-Legendre.


class Axis:
    """The horizontal axis of a road from its parameter set alone."""

    def __init__(self, guide: RoadGuide) -> None:
        axis = guide.geometry.parameters.alignment
        self.rows = [(e.length, e.curvature_start, e.curvature_end) for e in axis.horizontal]
        self.start, self.heading0 = (axis.start_x, axis.start_y), math.radians(axis.start_heading_deg)

    def heading(self, station: float) -> float:
        turns, left = [self.heading0], station
        for length, before, after in self.rows:
            u = min(left, length)
            turns += [u * before, 0.5 * u * u * (after - before) / length]
            left -= u
            if left <= 0.0:
                break
        return math.fsum(turns)

    def position(self, station: float) -> tuple[float, float]:
        parts_x, parts_y, heading, left = [self.start[0]], [self.start[1]], [self.heading0], station
        for length, before, after in self.rows:
            u = min(left, length)
            slope, base = (after - before) / length, math.fsum(heading)
            pieces = max(1, math.ceil(u / 20.0))
            edges = np.arange(pieces + 1) * (u / pieces)
            half = np.diff(edges) / 2.0
            at = edges[:-1] + half + half * GAUSS[0][:, None]
            angle = base + at * (before + 0.5 * slope * at)
            parts_x += list(half * (GAUSS[1] @ np.cos(angle)))
            parts_y += list(half * (GAUSS[1] @ np.sin(angle)))
            heading += [u * before, 0.5 * u * u * slope]
            left -= u
            if left <= 0.0:
                break
        return math.fsum(parts_x), math.fsum(parts_y)

    def place(self, run: float, offset: float, length: float, forward: bool) -> tuple[float, float, float]:
        """Return where a run (m) along an offset line leads: it is s - offset (heading(s) - heading(0)) long."""

        def covered(station: float) -> float:
            return station - offset * (self.heading(station) - self.heading0)

        wanted = run if forward else covered(length) - run
        station = brentq(lambda s: covered(s) - wanted, 0.0, length, xtol=1e-12, rtol=1e-15)
        (x, y), heading = self.position(station), self.heading(station)
        return x - offset * math.sin(heading), y + offset * math.cos(heading), station


@pytest.mark.parametrize("case", ["winding", "abrupt", "1 m", "100 km"])
def test_a_direct_path_is_the_offset_line_of_the_axis_within_a_tenth_of_a_millimetre(case: str) -> None:
    guide = {
        "winding": road,
        "abrupt": lambda: road(ABRUPT),
        "1 m": lambda: sampled_road(1.0),
        "100 km": lambda: sampled_road(100_000.0),
    }[case]()
    axis = Axis(guide)
    path = path_of(guide, lateral_offsets=(10.0, -10.0, 0.0))
    for strip, offset, forward in zip(path.strips, (10.0, -10.0, 0.0), (True, False, True), strict=True):
        time = times(strip, 9)[1:-1]
        position, _ = path.pose(strip, time)
        for place, t in zip(position, time, strict=True):
            x, y, station = axis.place((t - strip.start_time) * 8.0, offset, guide.length, forward)
            assert math.hypot(place[0] - x, place[1] - y) < 1e-4
            assert place[2] == pytest.approx(float(guide.geometry.profile.elevation(station)) + 60.0, abs=1e-4)


def test_strips_go_there_and_back_with_a_turnaround_between() -> None:
    guide = road()
    path = path_of(guide, lateral_offsets=(5.0, -5.0, 15.0), speed=10.0)
    assert [strip.index for strip in path.strips] == [0, 1, 2]
    for before, after in pairwise(path.strips):
        assert after.start_time == pytest.approx(before.start_time + before.duration + TURNAROUND)
    for strip, offset, ends in zip(path.strips, (5.0, -5.0, 15.0), ((0, 600), (600, 0), (0, 600)), strict=True):
        position, _ = path.pose(strip, strip.start_time + np.array([0.0, strip.duration]))
        station, beside = guide.project(position[:, :2])
        np.testing.assert_allclose(station, ends, atol=1e-5)
        np.testing.assert_allclose(beside, offset, atol=1e-6)
    one_way = path_of(guide, lateral_offsets=(5.0, -5.0), there_and_back=False)
    for strip in one_way.strips:
        assert guide.project(one_way.pose(strip, np.array([strip.start_time]))[0][:, :2])[0][0] < 1e-5


FORMS = {
    "direct": {},
    "smoothed": {"path": "smoothed", "polynomial_degree": 5},
    "zigzag": {"path": "zigzag", "zigzag_amplitude": 8.0, "zigzag_wavelength": 120.0},
    "direct vehicle": {"kind": "vehicle"},
    "smoothed vehicle": {"kind": "vehicle", "path": "smoothed", "polynomial_degree": 9, "lateral_offsets": (-8.0,)},
    "zigzag vehicle": {
        "kind": "vehicle",
        "path": "zigzag",
        "zigzag_amplitude": 0.3,
        "zigzag_wavelength": 60.0,
    },
    "airborne": {"kind": "airborne"},
}


@pytest.mark.parametrize("form", FORMS)
def test_the_speed_over_ground_is_kept_and_the_nose_points_along_the_path(form: str) -> None:
    path = path_of(**FORMS[form])
    speed = make_platform(**FORMS[form]).value("speed")
    for strip in path.strips:
        time, h = times(strip, 200)[1:-1], 1e-3
        before, after = (path.pose(strip, time + d)[0] for d in (-h, h))
        velocity = (after - before)[:, :2] / (2 * h)
        np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), speed, rtol=2e-5)
        forward = path.pose(strip, time)[1][:, :2, 0]
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        across = forward[:, 0] * velocity[:, 1] - forward[:, 1] * velocity[:, 0]
        assert np.abs(across / speed).max() < 2e-3
        assert (forward * velocity).sum(axis=1).min() > 0.99 * speed


@pytest.mark.parametrize("form", FORMS)
def test_rotations_are_orthonormal_and_right_handed(form: str) -> None:
    path = path_of(**FORMS[form], roll_deg=20.0, pitch_deg=-35.0, yaw_deg=110.0)
    rotation = path.pose(path.strips[0], times(path.strips[0]))[1]
    unit = np.broadcast_to(np.eye(3), rotation.shape)
    np.testing.assert_allclose(rotation @ np.moveaxis(rotation, 1, 2), unit, atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-14)


def test_headings_of_a_direct_path_are_the_roads() -> None:
    """On straights, arcs and clothoids exactly; where the curvature begins to change, nearly."""
    guide = road()
    path = path_of(guide, lateral_offsets=(0.0,))
    station = np.linspace(0.0, 600.0, 400)
    rotation = path.pose(path.strips[0], station / 8.0)[1]
    heading = guide.geometry.alignment.heading(station)
    found = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    error = np.abs(np.angle(np.exp(1j * (found - heading))))
    assert error.max() < 1e-4
    borders = np.cumsum([row[0] for row in WINDING])[:-1]
    away = np.abs(station[:, None] - borders).min(axis=1) > 10.0
    assert error[away].max() < 1e-9
    np.testing.assert_array_equal(rotation[:, 2], np.broadcast_to([0.0, 0.0, 1.0], (400, 3)))


def test_a_path_can_be_asked_for_in_any_grouping_and_order() -> None:
    path = path_of(kind="vehicle")
    strip = path.strips[1]
    time = times(strip, 101)
    whole = path.pose(strip, time)
    shuffled = np.random.default_rng(1).permutation(101)
    for part in (shuffled[:1], shuffled[1:40], shuffled[40:]):
        position, rotation = path.pose(strip, time[part])
        np.testing.assert_allclose(position, whole[0][part], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation, whole[1][part], rtol=0, atol=1e-12)


# --- Heights


@pytest.mark.parametrize("path", ["direct", "smoothed", "zigzag"])
def test_every_form_keeps_the_height_above_the_centreline(path: str) -> None:
    guide = road()
    moving = path_of(guide, path=path, height=75.0, lateral_offsets=(0.0,))
    position, _ = moving.pose(moving.strips[0], times(moving.strips[0], 300))
    line = SmoothedGuide(guide, make_platform().polynomial_degree) if path == "smoothed" else guide
    station = nearest_station(line, position[:, :2]) if path == "smoothed" else guide.project(position[:, :2])[0]
    np.testing.assert_allclose(position[:, 2] - guide.geometry.profile.elevation(station), 75.0, atol=1e-4)


def nearest_station(line: SmoothedGuide, plan: np.ndarray) -> np.ndarray:
    """Return stations on a line by a fine search and one step along its tangent."""
    grid = np.linspace(0.0, line.length, 20_001)
    places, heading, _, stretch = line.frame(grid)
    nearest = np.array([np.hypot(*(places - p).T).argmin() for p in plan])
    tangent = np.stack([np.cos(heading), np.sin(heading)], axis=1)[nearest]
    return grid[nearest] + ((plan - places[nearest]) * tangent).sum(axis=1) / stretch[nearest]


@pytest.mark.parametrize("path", ["direct", "smoothed", "zigzag"])
def test_a_vehicle_stands_on_the_road_as_its_crossfall_and_grade_say(path: str) -> None:
    guide = road()
    geometry = guide.geometry
    options = {"path": path, "zigzag_amplitude": 0.3, "polynomial_degree": 9, "height": 2.0}
    moving = path_of(guide, kind="vehicle", lateral_offsets=(-8.0, 8.0), **options)
    for strip, traffic in zip(moving.strips, (1, -1), strict=True):
        position, rotation = moving.pose(strip, times(strip, 200)[1:-1])
        station, offset = guide.project(position[:, :2])
        np.testing.assert_allclose(position[:, 2] - geometry.elevation(station, offset), 2.0, atol=3e-4)
        assert np.median(np.abs(position[:, 2] - geometry.elevation(station, offset) - 2.0)) < 1e-5
        assert np.sign(np.diff(station)).mean() == traffic
        # One metre along the body's forward and left axis the surface is as far below as at the body.
        for axis in (0, 1):
            ahead = position + rotation[:, :, axis]
            s, o = guide.project(ahead[:, :2])
            np.testing.assert_allclose(ahead[:, 2] - geometry.elevation(s, o), 2.0, atol=4e-3)


def test_roll_and_pitch_have_the_signs_of_crossfall_and_grade() -> None:
    data = parameters(((600.0, 0.0, 0.0),), ((0.0, 0.0, 0.0), (600.0, 24.0, 0.0))).to_dict()
    for item in data["objects"].values():
        if item["type"] == "Carriageway":
            item["crossfall"] = [{"station": 0.0, "crossfall_percent": 2.5}]  # falls to the right of the stations
    guide = RoadGuide(RoadGeometry(RoadParameters.from_dict(data)))
    path = path_of(guide, kind="vehicle")
    for strip, direction in zip(path.strips, (1.0, -1.0), strict=True):
        rotation = path.pose(strip, times(strip))[1]
        pitch = np.arcsin(rotation[:, 2, 0])
        np.testing.assert_allclose(np.tan(pitch), direction * 0.04, atol=1e-9)
        # The left axis is (-sin p sin r, cos r, cos p sin r) before the heading: up on the side that is higher.
        roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
        np.testing.assert_allclose(np.tan(roll) / np.cos(pitch), direction * 0.025, atol=1e-9)


def test_a_vehicle_ignores_ruts_and_potholes_that_a_tripod_stands_in() -> None:
    data = parameters(((600.0, 0.0, 0.0),)).to_dict()
    carriageway = next(item for item in data["objects"].values() if item.get("side") == "right" and "lanes" in item)
    bowl = {"station": 300.0, "offset": -8.0, "length": 2.0, "width": 2.0, "depth": 0.2}
    carriageway["pavement"] = {"kind": "asphalt", "ruts": [], "potholes": [bowl]}
    damaged = RoadGuide(RoadGeometry(RoadParameters.from_dict(data)))
    carriageway["pavement"]["potholes"] = []
    sound = RoadGuide(RoadGeometry(RoadParameters.from_dict(data)))
    time = 300.0 / 20.0 + np.linspace(-0.2, 0.2, 41)
    over, past = (path_of(g, kind="vehicle", lateral_offsets=(-8.0,)) for g in (damaged, sound))
    for a, b in zip(over.pose(over.strips[0], time), past.pose(past.strips[0], time), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)
    low, high = (path_of(g, kind="tripod", stations=(300.0,), lateral_offsets=(-8.0,)) for g in (damaged, sound))
    assert high.positions[0, 2] - low.positions[0, 2] == pytest.approx(0.2)


def test_a_vehicle_drives_in_the_middle_of_the_outermost_through_lane_with_its_traffic() -> None:
    guide = road()
    path = path_of(guide, kind="vehicle")
    assert len(path.strips) == 2
    for strip, side in zip(path.strips, ("right", "left"), strict=True):
        station, offset = guide.project(path.pose(strip, times(strip))[0][:, :2])
        outer, inner = guide.geometry.sections[side].lane_boundaries(station)[:, :2].T
        np.testing.assert_allclose(np.abs(offset), (outer + inner) / 2, atol=1e-6)
        assert (offset < 0).all() == (side == "right")
        assert (np.diff(station) > 0).all() == (side == "right")


def test_a_vehicles_direction_is_its_carriageways_whatever_the_order_of_the_strips() -> None:
    guide = road()
    offsets = (8.0, -8.0, -4.5, 4.5)
    path = path_of(guide, kind="vehicle", lateral_offsets=offsets)
    for strip, offset in zip(path.strips, offsets, strict=True):
        station, beside = guide.project(path.pose(strip, times(strip))[0][:, :2])
        np.testing.assert_allclose(beside, offset, atol=1e-6)
        assert (np.diff(station) > 0).all() == (offset < 0)


def test_a_vehicle_on_a_short_road_asks_for_no_ground_beyond_its_ends() -> None:
    asked: list[np.ndarray] = []

    class Watched(RoadGuide):
        def ground(self, station: np.ndarray, offset: np.ndarray, damaged: bool) -> np.ndarray:
            asked.append(station)
            return super().ground(station, offset, damaged)

    path = path_of(Watched(sampled_road(1.0).geometry), kind="vehicle")
    for strip in path.strips:
        path.pose(strip, times(strip))
    station = np.concatenate(asked)
    assert station.min() >= -1e-9
    assert station.max() <= 1.0 + 1e-9


@pytest.mark.parametrize(("kind", "expected"), [("climbing", 1), ("through", 0)])
def test_a_climbing_lane_is_not_the_vehicles(kind: str, expected: int) -> None:
    data = parameters(WINDING).to_dict()
    for item in data["objects"].values():
        if item["type"] == "Carriageway":
            item["lanes"][0] |= {"kind": kind, "width": 3.5}
    guide = RoadGuide(RoadGeometry(RoadParameters.from_dict(data)))
    boundaries = guide.geometry.sections["right"].lane_boundaries(0.0)[0]
    assert guide.driving_offsets()[0] == pytest.approx(-boundaries[expected : expected + 2].mean())


def test_a_lane_that_is_mostly_dropped_is_not_the_vehicles() -> None:
    data = parameters(WINDING).to_dict()
    points = [{"station": 200.0, "width": 3.75}, {"station": 260.0, "width": 0.0}]
    for item in data["objects"].values():
        if item["type"] == "Carriageway":
            item["lanes"][0]["width"] = points
    guide = RoadGuide(RoadGeometry(RoadParameters.from_dict(data)))
    boundaries = guide.geometry.sections["right"].lane_boundaries(600.0)[0]
    assert guide.driving_offsets()[0] == pytest.approx(-boundaries[1:3].mean())


# --- Zigzag and smoothed


@given(
    amplitude=st.floats(0.1, 100.0),
    factor=st.floats(1.0, 100.0),
    station=st.lists(st.floats(-1e4, 1e5), min_size=1, max_size=20),
)
@settings(max_examples=60, deadline=None)
def test_a_sway_is_periodic_odd_within_its_amplitude_and_has_its_slope(amplitude, factor, station) -> None:
    sway = Sway(amplitude, amplitude * factor)
    at = np.array(station)
    offset, slope = sway.at(at)
    tolerance = 1e-9 * amplitude + 1e-11 * sway.slope * 1e5
    assert np.abs(offset).max() <= amplitude + tolerance
    assert np.abs(slope).max() <= sway.slope + 1e-12
    for other, sign in ((at + sway.wavelength, 1), (at + sway.wavelength / 2, -1), (-at, -1)):
        np.testing.assert_allclose(sway.at(other)[0], sign * offset, atol=tolerance)
    h = 1e-5 * sway.wavelength
    difference = (sway.at(at + h)[0] - sway.at(at - h)[0]) / (2 * h)
    np.testing.assert_allclose(difference, slope, atol=1e-3 * sway.slope + 1e-9 * 1e5 / h * sway.slope * 1e-6)


def test_a_zigzag_sways_to_its_amplitude_along_straight_legs_with_rounded_turning_points() -> None:
    guide = road()
    path = path_of(guide, path="zigzag", zigzag_amplitude=6.0, zigzag_wavelength=100.0, lateral_offsets=(3.0,))
    position, _ = path.pose(path.strips[0], times(path.strips[0], 20_001))
    station, offset = guide.project(position[:, :2])
    sway = offset - 3.0
    assert sway.max() == pytest.approx(6.0, abs=1e-4)
    assert sway.min() == pytest.approx(-6.0, abs=1e-4)
    assert sway[0] == pytest.approx(0.0, abs=1e-6)
    crossings = station[:-1][np.diff(np.sign(sway)) != 0]
    np.testing.assert_allclose(crossings, 50.0 * np.arange(len(crossings)), atol=0.05)
    slope = np.gradient(sway, station)
    leg = np.abs(np.abs(slope) - np.abs(slope).max()) < 1e-3
    assert 0.55 < leg.mean() < 0.65  # three fifths of the way are straight, two are turning points
    assert np.abs(np.diff(slope)).max() < 0.01  # no corner


def test_a_smoothed_path_is_the_least_squares_polynomial() -> None:
    guide = road()
    path = path_of(guide, path="smoothed", polynomial_degree=4, lateral_offsets=(0.0,))
    station = np.linspace(0.0, 600.0, 601)
    plan = guide.frame(station)[0]
    u = station / 300.0 - 1.0
    fitted = np.stack([np.polynomial.Polynomial.fit(u, plan[:, i], 4, domain=[-1, 1])(u) for i in (0, 1)], axis=1)
    on_line = SmoothedGuide(guide, 4).frame(station)[0]
    np.testing.assert_allclose(on_line, fitted, atol=1e-6)
    position, _ = path.pose(path.strips[0], times(path.strips[0], 2001))
    beside = np.abs(guide.project(position[:, :2])[1])
    assert 1.0 < beside.max() < 60.0


def test_a_smoothed_path_turns_through_west_without_a_jerk() -> None:
    """There its direction leaps from +180 to -180 degrees."""
    angle = np.linspace(0.0, np.pi, 100)
    guide = PolylineGuide(400.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    path = make_platform(path="smoothed", polynomial_degree=7, lateral_offsets=(0.0,)).make_path(guide)
    strip = path.strips[0]
    headings = SmoothedGuide(guide, 7).frame(np.linspace(0.0, guide.length, 500))[1]
    assert np.abs(np.diff(headings)).max() > 6.0
    time = times(strip, 3000)
    position, rotation = path.pose(strip, time)
    velocity = np.gradient(position[:, :2], time, axis=0)[1:-1] / 8.0
    np.testing.assert_allclose(rotation[1:-1, :2, 0], velocity, atol=1e-3)
    assert knot_error(path) < KNOT_ERROR
    assert path.knot_spacing > 5e-3


@given(degree=st.integers(1, 9), length=st.floats(1.0, 1e5))
@settings(max_examples=10, deadline=None)
def test_a_straight_line_is_smoothed_into_itself(degree: int, length: float) -> None:
    guide = PolylineGuide([(5.0, 3.0), (5.0 - length * 0.6, 3.0 + length * 0.8)])
    path = make_platform(path="smoothed", polynomial_degree=degree, lateral_offsets=(2.0,)).make_path(guide)
    position, rotation = path.pose(path.strips[0], times(path.strips[0], 7))
    np.testing.assert_allclose(guide.project(position[:, :2])[1], 2.0, atol=1e-9 * length)
    np.testing.assert_allclose(rotation[:, :, 0], np.tile([-0.6, 0.8, 0.0], (7, 1)), atol=1e-8)


# --- Bends too sharp for an offset


@pytest.mark.parametrize("offset", [290.0, -395.0, 300.0, 1e4])
@pytest.mark.parametrize("kind", ["uav", "vehicle"])
def test_an_offset_line_that_would_turn_back_is_refused_by_station(kind: str, offset: float) -> None:
    if offset == 290.0:
        path_of(kind="uav", lateral_offsets=(0.0, offset))  # just below 98 % of the radius, 294 m
        return
    message = r"lateral_offsets\[1\] is .* at station \d+\.\d m.* radius is [34]00\.00 m"
    with pytest.raises(InputError, match=message) as info:
        path_of(kind=kind, lateral_offsets=(0.0, offset))
    station = float(str(info.value).split("station ")[1].split(" m")[0])
    low, high = (230.0, 350.0) if offset > 0 else (410.0, 500.0)
    assert low - 1.0 <= station <= high + 1.0


def test_a_path_near_the_fold_never_goes_backwards() -> None:
    path = path_of(lateral_offsets=(290.0,))
    station = road().project(path.pose(path.strips[0], times(path.strips[0], 3000))[0][:, :2])[0]
    assert np.diff(station).min() > 0.0


def test_a_zigzag_that_folds_or_runs_across_is_refused() -> None:
    with pytest.raises(InputError, match=r"lateral_offsets.* at station"):
        path_of(path="zigzag", lateral_offsets=(280.0,), zigzag_amplitude=50.0)
    with pytest.raises(InputError, match=r"zigzag_wavelength is 20\.0: at least the amplitude, 30 m"):
        path_of(path="zigzag", zigzag_amplitude=30.0, zigzag_wavelength=20.0)


def test_polynomials_that_turn_back_are_refused() -> None:
    there_and_back = PolylineGuide([(0, 0), (500, 0), (500, 12), (0, 12)])
    with pytest.raises(InputError, match=r"polynomial_degree is 2: the smoothed path turns back at station \d+"):
        make_platform(path="smoothed", polynomial_degree=2).make_path(there_and_back)


# --- Tripod


def test_a_tripod_turns_once_at_each_position() -> None:
    guide = road()
    path = path_of(guide, kind="tripod", turn_seconds=40.0, station_spacing=100.0)
    assert len(path.strips) == 7
    station, _ = guide.project(path.positions[:, :2])
    np.testing.assert_allclose(station, np.arange(7) * 100.0, atol=1e-6)
    for strip in path.strips:
        assert strip.duration == 40.0
        time = strip.start_time + np.linspace(0.0, 40.0, 81)
        position, rotation = path.pose(strip, time)
        assert np.ptp(position, axis=0).max() == 0.0
        heading = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
        np.testing.assert_allclose(heading - heading[0], np.linspace(0.0, 2.0 * np.pi, 81), atol=1e-9)
        np.testing.assert_allclose(rotation[-1], rotation[0], atol=1e-12)
        facing = guide.geometry.alignment.heading(station[strip.index])
        np.testing.assert_allclose(rotation[0, :2, 0], [np.cos(facing), np.sin(facing)], atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 90.0])
def test_a_tripod_turns_as_far_as_told_or_stands_still(angle: float) -> None:
    platform = make_platform(kind="tripod", turn_seconds=2.0, turn_deg=angle, stations=(50.0, 90.0))
    for path in (platform.make_path(road()), TripodPath(platform, [(0, 0, 0), (1, 2, 3)])):
        for strip in path.strips:
            _, rotation = path.pose(strip, strip.start_time + np.array([0.0, 1.0, 2.0]))
            heading = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
            np.testing.assert_allclose(np.rad2deg(heading - heading[0]), [0.0, angle / 2.0, angle], atol=1e-9)


def test_a_recipe_of_sweeps_sees_all_around() -> None:
    """A head that turns one way on a tripod that turns the other way at the same rate would look one way only."""
    job = scene_jobs(load_recipe("sweeps"))[0]
    path = job.scenario.scan.platform.make_path(road())
    setting = scanner_setting(job.scenario.scan)
    (strip,) = path.strips
    fired = shots(setting, 0, shot_count(setting, strip.duration))
    _, rotation = path.pose(strip, strip.start_time + fired.time)
    x, y, _ = np.einsum("pij,jp->ip", rotation, fired.direction)
    azimuth = np.sort(np.rad2deg(np.arctan2(y, x)))
    gaps = np.diff(np.append(azimuth, azimuth[0] + 360.0))
    assert gaps.max() < 1.0


def test_tripods_stand_by_turns_on_the_pavements_outer_edges_above_the_ground() -> None:
    guide = road()
    path = path_of(guide, kind="tripod", height=1.5)
    station, offset = guide.project(path.positions[:, :2])
    for i, (s, o) in enumerate(zip(station, offset, strict=True)):
        side = ("right", "left")[i % 2]
        edge = guide.geometry.sections[side].paved_edge(s)[0]
        assert o == pytest.approx(edge if side == "left" else -edge, abs=1e-6)
    ground = guide.geometry.elevation(station, offset * (1 - 1e-9))
    np.testing.assert_allclose(path.positions[:, 2] - ground, 1.5, atol=1e-6)


def test_a_tripods_stations_and_offsets() -> None:
    guide = road()
    path = path_of(guide, kind="tripod", stations=(10.0, 590.0, 300.0), lateral_offsets=(4.0, -6.0))
    station, offset = guide.project(path.positions[:, :2])
    np.testing.assert_allclose(station, (10.0, 590.0, 300.0), atol=1e-6)
    np.testing.assert_allclose(offset, (4.0, -6.0, 4.0), atol=1e-6)
    with pytest.raises(InputError, match=r"scan\.platform\.stations\[1\] is 600\.5: from 0 to 600 m"):
        path_of(guide, kind="tripod", stations=(10.0, 600.5))
    uneven = path_of(guide, kind="tripod", station_spacing=170.0)
    np.testing.assert_allclose(guide.project(uneven.positions[:, :2])[0], [45.0, 215.0, 385.0, 555.0], atol=1e-6)
    with pytest.raises(InputError, match="at most 65536"):
        path_of(sampled_road(100_000.0), kind="tripod", station_spacing=1.0)


def test_a_tripod_outside_the_verge_stands_on_the_batter_or_the_ground() -> None:
    guide = road()
    path = path_of(guide, kind="tripod", stations=(300.0,), lateral_offsets=(-40.0,))
    edge = guide.geometry.elevation(300.0, guide.geometry.offsets(300.0)[:, -1])
    assert path.positions[0, 2] - 1.8 < edge[0] - 0.2


# --- Mounting, knots, extremes


def test_the_mounting_turns_the_scanner_in_the_platforms_frame() -> None:
    plain, mounted = path_of(), path_of(roll_deg=90.0, pitch_deg=30.0, yaw_deg=180.0)
    time = times(plain.strips[0], 5)
    base, turned = (path.pose(path.strips[0], time)[1] for path in (plain, mounted))
    relative = np.moveaxis(base, 1, 2) @ turned
    # Facing back, nose 30 degrees up; then the left side up by a right angle about the nose.
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    np.testing.assert_allclose(relative[:, :, 0], np.tile([-c, 0.0, s], (5, 1)), atol=1e-12)
    np.testing.assert_allclose(relative[:, :, 1], np.tile([s, 0.0, c], (5, 1)), atol=1e-12)


KNOT_CASES = {
    "uav": (road, {}),
    "uav over jumps of the curvature and kinks": (lambda: road(ABRUPT, KINKED), {"speed": 12.0}),
    "vehicle": (road, {"kind": "vehicle", "roll_deg": 10.0, "pitch_deg": 45.0, "yaw_deg": 135.0}),
    "vehicle over jumps of the curvature and kinks": (lambda: road(ABRUPT, KINKED), {"kind": "vehicle"}),
    "fast vehicle": (road, {"kind": "vehicle", "speed": 40.0}),
    "smoothed": (road, {"path": "smoothed"}),
    "smoothed vehicle": (road, {"kind": "vehicle", "path": "smoothed", "polynomial_degree": 9}),
    "zigzag": (road, {"path": "zigzag"}),
    "zigzag over jumps": (lambda: road(ABRUPT), {"path": "zigzag", "zigzag_wavelength": 30.0}),
    "steep zigzag": (road, {"path": "zigzag", "zigzag_amplitude": 10.0, "zigzag_wavelength": 20.0}),
    "airborne": (road, {"kind": "airborne"}),
    "tripod": (road, {"kind": "tripod"}),
    "fast tripod": (road, {"kind": "tripod", "turn_seconds": 0.1}),
    "polyline": (lambda: PolylineGuide([(0, 0, 5), (100, 0, 9), (160, 80, 3), (300, 80, 3)]), {}),
    "vehicle on a polyline": (
        lambda: PolylineGuide([(0, 0, 5), (60, 2, 5), (90, 30, 6), (200, 31, 4)]),
        {"kind": "vehicle"},
    ),
}


def knot_error(path: Path, most: int = 6000) -> float:
    """Return what interpolating between knots errs at 100 m at most, everywhere or at stretches of a strip."""
    worst = 0.0
    for strip in path.strips[:2]:
        last = int(strip.duration / path.knot_spacing)
        stretch = np.arange(last + 1)
        if last > most:
            starts = np.linspace(0, last - most // 40, 40).astype(int)
            stretch = (starts[:, None] + np.arange(most // 40)).ravel()
        knots = strip.start_time + stretch * path.knot_spacing
        worst = max(worst, interpolation_error(path, strip, knots))
    return worst


def interpolation_error(path: Path, strip: Strip, knots: np.ndarray) -> float:
    """Return what interpolation behind knots (K,) errs at 100 m at most."""
    worst = 0.0
    (p0, r0), (p1, r1) = path.pose(strip, knots), path.pose(strip, knots + path.knot_spacing)
    for share in (0.2, 0.5, 0.7):
        position, rotation = path.pose(strip, knots + share * path.knot_spacing)
        moved = np.linalg.norm(p0 + share * (p1 - p0) - position, axis=1)
        turned = np.linalg.norm(r0 + share * (r1 - r0) - rotation, ord=2, axis=(1, 2))
        worst = max(worst, float((moved + 100.0 * turned).max()))
    return worst


@pytest.mark.parametrize("case", KNOT_CASES)
def test_poses_may_be_interpolated_between_knots(case: str) -> None:
    guide, platform = KNOT_CASES[case]
    path = make_platform(**platform).make_path(guide())
    assert knot_error(path) < KNOT_ERROR == 2e-5


def test_where_a_course_jumps_poses_may_be_interpolated_too() -> None:
    """A sway at an angle to a guide whose curvature jumps has a corner, which lies between two knots of very many."""
    guide = road(ABRUPT)
    sway = {"path": "zigzag", "zigzag_amplitude": 20.0, "zigzag_wavelength": 200.0}
    path = path_of(guide, lateral_offsets=(100.0,), **sway)
    strip = path.strips[0]
    coarse = times(strip, 5000)
    station = guide.project(path.pose(strip, coarse)[0][:, :2])[0]
    for corner in (200.0, 350.0, 500.0):
        first = round(float(np.interp(corner, station, coarse)) / path.knot_spacing)
        knots = (first + np.arange(-400, 400)) * path.knot_spacing
        assert spans(guide, path, strip, knots, corner)
        assert interpolation_error(path, strip, knots) < KNOT_ERROR


def spans(guide: RoadGuide, path: Path, strip: Strip, knots: np.ndarray, station: float) -> bool:
    """Return whether a station lies between the first and the last knot."""
    ends = guide.project(path.pose(strip, knots[[0, -1]])[0][:, :2])[0]
    return bool(ends[0] < station < ends[1])


def test_knots_are_not_denser_than_they_need_be() -> None:
    """On an ordinary road they stay apart by several pulses: with ten times the spacing the error is too large."""
    for platform in ({}, {"kind": "vehicle"}, {"kind": "tripod"}, {"path": "zigzag"}):
        path = path_of(**platform)
        assert path.knot_spacing > 1e-3
        spacing = path.knot_spacing
        path.knot_spacing = spacing * 10.0
        assert knot_error(path) > KNOT_ERROR


@pytest.mark.parametrize("length", [1.0, 100_000.0])
@pytest.mark.parametrize("form", [*FORMS, "tripod"])
def test_roads_of_a_metre_and_of_a_hundred_kilometres(length: float, form: str) -> None:
    guide = sampled_road(length)
    options = FORMS.get(form, {"kind": "tripod"}) | ({"polynomial_degree": 3} if "smoothed" in form else {})
    path = path_of(guide, **options)
    for strip in path.strips[-2:]:
        position, rotation = path.pose(strip, times(strip, 200))
        assert np.isfinite(position).all()
        np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-12)
        if form == "direct":
            _, offset = guide.project(position[:, :2])
            np.testing.assert_allclose(np.abs(offset), 10.0, atol=1e-5)


def test_usual_values_stand_where_nothing_is_given() -> None:
    path = path_of(kind="airborne")
    assert path.strips[0].duration == pytest.approx(600.0 / 60.0)
    position, _ = path.pose(path.strips[0], np.array([3.0]))
    assert position[0, 2] - road().geometry.profile.elevation(180.0) == pytest.approx(800.0, abs=1e-4)
    assert path.typical_range == 800.0
    assert path_of(kind="airborne", height=500.0).typical_range == 500.0
    assert path_of(kind="tripod").strips[0].duration == 60.0
    with pytest.raises(InputError, match=r"file can't be given for uav, only for trajectory"):
        path_of(kind="uav", file="a.csv")


# --- Polylines


def test_a_polylines_corners_are_rounded_in_heading_and_curvature() -> None:
    guide = PolylineGuide([(0.0, 0.0, 1.0), (100.0, 0.0, 3.0), (100.0, 100.0, 2.0)])
    station = np.linspace(0.0, guide.length, 4001)
    plan, heading, curvature, _ = guide.frame(station)
    np.testing.assert_allclose(plan[-1], [100.0, 100.0], atol=1e-9)
    assert np.abs(np.diff(heading)).max() < 0.02
    assert np.abs(np.diff(curvature)).max() < 0.01
    away = np.maximum(np.abs(plan[:, 0] - 100.0), np.abs(plan[:, 1])) > 10.0
    on_line = np.minimum(np.abs(plan[:, 1]), np.abs(plan[:, 0] - 100.0))
    assert on_line[away].max() < 1e-9
    corner = np.hypot(*(plan - [100.0, 0.0]).T).min()
    assert guide.deviation == pytest.approx(corner, abs=1e-4)
    assert corner == pytest.approx(3.9, abs=1.0)
    np.testing.assert_allclose(guide.elevation(np.array([0.0, guide.length / 2, guide.length])), [1.0, 3.0, 2.0])
    heading_at_end = guide.frame(np.array([guide.length]))[1][0]
    assert heading_at_end == pytest.approx(np.pi / 2, abs=1e-12)


@given(st.lists(st.tuples(st.floats(2.0, 200.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)), min_size=1, max_size=12))
@settings(max_examples=30, deadline=None)
def test_any_polyline_without_sharp_corners_is_followed(steps: list[tuple[float, float, float]]) -> None:
    lengths = np.array([length for length, _, _ in steps])
    # Turns grow with the shorter neighbour, so that each can be rounded.
    shorter = np.minimum(lengths, np.concatenate((lengths[:1], lengths[:-1])))
    heading = np.cumsum([turn for _, turn, _ in steps] * np.minimum(1.0, shorter / 20.0))
    advance = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    plan = np.concatenate([np.zeros((1, 2)), np.cumsum(advance, axis=0)]) + [300.0, -50.0]
    height = np.concatenate(([0.0], np.cumsum([rise for _, _, rise in steps])))
    guide = PolylineGuide(np.column_stack([plan, height]))
    at_ends = np.array([0.0, guide.length])
    ends = np.column_stack([guide.frame(at_ends)[0], guide.elevation(at_ends)])
    np.testing.assert_allclose(ends, np.column_stack([plan, height])[[0, -1]], atol=1e-8)
    station = np.linspace(0.0, guide.length, 500)
    _, turned, _, _ = guide.frame(station)
    sharpest = max(abs(element.curvature_end) for element in guide.alignment.elements)
    # The heading is the integral of the curvature, from the first segment's to the last one's.
    assert turned[0] == pytest.approx(heading[0])
    np.testing.assert_allclose(np.exp(1j * turned[-1]), np.exp(1j * heading[-1]), atol=1e-9)
    assert np.abs(np.diff(turned)).max() <= sharpest * (station[1] - station[0]) * (1 + 1e-9) + 1e-12
    assert sharpest < 1.0
    path = make_platform(lateral_offsets=(0.0,)).make_path(guide)
    position, _ = path.pose(path.strips[0], times(path.strips[0], 100))
    step = np.hypot(*np.diff(position[:, :2], axis=0).T)
    assert step.max() <= guide.length / 99 * (1 + 1e-6)


def test_wrong_polylines_are_refused() -> None:
    for points, message in (
        ([(0, 0)], "at least two points"),
        ([(0, 0), (0, 0), (0.0, 1e-4)], "at least two points"),
        ([(0, 0), (1, np.nan)], r"points\[1, 1\]|points\[1\]\[1\]"),
        ([(0, 0, 0, 0), (1, 1, 1, 1)], r"shape \(N, 2\) or \(N, 3\)"),
        ([(0, 0), (100, 0), (0, 1)], r"points\[1\].*turns by 179 degrees"),
        ([(0, 0), (0, 0), (0.5, 0), (0.5, 0.5), (50, 50)], r"points\[2\].*too sharply"),
    ):
        with pytest.raises(InputError, match=message):
            PolylineGuide(points)


def test_a_jittering_line_is_thinned_within_its_tolerance() -> None:
    rng = np.random.default_rng(7)
    angle = np.arange(0.0, 1.0, 0.001)  # 1 m apart on an arc of 1000 m
    arc = 1000.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    measured = arc + rng.normal(0.0, 0.01, arc.shape)
    with pytest.raises(InputError, match="radius is"):
        make_platform(lateral_offsets=(60.0,)).make_path(PolylineGuide(measured))
    guide = PolylineGuide(measured, tolerance=0.05)
    assert guide.deviation < 0.06
    path = make_platform(lateral_offsets=(60.0, -60.0)).make_path(guide)
    for strip, offset in zip(path.strips, (60.0, -60.0), strict=True):
        position, _ = path.pose(strip, times(strip))
        np.testing.assert_allclose(np.hypot(*position[1:-1, :2].T), 1000.0 - offset, atol=1.0)


def test_a_polyline_is_read_from_a_file_in_map_coordinates(tmp_path) -> None:
    file = tmp_path / "axis.csv"
    file.write_text("x,y,z\n500000,5600000,100\n500300,5600000,103\n500600,5600100,100\n", encoding="utf-8")
    guide = PolylineGuide.along(AxisContent.read(file), origin=(500_000.0, 5_600_000.0, 90.0))
    start = np.zeros(1)
    np.testing.assert_allclose(guide.frame(start)[0], [[0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(guide.elevation(start), 10.0, atol=1e-9)
    np.testing.assert_array_equal(guide.origin, (500_000.0, 5_600_000.0, 90.0))
    centred = PolylineGuide.along(AxisContent.read(file))
    place = np.append(centred.frame(start)[0], centred.elevation(start))
    np.testing.assert_allclose(place + centred.origin, [500_000.0, 5_600_000.0, 100.0])
    path = make_platform(kind="vehicle").make_path(guide)
    assert len(path.strips) == 1
    assert path.pose(path.strips[0], np.array([5.0]))[0][0, 2] == pytest.approx(10.0 + 1.0 + 2.2, abs=1e-3)


def test_a_guide_of_elements_and_one_of_points_agree() -> None:
    """A finely sampled axis as a polyline gives the same path as the axis itself."""
    axis = Alignment([Element(*row) for row in WINDING], -200.0, 100.0, math.radians(30.0))
    station = np.linspace(0.0, 600.0, 301)
    line = PolylineGuide(axis.position(station))
    path = make_platform(lateral_offsets=(20.0,), speed=10.0).make_path(line)
    position, rotation = path.pose(path.strips[0], np.linspace(0.0, path.strips[0].duration, 50))
    s, offset = axis.project(position[:, :2])
    np.testing.assert_allclose(offset, 20.0, atol=0.02)
    forward = np.stack([np.cos(axis.heading(s)), np.sin(axis.heading(s))], axis=1)
    np.testing.assert_allclose(rotation[:, :2, 0], forward, atol=5e-3)
