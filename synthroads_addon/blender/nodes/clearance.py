"""Clearance of structures that span the road: heights of the pavement below them."""

from __future__ import annotations

from ...base.classes import class_id
from . import operations as op
from .builder import Operand, Value

SPACING = 0.0125
"""Distance (m) between points across the road at which the pavement's height is found: 0.9 mm at 7 % crossfall."""
_ROWS = 7
"""Rows of these points along the road; chosen."""
_NO_HEIGHT = -1e5
"""Height that stands for no pavement, m."""


def pavement_near(road: Value, reach: Value) -> Value:
    """Add nodes for the paved faces of a road's mesh within the distance `reach` (m) of the origin in plan."""
    tree = road.tree
    place = op.position(tree)
    plan_position = op.vector(tree, op.component(place, "X"), op.component(place, "Y"))
    is_near = op.length(plan_position) < reach
    is_paved = op.named_attribute(tree, "class_id", "INT").equals(class_id("road"))
    return op.separate(road, is_paved & is_near, "FACE")


def highest_below(pavement: Value, start: Value, end: Value, depth: tuple[Value, Value], shear: Operand = 0.0) -> Value:
    """Add nodes for the z (m) of the pavement's highest point below a rectangle, a single number; 0 if there is none.

    The rectangle lies between x = `start` and x = `end`, and between the two y of `depth`; `shear` moves it by
    `shear` * x in y.
    """
    tree = pavement.tree
    columns = op.round_up((end - start) / SPACING) + 1
    points, column, row = op.grid(tree, columns, _ROWS)
    x = start + (end - start) * (column / (columns - 1.0))
    y = depth[0] + (depth[1] - depth[0]) * (row / (_ROWS - 1.0)) + x * shear
    points = op.set_position(points, op.vector(tree, x, y, 500.0))
    ray = tree.node("GeometryNodeRaycast", target_geometry=pavement, ray_length=1000.0)
    z = op.switch(ray["Is Hit"], _NO_HEIGHT, op.component(ray["Hit Position"], "Z"))
    highest = tree.node("GeometryNodeAttributeStatistic", points, attribute=z, data_type="FLOAT")["Max"]
    return op.switch(highest > 0.5 * _NO_HEIGHT, 0.0, highest)
