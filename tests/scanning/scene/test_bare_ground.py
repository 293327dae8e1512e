"""Footprints on bare ground: near creases they lie on one plane if within one face, on paint's edges never."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.scanning.scene.bare_ground import BareGround
from synthroads_addon.scanning.scene.mesh import SceneMesh

RADIUS = 0.05
ROAD, PAINT = 0, 1


def quad(x: tuple[float, float], z: tuple[float, float]) -> list[tuple[float, float, float]]:
    """Return the corners of a strip of 20 m between two x, at a height at each."""
    return [(x[0], -10.0, z[0]), (x[1], -10.0, z[1]), (x[1], 10.0, z[1]), (x[0], 10.0, z[0])]


def ground() -> BareGround:
    """Return pavement with a crease at x = 0, and 2 mm above it a line from x = 5 to 5.1 m."""
    left, right, line = quad((-10.0, 0.0), (-0.5, 0.0)), quad((0.0, 10.0), (0.0, 0.0)), quad((5.0, 5.1), (0.002, 0.002))
    # The pavement's quadrilaterals share two vertices: those of the crease.
    vertices = np.array([*left, right[1], right[2], *line], np.float32)
    quads = [(0, 1, 2, 3), (1, 4, 5, 2), (6, 7, 8, 9)]
    triangles = np.array([(q[0], q[1], q[2]) for q in quads] + [(q[0], q[2], q[3]) for q in quads], np.int32)
    kinds = [class_id("road"), class_id("road"), class_id("road_marking")] * 2
    mesh = SceneMesh(
        vertices,
        triangles,
        np.array(kinds, np.uint8),
        np.ones(6, np.uint32),
        np.array([ROAD, ROAD, PAINT] * 2, np.uint16),
        ("asphalt", "paint_white"),
        np.zeros(3),
    )
    return BareGround(mesh, np.zeros(2, bool), RADIUS)


def on_one_plane(face: int, x: float, y: float, z: float) -> bool:
    """Say whether a footprint around a place on a face is told to lie on one plane."""
    spans = (np.array([[RADIUS], [0.0], [0.0]]), np.array([[0.0], [RADIUS], [0.0]]))
    towards = np.array([[0.0], [0.0], [1.0]])
    whole, _ = ground().check_footprints(np.array([face]), np.array([[x], [y], [z]]), spans, towards)
    return bool(whole[0])


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ("in the middle of a face", (1, 2.5, -5.0, True)),
        ("near the crease", (4, 0.07, -5.0, True)),
        ("on the crease", (4, 0.03, -5.0, False)),
        ("on the line's edge", (1, 4.97, -5.0, False)),
        ("on the line", (2, 5.02, -5.0, False)),
    ],
)
def test_a_footprint_near_an_edge_is_on_one_plane_where_its_face_holds_it_alone(
    place: str, expected: tuple[int, float, float, bool]
) -> None:
    face, x, y, whole = expected
    assert on_one_plane(face, x, y, 0.002 if face == 2 else 0.0) is whole, place
