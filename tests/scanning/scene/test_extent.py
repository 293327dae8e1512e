"""Where a scene is: its middle line, its median elevation, the surface below a place; and tripods put there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.platforms.registry import make_platform
from synthroads_addon.scanning.platforms.tripod import TripodPath
from synthroads_addon.scanning.scene.extent import bounds, elevation_at, median_elevation, middle_line
from synthroads_addon.scanning.scene.mesh import SceneMesh


def mesh(vertices: list[list[float]], triangles: list[list[int]]) -> SceneMesh:
    count = len(triangles)
    return SceneMesh(
        vertices=np.array(vertices, np.float32),
        triangles=np.array(triangles, np.int32).reshape(-1, 3),
        class_id=np.zeros(count, np.uint8),
        instance_id=np.zeros(count, np.uint32),
        material=np.zeros(count, np.uint16),
        materials=("unknown",),
        origin=np.zeros(3),
    )


def slab(low: float, high: float, z: float, slope: float = 0.0) -> tuple[list[list[float]], list[list[int]]]:
    """Return a square in plan that rises by `slope` along x."""
    corners = [[x, y, z + slope * x] for x, y in ((low, low), (high, low), (high, high), (low, high))]
    return corners, [[0, 1, 2], [0, 2, 3]]


def joined(*parts: tuple[list[list[float]], list[list[int]]]) -> SceneMesh:
    vertices, triangles = [], []
    for corners, faces in parts:
        triangles += [[i + len(vertices) for i in face] for face in faces]
        vertices += corners
    return mesh(vertices, triangles)


within = st.floats(-4.9, 4.9)


@given(within, within, st.floats(-2.0, 2.0), st.booleans())
def test_the_highest_surface_counts(x: float, y: float, slope: float, turned: bool) -> None:
    scene = joined(slab(-5, 5, 1.0, slope), slab(-5, 5, -20.0), slab(-1, 1, 30.0))
    if turned:
        scene = mesh(scene.vertices.tolist(), scene.triangles[:, ::-1].tolist())
    expected = 30.0 if max(abs(x), abs(y)) <= 1.0 else 1.0 + slope * x
    assert elevation_at(scene, x, y) == pytest.approx(expected, abs=1e-5)


def test_beside_the_scene_and_on_walls_there_is_no_surface() -> None:
    wall = ([[0, 0, 0], [4, 0, 0], [4, 0, 3]], [[0, 1, 2]])
    assert elevation_at(joined(slab(-5, 5, 1.0)), 5.1, 0.0) is None
    assert elevation_at(joined(wall), 2.0, 0.0) is None
    assert elevation_at(joined(wall, slab(-5, 5, 1.0)), 2.0, 0.0) == pytest.approx(1.0)


def test_median_elevation_is_by_area_in_plan() -> None:
    tower = ([[0, 0, 0], [1, 0, 0], [1, 0, 90], [0, 0, 90]], [[0, 1, 2], [0, 2, 3]])
    assert median_elevation(joined(slab(-5, 5, 2.0), slab(-1, 1, 50.0), slab(-3, 3, -7.0), tower)) == 2.0
    assert median_elevation(joined(tower)) == 0.0


@pytest.mark.parametrize(("axis", "reach"), [(0, 30.0), (1, 30.0)])
def test_the_middle_line_follows_the_longer_side(axis: int, reach: float) -> None:
    long, short = [(-reach + 7.0, reach + 7.0), (-4.0, 2.0)]
    x, y = (long, short) if axis == 0 else (short, long)
    corners = [[x[0], y[0], 3.0], [x[1], y[0], 3.0], [x[1], y[1], 3.0], [x[0], y[1], 3.0], [900.0, 900.0, 900.0]]
    scene = mesh(corners, [[0, 1, 2], [0, 2, 3]])
    ends = middle_line(scene)
    expected = np.array([[-23.0, -1.0, 3.0], [37.0, -1.0, 3.0]])
    assert np.allclose(ends, expected if axis == 0 else expected[:, [1, 0, 2]])
    assert bounds(scene)[1].max() < 900.0  # a vertex of no triangle is no part of the scene


def test_even_a_tiny_scene_has_a_line_to_fly() -> None:
    ends = middle_line(joined(slab(-1e-4, 1e-4, 0.0)))
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(1.0)
    PolylineGuide(ends)


def test_a_tripod_put_down_turns_as_one_beside_a_line_does() -> None:
    platform = make_platform(
        kind="tripod", turn_seconds=7.0, height=2.0, stations=(3.0,), lateral_offsets=(0.0,), yaw_deg=20.0
    )
    beside = platform.make_path(PolylineGuide([[0.0, 0.0, 1.0], [10.0, 0.0, 1.0]]))
    put = TripodPath(platform, [(3.0, 0.0, 3.0)])
    time = np.linspace(0.0, 7.0, 50)
    for mine, theirs in zip(put.pose(put.strips[0], time), beside.pose(beside.strips[0], time), strict=True):
        assert np.allclose(mine, theirs, atol=1e-12)
    assert put.strips == beside.strips
    assert put.knot_spacing == beside.knot_spacing
    assert put.typical_range == beside.typical_range


def test_each_position_is_a_strip_of_its_own() -> None:
    path = TripodPath(make_platform(kind="tripod", turn_seconds=5.0), [(0, 0, 0), (1, 2, 3)])
    assert [strip.index for strip in path.strips] == [0, 1]
    position, rotation = path.pose(path.strips[1], np.array([path.strips[1].start_time]))
    assert position.tolist() == [[1.0, 2.0, 3.0]]
    assert np.allclose(rotation, np.eye(3))
