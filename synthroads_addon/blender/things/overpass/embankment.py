"""SR Bridge Embankment: the embankment behind an abutment, its cones around the wing walls, and the road on it."""

from __future__ import annotations

import math

from ....base.classes import class_id
from ....road.things.overpass import Overpass
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres, number, socket
from ...nodes.solids import flip_faces, paint_faces

_GRADE = 0.05
"""Fall of the crossing road behind the wing walls (m/m); chosen."""
_ROUNDING = 15.0
"""Length over which the fall begins, m; chosen."""
_CONE, _EDGE = 7, 24
"""Columns of points of a cone, and along the embankment's edge."""
_BURIED = 0.4
"""Depth to which a slope goes on below the ground, m; chosen."""
_UNDER_WALL = 0.3
"""Overlap of the crown with the wing walls, m; chosen."""


class _Bank(Inputs):
    ground = socket("Geometry", "Surface that the slopes fall to")
    face = metres(20.0, (-300.0, 300.0), "x of the abutment's face")
    side = number(1.0, (-1.0, 1.0), "+1 if the embankment runs along +x, -1 if along -x")
    wing_length = metres(8.0, (0.5, 50.0), "Length of the wing walls, from the face")
    length = metres(40.0, (1.0, 500.0), "End of the embankment, from the face")
    top = metres(6.0, (-100.0, 100.0), "z of the deck's surface")
    width = metres(10.0, (2.0, 60.0), "Width of its crown along y")
    edge_width = metres(0.8, (0.1, 5.0), "Width beside the pavement, on either side")
    shear = number(0.0, (-3.0, 3.0), "Move in y per metre of x: the bridge's skew")
    slope = number(1.5, (0.5, 10.0), "Run of the slopes per metre of height (m/m)")
    pavement_material = material_of("the crossing road")
    ground_material = material_of("the slopes")

    def crown(self, distance: Value, y: Value) -> Value:
        """Add nodes for the crown's point at a distance (m) behind the abutment's face, at y (m) from its middle."""
        x = self.face + self.side * distance
        wall_distance = op.maximum(distance - self.wing_length, 0.0)
        z = self.top - wall_distance * wall_distance * _GRADE / (wall_distance + _ROUNDING)
        return op.vector(self.tree, x, y + x * self.shear, z)

    def fall_direction(self, side: float, angle: Value, share: Value) -> Value:
        """Add nodes for the horizontal unit direction in which the slope of one side (`side` +1 or -1) falls.

        It is perpendicular to the embankment; in the cones it is rotated towards the bridge by an angle (rad). With the
        share of the way to the embankment's end it turns to +-y within the slope's plane, as the end is parallel to y.
        """
        norm = op.unary("SQRT", self.shear * self.shear + 1.0)
        axis_direction = op.vector(self.tree, 1.0, self.shear, 0.0) * (1.0 / norm)
        side_direction = op.vector(self.tree, -self.shear, 1.0, 0.0) * (side / norm)
        rotated = side_direction * op.unary("COSINE", angle) + axis_direction * (-self.side * op.unary("SINE", angle))
        return rotated + axis_direction * (self.shear * side * share)


@makes_group("SR Bridge Embankment")
def bridge_embankment_group(tree: Tree) -> None:
    """An embankment from an abutment outwards, falling from the deck's level, with slopes down to the ground."""
    bank = _Bank(tree)
    with tree.frame("Crown: verge, pavement, verge"):
        crown = _crown(tree, bank)
    slopes = []
    for name, side in (("left", 1.0), ("right", -1.0)):
        with tree.frame(f"Slope on the {name}, and the cone around the wing wall"):
            slopes.append(_slope(tree, bank, side))
    with tree.frame("End"):
        end = _end(tree, *slopes)
        end_face = op.switch(bank.side > 0.0, flip_faces(end), end)
    with tree.frame("Labels"):
        earth = op.store(
            paint_faces(op.join(*slopes, end_face), bank.ground_material), "class_id", class_id("ground"), "FACE"
        )
        mesh = op.delete_degenerate(op.join(crown, earth))
    tree.output("Mesh", mesh, description="Embankment with its classes; the road on it is part of the bridge")


def _crown(tree: Tree, bank: _Bank) -> Value:
    """Add nodes for the crown: verge, pavement, verge, with their classes and materials."""
    mesh, column, row = op.grid(tree, 4, _EDGE)
    half_width, half_pavement = bank.width * 0.5, bank.width * 0.5 - bank.edge_width
    is_outer = column.equals(0) | column.equals(3)
    y = op.switch(is_outer, half_pavement, half_width) * op.switch(column < 2, -1.0, 1.0)
    start = bank.wing_length - _UNDER_WALL
    # Along -x the other side is on the left.
    place = bank.crown(start + (bank.length - start) * (row / (_EDGE - 1.0)), y * bank.side)
    mesh = op.set_position(mesh, place)
    is_pavement = (op.index(tree) // (_EDGE - 1)).equals(1)
    ground = tree.node("FunctionNodeInputInt", integer=class_id("ground")).value
    label = op.switch(is_pavement, ground, class_id(Overpass.points_class))
    mesh = op.store(paint_faces(mesh, bank.ground_material), "class_id", label, "FACE")
    return paint_faces(mesh, bank.pavement_material, is_pavement)


def _slope(tree: Tree, bank: _Bank, side: float) -> Value:
    """Add nodes for one side's slope, from the cone's foot at the abutment to the embankment's end."""
    mesh, column, row = op.grid(tree, _CONE + _EDGE, 2)
    cone_angle = op.maximum(1.0 - column / float(_CONE), 0.0) * (math.pi / 2)
    share = op.maximum((column - _CONE) / (_EDGE - 1.0), 0.0)
    distance = bank.wing_length + (bank.length - bank.wing_length) * share
    crown = bank.crown(distance, bank.width * (0.5 * side))
    fall_vector = bank.fall_direction(side, cone_angle, share) * bank.slope - (0.0, 0.0, 1.0)
    ray = tree.node(
        "GeometryNodeRaycast",
        target_geometry=bank.ground,
        source_position=crown,
        ray_direction=fall_vector,
        ray_length=200.0,
    )
    # A ray may miss the ground at its border: then the nearest point of the ground gives the height.
    nearest_z = op.component(op.sample_surface(bank.ground, op.position(tree), crown), "Z")
    vector_length = op.length(fall_vector)
    fall = op.switch(
        ray["Is Hit"],
        op.minimum(op.maximum(op.component(crown, "Z") - nearest_z, 0.3), 30.0),
        ray["Hit Distance"] / vector_length + _BURIED,
    )
    mesh = op.set_position(mesh, op.switch(row > 0, crown, crown + fall_vector * fall))
    is_reversed = bank.side * side < 0.0
    return op.switch(is_reversed, mesh, flip_faces(mesh))


def _end(tree: Tree, left: Value, right: Value) -> Value:
    """Add nodes for the face that closes the embankment at its end, between the last columns of both slopes."""
    last_column = 2 * (_CONE + _EDGE - 1)
    mesh = tree.node("GeometryNodeMeshCircle", vertices=4, fill_type="NGON").value
    corner = op.index(tree)
    row = op.switch(corner.equals(1) | corner.equals(2), 0, 1)
    position = op.position(tree)
    places = [op.sample_index(slope, position, row + last_column) for slope in (left, right)]
    return op.set_position(mesh, op.switch(corner < 2, places[1], places[0]))
