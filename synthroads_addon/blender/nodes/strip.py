"""SR Strip: one lengthwise ribbon of the road."""

from __future__ import annotations

import bpy

from . import operations as op
from .backbone import cut, row
from .builder import Tree, node_group

FAR = (-1000.0, 1000.0)
INSTANCES = (-(2**31), 2**31 - 1)
"""Limits of instance numbers: 32 bits, with a sign in the nodes and without one elsewhere."""


def strip_group() -> bpy.types.NodeTree:
    """Return the group SR Strip."""
    return node_group("SR Strip", _build)


def _build(tree: Tree) -> None:
    """A ribbon along a backbone between two offsets, each at its own height above the axis."""
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    left = tree.number(
        "Left Offset", 1.0, FAR, unit="m", description="Offset of the left edge, positive to the left"
    )
    right = tree.number("Right Offset", -1.0, FAR, unit="m", description="Offset of the right edge")
    left_height = tree.number(
        "Left Height", 0.0, FAR, unit="m", description="Left edge above the axis, per row"
    )
    right_height = tree.number(
        "Right Height", 0.0, FAR, unit="m", description="Right edge above the axis, per row"
    )
    class_id = tree.integer("Class", 0, (0, 255), description="Semantic class of the faces")
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    material = tree.input("Material", "Material", description="Material of the faces")

    with tree.frame("Two columns, one row per point of the backbone"):
        mesh, column, number = op.grid(tree, 2, op.point_count(backbone))
    with tree.frame("Rows of the backbone"):
        axis, leftwards, curvature = row(backbone, number)
        heights = [op.sample_index(backbone, height, number) for height in (left_height, right_height)]
    with tree.frame("Offset, cut where it would fold, and the height there"):
        offset = cut(op.switch(column.equals(0), right, left), curvature)
        share = (offset - right) / (left - right)
        height = heights[0] * share + heights[1] * (1.0 - share)
    with tree.frame("Place and label"):
        place = axis + leftwards * offset + op.vector(tree, 0.0, 0.0, height)
        mesh = op.store(mesh, "offset", offset)
        mesh = op.store(mesh, "station", op.sample_index(backbone, op.named(tree, "station"), number))
        mesh = op.without_degenerate(op.set_position(mesh, place))
        mesh = op.only_if(left - right > 1e-6, op.label(mesh, class_id, instance, material))
    tree.output("Mesh", mesh, description="Ribbon whose faces look up")
