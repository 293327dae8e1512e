"""SR Bridge Railing: a railing with upright bars (Fuellstabgelaender)."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import Inputs, metres
from ...nodes.solids import box, move_geometry, put_on_points, row_of_points

_POST_SPACING, _BAR_SPACING = 2.0, 0.14  # m
_POST, _BAR, _RAIL, _HANDRAIL = 0.06, 0.016, 0.04, (0.09, 0.06)  # m
_LOWER = 0.1
"""Lower rail above the deck, m."""


class _Railing(Inputs):
    length = metres(20.0, (0.5, 300.0), "Length")
    height = metres(1.0, (0.3, 3.0), "Top of the handrail")


@makes_group("SR Bridge Railing")
def bridge_railing_group(tree: Tree) -> None:
    """A railing from x = 0 on along x, standing on z = 0."""
    railing = _Railing(tree)
    length, height = railing.length, railing.height
    with tree.frame("Rails"):
        wide, high = _HANDRAIL
        rail = box(tree, op.vector(tree, length, _RAIL, _RAIL), op.vector(tree, length * 0.5, 0.0, _LOWER))
        upper = move_geometry(rail, op.vector(tree, 0.0, 0.0, height - high - 0.1 - _LOWER))
        hand = box(tree, op.vector(tree, length, wide, high), op.vector(tree, length * 0.5, 0.0, height - high / 2))
    with tree.frame("Posts"):
        bays = op.round_up(length / _POST_SPACING)
        points = row_of_points(tree, bays + 1)
        x = op.index(tree) * ((length - _POST) / bays) + _POST / 2
        tall = height - high / 2
        posts = put_on_points(
            points, box(tree, op.vector(tree, _POST, _POST, tall)), op.vector(tree, x, 0.0, tall * 0.5)
        )
    with tree.frame("Bars between the rails"):
        points = row_of_points(tree, op.round_up(length / _BAR_SPACING) - 1)
        x = (op.index(tree) + 1) * _BAR_SPACING
        tall = height - high - 0.1 - _LOWER
        open_ = tree.node("GeometryNodeMeshCylinder", vertices=4, fill_type="NONE", radius=_BAR * 0.7, depth=tall).value
        bars = put_on_points(points, open_, op.vector(tree, x, 0.0, tall * 0.5 + _LOWER))
    with tree.frame("All"):
        mesh = op.realize(op.join(rail, upper, hand, posts, bars))
    tree.output("Mesh", mesh, description="The railing")
