"""A carriageway's cross-section in the nodes: its inputs, and the offset and height of a line at a distance."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import FAR, Inputs, boolean, metres, number

FAR_FROM_AXIS = (-1000.0, 1000.0)
"""Limits of distances from the axis, m."""
CROSSFALL = "Fall of the pavement to the right (m/m), which may be a field"

"""Description of inputs of the crossfall."""


class Ramp(Inputs):
    """Inputs of ramps that leave the pavement's plane."""

    ramp_width = metres(
        0.0, FAR_FROM_AXIS, "Width of a ramp that leaves the pavement's plane, up to the pavement's edge"
    )
    ramp_lift = metres(0.0, FAR, "Height of the ramp above that plane there, which may be a field")
    ramp_tilt = number(0.0, (-0.25, 0.25), "How much more the ramp rises outwards than that plane (m/m)")


RAMP_FIELDS = tuple(field.name for field in Ramp.fields())
"""Inputs of ramps that leave the pavement's plane; their values are fields on the backbone."""


class Section(Ramp):
    """Inputs of a carriageway's cross section: side, edge of the pavement, pivot, crossfall, verge's slope, ramps."""

    left_side = boolean(False, "On the left of the axis, else on its right")
    paved_edge = metres(14.0, FAR_FROM_AXIS, "Distance of the axis from where the verge begins")
    pivot = metres(8.0, FAR_FROM_AXIS, "Distance of the axis from the line that keeps its height")
    crossfall = number(0.025, (-0.12, 0.12), CROSSFALL)
    verge_slope = number(0.08, (0.0, 0.15), "Fall of the verge away from the pavement (m/m)")


class _Distance(Inputs):
    distance = metres(5.0, FAR_FROM_AXIS, "Distance from the axis")


@makes_group("SR Carriageway Height")
def height_group(tree: Tree) -> None:
    """Offset and height above the axis of a line at a distance from it."""
    section, distance = Section(tree), _Distance(tree).distance
    paved_edge = section.paved_edge
    with tree.frame("The pavement turns about the pivot, the verge falls away"):
        # A surface that falls to the right rises with the offset, and the offset is side * distance.
        side = op.switch(section.left_side, -1.0, 1.0)
        rise = section.crossfall * side
        verge_distance = op.maximum(distance - paved_edge, 0.0)
        pavement_distance = op.minimum(distance, paved_edge)
        height = rise * (pavement_distance - section.pivot) - verge_distance * section.verge_slope
    with tree.frame("A ramp has a plane of its own"):
        # The ramp's boundary is computed in two ways in single precision: 1 mm covers the difference.
        ramp_start = paved_edge - section.ramp_width
        ramp_height = section.ramp_lift + section.ramp_tilt * (pavement_distance - ramp_start)
        height = height + op.switch(distance > ramp_start - 0.001, 0.0, ramp_height)
    tree.output("Height", height, description="Height above the axis, per row of the backbone (m)")
    tree.output("Offset", distance * side, description="Offset, positive to the left (m)")
