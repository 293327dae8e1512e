"""Parts of a gantry: SR Gantry Beam (box, truss or tube), SR Gantry Post, and SR Gantry Catwalk on the beam.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math

from ....road.things import gantry as sizes
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, integer, material_of, metres
from ...nodes.solids import bars, box, move_geometry, paint_faces, prism, put_on_points, row_of_points

_JOINT_SPACING = 9.0
"""Largest distance between the bolted joints of a box or tube, m; chosen."""


class _Beam(Inputs):
    beam = integer(0, (0, 2), "Shape: 0 box, 1 truss, 2 tube")
    length = metres(15.0, (0.5, 200.0), "Length")
    height = metres(0.8, (0.2, 3.0), "Height")
    depth = metres(0.6, (0.2, 3.0), "Depth along the road")


@makes_group("SR Gantry Beam")
def gantry_beam_group(tree: Tree) -> None:
    """A beam from x = 0 on along x, in the middle of y, its lower edge on z = 0."""
    inputs = _Beam(tree)
    kind, length, height, depth = inputs.beam, inputs.length, inputs.height, inputs.depth
    middle = op.vector(tree, length * 0.5, 0.0, height * 0.5)
    with tree.frame("Box"):
        solid = box(tree, op.vector(tree, length, depth, height), middle)
    with tree.frame("Truss"):
        lattice = op.join(_chords(tree, length, height, depth), _lattice(tree, length, height, depth))
    with tree.frame("Tube"):
        cylinder = tree.node("GeometryNodeMeshCylinder", vertices=sizes.TUBE_SIDES, radius=0.5, depth=1.0).value
        unit_tube = op.transform(cylinder, rotation=op.turn(tree, y=math.pi / 2))
        size = op.vector(tree, length, depth, height)
        tube = op.transform(unit_tube, translation=middle, scale=size)
    with tree.frame("Bolted joints of box and tube"):
        joints = _joints(tree, kind, length, height, depth)
    with tree.frame("The chosen one"):
        parts = [op.only_if(kind.equals(i), part) for i, part in enumerate((solid, lattice, tube))]
        mesh = op.realize(op.join(*parts, op.only_if(~kind.equals(1), joints)))
    tree.output("Mesh", mesh, description="The beam")


def _chord(height: Value) -> Value:
    """Add nodes for the width (m) of a truss's chords."""
    share, minimum, maximum = sizes.TRUSS_CHORD
    return op.minimum(op.maximum(height * share, minimum), maximum)


def _chords(tree: Tree, length: Value, height: Value, depth: Value) -> Value:
    """Add nodes for the four chords of a truss, along the beam's edges."""
    width = _chord(height)
    bar = box(tree, op.vector(tree, length, width, width))
    chords = []
    for y_side in (-1.0, 1.0):
        for z_side in (-1.0, 1.0):
            x, y = length * 0.5, (depth - width) * (0.5 * y_side)
            z = height * 0.5 + (height - width) * (0.5 * z_side)
            chords.append(move_geometry(bar, op.vector(tree, x, y, z)))
    return op.join(*chords)


def _lattice(tree: Tree, length: Value, height: Value, depth: Value) -> Value:
    """Add nodes for a truss's posts, cross bars and diagonals; every second bay is upside down."""
    width = _chord(height)
    bays = op.round_up(length / (op.maximum(height, sizes.TRUSS_BAY[0]) * sizes.TRUSS_BAY[1]))
    points = row_of_points(tree, bays * len(sizes.TRUSS_BARS) + sizes.TRUSS_FRAME)
    bay, bar_index = op.index(tree) // len(sizes.TRUSS_BARS), op.index(tree) % len(sizes.TRUSS_BARS)
    mirror_sign = 1.0 - (bay % 2) * 2.0
    bar_ends = []
    for end in (0, 1):
        corner = op.choose(bar_index, [bar[end] for bar in sizes.TRUSS_BARS])
        x = (bay + op.component(corner, "X")) * (length - width) / bays + width * 0.5
        y = op.component(corner, "Y") * mirror_sign * ((depth - width) * 0.5)
        z = (op.component(corner, "Z") - 0.5) * mirror_sign * (height - width) + height * 0.5
        bar_ends.append(op.vector(tree, x, y, z))
    return bars(points, bar_ends[0], bar_ends[1], width * sizes.TRUSS_BAR)


def _joints(tree: Tree, kind: Value, length: Value, height: Value, depth: Value) -> Value:
    """Add nodes for the flanges of the bolted joints of a box or tube beam, no higher than it."""
    piece_count = op.round_up(length / _JOINT_SPACING)
    points = row_of_points(tree, piece_count - 1)
    place = op.vector(tree, (op.index(tree) + 1) * (length / piece_count), 0.0, height * 0.5)
    plate = box(tree, op.vector(tree, 0.08, depth + 0.06, height * 0.97))
    ring = tree.node("GeometryNodeMeshCylinder", vertices=sizes.TUBE_SIDES, radius=0.5, depth=0.08).value
    ring = op.transform(ring, rotation=op.turn(tree, y=math.pi / 2))
    ring = op.transform(ring, scale=op.vector(tree, 1.0, depth + sizes.JOINT, height * 0.995))
    flange = op.join(op.only_if(kind.equals(0), plate), op.only_if(kind.equals(2), ring))
    return put_on_points(points, flange, place)


class _Catwalk(Inputs):
    length = metres(15.0, (0.5, 200.0), "Length")
    beam_depth = metres(0.6, (0.2, 3.0), "Depth of the beam that it stands on")


@makes_group("SR Gantry Catwalk")
def gantry_catwalk_group(tree: Tree) -> None:
    """A catwalk from x = 0 on along x, in the middle of y, standing on z = 0: grating, supports, railings."""
    support, grate, bar = sizes.CATWALK_SUPPORT, sizes.CATWALK_GRATING, sizes.CATWALK_BAR
    catwalk = _Catwalk(tree)
    length, width = catwalk.length, op.maximum(catwalk.beam_depth, sizes.NARROWEST_CATWALK)
    with tree.frame("Grating and toe boards"):
        grating_z = support + grate / 2
        toe_thickness, toe_height, toe_z = sizes.CATWALK_TOE
        grating = box(tree, op.vector(tree, length, width, grate), op.vector(tree, length * 0.5, 0.0, grating_z))
        toe = box(
            tree,
            op.vector(tree, length, toe_thickness, toe_height),
            op.vector(tree, length * 0.5, 0.0, support + toe_z),
        )
        rail = box(tree, op.vector(tree, length, bar, bar), op.vector(tree, length * 0.5, 0.0, 0.0))
    with tree.frame("Railings on both sides"):
        edge = width * 0.5 - bar / 2
        top = support + grate + sizes.CATWALK_RAIL
        parts = [grating]
        for side in (-1.0, 1.0):
            parts.append(move_geometry(toe, op.vector(tree, 0.0, edge * side)))
            parts += [
                move_geometry(rail, op.vector(tree, 0.0, edge * side, z))
                for z in (top - bar / 2, top - sizes.CATWALK_RAIL / 2)
            ]
    with tree.frame("Posts of the railings, and supports below the grating"):
        bays = op.round_up(length / sizes.CATWALK_SPACING)
        points = row_of_points(tree, bays + 1)
        x = op.index(tree) * ((length - bar) / bays) + bar / 2
        post_height = top - bar - support
        post_width = bar * sizes.CATWALK_POST
        post = box(tree, (post_width, post_width, post_height), (0.0, 0.0, support + post_height / 2))
        frame = [move_geometry(post, op.vector(tree, 0.0, edge * side)) for side in (-1.0, 1.0)]
        size = op.vector(tree, support, width * sizes.CATWALK_SUPPORT_SHARE, support + sizes.CATWALK_SUPPORT_EXCESS)
        feet = box(tree, size, (0.0, 0.0, support / 2))
        parts.append(put_on_points(points, op.join(feet, *frame), op.vector(tree, x)))
    with tree.frame("All"):
        mesh = op.realize(op.join(*parts))
    tree.output("Mesh", mesh, description="The catwalk")


_BOLT = [(0.025, 0.0), (0.0125, 0.0217), (-0.0125, 0.0217), (-0.025, 0.0), (-0.0125, -0.0217), (0.0125, -0.0217)]
"""Outline of a bolt's hexagonal head, m."""
_BOLTS = [(x, y, 0.0) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) if x or y]
"""Places of the bolts around a post, in half sides of their square."""


class _Post(Inputs):
    width = metres(0.5, (0.1, 1.5), "Width across the road")
    depth = metres(0.6, (0.1, 3.5), "Depth along the road")
    height = metres(6.0, (0.5, 20.0), "Top above the surface")
    steel_material = material_of("the post")
    concrete_material = material_of("the plinth")


@makes_group("SR Gantry Post")
def gantry_post_group(tree: Tree) -> None:
    """A post on the origin, which lies on the surface."""
    inputs = _Post(tree)
    width, depth, height = inputs.width, inputs.depth, inputs.height
    with tree.frame("Plinth"):
        margin = 2.0 * sizes.PLINTH_MARGIN
        size = op.vector(tree, width + margin, depth + margin, sizes.PLINTH + sizes.BURIED)
        plinth = paint_faces(box(tree, size, (0.0, 0.0, (sizes.PLINTH - sizes.BURIED) / 2)), inputs.concrete_material)
    with tree.frame("Base plate"):
        margin = 2.0 * sizes.PLATE_MARGIN
        plate_thickness = sizes.BASE_PLATE + sizes.PLATE_SUNK
        plate_z = sizes.PLINTH + (sizes.BASE_PLATE - sizes.PLATE_SUNK) / 2
        plate = box(tree, op.vector(tree, width + margin, depth + margin, plate_thickness), (0.0, 0.0, plate_z))
    with tree.frame("Post"):
        post_height = height - sizes.PLINTH - sizes.BASE_PLATE + sizes.PLATE_SUNK
        post = box(
            tree,
            op.vector(tree, width, depth, post_height),
            op.vector(tree, 0.0, 0.0, post_height * 0.5 + (sizes.PLINTH + sizes.BASE_PLATE - sizes.PLATE_SUNK)),
        )
    with tree.frame("Bolts"):
        bolts = _bolts(tree, width, depth)
    with tree.frame("All of steel"):
        mesh = op.join(plinth, paint_faces(op.join(plate, post, op.realize(bolts)), inputs.steel_material))
    tree.output("Mesh", mesh, description="The post")


def _bolts(tree: Tree, width: Value, depth: Value) -> Value:
    """Add nodes for the bolts around a post, on its base plate."""
    half_sides = op.vector(tree, width * 0.5 + sizes.PLATE_MARGIN * 0.55, depth * 0.5 + sizes.PLATE_MARGIN * 0.55, 0.0)
    place = op.choose(op.index(tree), _BOLTS) * half_sides + (0.0, 0.0, sizes.PLINTH + 0.03)
    return put_on_points(row_of_points(tree, len(_BOLTS)), prism(tree, _BOLT, (1.0, 1.0, 0.06)), place)
