"""SR Sign: a traffic sign on its posts."""

from __future__ import annotations

from ....base.classes import class_id
from ....road.things import sign as sizes
from ....road.things.sign import TrafficSign
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, boolean, integer, material_of, metres
from ...nodes.solids import box, move_geometry, paint_faces, put_on_points, row_of_points, tube
from ...nodes.standing import Standing, put_on
from ..model_builder import ModelBuilder
from ..registry import model_part
from .face import Face, sign_face_group
from .looks import sign_face_inputs
from .outline import SHAPES
from .posts import MOST_POSTS, sign_posts_group

_RAIL_SPACING = 0.9
"""Largest distance between rails, m; chosen."""
_PLAY = 0.0005
"""Gap between rails and the parts in front of and behind them, m; chosen."""
_CLAMP = 0.05
"""Height of a clamp, m; chosen."""


class _SignInputs(Inputs):
    lower_edge = metres(2.0, (0.0, 10.0), "Lower edge of the face above the surface")
    posts = integer(1, (1, MOST_POSTS), "Number of posts")
    post_diameter = metres(0.076, (0.02, 0.5), "Diameter of a post")
    lattice = boolean(False, "Lattice posts instead of tubes")
    post_material = material_of("the posts", "galvanised_steel")


@makes_group("SR Sign", catalogue="Signs")
def sign_group(tree: Tree) -> None:
    """A traffic sign on its posts, facing those who drive along +y; points carry ``heading`` and ``elevation``."""
    standing, face, sign = Standing(tree), Face(tree), _SignInputs(tree)

    with tree.frame("What is behind the face, by its shape"):
        back_sizes = op.choose(face.shape, [sizes.BEHIND[shape] for shape in SHAPES])
        top_share, spread_share, length_share = (op.component(back_sizes, axis) for axis in "XYZ")
    with tree.frame("Face, in front of the posts"):
        plate = tree.call(sign_face_group(), instance=standing.instance, **face.values).value
        front = (sign.post_diameter * 0.5 + face.thickness + sizes.RAIL) * -1.0
        plate = move_geometry(plate, op.vector(tree, 0.0, front, sign.lower_edge + face.height * 0.5))
    mounting = _mounting(tree, face, sign, spread_share, length_share)
    with tree.frame("Put onto the points"):
        places = standing.places()
        mesh = put_on(places, op.join(plate, mounting))
    with tree.frame("Posts"):
        posts = tree.call(
            sign_posts_group(),
            points=places,
            road=standing.road,
            terrain=standing.terrain,
            posts=sign.posts,
            width=face.width,
            top=sign.lower_edge + face.height * top_share,
            post_diameter=sign.post_diameter,
            lattice=sign.lattice,
            material=sign.post_material,
        ).value
    with tree.frame("Labels"):
        mesh = standing.label(op.join(mesh, posts), class_id(TrafficSign.points_class))
    tree.output("Mesh", mesh, description="Sign with its posts")


def _mounting(tree: Tree, face: Face, sign: _SignInputs, spread_share: Value, length_share: Value) -> Value:
    """Add nodes for the rails behind the face and the clamps that hold them to the posts."""
    with tree.frame("Rails behind the face, one above the other"):
        count = op.round_up(op.maximum(face.height / _RAIL_SPACING, 2.0))

        def rail_height(rail_index: Value) -> Value:
            """Add nodes for the height (m) of a rail above the surface."""
            return sign.lower_edge + face.height * spread_share * ((rail_index + 0.5) / count)

        # Slightly less deep than the gap: rays can't tell apart coinciding faces.
        bar = box(tree, op.vector(tree, face.width * length_share, sizes.RAIL - 2.0 * _PLAY, sizes.RAIL))
        depth = (sign.post_diameter + sizes.RAIL) * -0.5
        rails = put_on_points(row_of_points(tree, count), bar, op.vector(tree, 0.0, depth, rail_height(op.index(tree))))
    with tree.frame("Clamps around the posts"):
        radius, height = sign.post_diameter * 0.5 + sizes.CLAMP, _CLAMP
        clamp = tube(tree, radius, height, 8)
        clamp_index = op.index(tree)
        x = (((clamp_index % sign.posts) + 0.5) / sign.posts - 0.5) * face.width
        place = op.vector(tree, x, 0.0, rail_height(clamp_index // sign.posts) - height / 2.0)
        clamps = put_on_points(row_of_points(tree, sign.posts * count), clamp, place)
        return paint_faces(op.join(rails, clamps), face.back_material)


@model_part("signs", 110)
def build_signs(builder: ModelBuilder) -> None:
    """Add one object per traffic sign to the model."""
    for name, sign in builder.parameters.of_type(TrafficSign).items():
        builder.add_thing(
            name,
            sign,
            sign_group(),
            **sign_face_inputs(sign),
            lattice=sign.on_lattices,
        )
