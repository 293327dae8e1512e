"""Pictograms of traffic signs as polygons, drawn in a square of side 1 around the origin: x right, y up."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
Polygon = list[Point]
"""Corners, anticlockwise."""


def _stroke(line: list[Point], width: float) -> Polygon:
    """Return the polygon of a band along a line, mitred at its corners."""
    left, right = _sides(np.array(line), width)
    return _polygon([*right, *left[::-1]])


def _arrow(line: list[Point], width: float, head: float = 3.0) -> Polygon:
    """Return the polygon of an arrow along a line, with a barbed head `head` times as wide as the shaft."""
    points = np.array(line)
    tip, along = points[-1].copy(), points[-1] - points[-2]
    along /= np.hypot(*along)
    across = np.array([-along[1], along[0]])
    points[-1] = tip - along * width * head * 0.6
    left, right = _sides(points, width)
    back = points[-1] - along * width * 0.15
    wings = [back - across * width * head / 2.0, tip, back + across * width * head / 2.0]
    return _polygon([*right, *wings, *left[::-1]])


def _sides(points: NDArray[np.float64], width: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the left and the right border (N, 2) of a mitred band along points (N, 2)."""
    along = np.diff(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    before, after = along[[0, *range(len(along))]], along[[*range(len(along)), -1]]
    across = np.column_stack([-(before + after)[:, 1], (before + after)[:, 0]])
    across *= width / (1.0 + (before * after).sum(axis=1, keepdims=True)) / 2.0
    return points + across, points - across


def _polygon(points: list[NDArray[np.float64]]) -> Polygon:
    return [(round(float(x), 4), round(float(y), 4)) for x, y in points]


def _mirror(polygons: list[Polygon]) -> list[Polygon]:
    return [[(-x, y) for x, y in reversed(polygon)] for polygon in polygons]


def _disc(middle: Point, radius: float, corners: int = 10) -> Polygon:
    turns = [2.0 * math.pi * i / corners for i in range(corners)]
    return [(round(middle[0] + radius * math.cos(t), 4), round(middle[1] + radius * math.sin(t), 4)) for t in turns]


def _bars(count: int) -> list[Polygon]:
    """Return the polygons of slanted bars one above the other, as on an exit's countdown markers."""
    thick, rise, pitch = 0.2, 0.3, 0.42
    lowest = [-(thick + rise + pitch * (count - 1)) / 2.0 + pitch * i for i in range(count)]
    return [[(-0.5, z), (0.5, z + rise), (0.5, z + rise + thick), (-0.5, z + thick)] for z in lowest]


def _stripes() -> list[Polygon]:
    """Return the polygons of the five stripes that cross out a round sign."""
    result = []
    for across in (-0.15, -0.075, 0.0, 0.075, 0.15):
        along = math.sqrt(0.25 - across**2) - 0.01
        turned = [((a - across) * math.sqrt(0.5), (a + across) * math.sqrt(0.5)) for a in (-along, along)]
        result.append(_stroke(turned, 0.035))
    return result


def _car(middle: float) -> list[Polygon]:
    """Return the polygons of a car seen from behind around x = `middle`, its window left out."""
    parts = [
        [(-0.2, -0.17), (-0.12, -0.17), (-0.12, -0.11), (0.12, -0.11), (0.12, -0.17), (0.2, -0.17), (0.2, 0.02),
         (-0.2, 0.02)],
        [(-0.2, 0.02), (-0.155, 0.02), (-0.11, 0.13), (-0.14, 0.17)],
        [(0.2, 0.02), (0.14, 0.17), (0.11, 0.13), (0.155, 0.02)],
        [(-0.14, 0.17), (-0.11, 0.13), (0.11, 0.13), (0.14, 0.17)],
    ]  # fmt: skip
    return [[(round(x + middle, 4), y) for x, y in part] for part in parts]


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
}
"""Polygons of each pictogram."""
NAMES = ("none", *PICTOGRAMS)
"""Pictograms by their number in the node groups' inputs."""
RED = {"no_overtaking": 4}
"""How many of a pictogram's first polygons have the border's colour instead of the writing's."""
