"""A new road's place beside other objects of the scene: its root is moved until nothing overlaps in plan."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Matrix

from ...base.arrays import Float
from .roads import root_above, world_matrix

GAP = 10.0
"""Distance in plan, m, that is left free between a new road and the other objects; chosen."""
_DIRECTIONS = 32
"""Number of directions in which outlines are compared; even, so that each has its opposite; chosen."""
_SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT", "POINTCLOUD"}


def move_beside(root: bpy.types.Object, layer: bpy.types.ViewLayer) -> None:
    """Move a road's root in plan, in the best of some directions, until its parts overlap no other visible object.

    A road that overlaps nothing stays where its parameters put it. As a user's move would, the move stays when the road
    is built again. Two sets of objects overlap if their convex outlines do, as seen in 32 directions.

    Args:
        root: root object of a road that is built completely.
        layer: view layer that contains it.
    """
    layer.update()
    visible_items = [item for item in layer.objects if item.type in _SOLID and item.visible_get(view_layer=layer)]
    parts = [item for item in visible_items if root_above(item) == root]
    other_items = [item for item in visible_items if root_above(item) != root]
    if not parts or not other_items:
        return
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    graph = layer.depsgraph
    road_reach = _reach(parts, directions, graph)
    # Along each direction the outlines overlap from the road's rear end (its reach in the opposite direction, negated)
    # to the others' front end: a move by that length in the direction separates them.
    opposite_reach = np.roll(road_reach, _DIRECTIONS // 2)
    other_reach = _reach(other_items, directions, graph)
    overlap = other_reach + opposite_reach
    if not np.all(overlap > 0.0):  # a direction separates them already
        return
    best_direction = int(np.argmin(overlap))
    step = (overlap[best_direction] + GAP) * directions[best_direction]
    place = world_matrix(root)
    place[:2, 3] += step
    root.matrix_world = Matrix(place.tolist())
    layer.update()


def _reach(items: Iterable[bpy.types.Object], directions: Float, graph: bpy.types.Depsgraph) -> Float:
    """Return the reach (D,), m, of objects in directions (D, 2) in plan: their largest coordinate along each."""
    reaches: list[Float] = [np.max(_plan(item, graph) @ directions.T, axis=0) for item in items]
    return np.asarray(np.max(reaches, axis=0), dtype=np.float64)


def _plan(item: bpy.types.Object, graph: bpy.types.Depsgraph) -> Float:
    """Return the plan coordinates (N, 2), m, of an evaluated object's vertices, or of its bounding box."""
    evaluated = item.evaluated_get(graph)
    points = np.array(evaluated.bound_box, dtype=np.float64)
    mesh = evaluated.data
    if isinstance(mesh, bpy.types.Mesh) and len(mesh.vertices):
        coordinates = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", coordinates)
        points = coordinates.reshape(-1, 3).astype(np.float64)
    matrix = np.array(evaluated.matrix_world)
    return points @ matrix[:2, :3].T + matrix[:2, 3]
