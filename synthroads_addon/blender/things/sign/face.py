"""SR Sign Face: the plate of a traffic sign with its border, writing and pictogram, readable."""

from __future__ import annotations

import math

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.solids import flip_faces, move_geometry, paint_faces
from ...nodes.strip import INSTANCES
from .outline import SHAPES, sign_outline_group
from .pictogram import pictogram_group
from .pictograms import NAMES
from .writing import LINES, sign_writing_group

RAISED = 0.001
"""Writing stands so far in front of the face, m."""
_WIDEST_EDGE, _WIDEST_BORDER = 0.1, 0.15
"""Most that edge and border take of a face's smaller side: a triangle hasn't more room."""
FACE_INPUTS = (
    "Shape", "Width", "Height", "Corner Radius", "Edge Width", "Border Width", "Thickness",
    *(f"Line {number}" for number in range(1, LINES + 1)), "Text Left", "Text Right", "Text Bottom", "Text Top",
    "Flush Left", "Pictogram", "Pictogram Left", "Pictogram Right", "Pictogram Bottom", "Pictogram Top",
    "Ground Material", "Border Material", "Edge Material", "Writing Material", "Back Material",
)  # fmt: skip
"""Inputs of a group that has a face, as `declare_face` names them."""


def declare_face(tree: Tree) -> dict[str, Value]:
    """Declare the inputs of a group that has a face; return them as `Tree.call` takes them."""
    values = [*_declare_plate(tree), *_declare_writing(tree), *_declare_pictogram(tree)]
    with tree.panel("Materials"):
        for part in ("Ground", "Border", "Edge", "Writing", "Back"):
            values.append(tree.input(f"{part} Material", "Material", description=f"Material of the {part.lower()}"))
    return {name.lower().replace(" ", "_"): value for name, value in zip(FACE_INPUTS, values, strict=True)}


def _declare_plate(tree: Tree) -> list[Value]:
    shapes = ", ".join(f"{i} {name}" for i, name in enumerate(SHAPES))

    def metres(name: str, default: float, limits: tuple[float, float], description: str) -> Value:
        return tree.number(name, default, limits, unit="m", description=description)

    return [
        tree.integer("Shape", 2, (0, len(SHAPES) - 1), description=shapes),
        metres("Width", 1.0, (0.01, 20.0), "Width of the face"),
        metres("Height", 1.0, (0.01, 20.0), "Height of the face"),
        metres("Corner Radius", 0.05, (0.001, 1.0), "Radius of its corners"),
        metres("Edge Width", 0.0, (0.0, 0.5), "Width of the bright edge outside of the border; 0 for none"),
        metres("Border Width", 0.02, (0.0, 1.0), "Width of the border; 0 for none"),
        metres("Thickness", 0.003, (0.001, 0.2), "Thickness of the plate"),
    ]


def _declare_writing(tree: Tree) -> list[Value]:
    with tree.panel("Writing"):
        return [
            *(
                tree.input(f"Line {number}", "String", description="Line of writing; empty for none")
                for number in range(1, LINES + 1)
            ),
            *_declare_box(tree, "Text", "writing"),
            tree.boolean("Flush Left", False, description="Lines begin on the left, else they are centred"),
        ]


def _declare_pictogram(tree: Tree) -> list[Value]:
    names = ", ".join(f"{i} {name}" for i, name in enumerate(NAMES))
    with tree.panel("Pictogram"):
        number = tree.integer("Pictogram", 0, (0, len(NAMES) - 1), description=names)
        return [number, *_declare_box(tree, "Pictogram", "pictogram")]


def _declare_box(tree: Tree, prefix: str, what: str) -> list[Value]:
    return [
        tree.number(
            f"{prefix} {side}", default, (0.0, 1.0), unit="share", description=f"Border of the {what}'s box on the face"
        )
        for side, default in (("Left", 0.1), ("Right", 0.9), ("Bottom", 0.1), ("Top", 0.9))
    ]


@makes_group("SR Sign Face")
def sign_face_group(tree: Tree) -> None:
    """The plate of a traffic sign around the origin, seen by those who look along +y; x is right, z up."""
    face = declare_face(tree)
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")

    def outline(inset: Value | float) -> Value:
        names = ("shape", "width", "height", "corner_radius")
        return tree.call(sign_outline_group(), inset=inset, **{name: face[name] for name in names}).value

    with tree.frame("Outlines of plate, border and ground"):
        side = op.minimum(face["width"], face["height"])
        edge = op.minimum(face["edge_width"], side * _WIDEST_EDGE)
        border = op.minimum(face["border_width"], side * _WIDEST_BORDER)
        outer, middle, inner = outline(0.0), outline(edge), outline(edge + border)
    with tree.frame("Front"):
        front = [
            paint_faces(_fill_curves(inner), face["ground_material"]),
            op.only_if(border > 1e-4, paint_faces(_fill_curves(op.join(middle, inner)), face["border_material"])),
            op.only_if(edge > 1e-4, paint_faces(_fill_curves(op.join(outer, middle)), face["edge_material"])),
        ]
    with tree.frame("Back and rim"):
        plate = tree.node(
            "GeometryNodeExtrudeMesh", flip_faces(_fill_curves(outer)), offset_scale=face["thickness"], individual=False
        ).value
        back = paint_faces(plate, face["back_material"])
    with tree.frame("Writing and pictogram"):
        drawn = [move_geometry(part, (0.0, 0.0, RAISED)) for part in _draw_writing(tree, face)]
    with tree.frame("Upright, and labelled"):
        mesh = op.transform(op.join(back, *front, *drawn), rotation=(math.pi / 2.0, 0.0, 0.0))
        mesh = op.store(op.store(mesh, "class_id", class_id("road_sign"), "FACE"), "instance_id", instance, "FACE")
    tree.output("Mesh", mesh, description="Plate; its front is at y = 0")


def _fill_curves(curve: Value) -> Value:
    """Return the area inside of curves, less what is inside of two of them."""
    return curve.tree.node("GeometryNodeFillCurve", curve).value


def _draw_writing(tree: Tree, face: dict[str, Value]) -> list[Value]:
    """Return writing and pictogram in the xy plane."""
    lines = {f"line_{number}": face[f"line_{number}"] for number in range(1, LINES + 1)}
    low, high = _box(tree, face, "text")
    writing = tree.call(
        sign_writing_group(), low_corner=low, high_corner=high, flush_left=face["flush_left"], **lines
    ).value
    low, high = _box(tree, face, "pictogram")
    colors = {name: face[name] for name in ("writing_material", "border_material")}
    pictogram = tree.call(
        pictogram_group(), pictogram=face["pictogram"], low_corner=low, high_corner=high, **colors
    ).value
    return [paint_faces(writing, face["writing_material"]), pictogram]


def _box(tree: Tree, face: dict[str, Value], prefix: str) -> tuple[Value, Value]:
    """Return the lower left and the upper right corner of a box that is given in shares of the face."""

    def corner(x: str, y: str) -> Value:
        right, up = face[f"{prefix}_{x}"] - 0.5, face[f"{prefix}_{y}"] - 0.5
        return op.vector(tree, right * face["width"], up * face["height"])

    return corner("left", "bottom"), corner("right", "top")
