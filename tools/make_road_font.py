"""Write `synthroads_addon/presets/fonts/road.ttf`: the typeface of the signs, after DIN 1451 Mittelschrift.

    python tools/make_road_font.py [--output FILE.ttf]

Needs fontTools, which Matplotlib brings (`pip install 'synthroads[dev]'`), and shapely. The same source gives the same
bytes.

Each glyph is drawn here from its centre lines: straight lines and circular arcs along which a stroke of constant width
runs. All lengths are widths of a stroke, of which a capital is 7 high. No outline of another typeface was used.
"""

from __future__ import annotations

import argparse
import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen
from shapely import LineString, Polygon, box, union_all
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

TARGET = Path(__file__).resolve().parents[1] / "synthroads_addon" / "presets" / "fonts" / "road.ttf"
FAMILY = "SynthRoads Mittelschrift"
_LICENCE = "GPL-3.0-or-later"
_LICENCE_URL = "https://www.gnu.org/licenses/gpl-3.0.html"

_DATE = 3_850_070_400
"""2026-01-01 in seconds since 1904, for the file's dates: they are not to make its bytes differ."""

UNIT = 200
"""Font units per width of a stroke."""
EM = 10 * UNIT
CAPITAL, SMALL, DESCENT = 7.0, 5.0, 2.0
"""Heights of capitals and of small letters, and how deep descenders reach, in widths of a stroke."""
_ASCENT = 9.0
"""Height that line spacing leaves for capitals with dots, in widths of a stroke."""
_TOLERANCE = 1.9 / 1000.0 * EM / UNIT
"""Most that a straight piece may stand off from its arc, in widths of a stroke; more pieces are more triangles."""
_FINE = 1e-5
"""The same where the direction of the arc counts."""

_FAR = 50.0
"""Further than any glyph reaches."""

Point = tuple[float, ...]
"""A corner of a centre line: x, y and, where it is rounded, its radius."""


@dataclass(frozen=True)
class Stroke:
    """A stroke of constant width along a centre line.

    Attributes:
        points: corners of the line.
        closed: whether the last corner joins the first.
        trim: lengths by which the line's beginning and end are shortened: for arcs that stop half-way.
        width: of the stroke.
        level: whether its beginning and its end, where they slant, are cut horizontally at their height; else they are
            at a right angle to the line.
    """

    points: tuple[Point, ...]
    closed: bool = False
    trim: tuple[float, float] = (0.0, 0.0)
    width: float = 1.0
    level: tuple[bool, bool] = (False, False)

    def area(self) -> BaseGeometry:
        """Return the polygon that the stroke covers."""
        points = list(self.points)
        ends = (self.points[1], self.points[0]), (self.points[-2], self.points[-1])
        if self.level[0]:
            points[0] = _beyond(*ends[0])
        if self.level[1]:
            points[-1] = _beyond(*ends[1])
        sides = [_rounded(_beside(points, side * self.width / 2.0, self.closed), self.closed) for side in (1.0, -1.0)]
        if self.closed:
            return Polygon(sides[0]).symmetric_difference(Polygon(sides[1]))
        area: BaseGeometry = Polygon([*sides[0], *reversed(sides[1])])
        assert area.is_valid, f"the stroke from {self.points[0]} crosses itself"
        for line, trim in ((points, self.trim[0]), (points[::-1], self.trim[1])):
            if trim:
                area = area.difference(_beginning(line, trim, self.width))
        for (point_before, end), is_level in zip(ends, self.level, strict=True):
            if is_level and point_before[1] != end[1]:
                lowest, highest = (end[1], _FAR) if point_before[1] > end[1] else (-_FAR, end[1])
                area = area.intersection(box(-_FAR, lowest, _FAR, highest))
        return area

    def moved(self, across: float, up: float) -> Stroke:
        """Return the stroke in another place."""
        return replace(self, points=tuple((x + across, y + up, *radius) for x, y, *radius in self.points))

    def turned(self, x: float, y: float) -> Stroke:
        """Return the stroke turned by half a turn about a point."""
        points = tuple((2.0 * x - point[0], 2.0 * y - point[1], *point[2:]) for point in self.points)
        return replace(self, points=points)


def _beside(points: Sequence[Point], distance: float, is_closed: bool) -> list[Point]:
    """Return the corners of the line that runs at a distance on the left of another one; on its right if negative."""
    corners: list[Point] = []
    count = len(points)
    for number, (x, y, *rounding) in enumerate(points):
        ends = [_direction(points[i % count], points[(i + 1) % count]) for i in (number - 1, number)]
        if not is_closed and number in (0, count - 1):
            ends = ends[1:] * 2 if number == 0 else ends[:1] * 2
        (ax, ay), (bx, by) = ends
        share = distance / (1.0 + ax * bx + ay * by)
        turn = math.copysign(1.0, ax * by - ay * bx)
        radius = rounding[0] - turn * distance if rounding else 0.0
        corners.append((x - (ay + by) * share, y + (ax + bx) * share, max(radius, 0.0)))
    return corners


def _beginning(points: Sequence[Point], length: float, width: float) -> BaseGeometry:
    """Return a polygon over a line's beginning of a length and what is before it, wider than the stroke."""
    line = LineString(_rounded(points, is_closed=False, tolerance=_FINE))
    (x, y), (ax, ay) = points[0][:2], _direction(points[0], points[1])
    first_part = LineString([(x - 0.1 * ax, y - 0.1 * ay), *substring(line, 0.0, length).coords])
    return first_part.buffer(width * 0.6, cap_style="flat", join_style="mitre")


def _beyond(inner: Point, end: Point) -> Point:
    """Return a point beyond the end of a slanting line, far enough for a horizontal cut there."""
    across, up = end[0] - inner[0], end[1] - inner[1]
    if not across or not up:
        return end
    factor = 1.5 / math.hypot(across, up)
    return (end[0] + across * factor, end[1] + up * factor)


def _rounded(points: Sequence[Point], is_closed: bool, tolerance: float = _TOLERANCE) -> list[tuple[float, float]]:
    """Return the points of a line whose corners with a radius are arcs of straight pieces."""
    line_points: list[tuple[float, float]] = []
    count = len(points)
    lengths_taken = [0.0] * count
    for number, point in enumerate(points):
        radius = point[2] if len(point) > 2 else 0.0
        point_before, point_after = points[number - 1], points[(number + 1) % count]
        is_end = not is_closed and number in (0, count - 1)
        if is_end or not radius:
            line_points.append((point[0], point[1]))
            continue
        arc, lengths_taken[number] = _arc(point_before, point, point_after, radius, tolerance)
        line_points += arc
    for number, point in enumerate(points):
        room = math.dist(points[number - 1][:2], point[:2]) if number or is_closed else math.inf
        assert lengths_taken[number - 1] + lengths_taken[number] < room + 1e-6, f"no room for the arcs beside {point}"
    if is_closed:
        line_points.append(line_points[0])
    return line_points


def _arc(
    point_before: Point, corner: Point, point_after: Point, radius: float, tolerance: float
) -> tuple[list[tuple[float, float]], float]:
    """Return the points of the arc that rounds a corner between two others, and what it takes of either side."""
    (ax, ay), (bx, by) = _direction(point_before, corner), _direction(corner, point_after)
    turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    tangent_length = radius * math.tan(abs(turn) / 2.0)
    side = math.copysign(1.0, turn)
    centre = (
        corner[0] - ax * tangent_length - ay * radius * side,
        corner[1] - ay * tangent_length + ax * radius * side,
    )
    start = math.atan2(-ax * side, ay * side)
    widest_angle = 2.0 * math.acos(radius / (radius + tolerance))
    pieces = max(1, round(math.ceil(math.pi / 2.0 / widest_angle) * abs(turn) / (math.pi / 2.0)))
    # The pieces touch the arc in their middles: so the first and the last lie on the lines that it joins.
    step = turn / pieces
    reach = radius / math.cos(step / 2.0)
    angles = [start + step * (number + 0.5) for number in range(pieces)]
    return [
        (centre[0] + reach * math.cos(angle), centre[1] + reach * math.sin(angle)) for angle in angles
    ], tangent_length


def _direction(start: Point, end: Point) -> tuple[float, float]:
    """Return the unit vector from one point to another."""
    across, up = end[0] - start[0], end[1] - start[1]
    length = math.hypot(across, up)
    return across / length, up / length


# Ways to write a stroke.


def _line(*points: Point, trim: tuple[float, float] = (0.0, 0.0), width: float = 1.0) -> Stroke:
    """Return a stroke whose ends are at a right angle to it."""
    return Stroke(points, trim=trim, width=width)


def _slant(*points: Point, width: float = 1.0, level: tuple[bool, bool] = (True, True)) -> Stroke:
    """Return a stroke whose slanting ends are cut horizontally at their height."""
    return Stroke(points, level=level, width=width)


def _stem(x: float, low: float = 0.0, high: float = CAPITAL) -> Stroke:
    """Return an upright stroke."""
    return Stroke(((x, low), (x, high)))


def _bar(y: float, left: float, right: float) -> Stroke:
    """Return a level stroke."""
    return Stroke(((left, y), (right, y)))


def _ring(left: float, low: float, right: float, high: float, width: float = 1.0) -> Stroke:
    """Return a closed stroke around a box, whose shorter sides are half circles."""
    radius = min(right - left, high - low) / 2.0
    corners = ((left, low, radius), (right, low, radius), (right, high, radius), (left, high, radius))
    return Stroke(corners, closed=True, width=width)


def _dot(x: float, y: float) -> Stroke:
    """Return a square dot by the middle of its lower side."""
    return _stem(x, y, y + 1.0)


_END = (False, True)
"""`level` of strokes that begin within another one."""

# Space beside a glyph, in widths of a stroke: beside upright strokes, beside round ones, beside slanting or open ones.
_UPRIGHT, _ROUND, _OPEN = 0.7, 0.5, 0.2
_FIGURE = 5.2
"""Width that each figure takes, but for 1."""


@dataclass(frozen=True)
class Glyph:
    """A glyph's strokes and the space that it takes, in widths of a stroke.

    Attributes:
        left, right: space beside its strokes.
        strokes: wherever they lie from left to right.
        advance: width of the whole with the strokes in its middle, instead of `left` and `right`; 0 for these.
    """

    left: float
    right: float
    strokes: tuple[Stroke, ...]
    advance: float = 0.0


_O, _SMALL_O = _ring(0.5, 0.5, 3.8, 6.5), _ring(0.5, 0.5, 3.2, 4.5)
_SMALL_STEM = _stem(0.5, 0.0, SMALL)
_ARCH = _line((0.5, 2.6), (0.5, 4.5, 1.35), (3.2, 4.5, 1.35), (3.2, 0.0))
_P = (_stem(0.5), _line((0.5, 6.5), (3.6, 6.5, 1.75), (3.6, 2.95, 1.75), (0.5, 2.95)))

_CAPITALS: dict[str, Glyph] = {
    "A": Glyph(_OPEN, _OPEN, (_slant((0.52, 0.0), (2.45, 7.0)), _slant((4.38, 0.0), (2.45, 7.0)), _bar(2.0, 1.2, 3.7))),
    "B": Glyph(
        _UPRIGHT,
        _ROUND,
        (
            _stem(0.5),
            _line((0.5, 6.5), (3.5, 6.5, 1.4), (3.5, 3.7, 1.4), (0.5, 3.7)),
            _line((0.5, 3.7), (3.75, 3.7, 1.6), (3.75, 0.5, 1.6), (0.5, 0.5)),
        ),
    ),
    "C": Glyph(
        _ROUND,
        0.4,
        (
            _line(
                (3.7, 4.9),
                (3.7, 6.5, 1.6),
                (0.5, 6.5, 1.6),
                (0.5, 0.5, 1.6),
                (3.7, 0.5, 1.6),
                (3.7, 2.1),
                trim=(0.2, 0.2),
            ),
        ),
    ),
    "D": Glyph(_UPRIGHT, _ROUND, (_stem(0.5), _line((0.5, 6.5), (3.75, 6.5, 2.0), (3.75, 0.5, 2.0), (0.5, 0.5)))),
    "E": Glyph(_UPRIGHT, 0.35, (_stem(0.5), _bar(6.5, 0.5, 3.6), _bar(3.6, 0.5, 3.3), _bar(0.5, 0.5, 3.6))),
    "F": Glyph(_UPRIGHT, 0.25, (_stem(0.5), _bar(6.5, 0.5, 3.5), _bar(3.5, 0.5, 3.2))),
    "G": Glyph(
        _ROUND,
        0.6,
        (
            _line(
                *(
                    (3.7, 4.9),
                    (3.7, 6.5, 1.6),
                    (0.5, 6.5, 1.6),
                    (0.5, 0.5, 1.6),
                    (3.7, 0.5, 1.6),
                    (3.7, 3.2),
                    (2.1, 3.2),
                ),
                trim=(0.2, 0.0),
            ),
        ),
    ),
    "H": Glyph(_UPRIGHT, _UPRIGHT, (_stem(0.5), _stem(3.9), _bar(3.6, 0.5, 3.9))),
    "I": Glyph(_UPRIGHT, _UPRIGHT, (_stem(0.5),)),
    "J": Glyph(_OPEN, _UPRIGHT, (_line((0.0, 0.5), (2.3, 0.5, 1.6), (2.3, 7.0)),)),
    "K": Glyph(
        _UPRIGHT, 0.1, (_stem(0.5), _slant((0.6, 1.85), (3.7, 7.0), level=_END), _slant((1.75, 3.9), (3.95, 0.0)))
    ),
    "L": Glyph(_UPRIGHT, 0.25, (_stem(0.5), _bar(0.5, 0.5, 3.4))),
    "Ł": Glyph(_OPEN, 0.25, (_stem(0.5), _bar(0.5, 0.5, 3.4), _line((-0.5, 3.0), (2.2, 4.6), width=0.8))),
    "M": Glyph(
        _UPRIGHT,
        _UPRIGHT,
        (_stem(0.5), _stem(4.8), _slant((0.56, 7.0), (2.65, 1.9)), _slant((4.74, 7.0), (2.65, 1.9))),
    ),
    "N": Glyph(_UPRIGHT, _UPRIGHT, (_stem(0.5), _stem(3.9), _slant((0.57, 7.0), (3.83, 0.0)))),
    "O": Glyph(_ROUND, _ROUND, (_O,)),
    "Ø": Glyph(_ROUND, _ROUND, (_O, _slant((0.4, -0.3), (3.9, 7.3), width=0.7))),
    "P": Glyph(_UPRIGHT, 0.4, _P),
    "Q": Glyph(_ROUND, _ROUND, (_O, _slant((2.5, 2.0), (3.95, 0.0), level=_END))),
    "R": Glyph(_UPRIGHT, 0.35, (*_P, _slant((1.95, 3.0), (3.75, 0.0)))),
    "S": Glyph(
        0.4,
        0.4,
        (
            _line(
                *(
                    (3.55, 5.0),
                    (3.55, 6.5, 1.5),
                    (0.55, 6.5, 1.5),
                    (0.55, 4.25, 1.15),
                    (3.6, 2.9, 1.2),
                    (3.6, 0.5, 1.5),
                ),
                *((0.5, 0.5, 1.55), (0.5, 2.05)),
                trim=(0.4, 0.35),
            ),
        ),
    ),
    "T": Glyph(_OPEN, _OPEN, (_stem(2.05), _bar(6.5, 0.0, 4.1))),
    "U": Glyph(_UPRIGHT, _UPRIGHT, (_line((0.5, 7.0), (0.5, 0.5, 1.65), (3.8, 0.5, 1.65), (3.8, 7.0)),)),
    "V": Glyph(_OPEN, _OPEN, (_slant((0.52, 7.0), (2.4, 0.0)), _slant((4.28, 7.0), (2.4, 0.0)))),
    "W": Glyph(
        _OPEN,
        _OPEN,
        tuple(
            _slant((0.5 + 1.65 * x, 7.0), (0.5 + 1.65 * (x + side), 0.0))
            for x, side in ((0, 1), (2, -1), (2, 1), (4, -1))
        ),
    ),
    "X": Glyph(_OPEN, _OPEN, (_slant((0.56, 7.0), (3.94, 0.0)), _slant((0.56, 0.0), (3.94, 7.0)))),
    "Y": Glyph(_OPEN, _OPEN, tuple(_slant((2.3 + 1.75 * side, 7.0), (2.3, 3.0), (2.3, 0.0)) for side in (-1, 1))),
    "Z": Glyph(0.35, 0.35, (_line((0.4, 6.5), (3.4, 6.5), (0.6, 0.5), (3.9, 0.5)),)),
}

_SMALL_LETTERS: dict[str, Glyph] = {
    "a": Glyph(
        0.45,
        _UPRIGHT,
        (
            _line((0.3, 3.2), (0.3, 4.5, 1.3), (3.0, 4.5, 1.3), (3.0, 0.0), trim=(1.1, 0.0)),
            _line((3.0, 2.8), (0.5, 2.8, 1.15), (0.5, 0.5, 1.15), (3.0, 0.5)),
        ),
    ),
    "b": Glyph(_UPRIGHT, _ROUND, (_stem(0.5), _SMALL_O)),
    "c": Glyph(
        _ROUND,
        0.3,
        (
            _line(
                (3.1, 3.2),
                (3.1, 4.5, 1.3),
                (0.5, 4.5, 1.3),
                (0.5, 0.5, 1.3),
                (3.1, 0.5, 1.3),
                (3.1, 1.8),
                trim=(0.7, 0.7),
            ),
        ),
    ),
    "d": Glyph(_ROUND, _UPRIGHT, (_stem(3.2), _SMALL_O)),
    "e": Glyph(
        _ROUND,
        0.4,
        (
            _line((0.5, 2.4), (3.2, 2.4), (3.2, 3.1)),
            _line(
                *((3.2, 3.0), (3.2, 4.5, 1.35), (0.5, 4.5, 1.35), (0.5, 0.5, 1.35), (3.2, 0.5, 1.35), (3.2, 1.85)),
                trim=(0.0, 0.7),
            ),
        ),
    ),
    "f": Glyph(0.3, 0.2, (_line((1.2, 0.0), (1.2, 6.5, 1.2), (2.7, 6.5)), _bar(4.5, 0.0, 2.6))),
    "g": Glyph(_ROUND, _UPRIGHT, (_SMALL_O, _line((3.2, 5.0), (3.2, -1.5, 1.35), (0.8, -1.5)))),
    "h": Glyph(_UPRIGHT, _UPRIGHT, (_stem(0.5), _ARCH)),
    "i": Glyph(_UPRIGHT, _UPRIGHT, (_SMALL_STEM, _dot(0.5, 6.0))),
    "j": Glyph(0.0, _UPRIGHT, (_line((0.5, 5.0), (0.5, -1.5, 1.2), (-1.0, -1.5)), _dot(0.5, 6.0))),
    "k": Glyph(
        _UPRIGHT, 0.1, (_stem(0.5), _slant((0.55, 1.5), (3.2, 5.0), level=_END), _slant((1.6, 3.0), (3.4, 0.0)))
    ),
    "l": Glyph(_UPRIGHT, 0.3, (_line((0.5, 7.0), (0.5, 0.5, 1.1), (2.0, 0.5)),)),
    "m": Glyph(
        _UPRIGHT,
        _UPRIGHT,
        (
            _SMALL_STEM,
            *(_line((x, 2.6), (x, 4.5, 1.2), (x + 2.4, 4.5, 1.2), (x + 2.4, 0.0)) for x in (0.5, 2.9)),
        ),
    ),
    "n": Glyph(_UPRIGHT, _UPRIGHT, (_SMALL_STEM, _ARCH)),
    "o": Glyph(_ROUND, _ROUND, (_SMALL_O,)),
    "p": Glyph(_UPRIGHT, _ROUND, (_stem(0.5, -2.0, SMALL), _SMALL_O)),
    "q": Glyph(_ROUND, _UPRIGHT, (_stem(3.2, -2.0, SMALL), _SMALL_O)),
    "r": Glyph(_UPRIGHT, 0.2, (_SMALL_STEM, _line((0.5, 2.6), (0.5, 4.5, 1.35), (2.4, 4.5)))),
    "s": Glyph(
        0.35,
        0.35,
        (
            _line(
                *((2.9, 3.5), (2.9, 4.5, 1.0), (0.5, 4.5, 1.0), (0.5, 2.95, 0.75), (3.0, 2.15, 0.8), (3.0, 0.5, 1.0)),
                *((0.4, 0.5, 1.0), (0.4, 1.5)),
                trim=(0.4, 0.5),
            ),
        ),
    ),
    "t": Glyph(_OPEN, 0.25, (_line((1.2, 6.5), (1.2, 0.5, 1.1), (2.6, 0.5)), _bar(4.5, 0.0, 2.6))),
    "u": Glyph(
        _UPRIGHT, _UPRIGHT, (_line((0.5, 5.0), (0.5, 0.5, 1.35), (3.2, 0.5, 1.35), (3.2, 2.4)), _stem(3.2, 0.0, SMALL))
    ),
    "v": Glyph(_OPEN, _OPEN, (_slant((0.53, 5.0), (2.0, 0.0)), _slant((3.47, 5.0), (2.0, 0.0)))),
    "w": Glyph(
        _OPEN,
        _OPEN,
        tuple(
            _slant((0.5 + 1.38 * x, 5.0), (0.5 + 1.38 * (x + side), 0.0))
            for x, side in ((0, 1), (2, -1), (2, 1), (4, -1))
        ),
    ),
    "x": Glyph(_OPEN, _OPEN, (_slant((0.58, 5.0), (3.32, 0.0)), _slant((0.58, 0.0), (3.32, 5.0)))),
    "y": Glyph(_OPEN, _OPEN, (_slant((0.53, 5.0), (2.0, 0.0)), _slant((3.47, 5.0), (1.56, -1.5, 1.1), (0.3, -1.5)))),
    "z": Glyph(0.3, 0.3, (_line((0.3, 4.5), (2.75, 4.5), (0.6, 0.5), (3.2, 0.5)),)),
    "ø": Glyph(_OPEN, _OPEN, (_SMALL_O, _slant((0.2, -0.4), (3.5, 5.4), width=0.7))),
    "ł": Glyph(_OPEN, 0.3, (_line((0.5, 7.0), (0.5, 0.5, 1.1), (2.0, 0.5)), _line((-0.7, 3.1), (1.7, 4.5), width=0.8))),
    "ß": Glyph(
        _UPRIGHT,
        _ROUND,
        (
            _line((0.5, 0.0), (0.5, 6.5, 1.35), (3.2, 6.5, 1.35), (3.2, 3.8, 1.3), (1.8, 3.8)),
            _line((1.8, 3.8), (3.5, 3.8, 1.6), (3.5, 0.5, 1.6), (1.7, 0.5)),
        ),
    ),
}

_SIX = (_ring(0.5, 0.5, 3.6, 4.1), _slant((0.5, 2.3), (0.5, 3.2, 2.6), (2.6, 7.0)))


def _figure(*strokes: Stroke) -> Glyph:
    """Return a figure, as wide as all others."""
    return Glyph(0.0, 0.0, strokes, _FIGURE)


_FIGURES: dict[str, Glyph] = {
    "0": _figure(_ring(0.5, 0.5, 3.6, 6.5)),
    "1": Glyph(0.5, 0.9, (_stem(1.9), _line((0.1, 4.996), (1.75, 6.646)))),
    "2": _figure(_line(*((0.5, 4.7), (0.5, 6.5, 1.5), (3.5, 6.5, 1.5), (3.5, 3.95, 2.8), (0.95, 0.5), (4.0, 0.5)))),
    "3": _figure(
        _line(*((0.6, 5.1), (0.6, 6.5, 1.4), (3.4, 6.5, 1.4), (3.4, 3.7, 1.4), (1.6, 3.7)), trim=(0.2, 0.0)),
        _line(*((1.6, 3.7), (3.6, 3.7, 1.6), (3.6, 0.5, 1.6), (0.5, 0.5, 1.5), (0.5, 2.0)), trim=(0.0, 0.2)),
    ),
    "4": _figure(_slant((2.3, 7.0), (0.5, 1.9), (4.15, 1.9)), _stem(3.05, 0.0, 3.7)),
    "5": _figure(
        _bar(6.5, 0.6, 3.7),
        _stem(0.9, 3.0, 7.0),
        _line(
            *((0.9, 3.0), (0.9, 4.3, 1.0), (3.6, 4.3, 1.7), (3.6, 0.5, 1.7), (0.5, 0.5, 1.4), (0.5, 1.9)),
            trim=(0.0, 0.1),
        ),
    ),
    "6": _figure(*_SIX),
    "7": _figure(_slant((0.2, 6.5), (3.5, 6.5), (1.4, 0.0))),
    "8": _figure(_ring(0.7, 3.7, 3.4, 6.5), _ring(0.5, 0.5, 3.6, 3.7)),
    "9": _figure(*(stroke.turned(2.05, 3.5) for stroke in _SIX)),
}

_SIGNS: dict[str, Glyph] = {
    " ": Glyph(0.0, 0.0, (), 2.4),
    ".": Glyph(0.6, 0.6, (_dot(0.5, 0.0),)),
    ",": Glyph(0.6, 0.6, (_dot(0.5, 0.0), _slant((0.5, 0.6), (0.1, -1.2)))),
    ":": Glyph(0.6, 0.6, (_dot(0.5, 0.0), _dot(0.5, 3.6))),
    ";": Glyph(0.6, 0.6, (_dot(0.5, 0.0), _slant((0.5, 0.6), (0.1, -1.2)), _dot(0.5, 3.6))),
    "-": Glyph(0.5, 0.5, (_bar(2.8, 0.0, 2.2),)),
    "–": Glyph(0.5, 0.5, (_bar(2.8, 0.0, 3.8),)),
    "/": Glyph(0.1, 0.1, (_slant((0.5, -0.6), (3.0, 7.6)),)),
    "(": Glyph(0.5, 0.2, (_line((1.8, 8.0), (0.5, 5.6, 9.0), (0.5, 0.9, 9.0), (1.8, -1.5)),)),
    ")": Glyph(0.2, 0.5, (_line((0.0, 8.0), (1.3, 5.6, 9.0), (1.3, 0.9, 9.0), (0.0, -1.5)),)),
    "&": Glyph(
        0.4,
        _OPEN,
        (
            _slant((4.5, 0.0), (1.7, 3.6)),
            _line((3.0, 1.93), (0.7, 4.9, 0.9), (0.7, 6.5, 1.1), (2.9, 6.5, 1.1), (2.9, 5.2)),
            _line(
                *((2.9, 5.3), (2.9, 4.5, 1.0), (0.5, 3.0, 1.0), (0.5, 0.5, 1.4), (3.5, 0.5, 1.9), (4.1, 2.9)),
            ),
        ),
    ),
    "+": Glyph(0.5, 0.5, (_stem(2.0, 0.9, 4.9), _bar(2.9, 0.0, 4.0))),
    "=": Glyph(0.5, 0.5, (_bar(1.9, 0.0, 3.8), _bar(3.9, 0.0, 3.8))),
    "'": Glyph(0.5, 0.5, (_stem(0.5, 5.0, 7.0),)),
    '"': Glyph(0.5, 0.5, (_stem(0.5, 5.0, 7.0), _stem(2.3, 5.0, 7.0))),
    "°": Glyph(0.4, 0.4, (_ring(0.4, 4.9, 2.1, 6.6, width=0.8),)),
    "%": Glyph(
        0.4,
        0.4,
        (
            _ring(0.4, 3.9, 2.1, 6.6, width=0.8),
            _ring(4.4, 0.4, 6.1, 3.1, width=0.8),
            _slant((1.6, 0.0), (4.9, 7.0), width=0.8),
        ),
    ),
    "!": Glyph(_UPRIGHT, _UPRIGHT, (_stem(0.5, 2.1, 7.0), _dot(0.5, 0.0))),
    "?": Glyph(
        0.4,
        0.4,
        (
            _line(
                (0.5, 4.9),
                (0.5, 6.5, 1.45),
                (3.4, 6.5, 1.45),
                (3.4, 4.2, 1.3),
                (1.8, 3.2, 0.6),
                (1.8, 2.1),
            ),
            _dot(1.8, 0.0),
        ),
    ),
}

_SAME = {"\u00a0": " ", "‐": "-", "‑": "-", "−": "–", "’": "'"}
"""Further characters that look like one of the above."""
_MARKS: dict[str, tuple[Stroke, ...]] = {
    "\N{COMBINING DIAERESIS}": (_dot(-0.95, 0.0), _dot(0.95, 0.0)),
    "\N{COMBINING DOT ABOVE}": (_dot(0.0, 0.0),),
    "\N{COMBINING ACUTE ACCENT}": (_slant((-0.4, 0.0), (0.4, 1.0)),),
    "\N{COMBINING GRAVE ACCENT}": (_slant((0.4, 0.0), (-0.4, 1.0)),),
    "\N{COMBINING DOUBLE ACUTE ACCENT}": tuple(_slant((x - 0.3, 0.0), (x + 0.3, 1.0), width=0.8) for x in (-0.6, 0.7)),
    "\N{COMBINING CIRCUMFLEX ACCENT}": tuple(_slant((side, 0.0), (0.0, 1.0), width=0.8) for side in (-0.9, 0.9)),
    "\N{COMBINING CARON}": tuple(_slant((side, 1.0), (0.0, 0.0), width=0.8) for side in (-0.9, 0.9)),
    "\N{COMBINING TILDE}": (_line((-1.1, 0.05), (-0.4, 0.55), (0.4, 0.25), (1.1, 0.75), width=0.6),),
    "\N{COMBINING MACRON}": (_bar(0.5, -1.0, 1.0),),
    "\N{COMBINING RING ABOVE}": (_ring(-0.4, 0.0, 0.4, 0.8, width=0.4),),
}
"""Marks above letters, around x = 0 and from y = 0 on."""
_BELOW: dict[str, tuple[Stroke, ...]] = {
    "\N{COMBINING CEDILLA}": (_line((0.0, 0.5), (0.4, -0.7, 0.3), (-0.7, -1.2), width=0.8),),
    "\N{COMBINING OGONEK}": (_line((0.3, 0.5), (-0.4, -1.2, 0.6), (0.9, -1.2), width=0.8),),
}
"""Marks below letters, around x = 0; they hang from y = 0."""
_ABOVE_CAPITALS, _ABOVE_SMALL = 7.6, 6.0
"""Where marks above letters begin, in widths of a stroke.

They are 1 high: those above capitals and the descenders end the box by whose height Blender scales a typeface.
"""


def glyphs() -> dict[str, Glyph]:
    """Return all glyphs by their characters, letters with marks included."""
    glyph_of_character = {**_CAPITALS, **_SMALL_LETTERS, **_FIGURES, **_SIGNS}
    letters = glyph_of_character | {"i": Glyph(_UPRIGHT, _UPRIGHT, (_SMALL_STEM,))}
    for character in map(chr, range(0xC0, 0x180)):
        letter, mark = (*unicodedata.normalize("NFD", character), "", "")[:2]
        if letter in letters and mark in _MARKS | _BELOW:
            glyph_of_character[character] = _with_mark(letters[letter], mark)
    return glyph_of_character


def _with_mark(glyph: Glyph, mark: str) -> Glyph:
    """Return a letter with a mark above or below its middle."""
    left_edge, _, right_edge, top = union_all([stroke.area() for stroke in glyph.strokes]).bounds
    up = 0.0 if mark in _BELOW else _ABOVE_SMALL if top < _ABOVE_SMALL else _ABOVE_CAPITALS
    marks = [stroke.moved((left_edge + right_edge) / 2.0, up) for stroke in (_MARKS | _BELOW)[mark]]
    return replace(glyph, strokes=(*glyph.strokes, *marks))


def outlines(glyph: Glyph) -> tuple[list[list[tuple[int, int]]], int]:
    """Return a glyph's contours in font units, outer ones clockwise and holes anticlockwise, and its advance."""
    if not glyph.strokes:
        return [], round(glyph.advance * UNIT)
    area = union_all([stroke.area() for stroke in glyph.strokes])
    left_edge, _, right_edge, _ = area.bounds
    advance = glyph.advance or glyph.left + right_edge - left_edge + glyph.right
    left = (glyph.advance - (right_edge - left_edge)) / 2.0 if glyph.advance else glyph.left
    polygons: Sequence[Polygon] = getattr(area, "geoms", [area])
    contours = []
    for polygon in polygons:
        for ring, clockwise in ((polygon.exterior, True), *((hole, False) for hole in polygon.interiors)):
            points = [(round((x - left_edge + left) * UNIT), round(y * UNIT)) for x, y in ring.coords[:-1]]
            contours.append(_in_order(_without_straight(points), clockwise))
    return sorted(contours), round(advance * UNIT)


def _without_straight(points: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the points of a ring without those within a font unit of the line between their neighbours."""
    corners = list(points)
    number = 0
    while number < len(corners):
        (ax, ay), (bx, by), (cx, cy) = corners[number - 1], corners[number], corners[(number + 1) % len(corners)]
        base_length = math.hypot(cx - ax, cy - ay)
        if abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) <= base_length:
            del corners[number]
            number = max(number - 1, 0)
        else:
            number += 1
    return corners


def _in_order(points: list[tuple[int, int]], is_clockwise: bool) -> list[tuple[int, int]]:
    """Return a ring's points the way round that is asked for, from the lowest of those furthest left on."""
    edges = zip(points, [*points[1:], points[0]], strict=True)
    area = sum(ax * by - bx * ay for (ax, ay), (bx, by) in edges)
    if (area < 0.0) != is_clockwise:
        points = points[::-1]
    first_number = points.index(min(points))
    return points[first_number:] + points[:first_number]


def make_font(path: Path) -> None:
    """Write the typeface to a TrueType file."""
    glyph_of_character = glyphs()
    names = {character: f"uni{ord(character):04X}" for character in sorted(glyph_of_character)}
    missing_glyph = Glyph(_UPRIGHT, _UPRIGHT, (Stroke(((0.5, 0.5), (3.5, 0.5), (3.5, 6.5), (0.5, 6.5)), closed=True),))
    shapes, widths = {}, {}
    for name, glyph in (
        (".notdef", missing_glyph),
        *((names[character], glyph_of_character[character]) for character in names),
    ):
        pen = TTGlyphPen(None)
        contours, advance = outlines(glyph)
        for contour in contours:
            pen.moveTo(contour[0])
            for point in contour[1:]:
                pen.lineTo(point)
            pen.closePath()
        shapes[name], widths[name] = pen.glyph(), advance
    builder = FontBuilder(EM, isTTF=True)
    builder.setupGlyphOrder(list(shapes))
    builder.setupCharacterMap({ord(key): names[_SAME.get(key, key)] for key in (*names, *_SAME)})
    builder.setupGlyf(shapes)
    glyf = builder.font["glyf"]
    builder.setupHorizontalMetrics({name: (width, getattr(glyf[name], "xMin", 0)) for name, width in widths.items()})
    ascent, descent = round(_ASCENT * UNIT), round(DESCENT * UNIT)
    builder.setupHorizontalHeader(ascent=ascent, descent=-descent)
    builder.setupOS2(
        sTypoAscender=ascent,
        sTypoDescender=-descent,
        sTypoLineGap=0,
        usWinAscent=ascent,
        usWinDescent=descent,
        sxHeight=round(SMALL * UNIT),
        sCapHeight=round(CAPITAL * UNIT),
        achVendID="SYNR",
        fsType=0,
    )
    builder.setupPost()
    builder.setupNameTable(
        {
            "copyright": "SynthRoads developers",
            "familyName": FAMILY,
            "styleName": "Regular",
            "uniqueFontIdentifier": f"{FAMILY} 1.0",
            "fullName": FAMILY,
            "version": "Version 1.000",
            "psName": FAMILY.replace(" ", "-"),
            "description": "Drawn for SynthRoads after the proportions of DIN 1451 Mittelschrift.",
            "licenseDescription": _LICENCE,
            "licenseInfoURL": _LICENCE_URL,
        },
        mac=False,
    )
    builder.updateHead(created=_DATE, modified=_DATE, fontRevision=1.0)
    builder.font.recalcTimestamp = False
    path.parent.mkdir(parents=True, exist_ok=True)
    builder.save(path)


def main(argv: list[str] | None = None) -> int:
    """Write the typeface to the file that the command line names; return the exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--output", type=Path, default=TARGET, metavar="FILE.ttf", help="default: the add-on's own")
    arguments = parser.parse_args(argv)
    make_font(arguments.output)
    print(f"{arguments.output}: {len(glyphs())} glyphs, {arguments.output.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
