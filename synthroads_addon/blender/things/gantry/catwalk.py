"""SR Gantry Catwalk: the catwalk on top of a gantry's beam."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import Inputs, metres
from ...nodes.solids import box, move_geometry, put_on_points, row_of_points

_SPACING = 2.0  # m, between the railings' posts
_HANDRAIL = 1.1  # m above the grating
_BAR = 0.045
_NARROWEST = 0.7
_SUPPORT, _GRATING = 0.06, 0.04


class _Catwalk(Inputs):
    length = metres(15.0, (0.5, 200.0), "Length")
    beam_depth = metres(0.6, (0.2, 3.0), "Depth of the beam that it stands on")


@makes_group("SR Gantry Catwalk")
def gantry_catwalk_group(tree: Tree) -> None:
    """A catwalk from x = 0 on along x, in the middle of y, standing on z = 0: grating, supports, railings."""
    catwalk = _Catwalk(tree)
    length, width = catwalk.length, op.maximum(catwalk.beam_depth, _NARROWEST)
    with tree.frame("Grating and toe boards"):
        level = _SUPPORT + _GRATING / 2
        grating = box(tree, op.vector(tree, length, width, _GRATING), op.vector(tree, length * 0.5, 0.0, level))
        toe = box(tree, op.vector(tree, length, 0.01, 0.12), op.vector(tree, length * 0.5, 0.0, _SUPPORT + 0.1))
        rail = box(tree, op.vector(tree, length, _BAR, _BAR), op.vector(tree, length * 0.5, 0.0, 0.0))
    with tree.frame("Railings on both sides"):
        edge = width * 0.5 - _BAR / 2
        top = _SUPPORT + _GRATING + _HANDRAIL
        parts = [grating]
        for side in (-1.0, 1.0):
            parts.append(move_geometry(toe, op.vector(tree, 0.0, edge * side)))
            parts += [
                move_geometry(rail, op.vector(tree, 0.0, edge * side, z)) for z in (top - _BAR / 2, top - _HANDRAIL / 2)
            ]
    with tree.frame("Posts of the railings, and supports below the grating"):
        bays = op.round_up(length / _SPACING)
        points = row_of_points(tree, bays + 1)
        x = op.index(tree) * ((length - _BAR) / bays) + _BAR / 2
        tall = top - _BAR - _SUPPORT
        post = box(tree, (_BAR * 0.8, _BAR * 0.8, tall), (0.0, 0.0, _SUPPORT + tall / 2))
        frame = [move_geometry(post, op.vector(tree, 0.0, edge * side)) for side in (-1.0, 1.0)]
        support = box(tree, op.vector(tree, 0.06, width * 0.96, _SUPPORT + 0.02), (0.0, 0.0, _SUPPORT / 2))
        parts.append(put_on_points(points, op.join(support, *frame), op.vector(tree, x)))
    with tree.frame("All"):
        mesh = op.realize(op.join(*parts))
    tree.output("Mesh", mesh, description="The catwalk")
