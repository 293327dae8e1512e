"""SR Sign Posts: the posts of a sign, each from the ground below it up to the same height."""

from __future__ import annotations

import math

from ....road.things import sign as sizes
from ....road.things.body import BURIED
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import boolean, integer, material_of, metres, socket
from ...nodes.solids import bars, paint_faces, row_of_points, tube
from ...nodes.standing import OnSurface, on_surface, put_on

MOST_POSTS = 4
"""Largest number of posts."""
_PANEL = 0.9
"""Height of a lattice post's panels, m."""
_DIAGONAL = 0.02
"""Thickness of a lattice post's diagonals, m."""


class _Posts(OnSurface):
    points = socket("Geometry", "Places of the signs on the surface")
    posts = integer(1, (1, MOST_POSTS), "Number of posts")
    width = metres(1.0, (0.01, 20.0), "Width of the sign")
    top = metres(2.5, (0.1, 20.0), "Top of the posts above the sign's place (m)")
    post_diameter = metres(0.076, (0.02, 0.5), "Diameter of a post")
    lattice = boolean(False, "Lattice posts instead of tubes")
    material = material_of("the posts")


@makes_group("SR Sign Posts")
def sign_posts_group(tree: Tree) -> None:
    """The posts of signs, side by side; points carry ``heading`` (rad), ``elevation`` (m) and stand on the surface."""
    sign = _Posts(tree)
    count, top, diameter = sign.posts, sign.top, sign.post_diameter

    with tree.frame("Places side by side, each on the surface below it"):
        x = ((op.index(tree) + 0.5) / count - 0.5) * sign.width
        side_by_side = op.set_position(row_of_points(tree, count), op.vector(tree, x))
        points = op.store(sign.points, "level", op.component(op.position(tree), "Z"))
        places = on_surface(put_on(points, side_by_side), sign.road, sign.terrain)
    with tree.frame("Length from below the surface up"):
        foot = op.component(op.position(tree), "Z") - BURIED
        places = op.store(places, "tall", op.maximum(op.named_attribute(tree, "level") + top - foot, 0.1))
        places = op.set_position(places, op.position(tree) - (0.0, 0.0, BURIED))
    with tree.frame("Tube of height 1"):
        pipe = tube(tree, diameter * 0.5, 1.0)
    with tree.frame("Lattice post of height 1"):
        girder = _lattice(tree, diameter * 0.5 - sizes.LATTICE_CHORD / 2.0, top + BURIED)
    with tree.frame("Posts"):
        post = op.switch(sign.lattice, pipe, girder)
        posts = put_on(places, post, op.vector(tree, 1.0, 1.0, op.named_attribute(tree, "tall")))
        posts = paint_faces(posts, sign.material)
    tree.output("Mesh", posts, description="Posts")


def _lattice(tree: Tree, radius: Value, height: Value) -> Value:
    """Add nodes for a lattice post, squeezed from its height (m) to 1 m: three chords on a circle, with diagonals."""
    angles = [math.pi / 2.0 + 2.0 * math.pi * i / 3.0 for i in range(3)]
    corners = [(math.cos(angle), math.sin(angle), 0.0) for angle in angles]

    def corner(number: Value) -> Value:
        return op.choose(number % 3, corners) * radius

    chords = row_of_points(tree, 3)
    foot = corner(op.index(tree))
    chords = bars(chords, foot, foot + (0.0, 0.0, 1.0), sizes.LATTICE_CHORD)
    panels = op.round_up(height / _PANEL)
    number = op.index(tree)
    side, panel = number // panels, number % panels
    is_odd = panel % 2
    start = corner(side + is_odd) + op.vector(tree, 0.0, 0.0, panel * _PANEL)
    end = corner(side + 1 - is_odd) + op.vector(tree, 0.0, 0.0, (panel + 1) * _PANEL)
    diagonals = bars(row_of_points(tree, panels * 3), start, end, _DIAGONAL)
    unit_diagonals = op.transform(diagonals, scale=op.vector(tree, 1.0, 1.0, 1.0 / (panels * _PANEL)))
    return op.join(chords, unit_diagonals)
