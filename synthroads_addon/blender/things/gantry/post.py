"""SR Gantry Post: a gantry's post with base plate, bolts and plinth."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, paint_faces, prism, put_on_points, row_of_points

PLINTH = 0.3
"""Top of the plinth above the surface, m."""
BURIED = 0.6
"""Depth of the plinth below the surface, m."""
_PLATE, _PLATE_MARGIN, _PLINTH_MARGIN = 0.04, 0.12, 0.2
_BOLT = [(0.025, 0.0), (0.0125, 0.0217), (-0.0125, 0.0217), (-0.025, 0.0), (-0.0125, -0.0217), (0.0125, -0.0217)]
_BOLTS = [(x, y, 0.0) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) if x or y]


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
        margin = 2.0 * _PLINTH_MARGIN
        size = op.vector(tree, width + margin, depth + margin, PLINTH + BURIED)
        plinth = paint_faces(box(tree, size, (0.0, 0.0, (PLINTH - BURIED) / 2)), inputs.concrete_material)
    with tree.frame("Base plate"):
        margin = 2.0 * _PLATE_MARGIN
        plate = box(tree, op.vector(tree, width + margin, depth + margin, _PLATE + 0.01), (0.0, 0.0, PLINTH + 0.015))
    with tree.frame("Post"):
        tall = height - PLINTH - _PLATE + 0.01
        post = box(
            tree,
            op.vector(tree, width, depth, tall),
            op.vector(tree, 0.0, 0.0, tall * 0.5 + (PLINTH + _PLATE - 0.01)),
        )
    with tree.frame("Bolts"):
        bolts = _bolts(tree, width, depth)
    with tree.frame("All of steel"):
        mesh = op.join(plinth, paint_faces(op.join(plate, post, op.realize(bolts)), inputs.steel_material))
    tree.output("Mesh", mesh, description="The post")


def _bolts(tree: Tree, width: Value, depth: Value) -> Value:
    """Return bolts around the post, on the base plate."""
    half = op.vector(tree, width * 0.5 + _PLATE_MARGIN * 0.55, depth * 0.5 + _PLATE_MARGIN * 0.55, 0.0)
    place = op.choose(op.index(tree), _BOLTS) * half + (0.0, 0.0, PLINTH + 0.03)
    return put_on_points(row_of_points(tree, len(_BOLTS)), prism(tree, _BOLT, (1.0, 1.0, 0.06)), place)
