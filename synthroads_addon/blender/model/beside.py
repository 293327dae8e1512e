"""A new road's place beside what is in the scene already: its root is moved until nothing overlaps in plan."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Matrix

from ...base.arrays import Float
from .roads import root_above, world_matrix

GAP = 10.0
"""Distance in plan, m, that is left free between a new road and what was there before."""
_DIRECTIONS = 32
_SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT", "POINTCLOUD"}


def move_beside(root: bpy.types.Object, layer: bpy.types.ViewLayer) -> None:
    """Move a road's root in plan, by the shortest way found, to where its parts overlap nothing else that is visible.

    A road that overlaps nothing stays where its parameters put it. The move is as one by the user: it stays when the
    road is built again. Overlaps are judged by convex outlines with 32 directions.

    Args:
        root: of a road that is built completely.
        layer: view layer that it is in.
    """
    layer.update()
    visible = [item for item in layer.objects if item.type in _SOLID and item.visible_get(view_layer=layer)]
    parts = [item for item in visible if root_above(item) == root]
    others = [item for item in visible if root_above(item) != root]
    if not parts or not others:
        return
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    graph = layer.depsgraph
    reach = _reach(parts, directions, graph)
    opposite = np.roll(reach, _DIRECTIONS // 2)  # of the road, against each direction
    there = _reach(others, directions, graph)
    overlap = there + opposite
    if not np.all(overlap > 0.0):
        return
    nearest = int(np.argmin(overlap))
    step = (overlap[nearest] + GAP) * directions[nearest]
    place = world_matrix(root)
    place[:2, 3] += step
    root.matrix_world = Matrix(place.tolist())
    layer.update()


def _reach(items: Iterable[bpy.types.Object], directions: Float, graph: bpy.types.Depsgraph) -> Float:
    """Return how far (D,), m, objects reach in each direction (D, 2) in plan, from the scene's origin."""
    reaches: list[Float] = [np.max(_plan(item, graph) @ directions.T, axis=0) for item in items]
    return np.asarray(np.max(reaches, axis=0), dtype=np.float64)


def _plan(item: bpy.types.Object, graph: bpy.types.Depsgraph) -> Float:
    """Return the plan coordinates (N, 2), m, of an evaluated object's vertices, or of its box's corners without any."""
    evaluated = item.evaluated_get(graph)
    points = np.array(evaluated.bound_box, dtype=np.float64)
    mesh = evaluated.data
    if isinstance(mesh, bpy.types.Mesh) and len(mesh.vertices):
        flat = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", flat)
        points = flat.reshape(-1, 3).astype(np.float64)
    matrix = np.array(evaluated.matrix_world)
    return points @ matrix[:2, :3].T + matrix[:2, 3]
