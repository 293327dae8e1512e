"""SR Sign Writing: lines of writing as filled outlines, fitted into a box."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import Inputs, boolean, socket
from ...nodes.solids import move_geometry
from .typeface import CAPITAL, sign_typeface

LINES = 6
"""Largest number of lines of writing on one face."""
LETTERS = 0.62
"""Height of a capital letter as a share of its line's height."""
_SMALLEST = 0.02
"""Height (m) below which letters can't be read and are left out; chosen."""


_LINE = "Writing; empty lines take no room"


class _Writing(Inputs):
    line_1 = socket("String", _LINE)
    line_2 = socket("String", _LINE)
    line_3 = socket("String", _LINE)
    line_4 = socket("String", _LINE)
    line_5 = socket("String", _LINE)
    line_6 = socket("String", _LINE)
    low_corner = socket("Vector", "Lower left corner of the box (m)")
    high_corner = socket("Vector", "Upper right corner of the box (m)")
    flush_left = boolean(False, "Lines begin on the left, else they are centred")


@makes_group("SR Sign Writing")
def sign_writing_group(tree: Tree) -> None:
    """Lines of writing in the xy plane, one below the other, all of one size: as large as fits into the box."""
    writing = _Writing(tree)
    low_corner, high_corner = writing.low_corner, writing.high_corner

    with tree.frame("Letters of size 1, and the length of each line"):
        lines = [
            tree.call(sign_line_group(), writing=line)
            for line in (writing.values[f"line_{number}"] for number in range(1, LINES + 1))
        ]
        largest_length = lines[0]["Length"]
        for line in lines[1:]:
            largest_length = op.maximum(largest_length, line["Length"])
    with tree.frame("Height of a line, and size of the letters"):
        lines_above = [tree.node("FunctionNodeInputInt", integer=0).value]
        for line in lines:
            lines_above.append(lines_above[-1] + op.round_up(op.minimum(line["Length"], 1.0)))
        pitch = op.component(high_corner - low_corner, "Y") / op.maximum(lines_above[-1], 1.0)
        box_width = op.component(high_corner - low_corner, "X")
        size = op.minimum(pitch * (LETTERS / CAPITAL), box_width / op.maximum(largest_length, 1e-3))
    placed_lines = []
    for number, line in enumerate(lines):
        with tree.frame(f"Line {number + 1} in its place"):
            line_start = op.component(low_corner, "X") + op.switch(
                writing.flush_left, (box_width - line["Length"] * size) * 0.5, 0.0
            )
            base = op.component(high_corner, "Y") - pitch * (lines_above[number] + 0.5) - size * (CAPITAL / 2.0)
            place, scale = op.vector(tree, line_start, base), op.vector(tree, size, size, 1.0)
            placed_lines.append(op.transform(line.value, translation=place, scale=scale))
    with tree.frame("Filled"):
        mesh = op.realize(tree.node("GeometryNodeFillCurve", op.join(*placed_lines)).value)
        mesh = op.only_if(size * CAPITAL > _SMALLEST, mesh)
    tree.output("Mesh", mesh, description="Letters, facing +z")


@makes_group("SR Sign Line")
def sign_line_group(tree: Tree) -> None:
    """The outlines of one line's letters of size 1 in the xy plane, from x = 0 on."""
    writing = tree.input("Writing", "String", description="What is written")
    with tree.frame("Letters"):
        curves = tree.node("GeometryNodeStringToCurves", writing, size=1.0, font=sign_typeface()).value
    with tree.frame("From x = 0 on"):
        # The bounds of instances would be those of each letter.
        extent = tree.node("GeometryNodeBoundBox", op.realize(curves), use_radius=False)
        start, end = op.component(extent["Min"], "X"), op.component(extent["Max"], "X")
        curves = move_geometry(curves, op.vector(tree, -start))
    tree.output("Curves", curves, description="Outlines of the letters")
    tree.output("Length", end - start, description="Length of the line (m)")
