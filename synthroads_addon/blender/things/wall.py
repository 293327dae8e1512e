"""Walls with a coping (SR Wall)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import wall as sizes
from ...road.things.body import BURIED
from ...road.things.wall import Wall
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.foot import Lengthwise, sweep
from ..nodes.inputs import instance_number, material_of, metres
from ..nodes.solids import paint_faces
from .model_builder import ModelBuilder
from .registry import model_part

_BLOCK = [(1.0, 0.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, 0.0)]
"""Outline of wall and coping: x in half thicknesses, z in heights."""


class _Wall(Lengthwise):
    height = metres(1.8, (0.3, 6.0), "Top of the coping above the surface")
    thickness = metres(0.24, (0.08, 1.0), "Thickness below the coping")
    step = metres(2.0, (0.1, 8.0), "Largest length of a straight piece")
    instance = instance_number()
    material = material_of("the wall", "plaster")
    coping_material = material_of("the coping", "noise_concrete")


@makes_group("SR Wall", catalogue="Barriers")
def wall_group(tree: Tree) -> None:
    """A wall along the road, with a coping."""
    wall = _Wall(tree)
    line = wall.rows(wall.step)
    with tree.frame("Wall and coping"):
        half_thickness, body_height = wall.thickness * 0.5, wall.height - sizes.COPING
        block = paint_faces(sweep(line, _BLOCK, half_thickness, body_height + BURIED, -BURIED), wall.material)
        coping = paint_faces(
            sweep(line, _BLOCK, half_thickness + sizes.OVERHANG, sizes.COPING, body_height), wall.coping_material
        )
    with tree.frame("Labels"):
        mesh = op.label(op.join(block, coping), class_id(Wall.points_class), wall.instance)
    tree.output("Mesh", mesh, description="Wall and coping")


@model_part("walls", 64)
def build_walls(builder: ModelBuilder) -> None:
    """Add one object per wall to the model."""
    for name, wall in builder.parameters.of_type(Wall).items():
        end = builder.along(min(wall.end_station, builder.geometry.length))
        builder.add_thing(
            name, wall, wall_group(), end_station=end, step=builder.step, material=sizes.MATERIALS[wall.kind]
        )
