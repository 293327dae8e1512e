"""Heights along a line of a file: pieces of cubics, which become intersections with parabolic roundings."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..road.profile import IntersectionPoint

TOLERANCE = 5e-4
"""Height (m) that parabolas may keep from a cubic or a circle."""
_MOST_PIECES = 256
_SHORTEST = 1e-9
"""Parabolas shorter than this, m, are left out (chosen)."""
_FLAT = 1e-9
"""Changes of grade below this, m/m, count as none (chosen): 1 nm in a metre."""
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


class _Parabola(NamedTuple):
    """A parabola of the profile: stations and height at its start in m, grades at both ends in m/m."""

    start: float
    end: float
    height: float
    start_grade: float
    end_grade: float


def circle(start: float, end: float, elevation: float, start_grade: float, end_grade: float) -> list[HeightPiece]:
    """Return cubics within 0.1 mm of a circular arc in the profile, with the arc's heights and grades at their ends.

    Args:
        start, end: stations, m.
        elevation: at the start, m.
        start_grade, end_grade: m/m; the radius (m, positive in a sag) follows from them: R = (end - start) /
            (sin b - sin a), with the slope angles a = atan start_grade and b = atan end_grade.
    """
    start_sine, end_sine = np.sin(np.arctan([start_grade, end_grade]))
    radius = (end - start) / (end_sine - start_sine)
    # Chosen: each cubic turns the slope by 0.02 rad at most, so that it keeps within 0.1 mm of the circle.
    count = max(1, int(np.ceil(abs(end_sine - start_sine) / 0.02)))
    edges = np.linspace(start, end, count + 1)
    sine = start_sine + (edges - start) / radius
    height = elevation + radius * (np.sqrt(1.0 - start_sine**2) - np.sqrt(1.0 - sine**2))
    grade = sine / np.sqrt(1.0 - sine**2)
    pieces = []
    for n in range(count):
        length, rise = edges[n + 1] - edges[n], height[n + 1] - height[n]
        # Hermite's cubic: heights and grades at both ends are those of the circle.
        square = (3.0 * rise / length - 2.0 * grade[n] - grade[n + 1]) / length
        cube = (grade[n] + grade[n + 1] - 2.0 * rise / length) / length**2
        pieces.append(HeightPiece(*(float(v) for v in (edges[n], edges[n + 1], height[n], grade[n], square, cube))))
    return pieces


def as_parabolas(pieces: Sequence[HeightPiece], tolerance: float = TOLERANCE) -> Heights:
    """Return the intersections and roundings of heights given by pieces in order, without gaps between them.

    Grades and parabolas are exact. A cubic becomes pairs of parabolas with its heights and grades at their ends. Where
    a piece doesn't begin at the height at which the one before ends, the later one is shifted.
    """
    parabolas: list[_Parabola] = []
    shift, jumps = 0.0, []
    worst, worst_station = 0.0, pieces[0].start
    for n, piece in enumerate(pieces):
        if n:
            previous = pieces[n - 1]
            step = piece.elevation - previous.elevation_at(previous.end)
            shift -= step
            if abs(step) > JUMP:
                jumps.append((piece.start, step))
        for parabola in _parabolas(piece, tolerance):
            parabolas.append(parabola._replace(height=parabola.height + shift))
        deviation, station = _deviation(piece, parabolas, shift)
        if deviation > worst:
            worst, worst_station = deviation, station
    return Heights(_points(parabolas), worst, worst_station, tuple(jumps))


def _parabolas(piece: HeightPiece, tolerance: float) -> list[_Parabola]:
    """Return the parabolas that keep within a tolerance (m) of a piece: one, or a pair for each part of a cubic."""
    length = piece.end - piece.start
    single = _Parabola(piece.start, piece.end, piece.elevation, piece.grade, piece.grade_at(piece.end))
    if piece.cube == 0.0:
        return [single]
    # A pair of parabolas with the heights and grades of a cubic d u^3 at its ends is off by |d| L^3 / 32 at most.
    count = int(np.clip(np.ceil((abs(piece.cube) * length**3 / (32.0 * tolerance)) ** (1.0 / 3.0)), 1, _MOST_PIECES))
    edges = np.linspace(piece.start, piece.end, count + 1).tolist()
    parabolas = []
    for start, end in itertools.pairwise(edges):
        half = 0.5 * (end - start)
        if half < _SHORTEST:
            continue
        start_height, end_height = piece.elevation_at(start), piece.elevation_at(end)
        start_grade, end_grade = piece.grade_at(start), piece.grade_at(end)
        # The grade at which the pair meets, so that the second parabola ends at the cubic's height.
        middle_grade = (end_height - start_height) / half - 0.5 * (start_grade + end_grade)
        middle_height = start_height + 0.5 * half * (start_grade + middle_grade)
        parabolas.append(_Parabola(start, start + half, start_height, start_grade, middle_grade))
        parabolas.append(_Parabola(start + half, end, middle_height, middle_grade, end_grade))
    return parabolas or [single]


def _deviation(piece: HeightPiece, parabolas: Sequence[_Parabola], shift: float) -> tuple[float, float]:
    """Return the largest height (m) between a piece and its parabolas, and the station (m) of it.

    The parabolas lie `shift` (m) higher than the file's heights; those outside of the piece are passed over.
    """
    worst, worst_station = 0.0, piece.start
    if piece.cube == 0.0:
        return worst, worst_station
    for start, end, height, start_grade, end_grade in parabolas:
        if start >= piece.start - 1e-9 and end <= piece.end + 1e-9:
            for share in (0.25, 0.5, 0.75):
                u = share * (end - start)
                elevation = height + u * (start_grade + 0.5 * (end_grade - start_grade) * share)
                deviation = abs(elevation - shift - piece.elevation_at(start + u))
                if deviation > worst:
                    worst, worst_station = deviation, start + u
    return worst, worst_station


def _points(parabolas: Sequence[_Parabola]) -> tuple[IntersectionPoint, ...]:
    """Return the points of vertical intersection: in the middle of each rounding, at each kink, and at both ends."""
    begin, final = parabolas[0], parabolas[-1]
    rows = [(begin.start, begin.height, 0.0)]  # station, height, length of the tangents, m
    for n, (start, end, height, start_grade, end_grade) in enumerate(parabolas):
        if n and abs(start_grade - parabolas[n - 1].end_grade) > _FLAT:
            rows.append((start, height, 0.0))
        if abs(end_grade - start_grade) > _FLAT:
            half = 0.5 * (end - start)
            rows.append((start + half, height + start_grade * half, half))
    # A parabola rises by its length times the mean of its grades.
    end_height = final.height + 0.5 * (final.end - final.start) * (final.start_grade + final.end_grade)
    rows.append((final.end, end_height, 0.0))
    station, height, tangent = np.array(rows).T
    # A rounding's tangent is T = R |dg| / 2 with the change dg of the grade. It is taken from the grades between the
    # intersections, so that roundings which touch don't overlap.
    grades = np.diff(height) / np.diff(station)
    grade_change = np.abs(np.concatenate([[0.0], np.diff(grades), [0.0]]))
    radius = np.where(tangent > 0.0, 2.0 * tangent / np.where(grade_change > 0.0, grade_change, np.inf), 0.0)
    return tuple(
        IntersectionPoint(s, z, r) for s, z, r in zip(station.tolist(), height.tolist(), radius.tolist(), strict=True)
    )
