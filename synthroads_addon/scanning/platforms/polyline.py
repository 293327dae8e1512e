"""Any polyline as what a path follows: its corners are rounded, so that heading and curvature are continuous."""

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float, Index
from ...base.errors import InputError
from ...base.maps.places import Placement
from ...base.rotations import wrap_angle
from ...road.alignment import CURVATURE_LIMIT, Alignment, Element, finite_array
from ...road.axes.centerline import AxisContent
from ...road.profile import IntersectionPoint, Profile
from .guides import Guide

CORNER = 10.0
"""A corner is rounded from this far (m) before it on, or from nearly half way to the nearer neighbouring point. Chosen:
as a car turns in."""
MEASURED = 0.05
"""Points of a measured line nearer than this (m) to the line through the others say nothing of its course. Chosen: what
a smoothed track jitters by."""

_REPEATED = 1e-3
"""Distance of points that are one, m. Chosen: no course is told from less."""


class PolylineGuide(Guide):
    """A polyline whose corners are rounded in plan, so that its heading is continuous.

    Each corner is replaced by two clothoids that begin `CORNER` before it (or at 49 % of the way to the nearer
    neighbouring point) and end as far behind it; heading and curvature are continuous. In height it is straight
    between the corners.

    A measured line that jitters by centimetres has bends of a few metres' radius at points half a metre apart, beside
    which there is no offset line. A tolerance leaves out the points that lie within it of the line through the others
    (Douglas and Peucker 1973).

    Attributes:
        deviation: how far the rounded line is from any point at most, m, in plan.

    Args:
        points: (N, 2) or (N, 3) local coordinates, m; without z the elevation is 0. Points that repeat the one before
            are left out.
        origin: map coordinates of the local origin, m.
        tolerance: m; 0 keeps every point.

    Raises:
        InputError: points that aren't finite, fewer than two distinct ones, or a corner too sharp to be rounded.
    """

    def __init__(self, points: ArrayLike, origin: Sequence[float] = (0.0, 0.0, 0.0), tolerance: float = 0.0) -> None:
        coordinates = finite_array("points", points)
        if coordinates.ndim != 2 or coordinates.shape[1] not in (2, 3):
            raise InputError("points", coordinates.shape, "an array of shape (N, 2) or (N, 3) is needed")
        indices = _thin_points(coordinates, tolerance)
        vertices = coordinates[indices]
        step = np.diff(vertices[:, :2], axis=0)
        chord, heading = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
        turn = wrap_angle(np.diff(heading))
        # Not half of a chord: a straight is left between two corners, however near they are.
        tangent = np.minimum(CORNER, 0.49 * np.minimum(chord[:-1], chord[1:]))
        clothoids = _clothoid_lengths(turn, tangent)
        _refuse_sharp(coordinates, indices, turn, clothoids)
        straights = _straight_lengths(chord, tangent)
        x, y = vertices[0, :2].tolist()
        alignment = Alignment(_elements(straights, turn, clothoids), x, y, float(heading[0]))
        station = _vertex_stations(straights, clothoids)
        height = vertices[:, 2] if vertices.shape[1] == 3 else np.zeros(len(vertices))
        profile = Profile([IntersectionPoint(float(s), float(z)) for s, z in zip(station, height, strict=True)])
        super().__init__(alignment, profile, origin)
        self.deviation = float(np.abs(alignment.project(coordinates[:, :2])[1]).max())

    @classmethod
    def along(
        cls,
        line: AxisContent,
        origin: Sequence[float] | None = None,
        tolerance: float = MEASURED,
        place: Placement | None = None,
    ) -> Self:
        """Return the guide of a file's line.

        Args:
            line: of the file, in map coordinates.
            origin: map coordinates of the local origin, m; the points' mean to the metre if not given.
            tolerance: m, see the class.
            place: the map's coordinate system, see `read_axis`.

        Raises:
            InputError: the line is elsewhere than the map, or has a corner too sharp to be rounded.
        """
        points = line.placed(place or Placement())
        base = np.round(points.mean(axis=0)) if origin is None else np.array(origin, dtype=np.float64)
        return cls(points - base, base.tolist(), tolerance)


def _thin_points(points: Float, tolerance: float) -> Index:
    """Return the indices of the points that are kept: without repetitions, thinned to a tolerance (m) in 3D.

    Thinning is that of Douglas and Peucker (1973): of a stretch between two kept points the point that lies farthest
    from their chord is kept as well if it is farther than the tolerance, and so on for both parts.
    """
    is_distinct = np.concatenate(([True], np.hypot(*np.diff(points[:, :2], axis=0).T) > _REPEATED))[: len(points)]
    distinct_points = np.flatnonzero(is_distinct)
    if len(distinct_points) < 2:
        raise InputError("points", len(points), "at least two points, more than 1 mm apart in plan, are needed")
    if tolerance <= 0.0:
        return distinct_points
    line, keep_mask = points[distinct_points], np.zeros(len(distinct_points), dtype=bool)
    keep_mask[[0, -1]] = True
    stretches = [(0, len(distinct_points) - 1)]
    while stretches:
        begin, end = stretches.pop()
        chord, offsets = line[end] - line[begin], line[begin + 1 : end] - line[begin]
        if not len(offsets):
            continue
        share = np.clip(offsets @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
        distance = np.linalg.norm(offsets - share[:, None] * chord, axis=1)
        farthest_row = int(distance.argmax())
        if distance[farthest_row] > tolerance:
            middle = begin + 1 + farthest_row
            keep_mask[middle] = True
            stretches += [(begin, middle), (middle, end)]
    return distinct_points[keep_mask]


def _clothoid_lengths(turn: Float, reach: Float) -> Float:
    """Return the length (C,), m, of either clothoid at corners.

    With the deflection f = |turn| / 2 and unit length, one clothoid ends at x = int cos(f u^2), y = int sin(f u^2); the
    tangent from the corner is x + y tan(f) long.

    Args:
        turn: (C,) at the corners, rad.
        reach: (C,) how far before the corner the first clothoid begins, m.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    # Gauss and Legendre's rule of 20 nodes on 0 to 1 is exact to rounding for any turn that isn't refused.
    angle = np.abs(turn)[:, None] / 2.0 * ((nodes + 1.0) / 2.0) ** 2
    x, y = np.cos(angle) @ weights / 2.0, np.sin(angle) @ weights / 2.0
    half_turn = np.abs(turn) / 2.0
    return np.asarray(reach / (x + y * np.tan(half_turn)))


def _refuse_sharp(points: Float, point_indices: Index, turn: Float, lengths: Float) -> None:
    """Raise `InputError`, naming the point, if a corner is too sharp to be rounded.

    Args:
        points: (N, 2 or 3) of the line.
        point_indices: (C + 2,) those that are kept.
        turn: (C,) at the corners between, rad.
        lengths: (C,) of the clothoids that round them, m.
    """
    is_sharp = (np.abs(turn) > CURVATURE_LIMIT * lengths) | (np.abs(turn) > np.deg2rad(170.0))
    if not is_sharp.any():
        return
    corner = int(np.argmax(is_sharp))
    index = int(point_indices[corner + 1])
    degrees = abs(float(np.rad2deg(turn[corner])))
    requirement = (
        f"the line turns by {degrees:.0f} degrees here, too sharply to be rounded with a radius of 1 m or more"
    )
    raise InputError(f"points[{index}]", [float(value) for value in points[index]], requirement)


def _straight_lengths(chord: Float, tangent: Float) -> Float:
    """Return the lengths (C + 1,), m, of the straights: what the corners' tangents at both ends leave of the chords."""
    return chord - np.concatenate(([0.0], tangent)) - np.concatenate((tangent, [0.0]))


def _vertex_stations(straights: Float, clothoids: Float) -> Float:
    """Return the stations (C + 2,), m, of the line's ends, and of the corners between: each between its clothoids."""
    # Of each straight's end: all straights up to it, and two clothoids at each corner before.
    ends = np.cumsum(straights) + np.concatenate(([0.0], np.cumsum(2.0 * clothoids)))
    ends[:-1] += clothoids
    return np.concatenate(([0.0], ends))


def _elements(straights: Float, turn: Float, clothoids: Float) -> list[Element]:
    """Return the alignment's elements: straights, and two clothoids at each corner between them."""
    elements = [Element(float(straights[0]), 0.0, 0.0)]
    for angle, length, straight in zip(turn, clothoids, straights[1:], strict=True):
        # Either clothoid turns by half the angle: k length / 2 = angle / 2.
        curvature = float(angle / length)
        elements.append(Element(float(length), 0.0, curvature))
        elements.append(Element(float(length), curvature, 0.0))
        elements.append(Element(float(straight), 0.0, 0.0))
    return elements
