"""Bodies of what stands at one place, as extrusions, in a driver's frame.

The frame's origin is the foot; x points away from the driver whom the object faces, y to the driver's left, z up. An
object's rotation about the vertical turns its body within its placement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...road.things.sign_outline import SIGN_OUTLINES
from .entities import Entity, IfcFile, short

Point2 = tuple[float, float]
Point3 = tuple[float, float, float]


class Solids:
    """Makes extrusions that are turned about the vertical by an angle (rad).

    What has no extent along one of its axes, as the post of a gantry whose beam lies below the post's foot, has no
    body: None.
    """

    def __init__(self, ifc: IfcFile, turn: float = 0.0) -> None:
        self.ifc = ifc
        self._turn = turn

    def box(self, size: Point3, foot: Point3) -> Entity | None:
        """Add a box of a size along x, y and z; ``foot`` is the middle of its underside."""
        if _flat(*size):
            return None
        axes = self.ifc.add("IfcAxis2Placement2D", self.ifc.point(0.0, 0.0), None)
        profile = self.ifc.add("IfcRectangleProfileDef", "AREA", None, axes, *short(size[:2]))
        return self._upwards(profile, foot, size[2])

    def cylinder(self, diameter: float, foot: Point3, height: float) -> Entity | None:
        """Add an upright cylinder."""
        if _flat(diameter / 2.0, height):
            return None
        axes = self.ifc.add("IfcAxis2Placement2D", self.ifc.point(0.0, 0.0), None)
        profile = self.ifc.add("IfcCircleProfileDef", "AREA", None, axes, short(diameter / 2.0))
        return self._upwards(profile, foot, height)

    def prism(self, outline: Sequence[Point2], foot: Point3, height: float) -> Entity | None:
        """Add an upright prism over an outline in x and y around its foot."""
        if _flat(height):
            return None
        return self._upwards(self._outline(outline), foot, height)

    def plate(self, shape: str, width: float, height: float, middle: Point3, thickness: float) -> Entity | None:
        """Add an upright plate that faces the driver; ``middle`` is that of its back."""
        if _flat(width / 2.0, height / 2.0, thickness):
            return None
        ifc = self.ifc
        if shape not in SIGN_OUTLINES:
            axes = ifc.add("IfcAxis2Placement2D", ifc.point(0.0, 0.0), None)
            half = short((width / 2.0, height / 2.0))
            profile = ifc.add("IfcEllipseProfileDef", "AREA", None, axes, *half)
        else:
            profile = self._outline([(u * width, v * height) for u, v in SIGN_OUTLINES[shape]])
        # The profile's x runs to the driver's right, its y up; it is extruded towards the driver.
        towards = self._direction(-1.0, 0.0)
        right = self._direction(0.0, -1.0)
        return self._extruded(profile, middle, (towards, right), thickness)

    def _upwards(self, profile: Entity, foot: Point3, height: float) -> Entity:
        return self._extruded(profile, foot, (self.ifc.direction(0.0, 0.0, 1.0), self._direction(1.0, 0.0)), height)

    def _outline(self, points: Sequence[Point2]) -> Entity:
        corners = self.ifc.add("IfcCartesianPointList2D", short([*points, points[0]]))
        curve = self.ifc.add("IfcIndexedPolyCurve", corners, None, False)
        return self.ifc.add("IfcArbitraryClosedProfileDef", "AREA", None, curve)

    def _direction(self, x: float, y: float) -> Entity:
        return self.ifc.direction(*self._turned(x, y), 0.0)

    def _turned(self, x: float, y: float) -> Point2:
        cosine, sine = math.cos(self._turn), math.sin(self._turn)
        return cosine * x - sine * y, sine * x + cosine * y

    def _extruded(self, profile: Entity, place: Point3, axes: tuple[Entity, Entity], depth: float) -> Entity:
        """Extrude a profile along the first of two axes; the second is the profile's x."""
        x, y, z = place
        position = self.ifc.add("IfcAxis2Placement3D", self.ifc.point(*self._turned(x, y), z), *axes)
        return self.ifc.add("IfcExtrudedAreaSolid", profile, position, self.ifc.direction(0.0, 0.0, 1.0), short(depth))


def _flat(*lengths: float) -> bool:
    """Return whether one of some lengths (m) isn't positive as it would be written."""
    return min(short(lengths)) <= 0.0
