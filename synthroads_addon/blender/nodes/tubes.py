"""Round masts and posts."""

from __future__ import annotations

from . import operations as op
from .builder import Operand, Tree, Value
from .solids import move_geometry


def tube(tree: Tree, radius: Operand, height: Value | float, sides: int = 12) -> Value:
    """Return an upright closed tube from z = 0 on."""
    cylinder = tree.node("GeometryNodeMeshCylinder", vertices=sides, radius=radius, depth=height)
    smooth = tree.node("GeometryNodeSetShadeSmooth", cylinder["Mesh"], cylinder["Side"]).value
    return move_geometry(smooth, op.vector(tree, 0.0, 0.0, height * 0.5))


def cone(tree: Tree, bottom: Operand, top: Operand, height: Operand, sides: int = 16) -> Value:
    """Return an upright closed cone, cut off, from z = 0 on."""
    body = tree.node("GeometryNodeMeshCone", vertices=sides, radius_top=top, radius_bottom=bottom, depth=height)
    return tree.node("GeometryNodeSetShadeSmooth", body["Mesh"], body["Side"]).value
