"""Pictograms of traffic signs as polygons, drawn in a square of side 1 around the origin: x right, y up.

Coordinates are drawn by eye.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
Polygon = list[Point]
"""Corners, anticlockwise."""


def _stroke(line: list[Point], width: float) -> Polygon:
    """Return the polygon of a band along a line, mitred at its corners."""
    left_side, right_side = _sides(np.array(line), width)
    return _polygon([*right_side, *left_side[::-1]])


def _arrow(line: list[Point], width: float, head: float = 3.0) -> Polygon:
    """Return the polygon of an arrow along a line, with a barbed head `head` times as wide as the shaft."""
    points = np.array(line)
    tip, direction = points[-1].copy(), points[-1] - points[-2]
    direction /= np.hypot(*direction)
    left_direction = np.array([-direction[1], direction[0]])
    # The shaft ends within the head; 0.6 and 0.15 are chosen.
    points[-1] = tip - direction * width * head * 0.6
    left_side, right_side = _sides(points, width)
    head_base = points[-1] - direction * width * 0.15
    head_corners = [
        head_base - left_direction * width * head / 2.0,
        tip,
        head_base + left_direction * width * head / 2.0,
    ]
    return _polygon([*right_side, *head_corners, *left_side[::-1]])


def _sides(points: NDArray[np.float64], width: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the left and the right border (N, 2) of a mitred band along points (N, 2)."""
    directions = np.diff(points, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions_before, directions_after = (
        directions[[0, *range(len(directions))]],
        directions[[*range(len(directions)), -1]],
    )
    mitre = np.column_stack(
        [-(directions_before + directions_after)[:, 1], (directions_before + directions_after)[:, 0]]
    )
    # Mitre: n1 + n2, times width / 2 / (1 + d1 . d2), of the directions d and normals n of both pieces.
    mitre *= width / (1.0 + (directions_before * directions_after).sum(axis=1, keepdims=True)) / 2.0
    return points + mitre, points - mitre


def _polygon(points: list[NDArray[np.float64]]) -> Polygon:
    """Return points as a polygon with coordinates rounded to 4 decimals."""
    return [(round(float(x), 4), round(float(y), 4)) for x, y in points]


def _mirror(polygons: list[Polygon]) -> list[Polygon]:
    """Return polygons mirrored at x = 0, anticlockwise again."""
    return [[(-x, y) for x, y in reversed(polygon)] for polygon in polygons]


def _disc(centre: Point, radius: float, corners: int = 10) -> Polygon:
    """Return the polygon of a disc."""
    angles = [2.0 * math.pi * i / corners for i in range(corners)]
    return [
        (round(centre[0] + radius * math.cos(angle), 4), round(centre[1] + radius * math.sin(angle), 4))
        for angle in angles
    ]


def _bars(count: int) -> list[Polygon]:
    """Return the polygons of slanted bars above each other, as on the countdown markers before an exit."""
    thickness, rise, pitch = 0.2, 0.3, 0.42
    bottoms = [-(thickness + rise + pitch * (count - 1)) / 2.0 + pitch * i for i in range(count)]
    return [
        [(-0.5, bottom), (0.5, bottom + rise), (0.5, bottom + rise + thickness), (-0.5, bottom + thickness)]
        for bottom in bottoms
    ]


def _stripes() -> list[Polygon]:
    """Return the polygons of the five diagonal stripes that cross out a round sign of diameter 1."""
    result = []
    for distance in (-0.15, -0.075, 0.0, 0.075, 0.15):
        half_length = math.sqrt(0.25 - distance**2) - 0.01
        ends = [
            ((end - distance) * math.sqrt(0.5), (end + distance) * math.sqrt(0.5))
            for end in (-half_length, half_length)
        ]
        result.append(_stroke(ends, 0.035))
    return result


def _car(centre: float) -> list[Polygon]:
    """Return the polygons of a car seen from behind around x = `centre`, its window left out."""
    parts = [
        [(-0.2, -0.17), (-0.12, -0.17), (-0.12, -0.11), (0.12, -0.11), (0.12, -0.17), (0.2, -0.17), (0.2, 0.02),
         (-0.2, 0.02)],
        [(-0.2, 0.02), (-0.155, 0.02), (-0.11, 0.13), (-0.14, 0.17)],
        [(0.2, 0.02), (0.14, 0.17), (0.11, 0.13), (0.155, 0.02)],
        [(-0.14, 0.17), (-0.11, 0.13), (0.11, 0.13), (0.14, 0.17)],
    ]  # fmt: skip
    return [[(round(x + centre, 4), y) for x, y in part] for part in parts]


_CHEVRON = [[(-0.5, 0.5), (0.02, 0.0), (-0.5, -0.5), (-0.02, -0.5), (0.5, 0.0), (-0.02, 0.5)]]
_CURVE = [_arrow([(0.17, -0.5), (0.17, -0.16), (0.13, 0.02), (0.03, 0.14), (-0.32, 0.38)], 0.15)]
_DOUBLE_CURVE = [_arrow([(0.1, -0.5), (0.1, -0.34), (-0.1, -0.06), (-0.1, 0.1), (0.14, 0.5)], 0.13)]
_NARROW = [
    _stroke([(0.24, -0.5), (0.24, 0.5)], 0.11),
    _stroke([(-0.3, -0.5), (-0.3, -0.16), (-0.06, 0.14), (-0.06, 0.5)], 0.11),
]
_BODY = [
    (0.0, 0.26), (-0.05, 0.2), (-0.03, 0.13), (-0.17, 0.02), (-0.11, -0.05), (0.06, 0.05), (0.06, -0.02),
    (-0.05, -0.26), (-0.03, -0.5), (0.07, -0.5), (0.06, -0.27), (0.15, -0.12), (0.22, -0.28), (0.25, -0.5),
    (0.35, -0.5), (0.33, -0.26), (0.27, -0.04), (0.24, 0.12), (0.09, 0.27),
]  # fmt: skip
_WORKS = [
    _disc((-0.02, 0.37), 0.095),
    _BODY,
    _stroke([(-0.155, -0.025), (-0.31, -0.25)], 0.035),
    [(-0.27, -0.245), (-0.34, -0.21), (-0.44, -0.33), (-0.36, -0.38)],
    [(-0.5, -0.5), (-0.14, -0.5), (-0.24, -0.41), (-0.36, -0.4), (-0.45, -0.45)],
]

# A triangle around the outline of somebody who walks.
_CROSSING: list[Polygon] = [
    [(-0.46, -0.38), (-0.17, -0.38), (-0.055, -0.08), (-0.055, 0.22), (-0.114, 0.22)],
    [(-0.114, 0.22), (-0.055, 0.22), (-0.055, 0.3), (-0.068, 0.3)],
]
_CROSSING_MIDDLE: list[Polygon] = [
    [(-0.09, -0.38), (0.09, -0.38), (0.0, -0.17)],
    [(-0.055, 0.12), (0.055, 0.12), (0.055, 0.15), (-0.055, 0.15)],
    [(-0.068, 0.3), (0.068, 0.3), (0.0, 0.42)],
]

PICTOGRAMS: dict[str, list[Polygon]] = {
    "end": _stripes(),
    "arrow": [_arrow([(-0.4, -0.4), (0.5, 0.5)], 0.2, 2.6)],
    "exit_arrow": [
        _arrow([(-0.22, -0.8), (-0.22, 0.8)], 0.14, 2.8),
        _arrow([(-0.15, -0.42), (0.04, -0.2), (0.36, 0.3)], 0.14, 2.8),
    ],
    "curve_left": _CURVE,
    "curve_right": _mirror(_CURVE),
    "double_curve_left": _DOUBLE_CURVE,
    "double_curve_right": _mirror(_DOUBLE_CURVE),
    "narrow_left": _NARROW,
    "narrow_right": _mirror(_NARROW),
    "works": _WORKS,
    "no_overtaking": [*_car(-0.24), *_car(0.24)],
    "bars_1": _bars(1),
    "bars_2": _bars(2),
    "bars_3": _bars(3),
    "down_arrow": [_arrow([(0.0, 0.5), (0.0, -0.5)], 0.2, 2.6)],
    "chevron_left": _mirror(_CHEVRON),
    "chevron_right": _CHEVRON,
    "town_end": [_stroke([(-1.4, -0.5), (1.4, 0.5)], 0.09)],
    "crossing": [*_CROSSING, *_mirror(_CROSSING), *_CROSSING_MIDDLE],
    "priority_next": [_arrow([(0.0, -0.5), (0.0, 0.5)], 0.17, 2.4), _stroke([(-0.34, -0.1), (0.34, -0.1)], 0.1)],
    "priority_road": [[(0.36, 0.0), (0.0, 0.36), (-0.36, 0.0), (0.0, -0.36)]],
    "crossed": [_stroke([(-1.1, -0.5), (1.1, 0.5)], 0.12)],
    "no_limit": [_stroke([(-0.28, -0.28), (0.28, 0.28)], 0.16)],
    "pass_left": [_arrow([(0.33, 0.33), (-0.4, -0.4)], 0.17, 2.8)],
    "pass_right": [_arrow([(-0.33, 0.33), (0.4, -0.4)], 0.17, 2.8)],
    "bar": [_stroke([(-0.36, 0.0), (0.36, 0.0)], 0.17)],
}
"""Polygons of each pictogram."""
NAMES = ("none", *PICTOGRAMS)
"""Pictograms by their number in the node groups' inputs."""
RED = {"no_overtaking": 4, "town_end": 1, "crossed": 1}
"""Number of a pictogram's first polygons that have the border's colour, not the writing's."""
