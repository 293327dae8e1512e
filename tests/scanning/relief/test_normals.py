"""Normals that follow the relief."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float, Index
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.relief.micro_relief import BeamEnds, ReliefField, micro_relief, shift_by_relief
from synthroads_addon.scanning.relief.normals import turn_normals
from tests.helpers.clouds.random_points import make_points

SIDE, SPACING = 121, 0.0005
NORMALS = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.3, -0.5, 0.8), (0.1, 0.0, -1.0)]


def grid(normal: Float) -> tuple[PointBlock, Float, tuple[Float, Float]]:
    """Return points of bark on a plane in a square grid, their places, and the grid's two directions."""
    first = np.cross([0.2, 1.0, 0.4], normal)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    step = (np.arange(SIDE) - SIDE // 2) * SPACING
    place = step[:, None, None] * first + step[None, :, None] * second
    position = place.reshape(-1, 3)
    points = make_points(SIDE * SIDE)
    arrays = {"normal": np.tile(normal, (len(position), 1)).astype(np.float32), "xyz": position.copy()}
    arrays |= {"material": np.zeros(len(position), np.uint16), "incidence_deg": np.zeros(len(position), np.float32)}
    return points.with_arrays(arrays), position, (first, second)


@pytest.mark.parametrize("direction", NORMALS)
def test_they_are_those_of_the_raised_surface(direction: tuple[float, float, float]) -> None:
    normal = np.array(direction) / np.linalg.norm(direction)
    points, position, (first, second) = grid(normal)
    towards = np.tile(normal, (len(position), 1))
    how = micro_relief(["bark"], [materials()["bark"]]), 0.3, 1, 3
    ends = BeamEnds(position, towards)
    raised = shift_by_relief(points, ends, *how)
    field = ReliefField(points, ends, *how)
    turned = turn_normals(raised, field.rough_rows, towards, field.heights)
    height = ((raised.xyz - position) @ normal).reshape(SIDE, SIDE)
    slopes = np.gradient(height, SPACING)
    expected = normal - slopes[0][..., None] * first - slopes[1][..., None] * second
    expected /= np.linalg.norm(expected, axis=2)[..., None]
    inner = (slice(2, -2), slice(2, -2))
    assert turned.normal is not None
    found = turned.normal.reshape(SIDE, SIDE, 3).astype(np.float64)
    off = np.degrees(np.arccos(np.clip((found * expected).sum(axis=2)[inner], -1.0, 1.0)))
    assert np.percentile(off, 95) < 1.0
    tilt = np.degrees(np.arccos(np.clip(expected @ normal, -1.0, 1.0)))
    assert np.percentile(tilt, 50) > 5.0
    assert turned.incidence_deg.reshape(SIDE, SIDE)[inner] == pytest.approx(
        np.degrees(np.arccos(np.clip(found @ normal, -1.0, 1.0)))[inner], abs=0.05
    )
    assert np.array_equal(turned.xyz, raised.xyz)


def test_what_is_seen_never_looks_away() -> None:
    points, position, (first, _) = grid(np.array([0.0, 0.0, 1.0]))
    grazing = np.tile(first * np.cos(0.02) + np.array([0.0, 0.0, np.sin(0.02)]), (len(position), 1))

    def steep(rows: Index, beside: Float) -> Float:
        return np.asarray(5.0 * (position[rows] + beside) @ first)

    rows = np.arange(0, len(position), 2)
    turned = turn_normals(points, rows, grazing, steep)
    assert turned.normal is not None
    assert np.linalg.norm(turned.normal, axis=1) == pytest.approx(1.0, abs=1e-6)
    assert (turned.normal * grazing).sum(axis=1).min() > -1e-6
    assert turned.incidence_deg[rows] == pytest.approx(90.0)
    assert turned.normal[1::2] == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(position) // 2, 1)))
