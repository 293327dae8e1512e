"""SR Gantry: a shield gantry over one carriageway or both, or on one post, with the boards that hang on its beam.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ....base.classes import class_id
from ....road.things import gantry as sizes
from ....road.things.gantry import Gantry, GantrySign
from ...nodes import operations as op
from ...nodes.backbone import height_on
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.clearance import highest_below, pavement_near
from ...nodes.inputs import Inputs, boolean, instance_number, integer, material_of, metres, number, socket
from ...nodes.solids import box, move_geometry, paint_faces, put_on_points, row_of_points
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from ..registry import model_part
from ..sign.looks import FaceStyle, face_inputs
from .board import gantry_sign_group
from .structure import gantry_beam_group, gantry_catwalk_group, gantry_post_group


class _Gantry(Inputs):
    signs = socket("Geometry", "A point per sign: y; width, height, display, facing, number")
    road = socket("Object", "Surface with the pavement below")
    terrain = socket("Object", "Surface beside the road")
    left_end = metres(8.0, (-200.0, 200.0), "Left end of the beam, left of the origin")
    right_end = metres(-8.0, (-200.0, 200.0), "Right end of the beam, negative: right of the origin")
    left_post = boolean(True, "A post at the left end")
    right_post = boolean(True, "A post at the right end")
    middle_post = boolean(False, "A post between them")
    middle_post_place = metres(0.0, (-200.0, 200.0), "Its distance to the left of the origin")
    elevation = metres(0.0, (-20.0, 50.0), "Feet of the posts above the surface")
    clearance = metres(5.2, (3.0, 10.0), "Lowest part above the pavement's highest point below it")
    beam = integer(0, (0, 2), "Shape of the beam: 0 box, 1 truss, 2 tube")
    beam_height = metres(0.8, (0.2, 3.0), "Height of the beam")
    beam_depth = metres(0.6, (0.2, 3.0), "Depth of the beam along the road")
    post_width = metres(0.5, (0.1, 1.5), "Width of a post")
    catwalk = boolean(False, "A catwalk on the beam, and a ladder to it")
    steel_material = material_of("beam, posts and catwalk", "gantry_steel")
    concrete_material = material_of("the plinths", "bridge_concrete")
    board_material = material_of("painted boards", "board_back")
    display_material = material_of("variable displays", "display")
    shade = number(0.5, (0.0, 1.0), "Base colour of the steel")
    instance = instance_number()


@makes_group("SR Gantry", catalogue="Structures")
def gantry_group(tree: Tree) -> None:
    """A gantry around the origin, its beam along y (left), level, so high that its clearance is kept.

    Signs are points with ``width``, ``height``, ``display`` (1 or 0), ``number`` (from 1 on), and ``facing``: 1 towards
    -x, -1 towards +x; of their places only y counts. The middles of their faces come out as points with ``number``.
    Within the group it is made with x to the right and y along the road, and turned at the end.
    """
    gantry = _Gantry(tree)

    with tree.frame("Height of the lowest part, above the pavement's highest point"):
        lowest_z, beam_bottom = _levels(tree, gantry, op.object_geometry_across(gantry.road))
    with tree.frame("Beam"):
        beam = tree.call(
            gantry_beam_group(),
            beam=gantry.beam,
            length=gantry.left_end - gantry.right_end,
            height=gantry.beam_height,
            depth=gantry.beam_depth,
        ).value
        beam = move_geometry(beam, op.vector(tree, -gantry.left_end, 0.0, beam_bottom))
    with tree.frame("Posts"):
        posts = _posts(tree, gantry, beam_bottom)
    with tree.frame("Catwalk and ladder"):
        walk = op.only_if(gantry.catwalk, _catwalk(tree, gantry, beam_bottom + gantry.beam_height))
    with tree.frame("Boards and what they hang on"):
        signs = _place_signs(tree, gantry, lowest_z, beam_bottom)
        boards, hangers = _boards(tree, gantry, signs)
    with tree.frame("Labels"):
        steel = paint_faces(op.join(beam, walk, hangers), gantry.steel_material)
        mesh = op.store(op.realize(op.join(steel, posts, boards)), "shade", gantry.shade)
        mesh = op.label(mesh, class_id(Gantry.points_class), gantry.instance)
        # Boards have their sign's attributes: only its point is to have its number.
        mesh = op.store(mesh, "number", 0)
    mesh = op.along(op.join(mesh, signs))
    tree.output("Mesh", mesh, description="The gantry, and a point in the middle of every sign's face")


def _thickness(signs: Value) -> Value:
    """Add nodes for the depth (m) of a sign's body, a field on the signs' points."""
    return op.switch(op.named_attribute(signs.tree, "display", "INT").equals(1), sizes.BOARD, sizes.DISPLAY)


def _levels(tree: Tree, gantry: _Gantry, road: Value) -> tuple[Value, Value]:
    """Add nodes for z (m) of the gantry's lowest part, clear of the pavement below, and of the beam's lower edge."""

    def maximum_of(value: Value) -> Value:
        """Add a node for the largest value of a field on the signs' points."""
        return tree.node("GeometryNodeAttributeStatistic", gantry.signs, attribute=value, data_type="FLOAT")["Max"]

    reach = op.maximum(op.unary("ABSOLUTE", gantry.left_end), op.unary("ABSOLUTE", gantry.right_end)) + 10.0  # chosen
    sign_reach = _thickness(gantry.signs) + sizes.HANGER
    front_reach, rear_reach = (
        gantry.beam_depth * 0.5
        + op.maximum(maximum_of(op.switch(op.named_attribute(tree, "facing") * side > 0.0, 0.0, sign_reach)), 0.0)
        for side in (1.0, -1.0)
    )
    pavement_z = highest_below(
        pavement_near(road, reach), -gantry.left_end, -gantry.right_end, (-front_reach, rear_reach)
    )
    lowest_z = pavement_z + gantry.clearance
    return lowest_z, lowest_z + op.maximum(
        maximum_of(op.named_attribute(tree, "height")) - gantry.beam_height, 0.0
    ) * sizes.OVERHANG


def _posts(tree: Tree, gantry: _Gantry, beam_bottom: Value) -> Value:
    """Add nodes for the posts: those at the ends enclose the beam's end, the middle one ends in it."""
    parts = []
    for has_post, place, is_outer in (
        (gantry.left_post, gantry.left_end, True),
        (gantry.right_post, gantry.right_end, True),
        (gantry.middle_post, gantry.middle_post_place, False),
    ):
        foot = height_on(gantry.road, gantry.terrain, op.vector(tree, 0.0, place)) + gantry.elevation
        top = beam_bottom + (gantry.beam_height + sizes.POST_ENCLOSES if is_outer else sizes.POST_ENTERS)
        post = tree.call(
            gantry_post_group(),
            width=gantry.post_width,
            depth=gantry.beam_depth + (2.0 * sizes.POST_ENCLOSES) if is_outer else gantry.beam_depth * sizes.POST_SHARE,
            height=top - foot,
            steel_material=gantry.steel_material,
            concrete_material=gantry.concrete_material,
        ).value
        parts.append(op.only_if(has_post, move_geometry(post, op.vector(tree, -place, 0.0, foot))))
    return op.join(*parts)


def _catwalk(tree: Tree, gantry: _Gantry, top: Value) -> Value:
    """Add nodes for the catwalk on the beam and its ladder at the right post, or at the left without a right one."""
    end_margin = gantry.post_width * 0.5 + sizes.CATWALK_CLEAR
    length = op.maximum(gantry.left_end - gantry.right_end - end_margin * 2.0, 1.0)
    walk = tree.call(gantry_catwalk_group(), length=length, beam_depth=gantry.beam_depth).value
    walk = move_geometry(walk, op.vector(tree, end_margin - gantry.left_end, 0.0, top))
    # The ladder is at the post, behind the boards that face the carriageway beside it.
    place = op.switch(gantry.right_post, gantry.left_end, gantry.right_end)
    side = op.switch(gantry.right_post, -1.0, 1.0)
    foot = height_on(gantry.road, gantry.terrain, op.vector(tree, 0.0, place)) + gantry.elevation + sizes.LADDER_FOOT
    ladder_height = top + sizes.CATWALK_RAIL - foot
    (rung_width, rung_thickness, rung_spacing), half_width = sizes.LADDER_RUNG, sizes.LADDER_HALF
    rail = box(
        tree,
        op.vector(tree, sizes.LADDER_RAIL, sizes.LADDER_RAIL, ladder_height),
        op.vector(tree, 0.0, 0.0, ladder_height * 0.5),
    )
    rungs = put_on_points(
        row_of_points(tree, op.round_up(ladder_height / rung_spacing - 1.0)),
        box(tree, (rung_width, rung_thickness, rung_thickness)),
        op.vector(tree, 0.0, 0.0, (op.index(tree) + 0.5) * rung_spacing),
    )
    ladder = op.join(move_geometry(rail, (-half_width, 0.0, 0.0)), move_geometry(rail, (half_width, 0.0, 0.0)), rungs)
    y = (gantry.beam_depth * 0.5 + sizes.LADDER_AWAY) * side
    return op.join(walk, move_geometry(op.realize(ladder), op.vector(tree, -place, y, foot)))


def _place_signs(tree: Tree, gantry: _Gantry, lowest_z: Value, beam_bottom: Value) -> Value:
    """Add nodes that move the signs' points to their faces' middles: lower edges in line, small ones on the beam."""
    sign_height = op.named_attribute(tree, "height")
    is_low = lowest_z + sign_height < beam_bottom + gantry.beam_height
    z = op.switch(is_low, lowest_z + sign_height * 0.5, beam_bottom + gantry.beam_height * 0.5)
    thickness = _thickness(gantry.signs)
    signs = op.store(op.across(gantry.signs), "thickness", thickness)
    y = op.named_attribute(tree, "facing") * -1.0 * (gantry.beam_depth * 0.5 + sizes.HANGER + thickness)
    signs = op.set_position(signs, op.vector(tree, op.component(op.position(tree), "X"), y, z))
    return op.store(signs, "level", beam_bottom + gantry.beam_height * 0.5 - z)


def _boards(tree: Tree, gantry: _Gantry, signs: Value) -> tuple[Value, Value]:
    """Add nodes for the bodies of boards and displays behind the signs' points, and for their hangers."""
    width, height, thickness = (op.named_attribute(tree, name) for name in ("width", "height", "thickness"))
    rotation = op.turn(tree, z=op.switch(op.named_attribute(tree, "facing") > 0.0, math.pi, 0.0))
    body = box(tree, 1.0, (0.0, 0.5, 0.0))
    boards = []
    for kind, finish in enumerate((gantry.board_material, gantry.display_material)):
        kind_points = op.separate(signs, op.named_attribute(tree, "display", "INT").equals(kind))
        size = op.vector(tree, width, thickness, height)
        boards.append(put_on_points(kind_points, paint_faces(body, finish), op.position(tree), size, rotation))
    hangers = []
    x_share, hanger_width, overlap = sizes.HUNG
    for side in (-1.0, 1.0):
        x = width * (x_share * side)
        hanger_y = op.named_attribute(tree, "facing") * (thickness + sizes.HANGER / 2)
        hanger_size = op.vector(tree, hanger_width, sizes.HANGER + overlap, op.maximum(height - 0.2, height * 0.5))
        hangers.append(
            put_on_points(
                signs, box(tree, 1.0), op.position(tree) + op.vector(tree, x, hanger_y), hanger_size, rotation
            )
        )
        # A clamp that reaches into the beam; its size is chosen.
        clamp_y = op.named_attribute(tree, "facing") * (thickness + sizes.HANGER + gantry.beam_depth * 0.1)
        clamp = op.vector(tree, 0.16, gantry.beam_depth * 0.3 + 0.05, gantry.beam_height * 0.3)
        place = op.position(tree) + op.vector(tree, x, clamp_y, op.named_attribute(tree, "level"))
        hangers.append(put_on_points(signs, box(tree, 1.0), place, clamp, rotation))
    return op.realize(op.join(*boards)), op.realize(op.join(*hangers))


_LIT = 0.9
"""Share of a display's sides that lights up; chosen."""


@model_part("gantries", 90)
def build_gantries(builder: ModelBuilder) -> None:
    """Add one object per gantry, and one per face of its signs, to the model."""
    for name, gantry in builder.parameters.of_type(Gantry).items():
        cantilever = gantry.kind == "cantilever"
        builder.add_thing(
            name,
            gantry,
            gantry_group(),
            _signs_mesh(gantry),
            left_end=gantry.left_offset - gantry.offset,
            right_end=gantry.right_offset - gantry.offset,
            left_post=not cantilever or gantry.post_side == "left",
            right_post=not cantilever or gantry.post_side == "right",
            middle_post=gantry.kind == "two_sided",
            middle_post_place=-gantry.offset,
            beam=sizes.BEAMS.index(gantry.beam),
            catwalk=gantry.catwalk,
        )
        for place, sign in enumerate(gantry.signs, 1):
            _add_face(builder, name, gantry, place, sign)


def _add_face(builder: ModelBuilder, name: str, gantry: Gantry, number: int, sign: GantrySign) -> None:
    """Add the object of one sign's face to the model; none for a display that shows nothing."""
    has_text = any(line.strip() for line in sign.text)
    if sign.kind == "display" and not has_text:
        return
    inputs = {
        "Gantry": builder.objects[name],
        "Number": number,
        "Instance": gantry.instance,
        **(_display_inputs(sign) if sign.kind == "display" else _board_inputs(sign)),
    }
    role = f"{name}/sign-{number}"
    builder.add(role, None, gantry_sign_group(), inputs, frame=builder.frame(gantry))


def _board_inputs(sign: GantrySign) -> dict[str, Any]:
    """Return the face inputs of a painted board: white text and arrows on blue."""
    return face_inputs(
        FaceStyle("blue", "white", "white", "down_arrow"), "rectangle", sign.width, sign.height, sign.text
    )


def _display_inputs(sign: GantrySign) -> dict[str, Any]:
    """Return the face inputs of a lit display: a speed limit with ring if it shows a number, else lines of text."""
    side = _LIT * min(sign.width, sign.height)
    if "".join(sign.text).isdigit():
        inputs = face_inputs(FaceStyle("black", "red", "white"), "round", side, side, sign.text)
    else:
        size = (_LIT * sign.width, _LIT * sign.height)
        inputs = face_inputs(FaceStyle("black", "black", "white"), "rectangle", *size, sign.text)
    dark_materials = dict.fromkeys(("Ground Material", "Edge Material", "Back Material"), "display")
    ring = "led_red" if "".join(sign.text).isdigit() else "display"
    return inputs | dark_materials | {"Border Material": ring, "Writing Material": "led_white"}


def _signs_mesh(gantry: Gantry) -> bpy.types.Mesh:
    """Create a mesh with one vertex per sign in the gantry's frame, with the attributes that its node group reads."""
    mesh = bpy.data.meshes.new("SR Gantry")
    across = np.array([gantry.offset - sign.offset for sign in gantry.signs])
    fill(mesh, np.column_stack([np.zeros(len(across)), -across, np.zeros(len(across))]))
    # Traffic on the right carriageway comes from -y.
    facing = np.array([sign.facing for sign in gantry.signs])
    values = {
        "width": np.array([sign.width for sign in gantry.signs]),
        "height": np.array([sign.height for sign in gantry.signs]),
        "facing": facing,
        "display": np.array([int(sign.kind == "display") for sign in gantry.signs], dtype=np.int32),
        "number": np.arange(1, len(gantry.signs) + 1, dtype=np.int32),
    }
    for key, value in values.items():
        attribute(mesh, key, value)
    return mesh
