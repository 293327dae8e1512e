"""Fences: posts, and between them wire mesh or rails (SR Fence)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import fence as sizes
from ...road.things.body import BURIED
from ...road.things.fence import Fence
from ..nodes import operations as op
from ..nodes.backbone import last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import Lengthwise, sweep
from ..nodes.inputs import boolean, instance_number, material_of, metres
from ..nodes.solids import paint_faces, put_on_points, tube
from .model_builder import ModelBuilder
from .registry import model_part

_BAND = [(1.0, 0.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, 0.0)]
"""Outline of a band: x in half thicknesses, z in heights."""


class _Fence(Lengthwise):
    rails = boolean(False, "Rails of wood, else wire mesh")
    height = metres(1.8, (0.5, 4.0), "Top of the posts above the surface")
    post_spacing = metres(5.0, (1.0, 20.0), "Distance between posts")
    post_diameter = metres(0.1, (0.03, 0.4), "Diameter of the posts (m)")
    instance = instance_number()
    post_material = material_of("the posts", "noise_wood")
    mesh_material = material_of("the wire mesh", "wire_mesh")
    rail_material = material_of("the rails", "noise_wood")


@makes_group("SR Fence", catalogue="Barriers")
def fence_group(tree: Tree) -> None:
    """A fence along the road: posts, and bands of wire mesh or rails that follow the ground from post to post."""
    fence = _Fence(tree)
    line = fence.rows(fence.post_spacing)
    with tree.frame("Posts; none where the fence goes on beyond what it follows"):
        station = op.named_attribute(tree, "station")
        end = last_station(fence.axis())
        post_index, last_index = op.index(tree), op.point_count(line) - 1
        target = op.minimum(fence.start_station + post_index * fence.post_spacing, fence.end_station)
        is_outside = (target - station > 1e-3) | (station - target > 1e-3)
        # A post on the end of a backbone beyond which the fence goes on belongs to the road's next section.
        is_next_section = (station > end - 1e-3) & (fence.end_station > end + 1e-3) & (post_index < last_index)
        posts = op.delete_points(line, is_outside | is_next_section)
        body = tube(tree, 1.0, 1.0, sizes.SIDES)
        radius = fence.post_diameter * 0.5
        size = op.vector(tree, radius, radius, fence.height + BURIED)
        foot = op.named_attribute(tree, "foot", "FLOAT_VECTOR")
        rotation = op.upright(op.named_attribute(tree, "left", "FLOAT_VECTOR"))
        posts = op.realize(put_on_points(posts, body, foot + (0.0, 0.0, -BURIED), size, rotation))
        posts = paint_faces(posts, fence.post_material)
    with tree.frame("Bands"):
        mesh = paint_faces(_bands(line, fence, "wildlife"), fence.mesh_material)
        rails = paint_faces(_bands(line, fence, "rails"), fence.rail_material)
        bands = op.switch(fence.rails, mesh, rails)
    with tree.frame("Labels"):
        fence_mesh = op.label(op.join(bands, posts), class_id(Fence.points_class), fence.instance)
    tree.output("Mesh", fence_mesh, description="Posts and bands")


def _bands(line: Value, fence: _Fence, kind: str) -> Value:
    """Add nodes for the bands of a kind of fence: wire mesh or rails."""
    bands = [
        sweep(line, _BAND, band.thickness / 2.0, fence.height * (band.high - band.low), fence.height * band.low)
        for band in sizes.KINDS[kind]
    ]
    return op.join(*bands) if len(bands) > 1 else bands[0]


@model_part("fences", 62)
def build_fences(builder: ModelBuilder) -> None:
    """Add one object per fence to the model."""
    for name, fence in builder.parameters.of_type(Fence).items():
        end = builder.along(min(fence.end_station, builder.geometry.length))
        builder.add_thing(name, fence, fence_group(), end_station=end, rails=fence.kind == "rails")
