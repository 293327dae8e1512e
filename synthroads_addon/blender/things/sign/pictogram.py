"""SR Pictogram: the drawing of a traffic sign, fitted into a box."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, integer, material_of, socket
from ...nodes.solids import paint_faces
from .pictograms import NAMES, PICTOGRAMS, RED

Row = tuple[float, float, float]


class _Pictogram(Inputs):
    pictogram = integer(0, (0, len(NAMES) - 1), ", ".join(f"{i} {name}" for i, name in enumerate(NAMES)))
    low_corner = socket("Vector", "Lower left corner of the box (m)")
    high_corner = socket("Vector", "Upper right corner of the box (m)")
    writing_material = material_of("pictograms")
    border_material = material_of("those parts that are red")


@makes_group("SR Pictogram")
def pictogram_group(tree: Tree) -> None:
    """A pictogram in the xy plane, as large as fits into a box."""
    inputs = _Pictogram(tree)
    low_corner, high_corner = inputs.low_corner, inputs.high_corner

    ranges, corners = _tables()
    with tree.frame("Corners of its polygons out of the table of all"):
        first_corner, count, red_count = (
            op.round_up(op.component(op.choose(inputs.pictogram, ranges), axis)) for axis in "XYZ"
        )
        corner = op.choose(op.index(tree) + first_corner, corners)
        place = corner * (1.0, 1.0, 0.0)
        points = tree.node("GeometryNodePoints", count=count, position=place).value
        polygon = op.round_up(op.component(corner, "Z"))
        curves = tree.node("GeometryNodePointsToCurves", points, curve_group_id=polygon).value
        curves = tree.node("GeometryNodeSetSplineCyclic", curves, cyclic=True).value
    with tree.frame("Filled one by one: the red ones come first"):
        is_red = op.index(tree) < red_count
        mesh = op.join(
            paint_faces(_fill_curves(op.separate(curves, is_red, "CURVE")), inputs.border_material),
            paint_faces(_fill_curves(op.separate(curves, ~is_red, "CURVE")), inputs.writing_material),
        )
    with tree.frame("Fitted into the box"):
        extent = tree.node("GeometryNodeBoundBox", mesh)
        size, box_size = extent["Max"] - extent["Min"], high_corner - low_corner
        scale = op.minimum(
            op.component(box_size, "X") / op.maximum(op.component(size, "X"), 1e-3),
            op.component(box_size, "Y") / op.maximum(op.component(size, "Y"), 1e-3),
        )
        shift = (low_corner + high_corner) * 0.5 - (extent["Max"] + extent["Min"]) * (scale * 0.5)
        mesh = op.transform(mesh, translation=shift, scale=op.vector(tree, scale, scale, 1.0))
    tree.output("Mesh", mesh, description="Pictogram, facing +z")


def _tables() -> tuple[list[Row], list[Row]]:
    """Return per pictogram (first corner, number of corners, number of red polygons), and the table of all corners.

    A corner is x, y and the number of its polygon.
    """
    ranges: list[Row] = [(0.0, 0.0, 0.0)]
    corners: list[Row] = []
    for name, polygons in PICTOGRAMS.items():
        rows = [(x, y, float(i)) for i, polygon in enumerate(polygons) for x, y in polygon]
        ranges.append((float(len(corners)), float(len(rows)), float(RED.get(name, 0))))
        corners += rows
    return ranges, corners


def _fill_curves(curves: Value) -> Value:
    """Add a node that fills closed curves one by one, so that they may overlap; return the mesh."""
    return curves.tree.node("GeometryNodeFillCurve", curves, group_id=op.index(curves.tree)).value
