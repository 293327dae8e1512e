"""The ground beside the road, and the batters that join it to the road (SR Terrain)."""

from __future__ import annotations

import bpy
import numpy as np

from ...base.classes import class_id
from ..materials import material
from ..nodes import operations as op
from ..nodes.backbone import cut, row
from ..nodes.builder import Tree, Value, node_group
from ..nodes.strip import INSTANCES
from .meshes import ground_mesh
from .model_builder import ModelBuilder

_FINE = 0.12
"""Share of even spacing among the columns; the rest grows away from the road."""


def terrain_group() -> bpy.types.NodeTree:
    """Return the group SR Terrain."""
    return node_group("SR Terrain", _build)


def _build(tree: Tree) -> None:
    """Ground on both sides of the road, joined to it by batters of a given slope."""
    backbone = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Object", description="The road, whose outermost edges the terrain begins at")
    ground = tree.input("Ground", "Object", description="Surface of the ground before the road was built")
    reach = tree.number(
        "Half Width", 60.0, (5.0, 1000.0), unit="m", description="Reach to either side of the axis"
    )
    batter = tree.number(
        "Batter Slope", 1.5, (0.5, 10.0), description="Run of the batter per metre of height (m/m)"
    )
    columns = tree.integer(
        "Columns", 40, (3, 500), description="Points across each side, closer near the road"
    )
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    material = tree.input("Material", "Material", description="Material of the ground")

    with tree.frame("Geometry"):
        axis, surface = op.object_geometry(backbone), op.object_geometry(ground)
        edges = op.object_geometry(road)
    sides = []
    for name, sign in (("Left", 1.0), ("Right", -1.0)):
        with tree.frame(f"{name} edge of the road"):
            edge = op.separate(edges, op.named(tree, "edge") * sign > 0.5)
        with tree.frame(f"{name} side"):
            sides.append(tree.call(
                _side_group(),
                backbone=axis,
                edge=edge,
                ground=surface,
                side=sign,
                half_width=reach,
                batter_slope=batter,
                columns=columns,
            ).value)  # fmt: skip
    with tree.frame("Labels"):
        mesh = op.label(op.join(*sides), class_id("ground"), instance, material)
    tree.output("Mesh", mesh, description="Terrain; its points carry their distance from the road")


def _side_group() -> bpy.types.NodeTree:
    return node_group("SR Terrain Side", _build_side)


def _build_side(tree: Tree) -> None:
    """Terrain on one side: from the road's edge outwards, between the batter's two planes."""
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    edge = tree.input(
        "Edge", "Geometry", description="Points of the road's edge, one per row of the backbone"
    )
    ground = tree.input("Ground", "Geometry", description="Surface of the ground before the road was built")
    side = tree.number("Side", 1.0, (-1.0, 1.0), description="+1 for the left, -1 for the right side")
    reach = tree.number("Half Width", 60.0, (5.0, 1000.0), unit="m", description="Reach from the axis")
    batter = tree.number(
        "Batter Slope", 1.5, (0.5, 10.0), description="Run of the batter per metre of height (m/m)"
    )
    columns = tree.integer("Columns", 40, (3, 500), description="Points from the edge outwards")

    with tree.frame("Columns from left to right, rows as the backbone's"):
        mesh, column, number = op.grid(tree, columns, op.point_count(backbone))
        share = column / (columns - 1.0)
        outwards = op.switch(side > 0.0, share, 1.0 - share)
        spread = outwards * _FINE + op.power(outwards, 2.2) * (1.0 - _FINE)
    with tree.frame("Offset, cut where it would fold"):
        axis, left, curvature = row(backbone, number)
        start = op.sample_index(edge, op.position(tree), number)
        start_offset = op.dot(start - axis, left)
        width = op.maximum(reach - start_offset * side, 0.0)
        beyond = cut(start_offset + width * spread * side, curvature) - start_offset
        distance = beyond * side
    with tree.frame("Height: the ground, as far as the batter reaches to it"):
        place = start + left * beyond
        rise = _ground_above(tree, ground, place)
        steepest = distance / batter
        height = op.maximum(op.minimum(rise, steepest), -steepest)
    with tree.frame("Mesh"):
        mesh = op.store(mesh, "distance", distance)
        mesh = op.set_position(mesh, place + op.vector(tree, 0.0, 0.0, height))
        tree.output("Mesh", op.without_degenerate(mesh))


def _ground_above(tree: Tree, ground: Value, place: Value) -> Value:
    """Return how far the ground lies above `place`; 0 where there is no ground."""
    above = place + (0.0, 0.0, 1000.0)
    ray = tree.node("GeometryNodeRaycast", target_geometry=ground, source_position=above, ray_length=2000.0)
    return op.switch(ray["Is Hit"], 0.0, 1000.0 - ray["Hit Distance"])


def build_terrain(builder: ModelBuilder) -> None:
    """Make the ground as it was, and the terrain that joins it to the road."""
    terrain = builder.parameters.terrain
    if terrain is None:
        return
    ground = ground_mesh(builder.geometry, terrain, builder.tolerance, builder.stretch, builder.origin)
    builder.add("Ground", ground, support=True)
    inputs = {
        **{role: builder.objects[role] for role in ("Backbone", "Road", "Ground")},
        "Half Width": terrain.half_width,
        "Batter Slope": terrain.batter_slope,
        "Columns": int(np.clip(terrain.half_width * 0.6, 12, 120)),
        "Instance": terrain.instance,
        "Material": material("grass_ground"),
    }
    builder.add("Terrain", bpy.data.meshes.new("SR Terrain"), terrain_group(), inputs)
