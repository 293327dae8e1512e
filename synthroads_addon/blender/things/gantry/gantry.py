"""SR Gantry: a shield gantry over one carriageway or both, or on one post, with the boards that hang on its beam."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ....base.classes import class_id
from ....road.things.body_shapes import GANTRY_BOARD, GANTRY_DISPLAY, GANTRY_HANGER, GANTRY_OVERHANG
from ...nodes import operations as op
from ...nodes.backbone import height_on
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.clearance import highest_below, pavement_near
from ...nodes.solids import box, move_geometry, paint_faces, put_on_points, row_of_points
from ...nodes.strip import INSTANCES
from .beam import gantry_beam_group
from .catwalk import gantry_catwalk_group
from .post import gantry_post_group

_LADDER_FOOT, _RUNG = 2.3, 0.3  # m
_ENCLOSED = 0.02
"""The posts at the ends of the beam enclose it by so much, m."""


@dataclass(frozen=True)
class _Gantry:
    left: Value
    right: Value
    left_post: Value
    right_post: Value
    middle_post: Value
    middle: Value
    elevation: Value
    clearance: Value
    beam: Value
    height: Value
    depth: Value
    post_width: Value
    catwalk: Value
    steel: Value
    concrete: Value
    board: Value
    display: Value


def _declare(tree: Tree) -> _Gantry:
    def metres(name: str, default: float, limits: tuple[float, float], description: str) -> Value:
        return tree.number(name, default, limits, unit="m", description=description)

    def made_of(name: str, what: str) -> Value:
        return tree.input(f"{name} Material", "Material", description=f"Material of {what}")

    return _Gantry(
        left=metres("Left End", 8.0, (-200.0, 200.0), "Left end of the beam, left of the origin"),
        right=metres("Right End", -8.0, (-200.0, 200.0), "Right end of the beam, negative: right of the origin"),
        left_post=tree.boolean("Left Post", True, description="A post at the left end"),
        right_post=tree.boolean("Right Post", True, description="A post at the right end"),
        middle_post=tree.boolean("Middle Post", False, description="A post between them"),
        middle=metres("Middle Post Place", 0.0, (-200.0, 200.0), "Its distance to the left of the origin"),
        elevation=metres("Elevation", 0.0, (-20.0, 50.0), "Feet of the posts above the surface"),
        clearance=metres("Clearance", 5.2, (3.0, 10.0), "Lowest part above the pavement's highest point below it"),
        beam=tree.integer("Beam", 0, (0, 2), description="Shape of the beam: 0 box, 1 truss, 2 tube"),
        height=metres("Beam Height", 0.8, (0.2, 3.0), "Height of the beam"),
        depth=metres("Beam Depth", 0.6, (0.2, 3.0), "Depth of the beam along the road"),
        post_width=metres("Post Width", 0.5, (0.1, 1.5), "Width of a post"),
        catwalk=tree.boolean("Catwalk", False, description="A catwalk on the beam, and a ladder to it"),
        steel=made_of("Steel", "beam, posts and catwalk"),
        concrete=made_of("Concrete", "the plinths"),
        board=made_of("Board", "painted boards"),
        display=made_of("Display", "variable displays"),
    )


@makes_group("SR Gantry")
def gantry_group(tree: Tree) -> None:
    """A gantry around the origin, its beam along x (right), level, so high that its clearance is kept.

    Signs are points with ``width``, ``height``, ``display`` (1 or 0), ``number`` (from 1 on), and ``facing``: 1 towards
    -y, -1 towards +y; of their places only x counts. The middles of their faces come out as points with ``number``.
    """
    signs = tree.input("Signs", "Geometry", description="A point per sign: x; width, height, display, facing, number")
    road = tree.input("Road", "Object", description="Surface with the pavement below")
    terrain = tree.input("Terrain", "Object", description="Surface beside the road")
    gantry = _declare(tree)
    shade = tree.number("Shade", 0.5, (0.0, 1.0), description="Base colour of the steel")
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")

    with tree.frame("Surfaces"):
        surfaces = op.object_geometry(road), op.object_geometry(terrain)
    with tree.frame("Height of the lowest part, above the pavement's highest point"):
        low, bottom = _levels(tree, gantry, signs, surfaces[0])
    with tree.frame("Beam"):
        beam = tree.call(
            gantry_beam_group(),
            beam=gantry.beam,
            length=gantry.left - gantry.right,
            height=gantry.height,
            depth=gantry.depth,
        ).value
        beam = move_geometry(beam, op.vector(tree, -gantry.left, 0.0, bottom))
    with tree.frame("Posts"):
        posts = _posts(tree, gantry, surfaces, bottom)
    with tree.frame("Catwalk and ladder"):
        walk = op.only_if(gantry.catwalk, _catwalk(tree, gantry, surfaces, bottom + gantry.height))
    with tree.frame("Boards and what they hang on"):
        signs = _place_signs(tree, gantry, signs, low, bottom)
        boards, hangers = _boards(tree, gantry, signs)
    with tree.frame("Labels"):
        steel = paint_faces(op.join(beam, walk, hangers), gantry.steel)
        mesh = op.store(op.realize(op.join(steel, posts, boards)), "shade", shade)
        mesh = op.store(mesh, "class_id", class_id("shield_gantry"), "FACE")
        mesh = op.store(mesh, "instance_id", instance, "FACE")
        # Boards have their sign's attributes: only its point is to have its number.
        mesh = op.store(mesh, "number", 0)
    tree.output("Mesh", op.join(mesh, signs), description="The gantry, and a point in the middle of every sign's face")


def _thickness(signs: Value) -> Value:
    """Return the depth of a sign's body (a field on the signs' points)."""
    return op.switch(op.named_attribute(signs.tree, "display", "INT").equals(1), GANTRY_BOARD, GANTRY_DISPLAY)


def _levels(tree: Tree, gantry: _Gantry, signs: Value, road: Value) -> tuple[Value, Value]:
    """Return z of the lowest part, and of the beam's lower edge."""

    def most(value: Value) -> Value:
        return tree.node("GeometryNodeAttributeStatistic", signs, attribute=value, data_type="FLOAT")["Max"]

    reach = op.maximum(op.unary("ABSOLUTE", gantry.left), op.unary("ABSOLUTE", gantry.right)) + 10.0
    beyond = _thickness(signs) + GANTRY_HANGER
    front, rear = (
        gantry.depth * 0.5
        + op.maximum(most(op.switch(op.named_attribute(tree, "facing") * side > 0.0, 0.0, beyond)), 0.0)
        for side in (1.0, -1.0)
    )
    below = highest_below(pavement_near(road, reach), -gantry.left, -gantry.right, (-front, rear))
    low = below + gantry.clearance
    return low, low + op.maximum(most(op.named_attribute(tree, "height")) - gantry.height, 0.0) * GANTRY_OVERHANG


def _posts(tree: Tree, gantry: _Gantry, surfaces: tuple[Value, Value], bottom: Value) -> Value:
    """Return the posts: those at the ends enclose the beam's end, the middle one ends in it."""
    parts = []
    for wanted, place, outer in (
        (gantry.left_post, gantry.left, True),
        (gantry.right_post, gantry.right, True),
        (gantry.middle_post, gantry.middle, False),
    ):
        foot = height_on(*surfaces, op.vector(tree, -place)) + gantry.elevation
        top = bottom + (gantry.height + _ENCLOSED if outer else 0.05)
        post = tree.call(
            gantry_post_group(),
            width=gantry.post_width,
            depth=gantry.depth + (2.0 * _ENCLOSED) if outer else gantry.depth * 0.9,
            height=top - foot,
            steel_material=gantry.steel,
            concrete_material=gantry.concrete,
        ).value
        parts.append(op.only_if(wanted, move_geometry(post, op.vector(tree, -place, 0.0, foot))))
    return op.join(*parts)


def _catwalk(tree: Tree, gantry: _Gantry, surfaces: tuple[Value, Value], top: Value) -> Value:
    """Return the catwalk on the beam, and the ladder at the right post, or at the left one if there is no right."""
    clear = gantry.post_width * 0.5 + 0.05
    length = op.maximum(gantry.left - gantry.right - clear * 2.0, 1.0)
    walk = tree.call(gantry_catwalk_group(), length=length, beam_depth=gantry.depth).value
    walk = move_geometry(walk, op.vector(tree, clear - gantry.left, 0.0, top))
    # Behind the boards of the carriageway that the post stands beside.
    place = op.switch(gantry.right_post, gantry.left, gantry.right)
    side = op.switch(gantry.right_post, -1.0, 1.0)
    foot = height_on(*surfaces, op.vector(tree, -place)) + gantry.elevation + _LADDER_FOOT
    tall = top + 1.1 - foot
    rail = box(tree, op.vector(tree, 0.05, 0.05, tall), op.vector(tree, 0.0, 0.0, tall * 0.5))
    rungs = put_on_points(
        row_of_points(tree, op.rounded_up(tall / _RUNG - 1.0)),
        box(tree, (0.4, 0.03, 0.03)),
        op.vector(tree, 0.0, 0.0, (op.index(tree) + 0.5) * _RUNG),
    )
    ladder = op.join(move_geometry(rail, (-0.2, 0.0, 0.0)), move_geometry(rail, (0.2, 0.0, 0.0)), rungs)
    away = (gantry.depth * 0.5 + 0.2) * side
    return op.join(walk, move_geometry(op.realize(ladder), op.vector(tree, -place, away, foot)))


def _place_signs(tree: Tree, gantry: _Gantry, signs: Value, low: Value, bottom: Value) -> Value:
    """Put the signs' points into the middles of their faces: lower edges in line, or small ones before the beam."""
    tall = op.named_attribute(tree, "height")
    behind = low + tall < bottom + gantry.height
    z = op.switch(behind, low + tall * 0.5, bottom + gantry.height * 0.5)
    thickness = _thickness(signs)
    signs = op.store(signs, "thickness", thickness)
    y = op.named_attribute(tree, "facing") * -1.0 * (gantry.depth * 0.5 + GANTRY_HANGER + thickness)
    signs = op.set_position(signs, op.vector(tree, op.component(op.position(tree), "X"), y, z))
    return op.store(signs, "level", bottom + gantry.height * 0.5 - z)


def _boards(tree: Tree, gantry: _Gantry, signs: Value) -> tuple[Value, Value]:
    """Return the bodies of boards and displays behind the signs' points, and their hangers."""
    wide, tall, thick = (op.named_attribute(tree, name) for name in ("width", "height", "thickness"))
    facing = op.turn(tree, z=op.switch(op.named_attribute(tree, "facing") > 0.0, math.pi, 0.0))
    body = box(tree, 1.0, (0.0, 0.5, 0.0))
    boards = []
    for kind, material in enumerate((gantry.board, gantry.display)):
        chosen = op.separate(signs, op.named_attribute(tree, "display", "INT").equals(kind))
        size = op.vector(tree, wide, thick, tall)
        boards.append(put_on_points(chosen, paint_faces(body, material), op.position(tree), size, facing))
    hangers = []
    for side in (-1.0, 1.0):
        x = wide * (0.32 * side)
        back = op.named_attribute(tree, "facing") * (thick + GANTRY_HANGER / 2)
        upright = op.vector(tree, 0.1, GANTRY_HANGER + 0.01, op.maximum(tall - 0.2, tall * 0.5))
        hangers.append(
            put_on_points(signs, box(tree, 1.0), op.position(tree) + op.vector(tree, x, back), upright, facing)
        )
        # A clamp that reaches into the beam.
        inwards = op.named_attribute(tree, "facing") * (thick + GANTRY_HANGER + gantry.depth * 0.1)
        clamp = op.vector(tree, 0.16, gantry.depth * 0.3 + 0.05, gantry.height * 0.3)
        place = op.position(tree) + op.vector(tree, x, inwards, op.named_attribute(tree, "level"))
        hangers.append(put_on_points(signs, box(tree, 1.0), place, clamp, facing))
    return op.realize(op.join(*boards)), op.realize(op.join(*hangers))
