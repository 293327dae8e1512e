"""Pictures of a scene: light and sky from the environment, a camera, and Cycles."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import ArrayLike

from ...road.parameters import Environment
from ..compat import sky_texture

SUN = "SR Sun"
CAMERA = "SR Camera"

_SUN_STRENGTH = 4.2
_SKY_STRENGTH = 0.16
_SUN_ANGLE = math.radians(0.53)


def light(environment: Environment) -> None:
    """Give the scene a sun and a sky; those of an earlier call are replaced."""
    elevation, azimuth = math.radians(environment.sun_elevation_deg), math.radians(environment.sun_azimuth_deg)
    # Azimuths count clockwise from north (+y).
    towards = Vector(
        (math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth), math.sin(elevation))
    )
    remove(SUN)
    lamp = bpy.data.lights.new(SUN, "SUN")
    lamp.energy = _SUN_STRENGTH * environment.sun_strength
    lamp.angle = _SUN_ANGLE
    lamp.color = (1.0, 0.93, 0.84)
    sun = bpy.data.objects.new(SUN, lamp)
    sun.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(sun)
    _sky(elevation, azimuth, environment)


def _sky(elevation: float, azimuth: float, environment: Environment) -> None:
    scene = bpy.context.scene
    world = bpy.data.worlds.get("SR Sky") or bpy.data.worlds.new("SR Sky")
    scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    sky = sky_texture(nodes, max(elevation, math.radians(1.0)), azimuth)
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = _SKY_STRENGTH * (0.4 + 0.6 * environment.sun_strength)
    links.new(sky.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])


def camera(place: ArrayLike, target: ArrayLike, lens: float = 35.0) -> bpy.types.Object:
    """Put the camera at a local place (m), looking at a target; focal length in mm on 36 mm."""
    remove(CAMERA)
    data = bpy.data.cameras.new(CAMERA)
    data.lens, data.clip_start, data.clip_end = lens, 0.05, 5000.0
    item = bpy.data.objects.new(CAMERA, data)
    eye, towards = (Vector(np.asarray(point, dtype=np.float64).tolist()) for point in (place, target))
    item.location = eye
    item.rotation_euler = (towards - eye).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(item)
    bpy.context.scene.camera = item
    return item


def render(path: Path, size: tuple[int, int] = (1280, 720), samples: int = 48) -> None:
    """Render the scene through its camera to a PNG file."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.03
    scene.cycles.use_denoising = True
    scene.cycles.max_bounces = 4
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "AgX"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.render.render(write_still=True)


def remove(name: str) -> None:
    """Remove an object made here, with its data."""
    item = bpy.data.objects.get(name)
    if item is None:
        return
    data = item.data
    bpy.data.objects.remove(item)
    if isinstance(data, bpy.types.Camera):
        bpy.data.cameras.remove(data)
    elif isinstance(data, bpy.types.Light):
        bpy.data.lights.remove(data)
