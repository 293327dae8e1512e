"""Vertical profile: constant grades between points of vertical intersection, rounded by parabolas.

With the grades g1 before and g2 after a point and the rounding's radius H, the parabola reaches T = ``H |g2 - g1| / 2``
to either side and has the constant curvature d2z/ds2 = sign(g2 - g1) / H: a sag is positive, a crest
negative. Stations are those of the horizontal alignment, so lengths are horizontal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Float
from ..base.errors import InputError
from .alignment import finite_array

#: Roundings may overlap by this much (m) and are then taken as touching: stations in files are rounded.
TOUCH = 1e-6
#: A rounding with a tangent up to this (m) is none; its curvature could exceed all numbers.
NO_ROUNDING = 1e-9


@dataclass(frozen=True)
class IntersectionPoint:
    """A point of vertical intersection: where two grades meet, and the radius of the rounding there.

    Attributes:
        station: m.
        elevation: of the intersection, m; a rounded profile passes above it in a sag and below it on a crest.
        radius: of the rounding, m, >= 0; 0 leaves the kink. Crest or sag follows from the grades.

    Raises:
        InputError: a value is not a finite number, or the radius is negative.
    """

    station: float
    elevation: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        for name in ("station", "elevation", "radius"):
            finite_array(f"intersection_point.{name}", getattr(self, name))
        if self.radius < 0:
            raise InputError("intersection_point.radius", self.radius, "0 m or more (the grades tell crest from sag)")


class Profile:
    """A vertical profile: elevation, grade and vertical curvature over the station, vectorised.

    The first and last grade go on beyond the ends; a single point makes a level profile. The first and last point have
    only one grade, so their radius has no effect.

    Attributes:
        points: tuple of P intersection points.
        grades: (P + 1,) m/m before, between and after the points.
        tangent_lengths: (P,) T of every rounding, m; 0 where there is none.
        breakpoints: sorted stations where the curvature jumps (both ends of a rounding) or the grade does (an
            intersection without rounding), m.

    Example:
        >>> lowest = IntersectionPoint(500.0, 90.0, radius=10_000.0)
        >>> sag = Profile([IntersectionPoint(0.0, 100.0), lowest, IntersectionPoint(1000.0, 100.0)])
        >>> float(sag.elevation(500.0)), sag.tangent_lengths.round(1).tolist()
        (92.0, [0.0, 200.0, 0.0])
        >>> sag.grade([0.0, 500.0, 1000.0]).round(3).tolist()
        [-0.02, 0.0, 0.02]
    """

    def __init__(self, points: Sequence[IntersectionPoint]) -> None:
        """Build the profile; InputError without points, for stations not increasing, or where roundings overlap."""
        if not points:
            raise InputError("profile.points", None, "at least one point of vertical intersection is needed")
        self.points = tuple(points)
        station = np.array([point.station for point in self.points], dtype=np.float64)
        elevation = np.array([point.elevation for point in self.points], dtype=np.float64)
        distances = np.diff(station)
        if (distances <= 0).any():
            point_index = int(np.argmax(distances <= 0)) + 1
            allowed = f"stations must increase: more than {station[point_index - 1]!r} m"
            raise InputError(f"profile.points[{point_index}].station", float(station[point_index]), allowed)
        self.grades = _grades(distances, np.diff(elevation))
        grade_changes = np.diff(self.grades)
        radius = np.array([point.radius for point in self.points], dtype=np.float64)
        tangent_lengths = 0.5 * radius * np.abs(grade_changes)
        self.tangent_lengths = np.where(tangent_lengths > NO_ROUNDING, tangent_lengths, 0.0)
        self._refuse_overlap(distances)
        is_rounded = self.tangent_lengths > 0
        self._build_pieces(
            station, elevation, np.where(is_rounded, np.sign(grade_changes) / np.where(is_rounded, radius, 1.0), 0.0)
        )
        is_kink = ~is_rounded & (grade_changes != 0)
        ends = np.concatenate((station - self.tangent_lengths, station + self.tangent_lengths))
        self.breakpoints = np.unique(np.concatenate((ends[np.tile(is_rounded, 2)], station[is_kink])))

    def _refuse_overlap(self, distances: Float) -> None:
        """Raise InputError if the tangents of neighbouring roundings need more than the distance (P - 1,) between."""
        needed_lengths = self.tangent_lengths[:-1] + self.tangent_lengths[1:]
        overlaps = needed_lengths > distances + TOUCH
        if overlaps.any():
            point_index = int(np.argmax(overlaps))
            allowed = (
                f"the tangents of points {point_index} and {point_index + 1} need {needed_lengths[point_index]:.6g} m"
                f" and have {distances[point_index]:.6g} m: smaller radii or more distance are needed"
            )
            raise InputError(f"profile.points[{point_index + 1}].radius", self.points[point_index + 1].radius, allowed)

    def _build_pieces(self, station: Float, elevation: Float, curvature: Float) -> None:
        """Store quadratics z + u (g + c u / 2): the first grade, then a rounding and a grade for each point.

        A grade is measured from its point, a rounding from its start: nothing is carried along the road.
        """
        tangent_lengths, grades_before, grades_after = self.tangent_lengths, self.grades[:-1], self.grades[1:]

        def interleaved(first_value: float, rounding_values: Float, grade_values: Float) -> Float:
            """Return the first grade's value, then for each point its rounding's and its grade's (2 P + 1,)."""
            return np.concatenate(([first_value], np.column_stack((rounding_values, grade_values)).ravel()))

        borders = interleaved(-np.inf, station - tangent_lengths, station + tangent_lengths)
        self._borders = np.maximum.accumulate(borders)[1:]  # touching roundings may cross by a rounding error
        self._bases = interleaved(station[0], station - tangent_lengths, station)
        self._elevations = interleaved(elevation[0], elevation - grades_before * tangent_lengths, elevation)
        self._grades = interleaved(grades_before[0], grades_before, grades_after)
        self._curvatures = interleaved(0.0, curvature, np.zeros_like(curvature))

    def _evaluate(self, station: ArrayLike) -> tuple[Float, Float, Float]:
        """Return elevation (m), grade and curvature (1/m) at stations of any shape; at a border those after it."""
        stations = finite_array("station", station)
        piece = np.searchsorted(self._borders, stations, side="right")
        u, grade, curvature = stations - self._bases[piece], self._grades[piece], self._curvatures[piece]
        # The pieces' parabola z = z0 + u (g + c u / 2) and its slope dz/du = g + c u.
        elevation = self._elevations[piece] + u * (grade + 0.5 * curvature * u)
        slope = grade + curvature * u
        # [()] makes the array of a single station a number.
        return elevation[()], slope[()], curvature[()]

    def elevation(self, station: ArrayLike) -> Float:
        """Return the elevation, m, at stations of any shape; InputError for stations that aren't finite."""
        return self._evaluate(station)[0]

    def grade(self, station: ArrayLike) -> Float:
        """Return the grade dz/ds (m/m, rising positive) at stations of any shape; at a kink that of the side after."""
        return self._evaluate(station)[1]

    def curvature(self, station: ArrayLike) -> Float:
        """Return d2z/ds2, 1/m, positive in a sag, at stations of any shape; at a border that of the side after it."""
        return self._evaluate(station)[2]


def _grades(distances: Float, height_differences: Float) -> Float:
    """Return the grades (P + 1,) before, between and after P points, the outer ones repeated; 0 for one point."""
    if not len(distances):
        return np.zeros(2)
    grades = height_differences / distances
    return np.concatenate((grades[:1], grades, grades[-1:]))
