"""Kilometre boards: writing on both sides, on a post of their own (SR Kilometre Board)."""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.parameters import KilometreBoard
from ...road.things.body_shapes import KILOMETRE_POST
from ..materials import material
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.solids import move_geometry
from ..nodes.standing import declare_standing, put_on
from .model_builder import ModelBuilder
from .sign.face import declare_face, sign_face_group
from .sign.looks import FaceStyle, face_inputs
from .sign.posts import sign_posts_group

_STYLE = FaceStyle("blue", "white", "white")
_THICKNESS = 0.024
"""Thickness of either half of a board, m."""


@makes_group("SR Kilometre Board")
def kilometre_board_group(tree: Tree) -> None:
    """A board on a post, read from both sides; points carry ``heading`` (rad) and ``elevation`` (m)."""
    standing = declare_standing(tree)
    face = declare_face(tree)
    lower_edge = tree.number(
        "Lower Edge", 1.2, (0.0, 10.0), unit="m", description="Lower edge of the board above the surface"
    )
    steel = tree.input("Post Material", "Material", description="Material of the post")

    with tree.frame("Two faces back to back around the post"):
        plate = tree.call(sign_face_group(), instance=standing.instance, **face).value
        front = move_geometry(plate, op.vector(tree, 0.0, -face["thickness"]))
        behind = op.transform(front, rotation=(0.0, 0.0, math.pi))
        middle = lower_edge + face["height"] * 0.5
        board = move_geometry(op.join(front, behind), op.vector(tree, 0.0, 0.0, middle))
    with tree.frame("Put onto the points"):
        places = standing.places()
        mesh = put_on(places, board)
    with tree.frame("Post, up into the board"):
        post = tree.call(
            sign_posts_group(),
            points=places,
            road=standing.road,
            terrain=standing.terrain,
            top=middle,
            post_diameter=KILOMETRE_POST,
            material=steel,
        ).value
    with tree.frame("Labels"):
        mesh = standing.labelled(op.join(mesh, post), class_id("road_sign"))
    tree.output("Mesh", mesh, description="Board with its post")


def build_kilometre_boards(builder: ModelBuilder) -> None:
    """Make one object per kilometre board."""
    for name, board in builder.parameters.of_type(KilometreBoard).items():
        inputs = {
            **builder.surfaces(),
            **face_inputs(_STYLE, "rectangle", board.width, board.height, (board.text,)),
            "Thickness": _THICKNESS,
            "Lower Edge": board.lower_edge,
            "Post Material": material("galvanised_steel"),
            "Instance": board.instance,
        }
        builder.add(name, builder.points(name, [board], {}), kilometre_board_group(), inputs)
