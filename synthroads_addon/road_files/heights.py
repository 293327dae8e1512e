"""Heights along a line of a file: pieces of cubics, which become intersections with parabolic roundings."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..road.profile import IntersectionPoint

TOLERANCE = 5e-4
"""Height (m) that parabolas may keep from a cubic or a circle."""
_MOST_PIECES = 256
_SHORTEST = 1e-9
"""Parabolas shorter than this, m, are none."""
_FLAT = 1e-9
"""Change of grade below this is none: 1 nm in a metre."""
JUMP = 1e-3
"""Heights that jump by more than this (m) from one piece to the next are told."""


@dataclass(frozen=True)
class HeightPiece:
    """Heights on a stretch: z0 + g u + c u^2 + d u^3, u the distance from its start.

    Attributes:
        start, end: stations, m.
        elevation: z0, m.
        grade: g, m/m.
        square, cube: c (1/m) and d (1/m^2).
    """

    start: float
    end: float
    elevation: float
    grade: float
    square: float = 0.0
    cube: float = 0.0

    def elevation_at(self, station: float) -> float:
        """Return the height, m, at a station."""
        u = station - self.start
        return self.elevation + u * (self.grade + u * (self.square + u * self.cube))

    def grade_at(self, station: float) -> float:
        """Return the grade, m/m, at a station."""
        u = station - self.start
        return self.grade + u * (2.0 * self.square + 3.0 * u * self.cube)


@dataclass(frozen=True)
class Heights:
    """Intersections with parabolic roundings that stand for the heights of a file.

    Attributes:
        points: of vertical intersection.
        deviation: largest height between them and the file's pieces, m.
        station: where it is, m.
        jumps: stations and heights (m) of steps between the file's pieces, where neighbours don't meet.
    """

    points: tuple[IntersectionPoint, ...]
    deviation: float
    station: float
    jumps: tuple[tuple[float, float], ...]


def circle(start: float, end: float, elevation: float, first: float, last: float) -> list[HeightPiece]:
    """Return cubics within 0.1 mm of a circular arc in the profile, with its heights and grades at their ends.

    Args:
        start, end: stations, m.
        elevation: at the start, m.
        first, last: grades at both ends, m/m; the radius follows: R = (end - start) / (sin b - sin a) with a = atan
            first and b = atan last.
    """
    low, high = np.sin(np.arctan([first, last]))
    radius = (end - start) / (high - low)
    count = max(1, int(np.ceil(abs(high - low) / 0.02)))
    edges = np.linspace(start, end, count + 1)
    sine = low + (edges - start) / radius
    height = elevation + radius * (np.sqrt(1.0 - low**2) - np.sqrt(1.0 - sine**2))
    grade = sine / np.sqrt(1.0 - sine**2)
    pieces = []
    for n in range(count):
        step, rise = edges[n + 1] - edges[n], height[n + 1] - height[n]
        square = (3.0 * rise / step - 2.0 * grade[n] - grade[n + 1]) / step
        cube = (grade[n] + grade[n + 1] - 2.0 * rise / step) / step**2
        pieces.append(HeightPiece(*(float(v) for v in (edges[n], edges[n + 1], height[n], grade[n], square, cube))))
    return pieces


def as_parabolas(pieces: Sequence[HeightPiece], tolerance: float = TOLERANCE) -> Heights:
    """Return the intersections and roundings of heights given by pieces in order, without gaps between them.

    Grades and parabolas are exact. A cubic becomes pairs of parabolas with its heights and grades at their ends. Where
    a piece doesn't begin at the height at which the one before ends, the later one is shifted.
    """
    parabolas: list[tuple[float, float, float, float, float]] = []  # start, end, height, both grades
    shift, jumps, worst, where = 0.0, [], 0.0, pieces[0].start
    for n, piece in enumerate(pieces):
        if n:
            before = pieces[n - 1]
            step = piece.elevation - before.elevation_at(before.end)
            shift -= step
            if abs(step) > JUMP:
                jumps.append((piece.start, step))
        for parabola in _parabolas(piece, tolerance):
            parabolas.append((*parabola[:2], parabola[2] + shift, *parabola[3:]))
        deviation, at = _deviation(piece, parabolas, shift)
        if deviation > worst:
            worst, where = deviation, at
    return Heights(_points(parabolas), worst, where, tuple(jumps))


def _parabolas(piece: HeightPiece, tolerance: float) -> list[tuple[float, float, float, float, float]]:
    """Return start, end, height and both grades of the parabolas that a piece becomes."""
    length = piece.end - piece.start
    if piece.cube == 0.0:
        return [(piece.start, piece.end, piece.elevation, piece.grade, piece.grade_at(piece.end))]
    # Of a pair of parabolas with a cubic's ends the middle is off by |d| L^3 / 32 at most.
    count = int(np.clip(np.ceil((abs(piece.cube) * length**3 / (32.0 * tolerance)) ** (1.0 / 3.0)), 1, _MOST_PIECES))
    edges = np.linspace(piece.start, piece.end, count + 1).tolist()
    parabolas = []
    for first, last in itertools.pairwise(edges):
        half = 0.5 * (last - first)
        if half < _SHORTEST:
            continue
        low, high = piece.elevation_at(first), piece.elevation_at(last)
        rise, fall = piece.grade_at(first), piece.grade_at(last)
        inner = (high - low) / half - 0.5 * (rise + fall)  # so that both parabolas end where the cubic does
        parabolas.append((first, first + half, low, rise, inner))
        parabolas.append((first + half, last, low + 0.5 * half * (rise + inner), inner, fall))
    return parabolas or [(piece.start, piece.end, piece.elevation, piece.grade, piece.grade_at(piece.end))]


def _deviation(
    piece: HeightPiece, parabolas: Sequence[tuple[float, float, float, float, float]], shift: float
) -> tuple[float, float]:
    """Return the largest height (m) between a piece and its parabolas, and its station."""
    worst, where = 0.0, piece.start
    if piece.cube == 0.0:
        return worst, where
    for first, last, height, rise, fall in parabolas:
        if first >= piece.start - 1e-9 and last <= piece.end + 1e-9:
            for share in (0.25, 0.5, 0.75):
                u = share * (last - first)
                elevation = height + u * (rise + 0.5 * (fall - rise) * share)
                off = abs(elevation - shift - piece.elevation_at(first + u))
                if off > worst:
                    worst, where = off, first + u
    return worst, where


def _points(parabolas: Sequence[tuple[float, float, float, float, float]]) -> tuple[IntersectionPoint, ...]:
    """Return the intersections: one at either end, one at each kink, one in the middle of each rounding.

    Args:
        parabolas: in order, without gaps: start and end, m, height at the start, m, grades at the start and the end.
    """
    first_start, _, first_height, _, _ = parabolas[0]
    rows = [(first_start, first_height, 0.0)]  # station, height and length of tangent, m, of each intersection
    grade_before = parabolas[0][3]
    for start, end, height, start_grade, end_grade in parabolas:
        is_kink = abs(start_grade - grade_before) > _FLAT
        if is_kink:
            rows.append((start, height, 0.0))
        is_rounding = abs(end_grade - start_grade) > _FLAT
        if is_rounding:
            # The tangents at both ends of a parabola meet in its middle.
            tangent_length = 0.5 * (end - start)
            rows.append((start + tangent_length, height + start_grade * tangent_length, tangent_length))
        grade_before = end_grade
    start, end, height, start_grade, end_grade = parabolas[-1]
    rows.append((end, height + 0.5 * (end - start) * (start_grade + end_grade), 0.0))
    station, height, tangent = np.array(rows).T
    # A rounding's tangent is T = R |dg| / 2 with the change dg of the grade. It is taken from the grades between the
    # intersections, so that roundings which touch don't overlap.
    grades = np.diff(height) / np.diff(station)
    grade_change = np.abs(np.concatenate([[0.0], np.diff(grades), [0.0]]))
    radius = np.where(tangent > 0.0, 2.0 * tangent / np.where(grade_change > 0.0, grade_change, np.inf), 0.0)
    return tuple(
        IntersectionPoint(s, z, r) for s, z, r in zip(station.tolist(), height.tolist(), radius.tolist(), strict=True)
    )
