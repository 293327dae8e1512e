"""SR Carriageway Height, SR Carriageway Marking: what lies at a distance from the axis on a carriageway."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import Inputs, metres, number
from .line import MarkingInputs, marking_group


class _Section(Inputs):
    side = number(1.0, (-1.0, 1.0), "+1 for the left, -1 for the right carriageway")
    distance = metres(5.0, (0.0, 1000.0), "Distance from the axis")
    paved_edge = metres(14.0, (0.0, 1000.0), "Where the verge begins")
    pivot = metres(8.0, (0.0, 1000.0), "Line that keeps the axis's height")
    crossfall = number(0.025, (-0.12, 0.12), "Positive where the surface falls to the right (m/m), per row")
    verge_slope = number(0.08, (0.0, 0.15), "Fall of the verge outwards (m/m)")


@makes_group("SR Carriageway Height")
def height_group(tree: Tree) -> None:
    """Offset and height above the axis of a line at a distance from it."""
    section = _Section(tree)
    side, distance, paved = section.side, section.distance, section.paved_edge
    with tree.frame("The pavement turns about the pivot, the verge falls away"):
        # A surface that falls to the right rises with the offset, and the offset is side * distance.
        rise = section.crossfall * side
        beyond = op.maximum(distance - paved, 0.0)
        height = rise * (op.minimum(distance, paved) - section.pivot) - beyond * section.verge_slope
    tree.output("Height", height, description="Height above the axis, per row of the backbone (m)")
    tree.output("Offset", distance * side, description="Offset, positive to the left (m)")


@makes_group("SR Carriageway Marking")
def carriageway_marking_group(tree: Tree) -> None:
    """A line marking centred on a line at a distance from the axis."""
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    section = _Section(tree)
    width = tree.number("Width", 0.15, (0.05, 1.0), unit="m", description="Width of the line")
    marking = MarkingInputs(tree)
    with tree.frame("Both edges of the line"):
        half = width * (section.side * 0.5)
        # Left is outwards on the left carriageway and inwards on the right one.
        left = tree.call(height_group(), **section.values | {"distance": section.distance + half})
        right = tree.call(height_group(), **section.values | {"distance": section.distance - half})
    with tree.frame("Line"):
        mesh = tree.call(
            marking_group(),
            backbone=backbone,
            left_offset=left["Offset"],
            right_offset=right["Offset"],
            left_height=left["Height"],
            right_height=right["Height"],
            **marking.values,
        ).value
    tree.output("Mesh", mesh, description="Dashes whose faces look up")
