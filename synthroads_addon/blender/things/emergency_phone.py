"""SR Emergency Phone: the orange pillar of a motorway's emergency telephone."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...base.classes import class_id
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.solids import Point, box, loft, move_geometry, paint_faces
from ..nodes.standing import BURIED, declare_standing, put_on
from ..nodes.tubes import tube
from .sign.writing import sign_writing_group

_CORNER = 0.16
"""Radius of the pillar's edges as a share of half its width."""
_CORNER_STEPS = 4
# Solids from below: the heights (a share; below the surface m) and widths (a share) that they go through.
_PLINTH = [(-BURIED, 0.97), (0.05, 0.97)]
_BODY_WIDTH = 0.92
_BODY = [(0.05, _BODY_WIDTH), (0.93, _BODY_WIDTH), (0.97, 0.8), (1.0, 0.4)]
_BAND = [(0.46, 1.0), (0.52, 1.0)]
_LETTERS = (0.77, 0.92)
"""Lower and upper border of the writing as shares of the height."""


@dataclass(frozen=True)
class _Phone:
    width: Value
    depth: Value
    height: Value


@makes_group("SR Emergency Phone")
def emergency_phone_group(tree: Tree) -> None:
    """An emergency telephone, its front towards those who drive along +y; points carry ``heading``, ``elevation``."""
    standing = declare_standing(tree)
    phone = _Phone(
        width=tree.number("Width", 0.3, (0.05, 2.0), unit="m", description="Width of its front"),
        depth=tree.number("Depth", 0.3, (0.05, 2.0), unit="m", description="Depth (m)"),
        height=tree.number("Height", 1.6, (0.3, 4.0), unit="m", description="Top above the surface"),
    )
    names = ("Body", "Plinth", "Band", "Writing", "Panel")
    body, plinth, band, writing, panel = (
        tree.input(f"{name} Material", "Material", description=f"Material of the {name.lower()}") for name in names
    )

    with tree.frame("Plinth, body with its roof, and reflective band"):
        solids = ((_PLINTH, plinth), (_BODY, body), (_BAND, band))
        parts = [paint_faces(_pillar(tree, phone, rows), material) for rows, material in solids]
    with tree.frame("Speech panel with its button"):
        front = phone.depth * (-0.5 * _BODY_WIDTH)
        size = op.vector(tree, phone.width * 0.6, 0.012, phone.height * 0.15)
        parts.append(paint_faces(box(tree, size, op.vector(tree, 0.0, front, phone.height * 0.68)), panel))
        button = tree.node(
            "GeometryNodeTransform",
            tube(tree, phone.width * 0.08, 0.01),
            translation=op.vector(tree, 0.0, front, phone.height * 0.64),
            rotation=(math.pi / 2, 0.0, 0.0),
        ).value
        parts.append(paint_faces(button, body))
    with tree.frame("SOS on all four sides"):
        parts.append(paint_faces(_writing(tree, phone), writing))
    with tree.frame("Put onto the points"):
        mesh = standing.labelled(put_on(standing.places(), op.join(*parts)), class_id("utility"))
    tree.output("Mesh", mesh, description="Emergency telephone")


def _outline() -> list[Point]:
    """Return a square of side 1 with rounded corners, anticlockwise from above."""
    inner, radius = (1.0 - _CORNER) / 2.0, _CORNER / 2.0
    points = []
    for x, y, start in ((1, -1, -90.0), (1, 1, 0.0), (-1, 1, 90.0), (-1, -1, 180.0)):
        for step in range(_CORNER_STEPS):
            turn = math.radians(start + 90.0 * step / (_CORNER_STEPS - 1))
            points.append((x * inner + radius * math.cos(turn), y * inner + radius * math.sin(turn), 0.0))
    return points


def _pillar(tree: Tree, phone: _Phone, rows: list[tuple[float, float]]) -> Value:
    """Return a solid through rows of height (a share, or m below the surface) and width (a share)."""

    def place(point: Value, row: Value) -> Value:
        level = op.choose(row, [(z, share, 0.0) for z, share in rows])
        z, share = op.component(level, "X"), op.component(level, "Y")
        z = op.switch(z < 0.0, z * phone.height, z)
        flat = tree.node("ShaderNodeVectorMath", point, op.vector(tree, phone.width, phone.depth), operation="MULTIPLY")
        return flat.value * share + op.vector(tree, 0.0, 0.0, z)

    points = _outline()
    return loft(tree, lambda number: op.choose(number, points), len(points), len(rows), place)


def _writing(tree: Tree, phone: _Phone) -> Value:
    """Return the letters on the four sides above the speech panel."""
    sides = []
    for turns in range(4):
        wide, deep = (phone.width, phone.depth) if turns % 2 == 0 else (phone.depth, phone.width)
        low, high = (
            op.vector(tree, wide * -0.36, phone.height * _LETTERS[0]),
            op.vector(tree, wide * 0.36, phone.height * _LETTERS[1]),
        )
        letters = tree.call(sign_writing_group(), line_1="SOS", low_corner=low, high_corner=high).value
        upright = op.transform(letters, rotation=(math.pi / 2, 0.0, 0.0))
        upright = move_geometry(upright, op.vector(tree, 0.0, deep * (-0.5 * _BODY_WIDTH) - 0.001))
        sides.append(op.transform(upright, rotation=(0.0, 0.0, turns * math.pi / 2)))
    return op.join(*sides)
