"""SR Bridge Abutment: bearing seat, back wall and wing walls. SR Bridge Pier: a wall pier and its bearings.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math

from ....road.things import overpass as sizes
from ...nodes import operations as op
from ...nodes.builder import Operand, Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, loft, paint_faces


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
    wall_width = width - 2.0 * sizes.WALL_INSIDE

    def wall(start: float, end: Operand, top: Value, size: Operand, middle: Operand = 0.0) -> Value:
        """Add nodes for a box from x = start to end and from the foot to the top, with a size and a middle in y, m."""
        corner = op.vector(tree, start, middle, abutment.foot)
        length = op.vector(tree, end, middle, top) - corner
        return box(tree, length + op.vector(tree, 0.0, size), corner + length * 0.5)

    with tree.frame("Seat and back wall"):
        seat_z = height * 0.0 - sizes.BEARING
        walls = [wall(0.0, sizes.ABUTMENT, seat_z, wall_width)]
        walls.append(
            wall(
                sizes.SEAT + sizes.BACK_WALL[0],
                sizes.ABUTMENT - sizes.BACK_WALL[1],
                height - sizes.PAVEMENT * 0.5,
                wall_width - 0.02,
            )
        )
    with tree.frame("Wing walls"):
        for side in (1.0, -1.0):
            y = (wall_width * 0.5 - sizes.WALL / 2) * side
            walls.append(
                wall(sizes.ABUTMENT - 0.02, abutment.wing_length, height - sizes.PAVEMENT * 0.6, sizes.WALL, y)
            )
    with tree.frame("Bearings below the webs"):
        y, bearing_z = width * (0.25 * sum(sizes.WEB)), -sizes.BEARING / 2
        pads = [
            box(tree, (0.5, 0.6, sizes.BEARING + 0.02), op.vector(tree, sizes.SEAT / 2, y * side, bearing_z))
            for side in (1.0, -1.0)
        ]
    with tree.frame("All"):
        mesh = op.join(
            paint_faces(op.join(*walls), abutment.concrete_material),
            paint_faces(op.join(*pads), abutment.steel_material),
        )
    tree.output("Mesh", mesh, description="The abutment")


class _Pier(Inputs):
    pier_width = metres(1.0, (0.2, 4.0), "Width along x")
    width = metres(10.0, (2.0, 60.0), "Width of the deck")
    concrete_material = material_of("the pier")
    steel_material = material_of("the bearings")


@makes_group("SR Bridge Pier")
def bridge_pier_group(tree: Tree) -> None:
    """A pier along y whose bearings carry a deck with its underside on z = 0; its body is 1 high, to be stretched."""
    pier = _Pier(tree)
    width, deck_width = pier.pier_width, pier.width
    angles = [math.pi * i / (sizes.PIER_ROUND - 1) for i in range(sizes.PIER_ROUND)]
    end_outline = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in angles]
    # z is the sign of the end that a point belongs to.
    outline = [(x, y, 1.0) for x, y in end_outline] + [(-x, -y, -1.0) for x, y in end_outline]
    with tree.frame("Body"):
        half_straight = (op.maximum(deck_width * sizes.PIER_LENGTH, width * 1.02) - width) * 0.5

        def place(point: Value, row: Value) -> Value:
            y = op.component(point, "Y") * width + op.component(point, "Z") * half_straight
            return op.vector(tree, op.component(point, "X") * width, y, row - 1)

        body = loft(tree, lambda number: op.choose(number, outline), len(outline), 2, place)
    with tree.frame("Bearings"):
        bearing_y = op.minimum(deck_width * (0.25 * sum(sizes.WEB)), half_straight)
        size = op.vector(tree, op.minimum(width * 0.8, 0.6), 0.5, sizes.BEARING + 0.02)
        pads = [box(tree, size, op.vector(tree, 0.0, bearing_y * side, -sizes.BEARING / 2)) for side in (1.0, -1.0)]
    tree.output("Body", paint_faces(body, pier.concrete_material), description="The pier, from z = -1 to 0")
    tree.output("Bearings", paint_faces(op.join(*pads), pier.steel_material), description="The bearings")
