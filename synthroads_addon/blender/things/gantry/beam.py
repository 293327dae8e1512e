"""SR Gantry Beam: the beam of a gantry as a box, a truss or a tube."""

from __future__ import annotations

import math

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, integer, metres
from ...nodes.solids import bars, box, move_geometry, put_on_points, row_of_points

KINDS = ("box", "truss", "tube")
# Bars of one bay of the truss from x = 0 to 1, y = -1 to 1, z = 0 to 1; the first four are its frame.
_BARS = [
    ((0.0, -1.0, 0.0), (0.0, -1.0, 1.0)), ((0.0, 1.0, 0.0), (0.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 1.0, 0.0)), ((0.0, -1.0, 1.0), (0.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (1.0, -1.0, 1.0)), ((0.0, 1.0, 0.0), (1.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (1.0, 1.0, 0.0)), ((0.0, -1.0, 1.0), (1.0, 1.0, 1.0)),
]  # fmt: skip
_FRAME = 4
_BAY = 1.2
"""Length of a bay as a share of the truss's height."""
_JOINT_SPACING = 9.0  # m, between the bolted joints of a box or tube
_TUBE_SIDES = 20


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
        round_ = tree.node("GeometryNodeMeshCylinder", vertices=_TUBE_SIDES, radius=0.5, depth=1.0).value
        lying = op.transform(round_, rotation=op.turn(tree, y=math.pi / 2))
        size = op.vector(tree, length, depth, height)
        tube = op.transform(lying, translation=middle, scale=size)
    with tree.frame("Bolted joints of box and tube"):
        joints = _joints(tree, kind, length, height, depth)
    with tree.frame("The chosen one"):
        parts = [op.only_if(kind.equals(i), part) for i, part in enumerate((solid, lattice, tube))]
        mesh = op.realize(op.join(*parts, op.only_if(~kind.equals(1), joints)))
    tree.output("Mesh", mesh, description="The beam")


def _chord(height: Value) -> Value:
    """Return the width of the truss's chords."""
    return op.minimum(op.maximum(height * 0.1, 0.06), 0.16)


def _chords(tree: Tree, length: Value, height: Value, depth: Value) -> Value:
    width = _chord(height)
    bar = box(tree, op.vector(tree, length, width, width))
    return op.join(
        *(
            move_geometry(
                bar,
                op.vector(tree, length * 0.5, (depth - width) * (0.5 * y), height * 0.5 + (height - width) * (0.5 * z)),
            )
            for y in (-1.0, 1.0)
            for z in (-1.0, 1.0)
        )
    )


def _lattice(tree: Tree, length: Value, height: Value, depth: Value) -> Value:
    """Return posts, cross bars and diagonals; every second bay is turned upside down."""
    width = _chord(height)
    bays = op.round_up(length / (op.maximum(height, 0.5) * _BAY))
    points = row_of_points(tree, bays * len(_BARS) + _FRAME)
    bay, number = op.index(tree) // len(_BARS), op.index(tree) % len(_BARS)
    mirror = 1.0 - (bay % 2) * 2.0
    ends = []
    for end in (0, 1):
        corner = op.choose(number, [bar[end] for bar in _BARS])
        x = (bay + op.component(corner, "X")) * (length - width) / bays + width * 0.5
        y = op.component(corner, "Y") * mirror * ((depth - width) * 0.5)
        z = (op.component(corner, "Z") - 0.5) * mirror * (height - width) + height * 0.5
        ends.append(op.vector(tree, x, y, z))
    return bars(points, ends[0], ends[1], width * 0.65)


def _joints(tree: Tree, kind: Value, length: Value, height: Value, depth: Value) -> Value:
    """Return pairs of flanges, no higher than the beam."""
    pieces = op.round_up(length / _JOINT_SPACING)
    points = row_of_points(tree, pieces - 1)
    place = op.vector(tree, (op.index(tree) + 1) * (length / pieces), 0.0, height * 0.5)
    plate = box(tree, op.vector(tree, 0.08, depth + 0.06, height * 0.97))
    ring = tree.node("GeometryNodeMeshCylinder", vertices=_TUBE_SIDES, radius=0.5, depth=0.08).value
    ring = op.transform(ring, rotation=op.turn(tree, y=math.pi / 2))
    ring = op.transform(ring, scale=op.vector(tree, 1.0, depth + 0.08, height * 0.995))
    flange = op.join(op.only_if(kind.equals(0), plate), op.only_if(kind.equals(2), ring))
    return put_on_points(points, flange, place)
