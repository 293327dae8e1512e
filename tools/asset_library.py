"""Write the asset library of node groups, or draw the pictures that it shows.

python tools/asset_library.py LIBRARY.blend      # the same source, pictures and Blender give the same bytes
python tools/asset_library.py --draw [NAME ...]  # tools/asset_previews/*.png, some seconds each
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from itertools import product
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from synthroads_addon.blender.compat import set_modifier_input  # noqa: E402 (the path comes first)
from synthroads_addon.blender.files import empty_file  # noqa: E402
from synthroads_addon.blender.model.library import give_usual_materials, user_groups, write_library  # noqa: E402
from synthroads_addon.blender.nodes.strip import strip_group  # noqa: E402
from synthroads_addon.blender.things.delineator import delineator_group  # noqa: E402
from tools.stable_blend import make_stable  # noqa: E402

PICTURES = ROOT / "tools" / "asset_previews"
_SIZE, _SAMPLES = 128, 48
_LENGTHS = {"Road": 40.0, "Barriers": 7.0}
"""Length of the curve that the groups of a catalogue lie along, m."""
_SHOWN: dict[str, dict[str, Any]] = {
    "SR Guardrail": {"Terminal Length": 0.0, "Post Spacing": 2.0, "Beam Step": 0.5},
    "SR Concrete Barrier": {"Terminal Length": 2.0, "Step": 0.5},
    "SR Temporary Barrier": {"Segment Length": 2.0},
    "SR Noise Barrier": {"Post Spacing": 2.0},
    "SR Strip": {"Left Offset": 4.0, "Right Offset": -4.0},
    "SR Points along Axis": {"Spacing": 4.0},
    "SR Line Marking": {"Dash Length": 3.0, "Gap Length": 3.0, "Left Offset": 0.5, "Right Offset": -0.5},
    "SR Carriageway Marking": {"Dash Length": 3.0, "Gap Length": 3.0, "Distance": 0.0, "Width": 0.8},
    "SR Sign": {"Line 1": "A 1", "Line 2": "Roads", "Width": 1.6, "Height": 1.2, "Posts": 2},
    "SR Kilometre Board": {"Line 1": "12.5", "Width": 0.6, "Height": 0.4},
    "SR Gantry": {"Catwalk": True},
}
"""Inputs that differ from their defaults, so that a small picture shows what a group is."""


_FOLLOWED_BY = {"SR Axis from Curve": strip_group, "SR Points along Axis": delineator_group}
"""Maker of the group that shows what another one gives it."""


def main(argv: list[str] | None = None) -> int:
    """Write the asset library or draw its pictures, as the command line says; return the exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("library", nargs="?", type=Path, metavar="LIBRARY.blend", help="file to write")
    parser.add_argument("--draw", nargs="*", metavar="NAME", help="draw the pictures of all groups, or of some")
    arguments = parser.parse_args(argv)
    if arguments.draw is not None:
        draw_pictures(set(arguments.draw))
    if arguments.library is not None:
        names = write_library(arguments.library.resolve(), PICTURES)
        arguments.library.write_bytes(make_stable(arguments.library.read_bytes()))
        print(f"{arguments.library}: {len(names)} node groups")
    return 0


def draw_pictures(names: set[str]) -> None:
    """Render the pictures of all node groups, or of those named, to `PICTURES`, discarding the open file."""
    empty_file()
    scene = _studio()
    for catalogue, group in user_groups():
        if names and group.name not in names:
            continue
        give_usual_materials(group)
        item = _example(catalogue, group)
        _aim(scene, item)
        scene.render.filepath = str(PICTURES / f"{group.name}.png")
        bpy.ops.render.render(write_still=True)
        bpy.data.objects.remove(item)


def _studio() -> bpy.types.Scene:
    """Return the open file's scene with camera, sun and settings for the pictures."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = _SAMPLES, False
    scene.render.resolution_x = scene.render.resolution_y = _SIZE
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.color_mode = "RGBA"
    scene.world = bpy.data.worlds.new("Studio")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.9, 1.0, 1.0)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (math.radians(50.0), 0.0, math.radians(-40.0))
    for item in (scene.camera, sun):
        scene.collection.objects.link(item)
    return scene


def _example(catalogue: str, group: bpy.types.NodeTree) -> bpy.types.Object:
    """Add an object to the scene that shows a node group, along a curve or on a point; return it."""
    inputs = {item.name for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"}
    data = _curve(_LENGTHS.get(catalogue, 14.0)) if inputs & {"Curve", "Backbone"} else _point()
    item = bpy.data.objects.new(group.name, data)
    bpy.context.scene.collection.objects.link(item)
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    for name, value in _SHOWN.get(group.name, {}).items():
        set_modifier_input(modifier, name, value)
    if group.name in _FOLLOWED_BY:
        following_modifier = item.modifiers.new("Shown", "NODES")
        following_modifier.node_group = _FOLLOWED_BY[group.name]()
        give_usual_materials(following_modifier.node_group)
    return item


def _curve(length: float) -> bpy.types.Curve:
    """Return a slightly bent curve of a length (m) to show groups along."""
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions = "3D"
    points = curve.splines.new("BEZIER").bezier_points
    points.add(2)
    for point, (x, y) in zip(points, ((-0.12, -0.5), (0.06, 0.0), (-0.12, 0.5)), strict=True):
        point.co = (x * length, y * length, 0.0)
        point.handle_left_type = point.handle_right_type = "AUTO"
    return curve


def _point() -> bpy.types.Mesh:
    """Return a mesh of one vertex, to show groups on a point."""
    mesh = bpy.data.meshes.new("Point")
    mesh.vertices.add(1)
    return mesh


def _aim(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Place the scene's camera so that the object fills the picture, seen from its front on the right."""
    graph = bpy.context.evaluated_depsgraph_get()
    corners = []
    for instance in graph.object_instances:
        if instance.object.original == item and instance.object.type == "MESH":
            places = np.empty(3 * len(instance.object.data.vertices))
            instance.object.data.vertices.foreach_get("co", places)
            corners.append(places.reshape(-1, 3))
    places = np.concatenate(corners)
    places = places[places[:, 2] > -0.05]  # what is buried isn't looked at
    lowest, highest = places.min(axis=0), places.max(axis=0)
    towards_camera = Vector((0.75, -1.0, 0.55)).normalized()
    camera = scene.camera
    camera.rotation_euler = towards_camera.to_track_quat("Z", "Y").to_euler()
    camera.location = Vector(((lowest + highest) / 2.0).tolist()) + towards_camera * 10.0
    bpy.context.view_layer.update()
    box = [value for corner in product(*zip(lowest, highest, strict=True)) for value in corner]
    place, _ = camera.camera_fit_coords(graph, box)
    camera.location = place


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # Blender's own end can crash after all is done
