"""Kilometre boards: writing on both sides, on a post of their own (SR Kilometre Board)."""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things import kilometre_board as sizes
from ...road.things.kilometre_board import KilometreBoard
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, material_of, metres
from ..nodes.solids import move_geometry
from ..nodes.standing import Standing, put_on
from .model_builder import ModelBuilder
from .registry import model_part
from .sign.face import Face, sign_face_group
from .sign.looks import FaceStyle, face_inputs
from .sign.posts import sign_posts_group

_STYLE = FaceStyle("blue", "white", "white")


class _Board(Inputs):
    lower_edge = metres(1.2, (0.0, 10.0), "Lower edge of the board above the surface")
    post_material = material_of("the post", "galvanised_steel")


@makes_group("SR Kilometre Board", catalogue="Signs")
def kilometre_board_group(tree: Tree) -> None:
    """A board on a post, read from both sides; points carry ``heading`` (rad) and ``elevation`` (m)."""
    standing, face, board = Standing(tree), Face(tree), _Board(tree)

    with tree.frame("Two faces back to back around the post"):
        plate = tree.call(sign_face_group(), instance=standing.instance, **face.values).value
        front = move_geometry(plate, op.vector(tree, 0.0, -face.thickness))
        back = op.transform(front, rotation=(0.0, 0.0, math.pi))
        middle = board.lower_edge + face.height * 0.5
        plates = move_geometry(op.join(front, back), op.vector(tree, 0.0, 0.0, middle))
    with tree.frame("Put onto the points"):
        places = standing.places()
        mesh = put_on(places, plates)
    with tree.frame("Post, up into the board"):
        post = tree.call(
            sign_posts_group(),
            points=places,
            road=standing.road,
            terrain=standing.terrain,
            top=middle,
            post_diameter=sizes.POST,
            material=board.post_material,
        ).value
    with tree.frame("Labels"):
        mesh = standing.label(op.join(mesh, post), class_id(KilometreBoard.points_class))
    tree.output("Mesh", mesh, description="Board with its post")


@model_part("kilometre_boards", 120)
def build_kilometre_boards(builder: ModelBuilder) -> None:
    """Add one object per kilometre board to the model."""
    for name, board in builder.parameters.of_type(KilometreBoard).items():
        face = face_inputs(_STYLE, "rectangle", board.width, board.height, (board.text,))
        group = kilometre_board_group()
        builder.add_thing(name, board, group, **face | {"thickness": sizes.BOARD})
