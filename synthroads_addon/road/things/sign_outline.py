"""Outlines of the faces of signs and boards."""

from typing import Literal

import numpy as np

from ...base.arrays import Float

FaceShape = Literal["round", "triangle", "rectangle", "octagon", "arrow", "arrow_left", "triangle_down", "diamond"]
"""Outlines that a sign's face may have; `triangle_down` stands on its point."""
_OCTAGON = 0.20710678118654752
SIGN_OUTLINES = {
    "rectangle": ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "triangle": ((0.0, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "octagon": (
        (0.5, _OCTAGON), (_OCTAGON, 0.5), (-_OCTAGON, 0.5), (-0.5, _OCTAGON),
        (-0.5, -_OCTAGON), (-_OCTAGON, -0.5), (_OCTAGON, -0.5), (0.5, -_OCTAGON),
    ),
    "arrow": ((0.5, 0.0), (0.3, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.3, -0.5)),
    "arrow_left": ((0.5, 0.5), (-0.3, 0.5), (-0.5, 0.0), (-0.3, -0.5), (0.5, -0.5)),
    "triangle_down": ((0.5, 0.5), (-0.5, 0.5), (0.0, -0.5)),
    "diamond": ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)),
}  # fmt: skip
"""Corners of a sign's face, anticlockwise, in shares of its width and height around the middle; others are round."""
_CORNERS = {"round": 0.06, "triangle": 0.06, "rectangle": 0.05, "octagon": 0.03, "arrow": 0.04, "arrow_left": 0.04}
_CORNERS |= {"triangle_down": 0.06, "diamond": 0.06}
_CORNER_LIMITS = (0.01, 0.1)
"""A face's corner radius as a share of its smaller side, and its limits, m."""
CORNER_STEPS, ROUND_STEPS = 5, 13
"""Points per corner of a face, and per quarter of a round one."""
MOST_OF_SIDE = 0.499
"""A corner's radius as a share of the face's smaller side at most."""


def corner_radius(shape: str, width: float, height: float) -> float:
    """Return the radius (m) of the rounded corners of a sign's face, by its shape and smaller side."""
    return float(np.clip(_CORNERS[shape] * min(width, height), *_CORNER_LIMITS))


def face_outline(shape: str, width: float, height: float) -> Float:
    """Return the corners (K, 2) of a sign's rounded face around its middle, m, anticlockwise."""
    corners = np.array(SIGN_OUTLINES["rectangle" if shape == "round" else shape])
    largest_radius = min(width, height) * MOST_OF_SIDE
    radius = largest_radius if shape == "round" else min(corner_radius(shape, width, height), largest_radius)
    # Around each corner an arc about a middle further in, from the outward normal of the side before to that of the
    # side after.
    arc_middles = corners * (width - 2.0 * radius, height - 2.0 * radius)
    sides = arc_middles - np.roll(arc_middles, 1, axis=0)
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.maximum(np.linalg.norm(sides, axis=1), 1e-300)[:, None]
    side_headings = np.arctan2(normals[:, 1], normals[:, 0])
    corner_turns = (np.roll(side_headings, -1) - side_headings) % (2.0 * np.pi)
    share = np.linspace(0.0, 1.0, ROUND_STEPS if shape == "round" else CORNER_STEPS)
    angles = side_headings[:, None] + corner_turns[:, None] * share
    arcs = arc_middles[:, None] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    return arcs.reshape(-1, 2)
