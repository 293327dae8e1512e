"""The ground beside the road, and the batters that join it to the road (SR Terrain)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.alignment import clip_offset
from ...road.geometry import RoadGeometry
from ...road.structures.relief import relief_range
from ...road.surroundings import Terrain
from ...road.terrain import GROUND_MARGIN, SWALE_FROM, SWALE_FULL, ground_elevation
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
from .side_road import add_side_road_ground

Float = NDArray[np.float64]

_OPEN = 0.99
"""Share from which a face lies between two rows that both are of a side road's ground."""
_RELIEF_SHARE = 4
"""In valleys below bridges and on hills above tunnels rows of the ground lie so many times as close; chosen."""
_FINE = 0.12
"""Share of even spacing among the columns; the other share is a power of the distance; chosen."""
_SHAPE_PIECES, _TOE_PIECES = 10, 8
"""Pieces of the cross-section over crest or swale, and over the batter's rounded toe or the ditch there; the batter in
between is a plane."""


class _Shape(Inputs):
    """Inputs of the batter's shape, as `road.terrain.batter_height` has them."""

    batter_slope = number(1.5, (0.5, 10.0), "Run of the batter per metre of height (m/m)")
    crest_length = metres(0.0, (0.0, 5.0), "Tangent length of the rounded crest of embankments")
    rounding_length = metres(0.0, (0.0, 10.0), "Tangent length of the rounding of batter and ground; on low ones less")
    swale_width = metres(0.0, (0.0, 5.0), "Width of the swale between verge and batter of a cutting; 0 for none")
    swale_depth = metres(0.0, (0.0, 1.0), "Depth of that swale's middle below the verge's edge")
    ditch_width = metres(0.0, (0.0, 5.0), "Width of the ditch at the foot of an embankment; 0 for none")
    ditch_depth = metres(0.0, (0.0, 1.0), "Depth of that ditch's middle below the ground")


class _Terrain(Inputs):
    backbone = backbone_socket("Object")
    road = socket("Object", "The road, whose outermost edges the terrain begins at")
    ground = socket("Object", "Surface of the ground before the road was built")
    side_road_ground = socket("Object", "Ground around side roads, which takes the place of what is there")
    half_width = metres(60.0, (5.0, 1000.0), "Reach to either side of the axis")


class _Columns(Inputs):
    columns = integer(40, (3, 500), "Points across each side beyond the batter, closer near the road")


class _Labels(Inputs):
    instance = instance_number()
    material = material_of("the ground", "grass_ground")


@makes_group("SR Terrain")
def terrain_group(tree: Tree) -> None:
    """Ground on both sides of the road, joined to it by batters with swales in cuttings and rounded edges."""
    terrain, shape, columns, labels = _Terrain(tree), _Shape(tree), _Columns(tree).columns, _Labels(tree)

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
                **shape.values,
                columns=columns,
            ).value)  # fmt: skip
    with tree.frame("Labels"):
        ground = op.join(*sides, op.object_geometry(terrain.side_road_ground))
        mesh = op.label(ground, class_id("ground"), labels.instance, labels.material)
    tree.output("Mesh", mesh, description="Terrain; its points carry their distance from the road")


class _TerrainInputs(Inputs):
    backbone = backbone_socket()
    edge = socket("Geometry", "Points of the road's edge, one per row of the backbone")
    ground = socket("Geometry", "Surface of the ground before the road was built")
    side = number(1.0, (-1.0, 1.0), "+1 for the left, -1 for the right side")
    half_width = metres(60.0, (5.0, 1000.0), "Reach from the axis")


@makes_group("SR Terrain Side")
def _side_group(tree: Tree) -> None:
    """Terrain on one side: from the road's edge outwards over swale or crest, batter and rounded toe to the ground."""
    inputs, shape, columns = _TerrainInputs(tree), _Shape(tree), _Columns(tree).columns
    backbone, side = inputs.backbone, inputs.side

    with tree.frame("Columns from left to right, rows as the backbone's"):
        # Columns beyond the toe are spread over the ground.
        last_column = columns + (_SHAPE_PIECES + _TOE_PIECES)
        mesh, column, row_number = op.grid(tree, last_column + 1, op.point_count(backbone))
        column_rank = op.switch(side > 0.0, column, last_column - column)
        outward_share = op.maximum(column_rank - (_SHAPE_PIECES + _TOE_PIECES), 0) / op.maximum(columns - 1.0, 1.0)
        # Shares of the way to the terrain's end: closer near the road; the exponent is chosen.
        spread = outward_share * _FINE + op.power(outward_share, 2.2) * (1.0 - _FINE)
    with tree.frame("Offset, cut where it would fold"):
        axis, left_vector, curvature = row(backbone, row_number)
        start = op.sample_index(inputs.edge, op.position(tree), row_number)
        start_offset = op.dot(start - axis, left_vector)
        width = op.maximum(inputs.half_width - start_offset * side, 0.0)
        largest_distance = (limit_offset(start_offset + width * side, curvature) - start_offset) * side
        spread_distance = (limit_offset(start_offset + width * spread * side, curvature) - start_offset) * side
    with tree.frame("On the edge's points: the ground's height, the batter's toe"):
        ground_height = _ground_above(tree, inputs.ground, op.position(tree))
        edge = op.store(op.store(inputs.edge, "above", ground_height), "toe", _toe(tree, inputs, shape, ground_height))
        edge_ground = op.sample_index(edge, op.named_attribute(tree, "above"), row_number)
        toe = op.sample_index(edge, op.named_attribute(tree, "toe"), row_number)
    with tree.frame("Columns: crest or swale, the toe's rounding, the ground"):
        rounding = op.minimum(shape.rounding_length / shape.batter_slope, op.unary("ABSOLUTE", edge_ground))
        # Where the ground is above the edge (a cutting) there is a swale, else (an embankment) a rounded crest.
        shape_width = op.switch(edge_ground > 0.0, shape.crest_length * 2.0, shape.swale_width)
        shape_distance = shape_width * op.minimum(column_rank * (1.0 / _SHAPE_PIECES), 1.0)
        ditch = _ditch_share(shape, edge_ground)
        tangent = rounding * shape.batter_slope * (1.0 - ditch)
        # The toe's rounding reaches one tangent to both sides of it; a ditch takes its place.
        toe_start = op.maximum(toe - tangent, shape_width)
        toe_end = op.maximum(toe + op.maximum(tangent, op.switch(ditch > 0.0, 0.0, shape.ditch_width)), toe_start)
        toe_distance = toe_start + (toe_end - toe_start) * op.clip(
            (column_rank - (_SHAPE_PIECES + 1)) * (1.0 / (_TOE_PIECES - 1)), 0.0, 1.0
        )
        distance = op.switch(column_rank > _SHAPE_PIECES, shape_distance, op.maximum(spread_distance, toe_distance))
        distance = op.minimum(distance, largest_distance)
    with tree.frame("Height: the ground, as far as the batter reaches to it"):
        place = start + left_vector * (distance * side)
        place_ground = _ground_above(tree, inputs.ground, place)
        height = tree.call(
            _batter_group(), **shape.values, distance=distance, ground=place_ground, at_edge=edge_ground
        ).value
    with tree.frame("Mesh"):
        mesh = op.store(mesh, "distance", distance)
        mesh = op.set_position(mesh, place + op.vector(tree, 0.0, 0.0, height))
        tree.output("Mesh", op.delete_degenerate(_without_mouths(mesh, backbone, side, row_number)))


def _without_mouths(mesh: Value, backbone: Value, side: Value, row_number: Value) -> Value:
    """Add nodes that delete the faces of one side where side roads have the ground around them; return the mesh."""
    names = ("right", "left")
    mouth = op.switch(side > 0.0, *(op.named_attribute(mesh.tree, f"mouth_{name}") for name in names))
    mesh = op.store(mesh, "mouth", op.sample_index(backbone, mouth, row_number))
    return op.delete_faces(mesh, op.named_attribute(mesh.tree, "mouth") > _OPEN)


class _BatterInputs(Inputs):
    distance = metres(0.0, (0.0, 1000.0), "Distance from the road's edge")
    ground = metres(0.0, FAR, "Height of the ground there above the edge")
    at_edge = metres(0.0, FAR, "Height of the ground at the edge above it")


@makes_group("SR Batter Height")
def _batter_group(tree: Tree) -> None:
    """Height above the road's edge of what lies beside it: crest, swale, batter, rounded toe, ground."""
    shape, inputs = _Shape(tree), _BatterInputs(tree)
    distance, ground, at_edge = inputs.distance, inputs.ground, inputs.at_edge
    with tree.frame("Swale: the deeper the cutting, up to its full depth"):
        width = shape.swale_width
        depth_share = op.clip((at_edge - SWALE_FROM) * (1.0 / (SWALE_FULL - SWALE_FROM)), 0.0, 1.0)
        full_depth = op.switch(width > 0.0, 0.0, depth_share * shape.swale_depth)
        angle = op.minimum(distance / op.maximum(width, 1e-6), 1.0) * math.pi
        # The swale is a sine squared across its width.
        swale_depth = full_depth * op.power(op.unary("SINE", angle), 2.0)
    with tree.frame("Planes of the batter, rounded where they begin"):
        cutting_plane = _rise(distance - width * 0.5, width * 0.25) / shape.batter_slope - swale_depth
        embankment_plane = -(_rise(distance, shape.crest_length) / shape.batter_slope)
    with tree.frame("Where they meet the ground"):
        rounding = op.minimum(shape.rounding_length / shape.batter_slope, op.unary("ABSOLUTE", at_edge))
        cutting_height = op.maximum(
            -_smooth_maximum(-ground, -cutting_plane, rounding), embankment_plane - full_depth * 2.0
        )
    with tree.frame("Ditch at the foot of an embankment"):
        ditch = _ditch_share(shape, at_edge)
        ditch_position = (ground - embankment_plane) * shape.batter_slope / op.maximum(shape.ditch_width, 1e-6)
        ditch_sine = op.unary("SINE", op.clip(ditch_position, 0.0, 1.0) * math.pi)
        ground = ground - ditch * shape.ditch_depth * op.power(ditch_sine, 2.0)
        rounding = rounding * (1.0 - ditch)
        embankment_height = op.minimum(_smooth_maximum(ground, embankment_plane, rounding), cutting_plane)
    tree.output(
        "Height", op.switch(at_edge > 0.0, embankment_height, cutting_height), description="Above the road's edge (m)"
    )


def _ditch_share(shape: _Shape, at_edge: Value) -> Value:
    """Add nodes for the share of its full depth that a ditch has; 0 without one."""
    share = op.clip((-at_edge - SWALE_FROM) * (1.0 / (SWALE_FULL - SWALE_FROM)), 0.0, 1.0)
    return op.switch(shape.ditch_width > 0.0, 0.0, share)


def _rise(distance: Value, tangent: Value) -> Value:
    """Add nodes for the height (m) of a plane of slope 1 that begins with a parabola of two tangent lengths (m)."""
    positive_distance = op.maximum(distance, 0.0)
    parabola = op.power(positive_distance, 2.0) / op.maximum(tangent * 4.0, 1e-6)
    return op.switch(positive_distance < tangent * 2.0, positive_distance - tangent, parabola)


def _smooth_maximum(height_a: Value, height_b: Value, rounding: Value) -> Value:
    """Add nodes for the larger of two heights, rounded by a parabola where they differ by less than `rounding`, m."""
    overlap = op.maximum(rounding - op.unary("ABSOLUTE", height_a - height_b), 0.0)
    return op.maximum(height_a, height_b) + op.power(overlap, 2.0) / op.maximum(rounding * 4.0, 1e-6)


def _toe(tree: Tree, inputs: _TerrainInputs, shape: _Shape, ground_height: Value) -> Value:
    """Add nodes for the distance (m) from the edge at which the batter meets the ground; a field on its points."""
    _, left_vector, _ = row(inputs.backbone, op.index(tree))
    batter_start = op.switch(ground_height > 0.0, shape.crest_length, shape.swale_width * 0.75)
    start = op.position(tree) + left_vector * (batter_start * inputs.side)
    rise_sign = op.switch(_ground_above(tree, inputs.ground, start) > 0.0, -1.0, 1.0)
    batter_direction = left_vector * (inputs.side * shape.batter_slope) + op.vector(tree, 0.0, 0.0, rise_sign)
    ray = tree.node(
        "GeometryNodeRaycast",
        target_geometry=inputs.ground,
        source_position=start,
        ray_direction=batter_direction,
        ray_length=2000.0,
    )
    reach = ray["Hit Distance"] * (shape.batter_slope / op.length(batter_direction))
    return op.switch(ray["Is Hit"], FAR[1], batter_start + reach)


def _ground_above(tree: Tree, ground: Value, place: Value) -> Value:
    """Add nodes for the ground's height (m) above `place`, negative below; 0 where there is no ground."""
    ray_start = place + (0.0, 0.0, 1000.0)
    ray = tree.node("GeometryNodeRaycast", target_geometry=ground, source_position=ray_start, ray_length=2000.0)
    return op.switch(ray["Is Hit"], 0.0, 1000.0 - ray["Hit Distance"])


@model_part("terrain", 20)
def build_terrain(builder: ModelBuilder) -> None:
    """Add the terrain to the model, with the original ground as a hidden support object; none without terrain."""
    terrain = builder.parameters.terrain
    if terrain is None:
        return
    ground = _ground_mesh(builder.geometry, terrain, builder.tolerance, builder.stretch, builder.origin)
    builder.add("Ground", ground, support=True)
    add_side_road_ground(builder)
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
    ground_curvature = terrain.undulation * (2.0 * np.pi / terrain.wavelength) ** 2
    # Chord error of the ground's waves, s = l^2 k / 8; limits are chosen.
    spacing = float(np.clip(np.sqrt(8.0 * tolerance / max(ground_curvature, 1e-9)), 1.5, 4.0))

    # Rows lie at multiples of the spacing, so that a stretch of the road has the whole road's ground.
    first_row, last_row = (stretch[0] - GROUND_MARGIN) // spacing, -((-stretch[1] - GROUND_MARGIN) // spacing)
    ends = -GROUND_MARGIN, geometry.length + GROUND_MARGIN
    rows = np.clip(np.arange(first_row, last_row + 1) * spacing, *ends)
    station = np.unique(np.concatenate([rows, *_relief_rows(geometry, spacing, (rows[0], rows[-1]))]))
    reach = terrain.half_width + GROUND_MARGIN
    offset = np.linspace(-reach, reach, int(np.ceil(2.0 * reach / spacing)) + 1)
    position, heading, curvature = geometry.alignment.frame(station)
    offsets = clip_offset(offset[None, :], curvature[:, None])
    left_vectors = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    plan = position[:, None, :] + offsets[:, :, None] * left_vectors[:, None, :]
    stations = np.repeat(station, len(offset))
    height = ground_elevation(geometry, terrain, stations, offsets.ravel())
    first_corners = np.arange(len(station) - 1)[:, None] * len(offset) + np.arange(len(offset) - 1)
    # Corners run forwards along the stations and then to larger offsets (left): anticlockwise from above.
    faces = np.stack(
        [first_corners, first_corners + len(offset), first_corners + len(offset) + 1, first_corners + 1], axis=-1
    )
    return np.column_stack([plan.reshape(-1, 2), height]), faces.reshape(-1, 4)


def _relief_rows(geometry: RoadGeometry, spacing: float, ends: tuple[float, float]) -> Iterator[Float]:
    """Yield further rows (R,), m at which valleys and hills bend the ground: at shares of the spacing, m."""
    step = spacing / _RELIEF_SHARE
    for structure in geometry.reliefs.values():
        first, last = np.clip(relief_range(structure), *ends)
        yield np.arange(np.ceil(first / step), np.floor(last / step) + 1.0) * step
