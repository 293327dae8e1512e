"""Tangent polygons: points whose straight connections are a road's tangents, rounded by clothoids and arcs.

At each inner point the tangents turn by an angle a. The curve there is a clothoid of length L, an arc of radius R and
the same clothoid backwards. With the clothoid's turn t = L / 2R, its end at (X, Y) and the shift s = Y - R (1 - cos t),
the curve takes of both tangents

    T = (R + s) tan(a / 2) + X - R sin t,

its arc is R a - L long, and it passes the point at the distance (R + s) / cos(a / 2) - R (RAA, RAS-L). The elements are
exactly these: nothing is fitted by iteration but the radius that still has room.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.schema import round_value
from ..road.alignment import Alignment, Element, finite_array
from ..road.crossfall import run_off_length
from ..road.guidelines import LIMITS

LEAST_RADIUS = 10.0
"""Smallest radius of a drawn curve, m: the sharpest curvature that a parameter set may have is 0.1 1/m."""
WIDEST_RADIUS = 5000.0
"""Largest radius that is proposed for flat angles, m. Chosen: as for roads that are drawn from a seed."""
SNAP_DEGREES, SNAP_LENGTH = 15.0, 10.0
"""Steps of the angle (degrees) and length (m) of a tangent that snaps."""
_STRAIGHT_ON = 1e-6
"""Angle (rad) between two tangents below which there is no curve: 1 mm of deviation on 1 km."""
_LEAST_TANGENT = 0.01
"""Shortest distance of two points, m. Chosen: a centimetre is a double click."""
_SPACE = 1e-6
"""Length (m) of a straight between two curves that touch which is left out."""
_TERMS = 10
"""Terms of a clothoid's series. A clothoid turns by 0.5 rad at most: the tenth is below 1e-20."""
_HALVINGS = 50
"""Halvings of the span in which a radius is looked for: a span of 100 km becomes less than 1e-9 m."""


@dataclass(frozen=True)
class CurveRule:
    """Rules by which curves are rounded: those of a design class, for a carriageway's width.

    Attributes:
        design_class: of the RAA, e.g. EKA1A.
        half_width: distance from the rotation axis to the pavement's edge, m: it decides the run-off's length.
    """

    design_class: str
    half_width: float

    @property
    def least_radius(self) -> float:
        """Return the smallest radius of the design class, m."""
        return LIMITS[self.design_class].radius

    @property
    def shortest_arc(self) -> float:
        """Return the shortest arc, m: two seconds of travel."""
        return 2.0 * LIMITS[self.design_class].speed / 3.6

    def usual_clothoid(self, radius: float) -> float:
        """Return the length (m) of a clothoid to a radius (m): A from R/3 to R, not below the class's, run-off held."""
        parameter = max(LIMITS[self.design_class].clothoid, radius / 3.0)
        run_off = run_off_length(self.design_class, self.half_width, 0.0, 1.0 / radius)
        return min(max(parameter**2 / radius, run_off), radius)  # A <= R

    def clothoid(self, radius: float, turn: float) -> float:
        """Return the length (m) of both clothoids of a curve that turns by an angle (rad) with a radius (m).

        It is the usual one where that leaves the shortest arc, else shorter, but at least half of the curve's turn is
        by clothoids.
        """
        space = abs(turn) * radius
        return min(self.usual_clothoid(radius), max(space - self.shortest_arc, 0.5 * space))

    def usual_radius(self, turn: float) -> float:
        """Return the radius (m) proposed for a turn (rad): the class's smallest, for flat angles a larger one.

        Flat angles need larger radii for their clothoids and the shortest arc.
        """
        for radius in np.geomspace(self.least_radius, max(WIDEST_RADIUS, self.least_radius), 60).tolist():
            if abs(turn) * radius - self.usual_clothoid(radius) >= self.shortest_arc:
                return float(math.ceil(radius / 10.0 - 1e-9) * 10.0)
        return max(WIDEST_RADIUS, self.least_radius)


@dataclass(frozen=True)
class Corner:
    """The curve at an inner point of a tangent polygon.

    Attributes:
        number: of the point, counted from 0, the polygon's first point.
        turn: angle between the tangents, rad, positive to the left.
        wanted_radius: radius that was given or proposed, m; 0 where the tangents go straight on.
        radius: radius that the tangents have room for, at most the wanted one, m.
        clothoid: length of each clothoid, m.
        tangent: length that the curve takes of both tangents, m.
        distance: from the point to the axis, m.
        start, end: stations of the curve's ends, m.
    """

    number: int
    turn: float
    wanted_radius: float
    radius: float
    clothoid: float
    tangent: float
    distance: float
    start: float = 0.0
    end: float = 0.0

    @property
    def is_reduced(self) -> bool:
        """Return whether the tangents don't hold the wanted radius."""
        return self.radius < self.wanted_radius - 1e-6


@dataclass(frozen=True)
class TangentAxis:
    """The axis of a tangent polygon.

    Attributes:
        alignment: lines, clothoids and arcs from the first point to the last one.
        corners: the curves at the inner points, in order.
    """

    alignment: Alignment
    corners: tuple[Corner, ...]

    @property
    def deviation(self) -> float:
        """Return the largest distance of a point from the axis, m; the ends are on it."""
        return max((corner.distance for corner in self.corners), default=0.0)


def tangent_axis(points: ArrayLike, radii: Sequence[float | None], rule: CurveRule) -> TangentAxis:
    """Return the axis of a tangent polygon.

    A radius that isn't given is the rule's usual one. Where two curves need more than the tangent between them, each
    gets half of it, what the other one leaves, or what its smallest radius needs.

    Args:
        points: (N, 2) of the polygon, m, N >= 2.
        radii: of the N - 2 curves at the inner points, m; None or 0 takes the rule's.
        rule: by which clothoids and radii are chosen.

    Raises:
        InputError: fewer than two points, two at one place, a number of radii that isn't N - 2, or a turn so sharp that
            its tangents don't hold a radius of `LEAST_RADIUS`.

    Example:
        >>> rule = CurveRule("EKA1A", half_width=12.0)
        >>> axis = tangent_axis([[0, 0], [800, 0], [1400, 500]], [None], rule)
        >>> [element.kind for element in axis.alignment.elements]
        ['line', 'clothoid', 'arc', 'clothoid', 'line']
        >>> axis.corners[0].radius, round(axis.deviation, 2)
        (900.0, 57.66)
    """
    polygon = finite_array("points", points)
    if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 2:
        raise InputError("points", polygon.shape, "two points or more are needed, an array of shape (N, 2)")
    if len(radii) != len(polygon) - 2:
        raise InputError("radii", len(radii), f"one for each inner point is needed: {len(polygon) - 2}")
    legs = np.diff(polygon, axis=0)
    lengths = np.hypot(*legs.T)
    if lengths.min() < _LEAST_TANGENT:
        raise InputError("point", int(lengths.argmin()) + 2, "lies on the point before it: put it elsewhere")
    headings = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
    turns = np.diff(headings)
    wanted = [_wanted_radius(radius, turn, rule) for radius, turn in zip(radii, turns.tolist(), strict=True)]
    corners = _corners(turns, wanted, _rooms(lengths, turns, wanted, rule), rule)
    return _chain(polygon[0], float(headings[0]), lengths, corners)


def _wanted_radius(radius: float | None, turn: float, rule: CurveRule) -> float:
    """Return the radius (m) that a curve is to have: the given one, else the rule's; 0 where nothing turns."""
    if abs(turn) < _STRAIGHT_ON:
        return 0.0
    return max(float(radius), LEAST_RADIUS) if radius else rule.usual_radius(turn)


def _rooms(lengths: Float, turns: Float, wanted: list[float], rule: CurveRule) -> Float:
    """Return what each curve may take of both its tangents (N - 2,), m.

    Args:
        lengths: (N - 1,) of the tangents, m.
        turns: (N - 2,) at the inner points, rad.
        wanted: N - 2 radii, m.
        rule: by which clothoids are chosen.

    Raises:
        InputError: a tangent is too short for the smallest radius, even by itself.
    """
    rows = list(zip(wanted, turns.tolist(), strict=True))
    needs = np.array([tangent_length(radius, turn, rule) if radius else 0.0 for radius, turn in rows])
    least = [tangent_length(LEAST_RADIUS, turn, rule) if radius else 0.0 for radius, turn in rows]
    for number, (turn, length) in enumerate(zip(turns.tolist(), least, strict=True), 1):
        room = float(lengths[number - 1 : number + 1].min())
        if length > room:
            raise _too_sharp(number, turn, room)
    least_lengths = np.concatenate(([0.0], np.minimum(needs, least), [0.0]))
    around = np.concatenate(([0.0], needs, [0.0]))

    def shares(end: slice, other: slice) -> Float:
        """Return what the curves at one end of the tangents may take of them (N - 1,), m."""
        half = np.clip(
            0.5 * lengths, least_lengths[end], np.maximum(lengths - least_lengths[other], least_lengths[end])
        )
        return np.maximum(half, lengths - around[other])

    before, after = shares(slice(1, None), slice(-1)), shares(slice(-1), slice(1, None))
    rooms = np.concatenate(([0.0], np.minimum(needs, np.minimum(before[:-1], after[1:])), [0.0]))
    for i, need in enumerate(needs.tolist(), 1):
        rooms[i] = max(min(need, lengths[i - 1] - rooms[i - 1], lengths[i] - rooms[i + 1]), 0.0)
    return rooms[1:-1]


def _corners(turns: Float, wanted: list[float], rooms: Float, rule: CurveRule) -> list[Corner]:
    """Return the curves at the inner points, without their stations.

    Raises:
        InputError: tangents turn too sharply.
    """
    corners = []
    for number, (turn, radius, room) in enumerate(zip(turns.tolist(), wanted, rooms.tolist(), strict=True), 1):
        if not radius:
            corners.append(Corner(number, turn, 0.0, 0.0, 0.0, 0.0, 0.0))
            continue
        held = largest_curve(radius, turn, room, rule)
        if held is None:
            raise _too_sharp(number, turn, room)
        shape = (_written(held[0]), turn, held[1])
        corners.append(Corner(number, turn, radius, *held, _tangent_of(*shape), _distance_of(*shape)))
    return corners


def _too_sharp(number: int, turn: float, room: float) -> InputError:
    """Return the error of a point (counted from 0) whose turn (rad) has too little room (m) on its tangents."""
    allowed = f"turns by {abs(math.degrees(turn)):.0f} degrees and has {room:.1f} m of its tangents for that"
    text = f"{allowed}, too little for a radius of {LEAST_RADIUS:g} m: put it, or the next point, farther away"
    return InputError("point", number + 1, text)


def largest_curve(wanted: float, turn: float, room: float, rule: CurveRule) -> tuple[float, float] | None:
    """Return the largest radius up to a wanted one, and its clothoids' length, that a room on both tangents holds, m.

    A radius that is smaller than the wanted one is cut to whole metres, below 100 m to decimetres, and the clothoids
    are lengthened by what that leaves: so the curve takes all of its room, and no straight of some centimetres is left
    before the next one. Where that would take the arc below its least length, or by more than a tenth where it is
    shorter already, or the clothoid's A above R, the radius isn't cut.

    Returns:
        radius and length of each clothoid, m; None where not even `LEAST_RADIUS` has room.
    """
    allowed = room + 1e-9
    if tangent_length(wanted, turn, rule) <= allowed:
        return wanted, rule.clothoid(wanted, turn)
    if tangent_length(LEAST_RADIUS, turn, rule) > allowed:
        return None
    largest = _largest(LEAST_RADIUS, wanted, lambda radius: tangent_length(radius, turn, rule) <= allowed)
    step = 1.0 if largest >= 100.0 else 0.1
    cut = round(max(math.floor(largest / step) * step, LEAST_RADIUS), 1)
    exact, shortest = _written(cut), rule.clothoid(cut, turn)
    arc = abs(turn) * exact - shortest
    least_arc = rule.shortest_arc if arc >= rule.shortest_arc - 1e-6 else 0.9 * arc
    longest = min(cut, shortest + arc - least_arc)  # A <= R
    if _tangent_of(exact, turn, shortest) <= allowed and _tangent_of(exact, turn, longest) >= room:
        return cut, _largest(shortest, longest, lambda length: _tangent_of(exact, turn, length) <= room)
    # the clothoids take what rounding of the curvature adds or leaves
    exact, usual = _written(largest), rule.clothoid(largest, turn)
    rounding = usual * 1e-6
    return largest, _largest(
        usual - rounding, usual + rounding, lambda length: _tangent_of(exact, turn, length) <= room
    )


def _largest(low: float, high: float, fits: Callable[[float], bool]) -> float:
    """Return the largest value between a low one that fits and a high one, found by halving."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def tangent_length(radius: float, turn: float, rule: CurveRule) -> float:
    """Return what the curve of a radius (m) takes of both tangents that turn by an angle (rad), m."""
    return _tangent_of(_written(radius), turn, rule.clothoid(radius, turn))


def radius_at_distance(distance: float, turn: float, rule: CurveRule) -> float:
    """Return the radius (m) whose curve passes the point at which its tangents meet at a distance (m).

    It is what a handle on the curve sets. The radius is between `LEAST_RADIUS` and 100 km.

    Example:
        >>> rule = CurveRule("EKA1A", half_width=12.0)
        >>> corner = tangent_axis([[0, 0], [900, 0], [1500, 500]], [1000.0], rule).corners[0]
        >>> round(radius_at_distance(corner.distance, corner.turn, rule), 3)
        1000.0
    """

    def is_nearer(radius: float) -> bool:
        return _distance_of(radius, turn, rule.clothoid(radius, turn)) <= distance

    return _largest(LEAST_RADIUS, 1e5, is_nearer)


def _clothoid_end(length: float, radius: float) -> tuple[float, float]:
    """Return the end (m) of a clothoid along and across the tangent that it begins at."""
    turn = length / (2.0 * radius)
    x = y = 0.0
    # X = L sum (-1)^n t^(2n) / ((4n + 1) (2n)!), Y = L sum (-1)^n t^(2n + 1) / ((4n + 3) (2n + 1)!)
    for n in range(_TERMS):
        sign = -1.0 if n % 2 else 1.0
        x += sign * turn ** (2 * n) / ((4 * n + 1) * math.factorial(2 * n))
        y += sign * turn ** (2 * n + 1) / ((4 * n + 3) * math.factorial(2 * n + 1))
    return length * x, length * y


def _shift_and_middle(radius: float, length: float) -> tuple[float, float]:
    """Return a clothoid's shift of the arc from the tangent, and where along the tangent the arc's middle is, m."""
    x, y = _clothoid_end(length, radius)
    turn = length / (2.0 * radius)
    return y - radius * (1.0 - math.cos(turn)), x - radius * math.sin(turn)


def _tangent_of(radius: float, turn: float, clothoid: float) -> float:
    """Return T = (R + s) tan(a / 2) + X - R sin t, m, see above."""
    shift, middle = _shift_and_middle(radius, clothoid)
    return (radius + shift) * math.tan(0.5 * abs(turn)) + middle


def _distance_of(radius: float, turn: float, clothoid: float) -> float:
    """Return the distance (R + s) / cos(a / 2) - R of a curve from the point where its tangents meet, m."""
    return (radius + _shift_and_middle(radius, clothoid)[0]) / math.cos(0.5 * turn) - radius


def _written(radius: float) -> float:
    """Return a radius (m) as a parameter set has it, which keeps 12 decimals of its curvature."""
    return 1.0 / round_value(1.0 / radius, 12)


def _chain(start: Float, heading: float, lengths: Float, corners: list[Corner]) -> TangentAxis:
    """Return the axis that begins at a point (2,) with a heading (rad): straights of the tangents, and the curves."""
    elements: list[Element] = []
    placed: list[Corner] = []
    station, taken = 0.0, 0.0

    def add(length: float, curvature_start: float, curvature_end: float) -> None:
        nonlocal station
        ends = round_value(curvature_start, 12), round_value(curvature_end, 12)
        if elements and ends == (0.0, 0.0) == (elements[-1].curvature_start, elements[-1].curvature_end):
            elements[-1] = Element(elements[-1].length + length, 0.0, 0.0)
        else:
            elements.append(Element(length, *ends))
        station += length

    for corner, length in zip(corners, lengths[:-1].tolist(), strict=True):
        straight = length - taken - corner.tangent
        if straight > _SPACE:
            add(straight, 0.0, 0.0)
        begin, taken = station, corner.tangent
        if corner.radius:
            radius = _written(corner.radius)
            curvature = math.copysign(1.0 / radius, corner.turn)
            add(corner.clothoid, 0.0, curvature)
            add(abs(corner.turn) * radius - corner.clothoid, curvature, curvature)
            add(corner.clothoid, curvature, 0.0)
        placed.append(replace(corner, start=begin, end=station))
    if lengths[-1] - taken > _SPACE:
        add(float(lengths[-1]) - taken, 0.0, 0.0)
    return TangentAxis(Alignment(elements, float(start[0]), float(start[1]), heading), tuple(placed))


def snapped_point(point: Float, last: Float, before: Float | None = None) -> Float:
    """Return a point (2,) whose tangent from the last one snaps to an angle and a length.

    Args:
        point: (2,) where the mouse is, m.
        last: (2,) the polygon's last point, m.
        before: (2,) the point before it, from whose tangent the angle counts; from the x axis if None.

    Example:
        >>> import numpy as np
        >>> snapped_point(np.array([103.0, 2.0]), np.array([0.0, 0.0])).tolist()
        [100.0, 0.0]
    """
    leg = point - last
    origin = 0.0 if before is None else float(np.arctan2(*(last - before)[::-1]))
    step = math.radians(SNAP_DEGREES)
    angle = origin + round((float(np.arctan2(leg[1], leg[0])) - origin) / step) * step
    length = max(1.0, round(float(np.hypot(*leg)) / SNAP_LENGTH)) * SNAP_LENGTH
    return last + length * np.array([math.cos(angle), math.sin(angle)])
