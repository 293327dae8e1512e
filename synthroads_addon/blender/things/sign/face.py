"""SR Sign Face: the plate of a traffic sign with its border, writing and pictogram, readable."""

from __future__ import annotations

import math

from ....base.classes import class_id
from ....road.things import sign as sizes
from ....road.things.sign import TrafficSign
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, boolean, instance_number, integer, material_of, metres, share, socket
from ...nodes.solids import flip_faces, move_geometry, paint_faces
from .outline import SHAPES, sign_outline_group
from .pictogram import pictogram_group
from .pictograms import NAMES
from .writing import LINES, sign_writing_group

RAISED = 0.001
"""Distance of the writing in front of the face, m; chosen."""
_WIDEST_EDGE, _WIDEST_BORDER = 0.1, 0.15
"""Largest widths of edge and border as shares of a face's smaller side, so that they fit into a triangle; chosen."""
_LINE = "Line of writing; empty for none"
_TEXT_BORDER, _DRAWING_BORDER = "Border of the writing's box on the face", "Border of the pictogram's box on the face"


class Face(Inputs):
    """Inputs of a node group with a sign's face: outline, border, writing, pictogram, materials."""

    shape = integer(2, (0, len(SHAPES) - 1), ", ".join(f"{i} {name}" for i, name in enumerate(SHAPES)))
    width = metres(1.0, (0.01, 20.0), "Width of the face")
    height = metres(1.0, (0.01, 20.0), "Height of the face")
    corner_radius = metres(0.05, (0.001, 1.0), "Radius of its corners")
    edge_width = metres(0.0, (0.0, 0.5), "Width of the bright edge outside of the border; 0 for none")
    border_width = metres(0.02, (0.0, 1.0), "Width of the border; 0 for none")
    thickness = metres(sizes.PLATE, (0.001, 0.2), "Thickness of the plate")
    line_1 = socket("String", _LINE, panel="Writing")
    line_2 = socket("String", _LINE, panel="Writing")
    line_3 = socket("String", _LINE, panel="Writing")
    line_4 = socket("String", _LINE, panel="Writing")
    line_5 = socket("String", _LINE, panel="Writing")
    line_6 = socket("String", _LINE, panel="Writing")
    text_left = share(0.1, (0.0, 1.0), _TEXT_BORDER, panel="Writing")
    text_right = share(0.9, (0.0, 1.0), _TEXT_BORDER, panel="Writing")
    text_bottom = share(0.1, (0.0, 1.0), _TEXT_BORDER, panel="Writing")
    text_top = share(0.9, (0.0, 1.0), _TEXT_BORDER, panel="Writing")
    flush_left = boolean(False, "Lines begin on the left, else they are centred", panel="Writing")
    pictogram = integer(
        0, (0, len(NAMES) - 1), ", ".join(f"{i} {name}" for i, name in enumerate(NAMES)), panel="Pictogram"
    )
    pictogram_left = share(0.1, (0.0, 1.0), _DRAWING_BORDER, panel="Pictogram")
    pictogram_right = share(0.9, (0.0, 1.0), _DRAWING_BORDER, panel="Pictogram")
    pictogram_bottom = share(0.1, (0.0, 1.0), _DRAWING_BORDER, panel="Pictogram")
    pictogram_top = share(0.9, (0.0, 1.0), _DRAWING_BORDER, panel="Pictogram")
    ground_material = material_of("the ground", "sheeting_blue", panel="Materials")
    border_material = material_of("the border", "sheeting_white", panel="Materials")
    edge_material = material_of("the edge", "sheeting_white", panel="Materials")
    writing_material = material_of("the writing", "sheeting_white", panel="Materials")
    back_material = material_of("the back", "board_back", panel="Materials")


class _LabelledFace(Face):
    instance = instance_number()


@makes_group("SR Sign Face")
def sign_face_group(tree: Tree) -> None:
    """The plate of a traffic sign around the origin, seen by those who look along +y; x is right, z up."""
    face = _LabelledFace(tree)

    def outline(inset: Value | float) -> Value:
        """Add nodes for the sign's outline, moved inwards by `inset` (m)."""
        names = ("shape", "width", "height", "corner_radius")
        return tree.call(sign_outline_group(), inset=inset, **{name: face.values[name] for name in names}).value

    with tree.frame("Outlines of plate, border and ground"):
        side = op.minimum(face.width, face.height)
        edge = op.minimum(face.edge_width, side * _WIDEST_EDGE)
        border = op.minimum(face.border_width, side * _WIDEST_BORDER)
        plate_outline, border_outline, ground_outline = outline(0.0), outline(edge), outline(edge + border)
    with tree.frame("Front"):
        front_parts = [
            paint_faces(_fill_curves(ground_outline), face.ground_material),
            op.only_if(
                border > 1e-4, paint_faces(_fill_curves(op.join(border_outline, ground_outline)), face.border_material)
            ),
            op.only_if(
                edge > 1e-4, paint_faces(_fill_curves(op.join(plate_outline, border_outline)), face.edge_material)
            ),
        ]
    with tree.frame("Back and rim"):
        plate = tree.node(
            "GeometryNodeExtrudeMesh",
            flip_faces(_fill_curves(plate_outline)),
            offset_scale=face.thickness,
            individual=False,
        ).value
        back_part = paint_faces(plate, face.back_material)
    with tree.frame("Writing and pictogram"):
        drawn_parts = [move_geometry(part, (0.0, 0.0, RAISED)) for part in _draw_writing(tree, face)]
    with tree.frame("Upright, and labelled"):
        mesh = op.transform(op.join(back_part, *front_parts, *drawn_parts), rotation=(math.pi / 2.0, 0.0, 0.0))
        mesh = op.label(mesh, class_id(TrafficSign.points_class), face.instance)
    tree.output("Mesh", mesh, description="Plate; its front is at y = 0")


def _fill_curves(curve: Value) -> Value:
    """Add a node that fills closed curves by the even-odd rule; return the mesh."""
    return curve.tree.node("GeometryNodeFillCurve", curve).value


def _draw_writing(tree: Tree, face: Face) -> list[Value]:
    """Add nodes for the meshes of writing and pictogram in the xy plane."""
    lines = {f"line_{number}": face.values[f"line_{number}"] for number in range(1, LINES + 1)}
    low_corner, high_corner = _box(tree, face, "text")
    writing = tree.call(
        sign_writing_group(), low_corner=low_corner, high_corner=high_corner, flush_left=face.flush_left, **lines
    ).value
    low_corner, high_corner = _box(tree, face, "pictogram")
    pictogram = tree.call(
        pictogram_group(),
        pictogram=face.pictogram,
        low_corner=low_corner,
        high_corner=high_corner,
        writing_material=face.writing_material,
        border_material=face.border_material,
    ).value
    return [paint_faces(writing, face.writing_material), pictogram]


def _box(tree: Tree, face: Face, prefix: str) -> tuple[Value, Value]:
    """Add nodes for the lower left and upper right corner (m) of a box given in shares of the face."""

    def corner(x: str, y: str) -> Value:
        x_share, y_share = face.values[f"{prefix}_{x}"] - 0.5, face.values[f"{prefix}_{y}"] - 0.5
        return op.vector(tree, x_share * face.width, y_share * face.height)

    return corner("left", "bottom"), corner("right", "top")
