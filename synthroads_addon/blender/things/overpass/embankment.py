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
"""Fall of the crossing road behind the wing walls."""
_ROUNDING = 15.0  # m, length over which the fall begins
_CONE, _EDGE = 7, 24
"""Columns of a cone, and along the embankment's edge."""
_BELOW = 0.4  # m that a slope goes on below the ground
_UNDER_WALL = 0.3  # m that it begins before the wing walls' end


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

    def crown(self, along: Value, across: Value) -> Value:
        """Add nodes for the crown's point `along` m behind the abutment's face and `across` m from its middle."""
        x = self.face + self.side * along
        beyond = op.maximum(along - self.wing_length, 0.0)
        z = self.top - beyond * beyond * _GRADE / (beyond + _ROUNDING)
        return op.vector(self.tree, x, across + x * self.shear, z)

    def away(self, across: float, angle: Value, share: Value) -> Value:
        """Add nodes for the horizontal unit direction in which the slope of one side (`across` +1 or -1) falls.

        It is square to the embankment, turned by an angle towards the bridge in the cones. With the share of the way to
        the embankment's end it swings round to +-y, within the slope's plane: the end is a section along y.
        """
        norm = op.unary("SQRT", self.shear * self.shear + 1.0)
        along = op.vector(self.tree, 1.0, self.shear, 0.0) * (1.0 / norm)
        square = op.vector(self.tree, -self.shear, 1.0, 0.0) * (across / norm)
        turned = square * op.unary("COSINE", angle) + along * (-self.side * op.unary("SINE", angle))
        return turned + along * (self.shear * across * share)


@makes_group("SR Bridge Embankment")
def bridge_embankment_group(tree: Tree) -> None:
    """An embankment from an abutment outwards, falling from the deck's level, with slopes down to the ground."""
    bank = _Bank(tree)
    with tree.frame("Crown: verge, pavement, verge"):
        crown = _crown(tree, bank)
    slopes = []
    for name, across in (("left", 1.0), ("right", -1.0)):
        with tree.frame(f"Slope on the {name}, and the cone around the wing wall"):
            slopes.append(_slope(tree, bank, across))
    with tree.frame("End"):
        end = _end(tree, *slopes)
        turned = op.switch(bank.side > 0.0, flip_faces(end), end)
    with tree.frame("Labels"):
        earth = op.store(
            paint_faces(op.join(*slopes, turned), bank.ground_material), "class_id", class_id("ground"), "FACE"
        )
        mesh = op.delete_degenerate(op.join(crown, earth))
    tree.output("Mesh", mesh, description="Embankment with its classes; the road on it is part of the bridge")


def _crown(tree: Tree, bank: _Bank) -> Value:
    mesh, column, row = op.grid(tree, 4, _EDGE)
    half, paved = bank.width * 0.5, bank.width * 0.5 - bank.edge_width
    outer = column.equals(0) | column.equals(3)
    across = op.switch(outer, paved, half) * op.switch(column < 2, -1.0, 1.0)
    start = bank.wing_length - _UNDER_WALL
    # Along -x the other side is on the left.
    place = bank.crown(start + (bank.length - start) * (row / (_EDGE - 1.0)), across * bank.side)
    mesh = op.set_position(mesh, place)
    middle = (op.index(tree) // (_EDGE - 1)).equals(1)
    ground = tree.node("FunctionNodeInputInt", integer=class_id("ground")).value
    label = op.switch(middle, ground, class_id(Overpass.points_class))
    mesh = op.store(paint_faces(mesh, bank.ground_material), "class_id", label, "FACE")
    return paint_faces(mesh, bank.pavement_material, middle)


def _slope(tree: Tree, bank: _Bank, across: float) -> Value:
    """Add nodes for one side's slope, from the cone's foot at the abutment to the embankment's end."""
    mesh, column, row = op.grid(tree, _CONE + _EDGE, 2)
    turn = op.maximum(1.0 - column / float(_CONE), 0.0) * (math.pi / 2)
    share = op.maximum((column - _CONE) / (_EDGE - 1.0), 0.0)
    along = bank.wing_length + (bank.length - bank.wing_length) * share
    crown = bank.crown(along, bank.width * (0.5 * across))
    down = bank.away(across, turn, share) * bank.slope - (0.0, 0.0, 1.0)
    ray = tree.node(
        "GeometryNodeRaycast",
        target_geometry=bank.ground,
        source_position=crown,
        ray_direction=down,
        ray_length=200.0,
    )
    nearest = op.component(op.sample_surface(bank.ground, op.position(tree), crown), "Z")
    run = op.length(down)
    fall = op.switch(
        ray["Is Hit"],
        op.minimum(op.maximum(op.component(crown, "Z") - nearest, 0.3), 30.0),
        ray["Hit Distance"] / run + _BELOW,
    )
    mesh = op.set_position(mesh, op.switch(row > 0, crown, crown + down * fall))
    turned = bank.side * across < 0.0
    return op.switch(turned, mesh, flip_faces(mesh))


def _end(tree: Tree, left: Value, right: Value) -> Value:
    """Add nodes for the face that closes the embankment at its end, between the last columns of both slopes."""
    last = 2 * (_CONE + _EDGE - 1)
    mesh = tree.node("GeometryNodeMeshCircle", vertices=4, fill_type="NGON").value
    number = op.index(tree)
    row = op.switch(number.equals(1) | number.equals(2), 0, 1)
    here = op.position(tree)
    places = [op.sample_index(slope, here, row + last) for slope in (left, right)]
    return op.set_position(mesh, op.switch(number < 2, places[1], places[0]))
