"""The ground beside the road, and the batters that join it to the road (SR Terrain)."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.alignment import clip_offset
from ...road.geometry import RoadGeometry
from ...road.surroundings import Terrain
from ...road.terrain import GROUND_MARGIN, ground_elevation
from ..nodes import operations as op
from ..nodes.backbone import limit_offset, row
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import (
    FAR,
    Inputs,
    backbone_socket,
    instance_number,
    integer,
    material_of,
    metres,
    number,
    socket,
)
from .meshes import fill
from .model_builder import ModelBuilder
from .registry import model_part

Float = NDArray[np.float64]

_FINE = 0.12
"""Share of even spacing among the columns; the rest grows away from the road."""


class _Terrain(Inputs):
    backbone = backbone_socket("Object")
    road = socket("Object", "The road, whose outermost edges the terrain begins at")
    ground = socket("Object", "Surface of the ground before the road was built")
    half_width = metres(60.0, (5.0, 1000.0), "Reach to either side of the axis")
    batter_slope = number(1.5, (0.5, 10.0), "Run of the batter per metre of height (m/m)")
    columns = integer(40, (3, 500), "Points across each side, closer near the road")
    instance = instance_number()
    material = material_of("the ground", "grass_ground")


@makes_group("SR Terrain")
def terrain_group(tree: Tree) -> None:
    """Ground on both sides of the road, joined to it by batters of a given slope."""
    terrain = _Terrain(tree)

    with tree.frame("Geometry"):
        axis, surface = op.object_geometry(terrain.backbone), op.object_geometry(terrain.ground)
        edges = op.object_geometry(terrain.road)
    sides = []
    for name, sign in (("Left", 1.0), ("Right", -1.0)):
        with tree.frame(f"{name} edge of the road"):
            edge = op.separate(edges, op.named_attribute(tree, "edge") * sign > 0.5)
        with tree.frame(f"{name} side"):
            sides.append(tree.call(
                _side_group(),
                backbone=axis,
                edge=edge,
                ground=surface,
                side=sign,
                half_width=terrain.half_width,
                batter_slope=terrain.batter_slope,
                columns=terrain.columns,
            ).value)  # fmt: skip
    with tree.frame("Labels"):
        mesh = op.label(op.join(*sides), class_id("ground"), terrain.instance, terrain.material)
    tree.output("Mesh", mesh, description="Terrain; its points carry their distance from the road")


class _TerrainInputs(Inputs):
    backbone = backbone_socket()
    edge = socket("Geometry", "Points of the road's edge, one per row of the backbone")
    ground = socket("Geometry", "Surface of the ground before the road was built")
    side = number(1.0, (-1.0, 1.0), "+1 for the left, -1 for the right side")
    half_width = metres(60.0, (5.0, 1000.0), "Reach from the axis")
    batter_slope = number(1.5, (0.5, 10.0), "Run of the batter per metre of height (m/m)")
    columns = integer(40, (3, 500), "Points from the edge outwards")


@makes_group("SR Terrain Side")
def _side_group(tree: Tree) -> None:
    """Terrain on one side: from the road's edge outwards, between the batter's two planes."""
    inputs = _TerrainInputs(tree)
    backbone, side, columns = inputs.backbone, inputs.side, inputs.columns

    with tree.frame("Columns from left to right, rows as the backbone's"):
        # One more than those that are spread: the first two are the edge and the batter's toe.
        mesh, column, number = op.grid(tree, columns + 1, op.point_count(backbone))
        rank = op.switch(side > 0.0, column, columns - column)
        outwards = op.maximum(rank - 1, 0) / (columns - 1.0)
        spread = outwards * _FINE + op.power(outwards, 2.2) * (1.0 - _FINE)
    with tree.frame("Offset, cut where it would fold"):
        axis, left, curvature = row(backbone, number)
        start = op.sample_index(inputs.edge, op.position(tree), number)
        start_offset = op.dot(start - axis, left)
        width = op.maximum(inputs.half_width - start_offset * side, 0.0)
        farthest = (limit_offset(start_offset + width * side, curvature) - start_offset) * side
        spread_out = (limit_offset(start_offset + width * spread * side, curvature) - start_offset) * side
    with tree.frame("None but the edge lies within the batter, whose toe is a column"):
        edge = op.store(inputs.edge, "toe", _toe(tree, inputs))
        toe = op.minimum(op.sample_index(edge, op.named_attribute(tree, "toe"), number), farthest)
        distance = op.switch(rank > 0, 0.0, op.maximum(spread_out, toe))
        beyond = distance * side
    with tree.frame("Height: the ground, as far as the batter reaches to it"):
        place = start + left * beyond
        rise = _ground_above(tree, inputs.ground, place)
        steepest = distance / inputs.batter_slope
        height = op.maximum(op.minimum(rise, steepest), -steepest)
    with tree.frame("Mesh"):
        mesh = op.store(mesh, "distance", distance)
        mesh = op.set_position(mesh, place + op.vector(tree, 0.0, 0.0, height))
        tree.output("Mesh", op.delete_degenerate(mesh))


def _toe(tree: Tree, inputs: _TerrainInputs) -> Value:
    """Add nodes for the distance (m) from the edge at which the batter meets the ground; a field on its points."""
    start = op.position(tree)
    _, left, _ = row(inputs.backbone, op.index(tree))
    rises = op.switch(_ground_above(tree, inputs.ground, start) > 0.0, -1.0, 1.0)
    along = left * (inputs.side * inputs.batter_slope) + op.vector(tree, 0.0, 0.0, rises)
    ray = tree.node(
        "GeometryNodeRaycast",
        target_geometry=inputs.ground,
        source_position=start,
        ray_direction=along,
        ray_length=2000.0,
    )
    return op.switch(ray["Is Hit"], FAR[1], ray["Hit Distance"] * (inputs.batter_slope / op.length(along)))


def _ground_above(tree: Tree, ground: Value, place: Value) -> Value:
    """Add nodes for the ground's height (m) above `place`, negative below; 0 where there is no ground."""
    above = place + (0.0, 0.0, 1000.0)
    ray = tree.node("GeometryNodeRaycast", target_geometry=ground, source_position=above, ray_length=2000.0)
    return op.switch(ray["Is Hit"], 0.0, 1000.0 - ray["Hit Distance"])


@model_part("terrain", 20)
def build_terrain(builder: ModelBuilder) -> None:
    """Add the terrain to the model, with the original ground as a hidden support object; none without terrain."""
    terrain = builder.parameters.terrain
    if terrain is None:
        return
    ground = _ground_mesh(builder.geometry, terrain, builder.tolerance, builder.stretch, builder.origin)
    builder.add("Ground", ground, support=True)
    columns = int(np.clip(terrain.half_width * 0.6, 12, 120))
    builder.add_thing("Terrain", terrain, terrain_group(), columns=columns)


def _ground_mesh(
    geometry: RoadGeometry, terrain: Terrain, tolerance: float, stretch: tuple[float, float], origin: Float
) -> bpy.types.Mesh:
    """Create the mesh of the original ground: a grid of stations and offsets, wider than the terrain."""
    vertices, faces = run_aside(lambda: _ground_grid(geometry, terrain, tolerance, stretch))
    mesh = bpy.data.meshes.new("SR Ground")
    fill(mesh, vertices - origin, faces=faces)
    return mesh


def _ground_grid(
    geometry: RoadGeometry, terrain: Terrain, tolerance: float, stretch: tuple[float, float]
) -> tuple[Float, NDArray[np.intp]]:
    """Return the original ground's local vertices (V, 3), m, and faces (F, 4), spaced by its undulation."""
    bend = terrain.undulation * (2.0 * np.pi / terrain.wavelength) ** 2
    spacing = float(np.clip(np.sqrt(8.0 * tolerance / max(bend, 1e-9)), 1.5, 4.0))

    # Whole multiples of the spacing, so that a stretch of the road has the whole road's ground.
    first, last = (stretch[0] - GROUND_MARGIN) // spacing, -((-stretch[1] - GROUND_MARGIN) // spacing)
    ends = -GROUND_MARGIN, geometry.length + GROUND_MARGIN
    station = np.clip(np.arange(first, last + 1) * spacing, *ends)
    reach = terrain.half_width + GROUND_MARGIN
    offset = np.linspace(-reach, reach, int(np.ceil(2.0 * reach / spacing)) + 1)
    position, heading, curvature = geometry.alignment.frame(station)
    offsets = clip_offset(offset[None, :], curvature[:, None])
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    plan = position[:, None, :] + offsets[:, :, None] * left[:, None, :]
    stations = np.repeat(station, len(offset))
    height = ground_elevation(geometry, terrain, stations, offsets.ravel())
    corner = np.arange(len(station) - 1)[:, None] * len(offset) + np.arange(len(offset) - 1)
    # Offsets grow to the left: forwards along the stations, then right, is seen from above against the clock.
    faces = np.stack([corner, corner + len(offset), corner + len(offset) + 1, corner + 1], axis=-1)
    return np.column_stack([plan.reshape(-1, 2), height]), faces.reshape(-1, 4)
