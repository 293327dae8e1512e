"""Places that are told to be in the sun without casting a ray: never one that a ray finds in the shade."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.arithmetic.loops import ColumnGrid, Faces, loops_by
from synthroads_addon.base.arrays import Float
from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.kernels.points import CompiledPoints
from synthroads_addon.scanning.scene.caster import FacePlanes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.scene.sun_columns import SunColumns, _axes_across
from synthroads_addon.scanning.scene.target import Target
from tests.helpers.scenes.kernel_scenes import Cast
from tests.helpers.scenes.scan_scenes import BruteForce, mesh_of

pytestmark = pytest.mark.any_blender

SUN = np.array([0.48, -0.36, 0.8])
SIDE = 60
FILM = 0.003
"""Thickness of a line of paint, m."""


def hills(seed: int, steep: float = 0.1) -> tuple[list[Float], list[Float]]:
    """Return vertices and triangles of bumpy ground with a step, 60 m wide, with painted lines on it."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(SIDE + 1.0), np.arange(SIDE + 1.0), indexing="ij"))
    height = steep * stream(seed, "hills").normal(size=len(x)) + 0.6 * (x > 30.0)
    corner = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    beside = corner + SIDE + 1
    triangles = [np.column_stack([corner, beside, corner + 1]), np.column_stack([corner + 1, beside, beside + 1])]
    vertices = np.column_stack([x, y, height])
    # A strip of ground once more, a film higher.
    line = np.flatnonzero(corner % (SIDE + 1) == 20)
    raised = vertices + [0.0, 0.0, FILM]
    painted = [one[line] + len(vertices) for one in triangles]
    return [vertices, raised], [*triangles, *painted]


def scene(seed: int, leaves: int = 1500) -> SceneMesh:
    """Return hills with small triangles of all directions above them, on one side."""
    vertices, triangles = hills(seed)
    random = stream(seed, "leaves")
    middle = random.uniform([0, 0, 0.2], [25, SIDE, 6.0], (leaves, 3))
    corners = (middle[:, None] + random.normal(0, 0.5, (leaves, 3, 3))).reshape(-1, 3)
    first = sum(map(len, vertices))
    rows = [*triangles, first + np.arange(3 * leaves).reshape(-1, 3)]
    return mesh_of(np.concatenate([*vertices, corners]), np.concatenate(rows))


def places_on(mesh: SceneMesh, count: int, seed: int) -> Float:
    """Return places (3, N) a millimetre off the faces, on the side of the sun, also near their edges and corners."""
    random = stream(seed, "places")
    face = random.integers(0, len(mesh.triangles), count)
    share = random.dirichlet([0.4, 0.4, 0.4], count)
    corners = mesh.vertices[mesh.triangles[face]].astype(np.float64)
    normal = FacePlanes(mesh).planes[face, :3]
    normal *= np.where(normal @ SUN < 0.0, -1.0, 1.0)[:, None]
    return np.ascontiguousarray((np.einsum("nk,nkj->nj", share, corners) + 1e-3 * normal).T)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_place_in_the_shade_is_told_to_be_in_the_sun(loops: CompiledPoints, seed: int) -> None:
    mesh = scene(seed)
    places = places_on(mesh, 40_000, seed)
    times = np.zeros(places.shape[1])
    expected = Target(ScannedScene(mesh), Cast).unobstructed(places, SUN, times, [])
    with loops_by(loops):
        target = Target(ScannedScene(mesh), Cast)
        clear = SunColumns(mesh, FacePlanes(mesh)).clear(places, SUN)
        found = target.unobstructed(places, SUN, times, [])
    assert clear is not None
    assert not (clear & ~expected).any()
    assert np.array_equal(found, expected)
    assert 0.1 < (~expected).mean() < 0.6
    assert clear.sum() > 0.4 * expected.sum()


def test_ground_that_nothing_stands_on_is_in_the_sun(loops: CompiledPoints) -> None:
    mesh = scene(5, leaves=1)
    places = places_on(mesh, 20_000, 5)
    with loops_by(loops):
        clear = SunColumns(mesh, FacePlanes(mesh)).clear(places, SUN)
    assert clear is not None
    assert clear.mean() > 0.8


def test_the_edge_of_paint_throws_its_shadow(loops: CompiledPoints) -> None:
    """A film of 3 mm shades what lies 2 mm beside it, which only a ray tells."""
    corners = [
        (x, y, z) for z, wide in ((0.0, 9.0), (FILM, 1.0)) for x, y in ((-wide, -9), (wide, -9), (wide, 9), (-wide, 9))
    ]
    mesh = mesh_of(corners, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    x = np.linspace(-1.02, -1.0, 4001)
    places = np.array([x, 0.0 * x, 0.0 * x + 0.001])
    towards = np.array([0.6, 0.0, 0.8])
    with loops_by(loops):
        free = Target(ScannedScene(mesh), Cast).unobstructed(places, towards, 0.0 * x, [])
    width = (FILM - 0.001) * 0.75
    assert np.array_equal(free, x < -1.0 - width)


def test_faces_lie_in_all_cells_that_they_touch(loops: CompiledPoints) -> None:
    mesh = scene(7, leaves=60)
    axes, cell = _axes_across(SUN), 0.7
    shown = Faces(mesh.vertices, mesh.triangles, FacePlanes(mesh).planes)
    seen = mesh.vertices.astype(np.float64) @ axes.T / cell
    grid = ColumnGrid(axes / cell, seen.min(axis=0) + 4.0, (50, 60), 0.02, SUN, 1e-4)  # smaller than the scene
    starts, faces = loops.face_columns(shown, grid, 255)
    listed = np.zeros((len(mesh.triangles), 3000), bool)
    listed[faces, np.repeat(np.arange(3000), np.diff(starts.astype(np.int64)))] = True
    random = stream(7, "touched")
    share = random.dirichlet([0.5, 0.5, 0.5], (len(mesh.triangles), 200))
    at = np.einsum("nsk,nkj->nsj", share, seen[mesh.triangles]) - grid.low
    column, row = np.floor(at).astype(np.int64).transpose(2, 0, 1)
    inside = (column >= 0) & (column < 50) & (row >= 0) & (row < 60)
    face = np.broadcast_to(np.arange(len(mesh.triangles))[:, None], inside.shape)
    assert listed[face[inside], (row * 50 + column)[inside]].all()
    assert inside.mean() > 0.3
    few = loops.face_columns(shown, grid, 3)
    counts = np.diff(starts.astype(np.int64))
    assert np.array_equal(np.diff(few[0].astype(np.int64)), np.where(counts > 3, 0, counts))
    with pytest.raises(ValueError, match="255"):
        loops.face_columns(shown, grid, 256)


def test_nothing_is_told_of_what_is_unknown(loops: CompiledPoints) -> None:
    mesh = scene(9)
    places, planes = places_on(mesh, 2 * len(mesh), 9), FacePlanes(mesh)
    columns = SunColumns(mesh, planes)
    assert columns.clear(places, SUN) is None, "NumPy's way casts every ray"
    with loops_by(loops):
        assert columns.clear(places[:, :10], SUN) is None, "ten places aren't worth it"
        assert columns.clear(places, SUN) is not None
        assert columns.clear(places, SUN[::-1].copy()) is None, "the columns are another direction's"
        far = places[:, :3] + 1e4
        far[0, 2] = np.nan
        unknown = columns.clear(far, SUN)
        assert unknown is not None
        assert not unknown.any()
        away = replace(mesh, vertices=mesh.vertices + np.float32(3e4))
        huge = SunColumns(away, FacePlanes(away))
        told = huge.clear(places + 3e4, SUN)
        assert told is not None
        assert not told.any(), "float32 doesn't tell a millimetre there"


def test_a_caster_without_packets_says_the_same(loops: CompiledPoints) -> None:
    mesh = scene(11, leaves=30)
    places = places_on(mesh, 300, 11)
    with loops_by(loops):
        found = Target(ScannedScene(mesh), BruteForce).unobstructed(places, SUN, np.zeros(300), [])
    assert np.array_equal(found, Target(ScannedScene(mesh), BruteForce).unobstructed(places, SUN, np.zeros(300), []))
