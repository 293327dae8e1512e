"""Distances between two epochs' surfaces against mathematics of their own, and to triangles against another library."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.changes.diff import diff_roads
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.epochs.nearest import NearestSurface, closest_points
from synthroads_addon.scanning.epochs.surface import SurfaceTruth
from tests.helpers.roads.parameter_sets import SMALL_ROAD

Float = Any
PLACES = 100_000
TOLERANCE = 1e-4
"""Largest error of a distance, m."""
LENGTH = 100.0
CROSSFALLS = {"flat": 0.0, "crossfall": 2.5, "curve": -4.0}
INNER, STRIP, LANE = 2.0, 0.5, 3.5
"""Widths of the cross-section from the centreline outwards, m."""
PAVED = INNER + STRIP + 2.0 * LANE + STRIP + 2.5
RUT = {"lane": 0, "start_station": 10.0, "end_station": 90.0, "depth": 0.012, "width": 0.9, "track": 1.8}
RUT |= {"ramp_length": 15.0}
BASIN = {"station": 50.0, "offset": -(INNER + PAVED) / 2.0, "length": 30.0, "width": 8.0, "depth": 0.05}
COURSE = {"start_station": 20.0, "end_station": 80.0, "inner": 2.5, "outer": 12.0, "thickness": 0.04}
COURSE |= {"ramp_length": 6.0, "taper": 0.3}


def road(case: str, grade: float = 0.0, **pavement: Any) -> RoadGeometry:
    """Return a road of 100 m whose pavement has some damages, flat, with a crossfall, or in a curve as well.

    It rises by ``grade`` (m/m).
    """
    data = copy.deepcopy(SMALL_ROAD)
    del data["objects"]["line"], data["objects"]["rail"]
    data["objects"] = {name: data["objects"][name] for name in ("alignment", "road")}
    curvature = 1.0 / 120.0 if case == "curve" else 0.0
    kind = "arc" if curvature else "line"
    element = {"kind": kind, "length": LENGTH, "curvature_start": curvature, "curvature_end": curvature}
    data["objects"]["alignment"]["horizontal"] = [element]
    ends = [{"station": station, "elevation": grade * station, "radius": 0.0} for station in (0.0, LENGTH)]
    data["objects"]["alignment"]["vertical"] = ends
    carriageway = data["objects"]["road"]
    carriageway["lanes"] = [{"width": LANE}, {"width": LANE}]
    carriageway["crossfall"] = [{"station": 0.0, "crossfall_percent": CROSSFALLS[case]}]
    carriageway["pavement"] = {"unevenness": 0.0, "joint_depth": 0.0, "wheel_track_depth": 0.0, **pavement}
    return RoadGeometry(RoadParameters.from_dict(data))


def rut_height(depth: float, station: Float, offset: Float) -> Float:
    """Return the height of the outermost lane's ruts by their formula."""
    middle = INNER + STRIP + 1.5 * LANE
    track = np.abs(np.abs(-offset - middle) - RUT["track"] / 2.0)
    ramp = np.clip(np.minimum(station - RUT["start_station"], RUT["end_station"] - station) / RUT["ramp_length"], 0, 1)
    across = np.where(track < RUT["width"] / 2.0, np.cos(math.pi * track / RUT["width"]) ** 2, 0.0)
    return -depth * np.sin(math.pi * ramp / 2.0) ** 2 * across


def basin_height(station: Float, offset: Float) -> Float:
    """Return the height of the settlement by its formula."""
    along, across = (station - BASIN["station"]) / BASIN["length"], (offset - BASIN["offset"]) / BASIN["width"]
    inside = (np.abs(along) < 0.5) & (np.abs(across) < 0.5)
    return np.where(inside, -BASIN["depth"] * np.cos(math.pi * along) ** 2 * np.cos(math.pi * across) ** 2, 0.0)


def course_height(station: Float, offset: Float) -> Float:
    """Return the height of the new course by its shape."""
    along = np.minimum(station - COURSE["start_station"], COURSE["end_station"] - station) / COURSE["ramp_length"]
    across = np.minimum(-offset - COURSE["inner"], COURSE["outer"] + offset) / COURSE["taper"]
    return COURSE["thickness"] * np.clip(along, 0, 1) * np.clip(across, 0, 1)


KINDS = {
    "rutted": (
        {"ruts": [RUT | {"depth": 0.004}]},
        {"ruts": [RUT]},
        lambda s, o: rut_height(0.004, s, o),
        lambda s, o: rut_height(0.012, s, o),
    ),
    "settled": ({}, {"settlements": [BASIN]}, lambda s, o: 0.0 * s, basin_height),
    "overlaid": (
        {"ruts": [RUT]},
        {"ruts": [RUT], "overlays": [COURSE]},
        lambda s, o: rut_height(0.012, s, o),
        lambda s, o: rut_height(0.012, s, o) + course_height(s, o),
    ),
}


def along_normal(slope: float, height: Float, other: Any, station: Float, offset: Float) -> Float:
    """Return distances along the built plane's normal from its own surface to another, by bisection of a formula."""
    norm = math.hypot(1.0, slope)
    level, upright = -slope / norm, 1.0 / norm

    def over(way: Float) -> Float:
        moved = offset - way * level
        return (slope * offset + height - way * upright) - (slope * moved + other(station, moved))

    low, high = np.full(len(station), -0.3), np.full(len(station), 0.3)
    for _ in range(45):
        middle = (low + high) / 2.0
        is_over = over(middle) > 0.0
        low, high = np.where(is_over, middle, low), np.where(is_over, high, middle)
    return (low + high) / 2.0


@pytest.mark.parametrize("case", CROSSFALLS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("is_second", [True, False])
def test_distances_are_those_of_the_formulas(case: str, kind: str, is_second: bool) -> None:
    first, second, first_height, second_height = KINDS[kind]
    before, after = road(case, **first), road(case, **second)
    changes = diff_roads(before.parameters, after.parameters).changes
    assert [change.kind for change in changes] == [kind]
    truth = SurfaceTruth(before, after, changes, is_second, 0.0)
    rng = np.random.default_rng(1)
    station = rng.uniform(1.0, LENGTH - 1.0, PLACES)
    offset = -rng.uniform(INNER + STRIP + 0.2, INNER + STRIP + 2.0 * LANE - 0.2, PLACES)
    own, other = (second_height, first_height) if is_second else (first_height, second_height)
    slope = CROSSFALLS[case] / 100.0
    expected = along_normal(slope, own(station, offset), other, station, offset)
    _, got = truth.measure(station, offset)
    assert np.abs(expected).max() > 0.007
    assert np.abs(got - expected).max() < TOLERANCE
    strongest = truth.strongest(station, offset)
    assert (strongest[np.abs(expected) > 1e-6] == 0).all()
    assert (strongest[np.abs(own(station, offset) - other(station, offset)) == 0.0] == -1).all()


def test_a_place_beside_all_changes_is_near_none() -> None:
    before, after = road("flat"), road("flat", ruts=[RUT | {"end_station": 30.0}])
    truth = SurfaceTruth(before, after, diff_roads(before.parameters, after.parameters).changes, True, 0.0)
    assert truth.near(np.array([5.0, 20.0, 40.0]), np.array([-7.0, -7.0, -7.0])).tolist() == [1]


def _soup(rng: np.random.Generator, count: int) -> Float:
    """Return triangles of all sizes and shapes."""
    centre = rng.uniform(-4.0, 4.0, (count, 1, 3))
    return centre + rng.normal(0.0, 1.0, (count, 3, 3)) * np.exp(rng.uniform(-5.0, 1.0, (count, 1, 1)))


def test_the_nearest_triangle_is_found_among_all() -> None:
    rng = np.random.default_rng(3)
    corners, points = _soup(rng, 300), rng.uniform(-5.0, 5.0, (400, 3))
    all_pairs = closest_points(np.tile(corners, (len(points), 1, 1)), np.repeat(points, len(corners), axis=0))
    far = np.linalg.norm(all_pairs - np.repeat(points, len(corners), axis=0), axis=1).reshape(len(points), -1)
    got = np.abs(NearestSurface(corners).distance(points, 20.0))
    assert np.abs(got - far.min(axis=1)).max() < 1e-9


def test_the_point_of_a_triangle_is_the_nearest_of_a_fine_grid() -> None:
    rng = np.random.default_rng(4)
    corners, points = _soup(rng, 40), rng.uniform(-5.0, 5.0, (40, 3))
    u, v = np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401))
    kept = u + v <= 1.0
    u, v = u[kept], v[kept]
    places = (
        corners[:, :1]
        + u[:, None] * (corners[:, 1:2] - corners[:, :1])
        + v[:, None] * (corners[:, 2:] - corners[:, :1])
    )
    least = np.linalg.norm(places - points[:, None], axis=2).min(axis=1)
    got = np.linalg.norm(closest_points(corners, points) - points, axis=1)
    assert (got <= least + 1e-12).all()
    assert np.abs(got - least).max() < 0.02


def _box(half: Float) -> Float:
    """Return the triangles (T, 3, 3) of a box about the origin, against the clock from outside; one side is finer."""
    triangles = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            count = 40 if (axis, sign) == (2, 1.0) else 1
            ends = np.linspace(-1.0, 1.0, count + 1)
            for i in range(count):
                for j in range(count):
                    u, v = (ends[i], ends[i + 1]), (ends[j], ends[j + 1])
                    square = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])][:: int(sign)]
                    face = np.insert(np.array(square), axis, sign, axis=1)
                    face = face[::-1] if axis == 1 else face
                    triangles += [face[[0, 1, 2]], face[[0, 2, 3]]]
    return np.array(triangles) * half


def test_distances_to_a_box_are_negative_inside_and_positive_outside() -> None:
    half, rng = np.array([3.0, 0.2, 1.0]), np.random.default_rng(6)
    points = rng.uniform(-1.0, 1.0, (5000, 3)) * (half + 0.4)
    beyond = np.abs(points) - half
    expected = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    assert (expected < 0.0).sum() > 500
    assert np.abs(NearestSurface(_box(half)).distance(points, 5.0) - expected).max() < 1e-9


def test_distances_are_those_of_trimesh() -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh: pip install trimesh rtree")
    rng = np.random.default_rng(5)
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=1.3)
    box = trimesh.creation.box((6.0, 0.4, 2.0))
    for shape in (mesh, box):
        points = rng.uniform(-3.5, 3.5, (2000, 3))
        expected = -trimesh.proximity.signed_distance(shape, points)
        got = NearestSurface(np.asarray(shape.triangles)).distance(points, 10.0)
        assert np.abs(got - expected).max() < 1e-3


def test_beyond_the_reach_the_reach_is_given() -> None:
    corners = np.array([[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]])
    got = NearestSurface(corners).distance(np.array([(0.2, 0.2, 3.0), (0.2, 0.2, -1.0), (0.2, 0.2, 80.0)]), 5.0)
    assert got == pytest.approx([3.0, -1.0, 5.0])


DEEP = {"station": 50.0, "offset": BASIN["offset"], "length": 12.0, "width": 8.0, "depth": 0.3}
"""A basin so steep that the normal's way along and across the road matters."""


@pytest.mark.parametrize("grade", [0.0, 0.06, -0.06])
@pytest.mark.parametrize("is_second", [True, False])
def test_distances_on_a_grade_in_a_curve_are_those_in_space(grade: float, is_second: bool) -> None:
    """Surfaces as points in space: circles about the curve's centre, whose heights rise along and across the road."""
    radius, slope = 120.0, CROSSFALLS["curve"] / 100.0
    before, after = road("curve", grade), road("curve", grade, settlements=[DEEP])
    changes = diff_roads(before.parameters, after.parameters).changes
    truth = SurfaceTruth(before, after, changes, is_second, 0.0)
    rng = np.random.default_rng(11)
    station = DEEP["station"] + rng.uniform(-5.0, 5.0, PLACES)
    offset = DEEP["offset"] + rng.uniform(-3.5, 3.5, PLACES)

    def basin(s: Float, d: Float) -> Float:
        along, across = (s - DEEP["station"]) / DEEP["length"], (d - DEEP["offset"]) / DEEP["width"]
        inside = (np.abs(along) < 0.5) & (np.abs(across) < 0.5)
        return np.where(inside, -DEEP["depth"] * np.cos(math.pi * along) ** 2 * np.cos(math.pi * across) ** 2, 0.0)

    def flat(s: Float, d: Float) -> Float:
        return np.zeros(np.broadcast(s, d).shape)

    own, other = (basin, flat) if is_second else (flat, basin)
    # Left curve about the origin: at offset d to the left the circle has the radius R - d.
    angle, arm = station / radius, radius - offset
    outward, ahead = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    place = np.array([*(arm * outward), grade * station + slope * offset + own(station, offset)])
    along = np.array([*(arm / radius * ahead), np.full(PLACES, grade)])
    across = np.array([*-outward, np.full(PLACES, slope)])
    normal = np.cross(along, across, axis=0)
    normal /= np.linalg.norm(normal, axis=0)

    def over(way: Float) -> Float:
        x, y, z = place - way * normal
        s, d = np.arctan2(y, x) * radius, radius - np.hypot(x, y)
        return z - (grade * s + slope * d + other(s, d))

    low, high = np.full(PLACES, -0.5), np.full(PLACES, 0.5)
    for _ in range(45):
        middle = (low + high) / 2.0
        is_over = over(middle) > 0.0
        low, high = np.where(is_over, middle, low), np.where(is_over, high, middle)
    _, got = truth.measure(station, offset)
    expected = (low + high) / 2.0
    assert np.abs(expected).max() > 0.25
    assert np.abs(got - expected).max() < 2e-6
