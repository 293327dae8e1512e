"""Gutters with a kerb (SR Gutter)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import gutter as sizes
from ...road.things.body import BURIED
from ...road.things.gutter import Gutter
from ..nodes import operations as op
from ..nodes.builder import Operand, Tree, Value, makes_group
from ..nodes.foot import Lengthwise, sweep
from ..nodes.inputs import boolean, instance_number, material_of, metres
from .model_builder import ModelBuilder
from .registry import model_part


class _Gutter(Lengthwise):
    kerb_on_right = boolean(False, "The kerb is on its right, else on its left, seen with the stations")
    width = metres(0.4, (0.2, 1.0), "Width, kerb included")
    height = metres(0.08, (0.02, 0.2), "Top of the kerb above the surface")
    step = metres(2.0, (0.1, 8.0), "Largest length of a straight piece")
    instance = instance_number()
    material = material_of("the gutter", "concrete")


@makes_group("SR Gutter", catalogue="Barriers")
def gutter_group(tree: Tree) -> None:
    """A gutter along the road: a channel and its kerb."""
    gutter = _Gutter(tree)
    line = gutter.rows(gutter.step)
    with tree.frame("Channel and kerb"):
        channel = _solid(line, gutter, sizes.CHANNEL, sizes.RIM + BURIED)
        kerb = _solid(line, gutter, sizes.BLOCK, gutter.height + BURIED)
    with tree.frame("Labels"):
        mesh = op.label(op.join(channel, kerb), class_id(Gutter.points_class), gutter.instance, gutter.material)
    tree.output("Mesh", mesh, description="Channel and kerb")


def _solid(line: Value, gutter: _Gutter, outline: tuple[tuple[float, float], ...], height: Operand) -> Value:
    """Add nodes for the solid of an outline, mirrored where the kerb is on the right."""
    half_width = gutter.width * 0.5
    left_solid = sweep(line, list(outline), half_width, height, -BURIED)
    right_solid = sweep(line, sizes.mirrored(outline), half_width, height, -BURIED)
    return op.switch(gutter.kerb_on_right, left_solid, right_solid)


@model_part("gutters", 68)
def build_gutters(builder: ModelBuilder) -> None:
    """Add one object per gutter to the model."""
    for name, gutter in builder.parameters.of_type(Gutter).items():
        end = builder.along(min(gutter.end_station, builder.geometry.length))
        on_right = gutter.kerb_side == "right"
        builder.add_thing(name, gutter, gutter_group(), end_station=end, step=builder.step, kerb_on_right=on_right)
