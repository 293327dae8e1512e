"""SR Points along Axis: places for things that stand beside a road, at even distances along any curve."""

from __future__ import annotations

import math

from . import operations as op
from .axis import AxisInputs
from .backbone import last_station, look_up, station_ribbon
from .builder import Tree, makes_group
from .inputs import boolean, metres
from .solids import row_of_points

_ROUNDING = 1e-4
"""Share of a step that may be missing to a whole number of steps. Chosen: 5 mm of steps of 50 m, as 32-bit
stations round up to 50 km."""


class _Points(AxisInputs):
    """Inputs of SR Points along Axis."""

    start_station = metres(0.0, (0.0, 1e6), "Station of the first point")
    end_station = metres(0.0, (0.0, 1e6), "No point stands beyond it; 0 is the end of what is followed")
    spacing = metres(50.0, (0.1, 10_000.0), "Distance between points")
    offset = metres(0.0, (-1000.0, 1000.0), "Offset of the points, positive to the left")
    against_traffic = boolean(False, "For those who drive against the stations, else with them")


@makes_group("SR Points along Axis", catalogue="Tools")
def points_along_axis_group(tree: Tree) -> None:
    """Points with ``heading`` and ``elevation``, as groups of things that stand at a place take them."""
    inputs = _Points(tree)
    with tree.frame("Number of points"):
        axis = inputs.axis()
        end = op.switch(inputs.end_station > 0.0, last_station(axis), inputs.end_station)
        # Where the end is a whole number of steps away, 32-bit rounding must not lose the last point.
        step_count = (end - inputs.start_station) / inputs.spacing + _ROUNDING
        count = tree.node("FunctionNodeFloatToInt", step_count, rounding_mode="FLOOR").value + 1
    with tree.frame("Places, looking along the axis"):
        ribbon = station_ribbon(axis)
        points = row_of_points(tree, count)
        station = inputs.start_station + op.index(tree) * inputs.spacing
        left_vector = look_up(ribbon, "left", station)
        # With the axis at an angle t from +x, the left vector's angle from +x is t + pi/2. The heading is the turn from
        # +y: t - pi/2 for who drives with the stations, t + pi/2, the left vector's angle, for who drives against them.
        heading_against = tree.node(
            "ShaderNodeMath", op.component(left_vector, "Y"), op.component(left_vector, "X"), operation="ARCTAN2"
        ).value
        heading = heading_against + op.switch(inputs.against_traffic, -math.pi, 0.0)
        points = op.store(op.store(points, "heading", heading), "elevation", 0.0)
        points = op.set_position(points, look_up(ribbon, "axis", station) + left_vector * inputs.offset)
        # The row is a mesh line: its edges go, its vertices are the points.
        points = tree.node("GeometryNodeDeleteGeometry", points, domain="EDGE", mode="EDGE_FACE").value
    tree.output("Points", points, description="Points with heading and elevation")
