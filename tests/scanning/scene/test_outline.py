"""Beams that an outline lets go meet nothing, not even with their rims; and it lets many of those go that don't."""

import numpy as np
import pytest

from synthroads_addon.scanning.scan import BlockResult
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.outline import Outline
from tests.helpers.scenes.scan_scenes import BruteForce, altered, mesh_of, plane, scan_of, scan_pulses

RADIUS, REACH = 2.0, 300.0


def scattered(count: int = 20, width: float = 60.0) -> SceneMesh:
    """Return triangles from 0.1 to 30 m large, all over an area, at heights of up to 20 m."""
    random = np.random.default_rng(5)
    size = 10.0 ** random.uniform(-1.0, 1.5, (count, 1, 1))
    middle = random.uniform([-width, -width / 4, 0.0], [width, width / 4, 20.0], (count, 3))[:, None]
    corners = middle + size * random.uniform(-0.5, 0.5, (count, 3, 3))
    return mesh_of(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def beams(mesh: SceneMesh, count: int = 800) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions (3, N) of beams from above, below and within, most of them past some triangle."""
    random = np.random.default_rng(6)
    origins = random.uniform([-80.0, -40.0, -40.0], [80.0, 40.0, 60.0], (count, 3)).T
    goals = mesh.vertices[random.integers(0, len(mesh.vertices), count)].T + random.normal(0.0, 1.5, (3, count))
    directions = goals - origins
    directions[:, ::8] = random.normal(size=(3, count))[:, ::8]
    return origins, directions / np.linalg.norm(directions, axis=0)


def meets(mesh: SceneMesh, origins: np.ndarray, directions: np.ndarray, shift: float) -> np.ndarray:
    """Return which beams meet a mesh with the axis or a rim of parallel rays at a radius (m) around it."""
    across = np.cross(directions.T, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    other = np.cross(directions.T, across)
    caster, met = BruteForce(mesh), np.zeros(origins.shape[1], bool)
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        begin = origins.T + shift * (np.cos(angle) * across + np.sin(angle) * other)
        met |= caster.cast(begin, directions.T, REACH) >= 0
    return met | (caster.cast(origins.T, directions.T, REACH) >= 0)


def test_no_beam_is_let_go_that_meets_anything_with_its_rim() -> None:
    mesh = scattered()
    origins, directions = beams(mesh)
    free = Outline(mesh, BruteForce, RADIUS).passed_by(origins, directions, REACH)
    met = meets(mesh, origins, directions, RADIUS)
    assert not (free & met).any()
    assert 0.02 < met.mean() < 0.8
    assert free.sum() > 0.1 * (~met).sum()
    # Without room for the rim some would be lost: it is needed.
    assert (Outline(mesh, BruteForce, 0.0).passed_by(origins, directions, REACH) & met).any()


def test_a_large_scene_has_wider_boxes_and_not_more() -> None:
    kept: list[SceneMesh] = []

    def caster(mesh: SceneMesh) -> BruteForce:
        kept.append(mesh)
        return BruteForce(mesh)

    for width in (120.0, 3000.0):
        Outline(scattered(200, width), caster, RADIUS)
        Outline(plane(width), caster, RADIUS)
    assert all(len(mesh) <= 12 * (1 << 14) * 1.1 for mesh in kept)
    assert len(kept[1]) == 12 * 60**2  # 240 m in boxes of 4 m


def test_where_nearly_all_beams_meet_something_few_are_asked() -> None:
    outline = Outline(plane(30.0), BruteForce, RADIUS)
    asked: list[int] = []
    cast = outline._caster

    class Counting:
        def occluded(self, origins, directions, reach):
            asked.append(len(origins))
            return cast.occluded(origins, directions, reach)

    outline._caster = Counting()
    origins = np.tile([[0.0], [0.0], [50.0]], 320)
    down = np.tile([[0.0], [0.0], [-1.0]], 320)
    assert not outline.passed_by(origins, down, REACH).any()
    assert asked == [20]
    assert outline.passed_by(origins, -down, REACH).all()
    assert asked[1:] == [20, 320]


@pytest.mark.parametrize("beam", ["conical", "cylindrical"])
def test_a_scan_is_the_same_with_fewer_rays(beam: str) -> None:
    """Of a line over a narrow road, with wide beams that reach it with their rims alone."""
    mesh = plane(20.0, (0.0, 0.1))
    full = altered(scan_of(mesh, 7, divergence=(2e-2, 1e-2)), beam=beam)
    margin = 300.0 * 2e-2

    def line(outline: Outline | None) -> BlockResult:
        return scan_pulses(altered(full, outline=outline), full.path.strips[0], 0, 1000)

    whole, some = line(None), line(Outline(mesh, BruteForce, margin))
    for name in ("xyz", "intensity", "gps_time", "return_number", "incidence_deg"):
        np.testing.assert_array_equal(getattr(some.points, name), getattr(whole.points, name))
    assert len(whole.points) > 100
    assert some.rays < 0.6 * whole.rays
    assert some.pulses == whole.pulses
    lost = line(Outline(mesh, BruteForce, -4.0))  # boxes that are too small: it would show
    assert len(lost.points) < len(whole.points)
