"""SR Bridge Pier: a wall pier with rounded ends, and the bearings on it."""

from __future__ import annotations

import math

from ....road.things.body_shapes import BRIDGE_BEARING, BRIDGE_PIER_LENGTH
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, loft, paint_faces
from .deck import WEB

_ROUND = 8
"""Points of a rounded end."""


class _Pier(Inputs):
    pier_width = metres(1.0, (0.2, 4.0), "Width along x")
    width = metres(10.0, (2.0, 60.0), "Width of the deck")
    concrete_material = material_of("the pier")
    steel_material = material_of("the bearings")


@makes_group("SR Bridge Pier")
def bridge_pier_group(tree: Tree) -> None:
    """A pier along y whose bearings carry a deck with its underside on z = 0; its body is 1 high, to be stretched."""
    pier = _Pier(tree)
    width, deck = pier.pier_width, pier.width
    angles = [math.pi * i / (_ROUND - 1) for i in range(_ROUND)]
    end = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in angles]
    # z says which end a point belongs to.
    outline = [(x, y, 1.0) for x, y in end] + [(-x, -y, -1.0) for x, y in end]
    with tree.frame("Body"):
        straight = (op.maximum(deck * BRIDGE_PIER_LENGTH, width * 1.02) - width) * 0.5

        def place(point: Value, row: Value) -> Value:
            y = op.component(point, "Y") * width + op.component(point, "Z") * straight
            return op.vector(tree, op.component(point, "X") * width, y, row - 1)

        body = loft(tree, lambda number: op.choose(number, outline), len(outline), 2, place)
    with tree.frame("Bearings"):
        beside = op.minimum(deck * (0.25 * sum(WEB)), straight)
        size = op.vector(tree, op.minimum(width * 0.8, 0.6), 0.5, BRIDGE_BEARING + 0.02)
        pads = [box(tree, size, op.vector(tree, 0.0, beside * side, -BRIDGE_BEARING / 2)) for side in (1.0, -1.0)]
    tree.output("Body", paint_faces(body, pier.concrete_material), description="The pier, from z = -1 to 0")
    tree.output("Bearings", paint_faces(op.join(*pads), pier.steel_material), description="The bearings")
