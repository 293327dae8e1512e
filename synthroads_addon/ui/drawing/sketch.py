"""A tangent polygon while it is drawn: its points and radii, its handles, and what is shown of it. Free of Blender."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.schema import round_value
from ...checking.checker import RULES
from ...fitting.tangents import Corner, TangentAxis, radius_at_distance, snapped_point
from ...jobs.drawn_axis import DrawnAxis, curve_rule, rounded_axis, tangents_of
from ...scenario.road import RoadScenario

_STEP = 1.1
"""Factor by which one turn of the wheel changes a radius. Chosen: seven turns double it."""
_SPACING = 5.0
"""Distance of the points by which an element is shown, m."""
_MILLIMETRE = 3
"""Decimals of a point's coordinates in m: what the view's own numbers keep within some kilometres."""


class Handle(NamedTuple):
    """Handle of a sketch that the mouse can take hold of: a point, or the middle of the curve at it."""

    kind: Literal["point", "radius"]
    number: int
    place: tuple[float, float]


class ShownElement(NamedTuple):
    """An element of the axis as it is shown: its kind, and points (N, 2) along it, m."""

    kind: str
    points: Float


@dataclass
class Sketch:
    """A tangent polygon in the making.

    Attributes:
        scenario: limits whose design class gives clothoids and radii.
        points: (x, y) of the polygon, m.
        radii: of its points, m; 0 takes the rule's. Those of the first and the last one have no effect.
        height: of all points, m.
        refusal: why the last change wasn't made; empty if it was.
    """

    scenario: RoadScenario
    points: list[tuple[float, float]] = field(default_factory=list)
    radii: list[float] = field(default_factory=list)
    height: float = 0.0
    refusal: str = ""

    def add(self, point: Float, snaps: bool = False) -> bool:
        """Add a point (2,) behind the last one; return whether the tangents can be rounded with it."""
        place = self.snapped(point) if snaps else point
        rounded = (round_value(place[0], _MILLIMETRE), round_value(place[1], _MILLIMETRE))
        return self._take([*self.points, rounded], [*self.radii, 0.0])

    def snapped(self, point: Float) -> Float:
        """Return a point (2,) snapped to angle and length from the last one; itself where there is none yet."""
        if not self.points:
            return point
        before = np.array(self.points[-2]) if len(self.points) > 1 else None
        return snapped_point(point, np.array(self.points[-1]), before)

    def remove_last(self) -> None:
        """Take the last point away, if there is one."""
        if self.points:
            self._take(self.points[:-1], self.radii[:-1])

    def move(self, number: int, point: Float) -> bool:
        """Move a point to another place (2,); return whether the tangents can be rounded then."""
        moved = list(self.points)
        moved[number] = (round_value(point[0], _MILLIMETRE), round_value(point[1], _MILLIMETRE))
        return self._take(moved, list(self.radii))

    def drag_radius(self, number: int, point: Float, whole: bool = False) -> bool:
        """Have the curve at a point pass through a place (2,) on its bisector; return whether that can be.

        Args:
            number: of the polygon's point.
            point: where the handle is dragged.
            whole: to steps of 10 m.
        """
        axis, corner = self.axis(), self._corner(number)
        if axis is None or corner is None or not corner.radius:
            return False
        vertex = np.array(self.points[number])
        inward = _middle(axis, corner) - vertex
        distance = float((point - vertex) @ inward / max(float(np.hypot(*inward)), 1e-9))
        radius = radius_at_distance(max(distance, 0.0), corner.turn, curve_rule(self.scenario))
        return self.set_radius(number, max(round(radius, -1), 10.0) if whole else round_value(radius, 1))

    def turn_wheel(self, number: int, steps: int) -> bool:
        """Enlarge the radius at a point by a tenth for each step, or lessen it; return whether that can be."""
        corner = self._corner(number)
        if corner is None or not corner.radius:
            return False
        return self.set_radius(number, round_value(corner.radius * _STEP**steps, 0))

    def set_radius(self, number: int, radius: float) -> bool:
        """Set the radius (m) of the curve at a point, 0 for the rule's; return whether the tangents hold one."""
        radii = list(self.radii)
        radii[number] = radius
        return self._take(list(self.points), radii)

    def axis(self, further: Float | None = None) -> TangentAxis | None:
        """Return the axis of the points, and of one more (2,) if it is given; None where they have none."""
        points, radii = list(self.points), list(self.radii)
        if further is not None:
            points, radii = [*points, (float(further[0]), float(further[1]))], [*radii, 0.0]
        try:
            return self._axis_of(points, radii)
        except InputError:
            return None

    def drawn(self, further: Float | None = None) -> DrawnAxis | None:
        """Return the axis with its deviation and the rules that it breaks; None where there is none yet."""
        points, radii = list(self.points), list(self.radii)
        if further is not None:
            points, radii = [*points, (float(further[0]), float(further[1]))], [*radii, 0.0]
        if len(points) < 2:
            return None
        places = np.column_stack([np.array(points), np.full(len(points), self.height)])
        try:
            return rounded_axis(places, radii[1:-1], self.scenario)
        except InputError:
            return None

    def handles(self) -> list[Handle]:
        """Return what can be taken hold of: the points, and the curves' middles."""
        found = [Handle("point", number, point) for number, point in enumerate(self.points)]
        axis = self.axis()
        if axis is None:
            return found
        for corner in axis.corners:
            if corner.radius:
                x, y = _middle(axis, corner).tolist()
                found.append(Handle("radius", corner.number, (x, y)))
        return found

    def to_text(self) -> str:
        """Return points, heights and radii as JSON text: rows of x, y, z, radius, m."""
        rows = zip(self.points, self.radii, strict=True)
        return json.dumps([[*point, self.height, radius] for point, radius in rows])

    def _corner(self, number: int) -> Corner | None:
        axis = self.axis()
        return next((corner for corner in axis.corners if corner.number == number), None) if axis else None

    def _axis_of(self, points: list[tuple[float, float]], radii: list[float]) -> TangentAxis | None:
        return tangents_of(points, radii[1:-1], self.scenario) if len(points) > 1 else None

    def _take(self, points: list[tuple[float, float]], radii: list[float]) -> bool:
        """Take other points and radii, if the tangents can be rounded; return whether."""
        try:
            self._axis_of(points, radii)
        except InputError as error:
            self.refusal = f"Point {error.value} {error.allowed}" if error.field == "point" else str(error)
            return False
        self.points, self.radii, self.refusal = points, radii, ""
        return True


def _middle(axis: TangentAxis, corner: Corner) -> Float:
    """Return the middle (2,) of a corner's curve, m."""
    return axis.alignment.position((corner.start + corner.end) / 2.0)


def shown_elements(axis: TangentAxis) -> list[ShownElement]:
    """Return an axis' elements as lines of points (N, 2), to be drawn."""
    shown = []
    starts = axis.alignment.element_starts
    for element, start in zip(axis.alignment.elements, starts[:-1].tolist(), strict=True):
        count = 2 if element.kind == "line" else max(2, int(np.ceil(element.length / _SPACING)) + 1)
        points = axis.alignment.position(start + np.linspace(0.0, element.length, count))
        shown.append(ShownElement(element.kind, points))
    return shown


def radius_text(corner: Corner) -> str:
    """Return what is written at a curve: its radius and clothoid, and the wanted radius where there's no room for it.

    Example:
        >>> radius_text(Corner(1, 0.5, 900.0, 640.0, 100.0, 0.0, 0.0))
        'R 640 m (900 m has no room), A 253 m'
    """
    parameter = (corner.clothoid * corner.radius) ** 0.5
    wanted = f" ({corner.wanted_radius:.0f} m has no room)" if corner.is_reduced else ""
    return f"R {corner.radius:.0f} m{wanted}, A {parameter:.0f} m"


def state_text(drawn: DrawnAxis | None) -> str:
    """Return lines on a sketch in words: its length and elements, its deviation, and each rule that it breaks."""
    if drawn is None:
        return "Click the next point"
    names = list(dict.fromkeys(RULES[violation.rule].title for violation in drawn.violations))
    rules = [f"Breaks: {name}" for name in names] or ["Keeps the rules of the centreline"]
    return "\n".join([f"{drawn.axis.length:,.1f} m, {drawn.text}", *rules])
