"""SR Emergency Phone: the orange pillar of a motorway's emergency telephone.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things import cabinet as sizes
from ...road.things.cabinet import Cabinet
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import material_of, metres
from ..nodes.solids import box, loft, move_geometry, paint_faces, tube
from ..nodes.standing import Standing
from .sign.writing import sign_writing_group

_LETTERS = (0.77, 0.92)
"""Lower and upper border of the writing as shares of the height; chosen."""


class _Phone(Standing):
    width = metres(0.3, (0.05, 2.0), "Width of its front")
    depth = metres(0.3, (0.05, 2.0), "Depth (m)")
    height = metres(1.6, (0.3, 4.0), "Top above the surface")
    body_material = material_of("the body", "plastic_orange")
    plinth_material = material_of("the plinth", "concrete")
    band_material = material_of("the band", "sheeting_white")
    writing_material = material_of("the writing", "sheeting_white")
    panel_material = material_of("the panel", "plastic_black")


@makes_group("SR Emergency Phone", catalogue="Roadside")
def emergency_phone_group(tree: Tree) -> None:
    """An emergency telephone, its front towards those who drive along +y; points carry ``heading``, ``elevation``."""
    phone = _Phone(tree)

    with tree.frame("Plinth, body with its roof, and reflective band"):
        solids = (
            (sizes.PHONE_PLINTH, phone.plinth_material),
            (sizes.PHONE_BODY, phone.body_material),
            (sizes.PHONE_BAND, phone.band_material),
        )
        parts = [paint_faces(_pillar(tree, phone, rows), material) for rows, material in solids]
    with tree.frame("Speech panel with its button"):
        front = phone.depth * (-0.5 * sizes.PHONE_WIDTH)
        size = op.vector(tree, phone.width * 0.6, 0.012, phone.height * 0.15)
        parts.append(
            paint_faces(box(tree, size, op.vector(tree, 0.0, front, phone.height * 0.68)), phone.panel_material)
        )
        button = tube(tree, phone.width * 0.08, 0.01)
        middle = op.vector(tree, 0.0, front, phone.height * 0.64)
        button = op.transform(button, translation=middle, rotation=(math.pi / 2, 0.0, 0.0))
        parts.append(paint_faces(button, phone.body_material))
    with tree.frame("SOS on all four sides"):
        parts.append(paint_faces(_writing(tree, phone), phone.writing_material))
    with tree.frame("Put onto the points"):
        mesh = phone.put_labelled(parts, class_id(Cabinet.points_class))
    tree.output("Mesh", mesh, description="Emergency telephone")


def _pillar(tree: Tree, phone: _Phone, rows: tuple[tuple[float, float], ...]) -> Value:
    """Add nodes for a solid through rows of (z as a share of the height, or in m if negative; share of the width)."""

    def place(point: Value, row: Value) -> Value:
        level = op.choose(row, [(z, share, 0.0) for z, share in rows])
        z, share = op.component(level, "X"), op.component(level, "Y")
        z = op.switch(z < 0.0, z * phone.height, z)
        return point * op.vector(tree, phone.width, phone.depth) * share + op.vector(tree, 0.0, 0.0, z)

    points = [(x, y, 0.0) for x, y in sizes.phone_outline().tolist()]
    return loft(tree, lambda number: op.choose(number, points), len(points), len(rows), place)


def _writing(tree: Tree, phone: _Phone) -> Value:
    """Add nodes for the letters SOS on the four sides above the speech panel."""
    sides = []
    for quarter_turns in range(4):
        width, depth = (phone.width, phone.depth) if quarter_turns % 2 == 0 else (phone.depth, phone.width)
        lower_corner, upper_corner = (
            op.vector(tree, width * -0.36, phone.height * _LETTERS[0]),
            op.vector(tree, width * 0.36, phone.height * _LETTERS[1]),
        )
        letters = tree.call(sign_writing_group(), line_1="SOS", low_corner=lower_corner, high_corner=upper_corner).value
        face_letters = op.transform(letters, rotation=(math.pi / 2, 0.0, 0.0))
        face_letters = move_geometry(face_letters, op.vector(tree, 0.0, depth * (-0.5 * sizes.PHONE_WIDTH) - 0.001))
        sides.append(op.transform(face_letters, rotation=(0.0, 0.0, quarter_turns * math.pi / 2)))
    return op.join(*sides)
