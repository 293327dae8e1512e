"""Delineator posts, Leitpfosten (SR Delineator)."""

from __future__ import annotations

import numpy as np

from ...base.classes import class_id
from ...road.things import delineator as sizes
from ...road.things.body import BURIED
from ...road.things.delineator import Delineator
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import material_of, metres, socket
from ..nodes.solids import paint_faces
from ..nodes.standing import OnSurface, put_on
from .model_builder import NO_SURFACES, ModelBuilder
from .registry import model_part

_LEVELS = (-BURIED, 0.0, 0.64, 0.89, sizes.TOP)
"""Heights (m) of the body's rows on its axis, from below; rows above the surface are slanted."""
_BAND = 2
"""Number of the level at which the black band begins."""
_REFLECTOR_WIDTH, _REFLECTOR_HEIGHT, _REFLECTOR_Z = sizes.REFLECTOR
"""Width and height of the upright reflector, and height of its middle, m."""
_UNDER, _PROUD = 0.001, 0.004
"""Depth of reflectors in the post, and their protrusion, m."""


class _Delineator(OnSurface):
    points = socket("Geometry", "One point per post, at any height")
    height = metres(1.0, (0.2, 3.0), "Height of posts whose points have no height")
    white_material = material_of("the body", "plastic_white")
    black_material = material_of("the band", "plastic_black")
    reflector_material = material_of("the reflectors", "reflector")


@makes_group("SR Delineator", catalogue="Roadside")
def delineator_group(tree: Tree) -> None:
    """A delineator post on each point; points carry ``heading``, ``elevation``, ``height`` and ``instance``."""
    post = _Delineator(tree)
    glass = post.reflector_material

    with tree.frame("Body: white, with a slanted black band"):
        body = _body(tree, post.white_material, post.black_material)
    with tree.frame("Reflectors: an upright one in front, two round ones behind"):
        body = op.join(body, _front(tree, glass), _behind(tree, glass, 0.07), _behind(tree, glass, -0.07))
    with tree.frame("On the surface"):
        places = post.places()
        height_scale = op.vector(tree, 1.0, 1.0, op.attribute_or(post.height, "height"))
        posts = put_on(places, body, height_scale)
    with tree.frame("Labels"):
        posts = op.store(posts, "class_id", class_id(Delineator.points_class), "FACE")
        posts = op.store(posts, "instance_id", op.named_attribute(tree, "instance", "INT"), "FACE")
    tree.output("Mesh", posts, description="Posts; each face has its own post's instance number")


def _body(tree: Tree, white: Value, black: Value) -> Value:
    """Add nodes for a post's body, 1 m high, with its slanted band and top."""
    rows = len(_LEVELS)
    mesh, column, row = op.grid(tree, len(sizes.OUTLINE) + 1, rows)
    section = op.choose(column, [(x, y, 0.0) for x, y in (*sizes.OUTLINE, sizes.OUTLINE[0])])
    level = op.component(op.choose(row, [(0.0, 0.0, z) for z in _LEVELS]), "Z")
    slant = op.switch(row > 1, 0.0, op.component(section, "X") * sizes.SLANT)
    mesh = op.set_position(mesh, section + op.vector(tree, 0.0, 0.0, level + slant))
    # Faces of a grid run column by column, rows - 1 of them each.
    is_band = (op.index(tree) % (rows - 1)).equals(_BAND)
    mesh = paint_faces(paint_faces(mesh, white), black, is_band)
    lid = tree.node("GeometryNodeMeshCircle", vertices=len(sizes.OUTLINE), fill_type="NGON").value
    outline = op.choose(op.index(tree), [(x, y, _LEVELS[-1] + sizes.SLANT * x) for x, y in sizes.OUTLINE])
    return op.join(mesh, paint_faces(op.set_position(lid, outline), white))


def _front(tree: Tree, glass: Value) -> Value:
    """Add nodes for the upright reflector on the face that approaching drivers see (-y)."""
    mesh, column, row = op.grid(tree, 2, 2)
    x = column * _REFLECTOR_WIDTH - _REFLECTOR_WIDTH / 2
    place = op.vector(tree, x, -_flank(x), row * _REFLECTOR_HEIGHT - _REFLECTOR_HEIGHT / 2 + _REFLECTOR_Z)
    return _reflector_body(op.set_position(mesh, place), glass)


def _behind(tree: Tree, glass: Value, height: float) -> Value:
    """Add nodes for a round reflector on the other face, `height` (m) above the reflectors' middle."""
    disc = tree.node("GeometryNodeMeshCircle", vertices=16, radius=0.03, fill_type="NGON").value
    place = op.position(tree)
    x = op.component(place, "X")
    place = op.vector(tree, -x, _flank(-x), op.component(place, "Y") + _REFLECTOR_Z + height)
    return _reflector_body(op.set_position(disc, place), glass)


def _flank(x: Value) -> Value:
    """Add nodes for the y (m) of the rear flank at x, 1 mm below the line (-0.045, 0.055) to (0.05, 0.014)."""
    return (x + 0.045) * (-0.041 / 0.095) + (0.055 - _UNDER)


def _reflector_body(face: Value, glass: Value) -> Value:
    """Add nodes that extrude a face to a reflector's body, 1 mm in the post and 4 mm out of it."""
    solid = face.tree.node("GeometryNodeExtrudeMesh", face, offset_scale=_UNDER + _PROUD, individual=False).value
    return paint_faces(solid, glass)


@model_part("delineators", 160, on_the_road=True)
def build_delineators(builder: ModelBuilder) -> None:
    """Add all delineator posts to the model as one object, a point each, and those of ramps as another."""
    posts = list(builder.parameters.of_type(Delineator).values())
    on_others = [builder.on_others(post) for post in posts]
    for role, inputs, is_on_others in (("Delineators", None, False), ("Ramps' Delineators", NO_SURFACES, True)):
        chosen = [post for post, is_there in zip(posts, on_others, strict=True) if is_there == is_on_others]
        if chosen:
            mesh = builder.points(role, chosen, {"height": np.array([post.height for post in chosen])})
            builder.add(role, mesh, delineator_group(), inputs, frame=builder.frame(*chosen))
