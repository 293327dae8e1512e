"""SR Bridge Abutment: bearing seat, back wall and wing walls."""

from __future__ import annotations

from ....road.things.body_shapes import BRIDGE_ABUTMENT, BRIDGE_BEARING, BRIDGE_SEAT
from ...nodes import operations as op
from ...nodes.builder import Operand, Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, paint_faces
from .deck import PAVEMENT, WEB

_WALL = 0.5
"""Thickness of the wing walls, m."""
_INSIDE = 0.06  # m from the deck's edge to the wing walls


class _Abutment(Inputs):
    width = metres(10.0, (2.0, 60.0), "Width of the deck")
    thickness = metres(1.2, (0.3, 5.0), "Height of the deck")
    foot = metres(-6.0, (-50.0, 50.0), "z of the walls' lower edge")
    wing_length = metres(8.0, (1.6, 50.0), "Length of the wing walls, from the face")
    concrete_material = material_of("the walls")
    steel_material = material_of("the bearings")


@makes_group("SR Bridge Abutment")
def bridge_abutment_group(tree: Tree) -> None:
    """An abutment whose face looks to -x and stands on x = 0; the deck's underside is z = 0."""
    abutment = _Abutment(tree)
    width, height = abutment.width, abutment.thickness
    wide = width - 2.0 * _INSIDE

    def wall(start: float, end: Operand, top: Value, size: Operand, middle: Operand = 0.0) -> Value:
        corner = op.vector(tree, start, middle, abutment.foot)
        length = op.vector(tree, end, middle, top) - corner
        return box(tree, length + op.vector(tree, 0.0, size), corner + length * 0.5)

    with tree.frame("Seat and back wall"):
        level = height * 0.0 - BRIDGE_BEARING
        walls = [wall(0.0, BRIDGE_ABUTMENT, level, wide)]
        walls.append(wall(BRIDGE_SEAT + 0.04, BRIDGE_ABUTMENT - 0.01, height - PAVEMENT * 0.5, wide - 0.02))
    with tree.frame("Wing walls"):
        for side in (1.0, -1.0):
            beside = (wide * 0.5 - _WALL / 2) * side
            walls.append(wall(BRIDGE_ABUTMENT - 0.02, abutment.wing_length, height - PAVEMENT * 0.6, _WALL, beside))
    with tree.frame("Bearings below the webs"):
        beside, below = width * (0.25 * sum(WEB)), -BRIDGE_BEARING / 2
        pads = [
            box(tree, (0.5, 0.6, BRIDGE_BEARING + 0.02), op.vector(tree, BRIDGE_SEAT / 2, beside * side, below))
            for side in (1.0, -1.0)
        ]
    with tree.frame("All"):
        mesh = op.join(
            paint_faces(op.join(*walls), abutment.concrete_material),
            paint_faces(op.join(*pads), abutment.steel_material),
        )
    tree.output("Mesh", mesh, description="The abutment")
