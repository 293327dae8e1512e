"""Pictures of a scene: light and sky from the environment, a camera, and Cycles."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import ArrayLike
from PIL import Image

from ...road.surroundings import Environment
from ..sky import fill_sky, new_sun
from .clouds import add_clouds
from .exposure import level_irradiance, stops_for

SUN = "SR Sun"
CAMERA = "SR Camera"


def light(environment: Environment) -> None:
    """Add a sun and a sky with clouds to the current scene, replacing those of an earlier call; set the exposure."""
    scene = bpy.context.scene
    remove(SUN)
    scene.collection.objects.link(new_sun(SUN, environment))
    scene.world = bpy.data.worlds.get("SR Sky") or bpy.data.worlds.new("SR Sky")
    fill_sky(scene.world, environment.sun_elevation_deg, environment.sun_azimuth_deg, environment.sun_strength)
    add_clouds(scene.world, environment)
    scene.view_settings.exposure = stops_for(level_irradiance(environment))


def camera(place: ArrayLike, target: ArrayLike, lens: float = 35.0) -> bpy.types.Object:
    """Add a camera at a place (m), looking at a target, with a lens (mm on 36 mm), as the scene's; return it."""
    remove(CAMERA)
    data = bpy.data.cameras.new(CAMERA)
    data.lens, data.clip_start, data.clip_end = lens, 0.05, 5000.0
    item = bpy.data.objects.new(CAMERA, data)
    eye, target_point = (Vector(np.asarray(point, dtype=np.float64).tolist()) for point in (place, target))
    item.location = eye
    item.rotation_euler = (target_point - eye).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(item)
    bpy.context.scene.camera = item
    return item


def render(path: Path, size: tuple[int, int] = (1280, 720), samples: int = 48) -> None:
    """Render the scene through its camera to a PNG file with Cycles, changing the scene's render settings."""
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
    with Image.open(path, formats=("PNG",)) as picture:
        picture.load()
    picture.info.clear()
    picture.save(path, "PNG")  # without the date and the times that Blender and Cycles write into it


def remove(name: str) -> None:
    """Remove an object by its name, with its camera or lamp data; nothing if there is none."""
    item = bpy.data.objects.get(name)
    if item is None:
        return
    data = item.data
    bpy.data.objects.remove(item)
    if isinstance(data, bpy.types.Camera):
        bpy.data.cameras.remove(data)
    elif isinstance(data, bpy.types.Light):
        bpy.data.lights.remove(data)
