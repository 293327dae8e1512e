"""SR Sign Outline: the outline of a sign's face, or a parallel curve inside of it."""

from __future__ import annotations

from ....road.things.sign_outline import CORNER_STEPS, MOST_OF_SIDE, ROUND_STEPS, SIGN_OUTLINES
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, integer, metres

SHAPES = ("round", "triangle", "rectangle", "octagon", "arrow", "arrow_left", "triangle_down", "diamond")
"""Shapes by their number in the group's input."""
_SHARPEST = 0.35
"""Least share of its radius that a corner keeps inside the outline; chosen."""


class _Outline(Inputs):
    shape = integer(2, (0, len(SHAPES) - 1), ", ".join(f"{i} {name}" for i, name in enumerate(SHAPES)))
    width = metres(1.0, (0.01, 20.0), "Width of the outline")
    height = metres(1.0, (0.01, 20.0), "Height of the outline")
    corner_radius = metres(0.05, (0.001, 10.0), "Radius of its corners")
    inset = metres(0.0, (0.0, 1.0), "Distance inside of the outline, at most a quarter of its smaller side")


@makes_group("SR Sign Outline")
def sign_outline_group(tree: Tree) -> None:
    """A closed curve in the xy plane around the origin: the outline of a sign, or one inside of it."""
    outline = _Outline(tree)
    width, height, inset = outline.width, outline.height, outline.inset

    with tree.frame("Corners of the shape, and points on each"):
        start, count, steps = _corners_of(tree, outline.shape)
        point_index = op.index(tree)
        corner, step = point_index // steps, point_index % steps
    with tree.frame("Radius; a round sign is nothing but corners"):
        largest_radius = op.minimum(width, height) * MOST_OF_SIDE
        corner_radius = op.minimum(
            op.switch(outline.shape.equals(0), outline.corner_radius, largest_radius), largest_radius
        )
        inset_radius = op.maximum(corner_radius - inset, corner_radius * _SHARPEST)
    with tree.frame("Middle of the corner's arc, and of those beside it"):
        size = op.vector(tree, width - corner_radius * 2.0, height - corner_radius * 2.0)
        previous_corner, arc_centre, next_corner = (
            op.choose(start + (corner + count + shift) % count, _table()) * size for shift in (-1, 0, 1)
        )
    with tree.frame("Points on the arcs"):
        outward_direction, inward_move = _directions(
            tree, arc_centre - previous_corner, next_corner - arc_centre, step / (steps - 1.0)
        )
        points = tree.node("GeometryNodeMeshCircle", vertices=count * steps).value
        # The radius shrinks with the inset; once it is at its least, the arc's centre moves inwards.
        points = op.set_position(
            points, arc_centre + inward_move * (inset - corner_radius + inset_radius) + outward_direction * inset_radius
        )
        curve = tree.node("GeometryNodeMeshToCurve", points).value
    tree.output("Curve", curve, description="Closed curve, anticlockwise")


def _directions(tree: Tree, side_before: Value, side_after: Value, share: Value) -> tuple[Value, Value]:
    """Add nodes for the outward unit direction at a share of a corner's arc, and its centre's move per metre inset.

    `side_before` and `side_after` are the sides that meet there. The move is -(n1 + n2) / (1 + n1 . n2) for their
    outward unit normals n1 and n2.
    """
    normal_before, normal_after = _normal(side_before), _normal(side_after)
    cosine = op.dot(normal_before, normal_after)
    angle = op.unary("ARCCOSINE", cosine) * share
    direction = tree.node(
        "ShaderNodeVectorRotate", normal_before, axis=(0.0, 0.0, 1.0), angle=angle, rotation_type="AXIS_ANGLE"
    ).value
    return direction, (normal_before + normal_after) * (-1.0 / (1.0 + cosine))


def _table() -> list[tuple[float, float, float]]:
    """Return the corners of all shapes, one shape after the other."""
    return [(x, y, 0.0) for corners in SIGN_OUTLINES.values() for x, y in corners]


def _corners_of(tree: Tree, shape: Value) -> tuple[Value, Value, Value]:
    """Add nodes for a shape's first corner in the table, its number of corners, and the points on each."""
    starts, total = {}, 0
    for name, corners in SIGN_OUTLINES.items():
        starts[name], total = total, total + len(corners)
    rows = []
    for name in SHAPES:
        outline = "rectangle" if name == "round" else name
        points = ROUND_STEPS if name == "round" else CORNER_STEPS
        rows.append((float(starts[outline]), float(len(SIGN_OUTLINES[outline])), float(points)))
    row = op.choose(shape, rows)
    start, count, steps = (op.round_up(op.component(row, axis)) for axis in "XYZ")
    return start, count, steps


def _normal(side: Value) -> Value:
    """Add nodes for the unit normal to the right of a vector in the xy plane: outwards along the outline."""
    right_vector = op.vector(side.tree, op.component(side, "Y"), -op.component(side, "X"))
    return side.tree.node("ShaderNodeVectorMath", right_vector, operation="NORMALIZE").value
