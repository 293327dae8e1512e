"""Time of editing a road's model, and time that Blender alone takes for as much geometry."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from ...road.parameters import RoadParameters
from ...road.surroundings import Vegetation
from ..compat import modifier_input, set_modifier_input
from ..files import empty_file, stderr_if_it_succeeds
from .build import RoadModel

_EDITS = 3
"""Number of changes, each with its reversal, whose times are measured; chosen."""


def seconds_of(work: Callable[[], object]) -> float:
    """Call a function; return its wall-clock time, s."""
    start_time = time.perf_counter()
    work()
    return time.perf_counter() - start_time


def panel_edit(model: RoadModel, parameters: RoadParameters) -> tuple[float, int]:
    """Measure changing a lane's width up to the updated view; hides the vegetation.

    Returns:
        median seconds of several such changes and reversals; number of the road's triangles, made anew by each of them.
    """
    for name in parameters.of_type(Vegetation):
        if name in model.objects:
            model.objects[name].hide_viewport = True
    bpy.context.view_layer.update()
    road = model.objects["Road"]
    modifier = road.modifiers[0]
    side = "Left" if parameters.carriageway("left") else "Right"
    name, seconds = f"{side} Lane 1 Width", []
    for change in (0.05, -0.05) * _EDITS:
        set_modifier_input(modifier, name, modifier_input(modifier, name) + change)
        road.update_tag()
        seconds.append(seconds_of(bpy.context.view_layer.update))
    mesh = road.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    mesh.calc_loop_triangles()
    return sorted(seconds)[len(seconds) // 2], len(mesh.loop_triangles)


def bare_mesh_seconds(triangles: int) -> float:
    """Return the seconds that Blender alone takes to make a mesh of so many triangles from arrays, and to read it.

    The mesh is a flat grid in an object of its own in the open file, removed afterwards.
    """
    side = max(1, round((triangles / 2) ** 0.5))
    # Number of the lower left vertex of each cell; each cell is two triangles.
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([corner, corner + 1, corner + side + 2]),
            np.column_stack([corner, corner + side + 2, corner + side + 1]),
        ]
    ).astype(np.int32)
    x, y = np.meshgrid(np.arange(side + 1, dtype=np.float32), np.arange(side + 1, dtype=np.float32))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size, np.float32)])
    mesh = bpy.data.meshes.new("Bare Mesh")
    item = bpy.data.objects.new("Bare Mesh", mesh)

    def make_and_read() -> None:
        """Fill the mesh, have Blender evaluate it, and read its vertices and triangles."""
        mesh.vertices.add(len(vertices))
        mesh.vertices.foreach_set("co", vertices.ravel())
        mesh.loops.add(faces.size)
        mesh.loops.foreach_set("vertex_index", faces.ravel())
        mesh.polygons.add(len(faces))
        mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
        mesh.update(calc_edges=True)
        bpy.context.scene.collection.objects.link(item)
        evaluated_mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        evaluated_mesh.calc_loop_triangles()
        evaluated_mesh.vertices.foreach_get("co", np.empty(vertices.size, np.float32))
        evaluated_mesh.loop_triangles.foreach_get("vertices", np.empty(faces.size, np.int32))

    try:
        return seconds_of(make_and_read)
    finally:
        bpy.data.objects.remove(item)
        bpy.data.meshes.remove(mesh)


def bare_import_seconds(path: Path) -> float:
    """Return the seconds that Blender's importer alone takes for an .obj file with z up; the open file is discarded."""
    empty_file()
    with stderr_if_it_succeeds():
        return seconds_of(lambda: bpy.ops.wm.obj_import(filepath=str(path), up_axis="Z", forward_axis="Y"))
