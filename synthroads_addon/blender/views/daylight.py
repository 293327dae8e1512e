"""Sun, sky, haze, landscape, sward and cameras of a road, kept in the file: for the user's pictures, not for scans."""

import math
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...road.parameters import RoadParameters
from ...road.surroundings import Environment
from ..sky import fill_sky, new_sun
from ..things.model_builder import SUPPORT
from .clouds import add_clouds
from .exposure import level_irradiance, stops_for, sun_and_sky
from .haze import haze_body, haze_light, light_below
from .landscape import add_landscape, remove_landscape
from .sward import Lawn, add_sward, remove_sward
from .viewpoints import Viewpoint, aerial_view, driver_view

VIEW = "synthroads_view"
"""Custom property of what is made here: what it is."""
SUN, SKY, HAZE, DRIVER, AERIAL = "sun", "sky", "haze", "driver", "aerial"
_NAMES = {SUN: "SR Sun", SKY: "SR Sky", HAZE: "SR Haze", DRIVER: "SR Driver", AERIAL: "SR Aerial"}
_VIEWS = {DRIVER: driver_view, AERIAL: aerial_view}
_HAZE_BELOW = 10_000.0
"""Visibility (m) from which on a picture shows no haze."""
_LOWEST_SKY = 0.02
"""Sine of the elevation whose colour goes on below."""


def add_views(scene: bpy.types.Scene, parameters: RoadParameters, matrix: Matrix) -> None:
    """Add a road's sun, sky with clouds, haze, landscape and cameras to a scene, replacing those of an earlier call.

    Other lights and cameras stay. A dense sward grows around the driver's camera, which becomes the scene's if it has
    none, or one of ours. The scene's exposure becomes that of the light.

    Args:
        scene: that shows the road.
        parameters: the road.
        matrix: from the road's local coordinates to the scene's.
    """
    current = scene.camera.get(VIEW, "") if scene.camera else DRIVER
    remove_views(scene)
    environment = parameters.environment
    sun = _mark(SUN, new_sun(_NAMES[SUN], environment), scene)
    scene.world = _world(scene, environment)
    if environment.visibility < _HAZE_BELOW:
        middle = matrix @ Vector(driver_view(parameters).place.tolist())
        _add_haze(scene, environment, sun, middle)
    else:
        scene.view_settings.exposure = stops_for(level_irradiance(environment))
    add_clouds(scene.world, environment)
    add_landscape(scene, parameters, matrix)
    add_sward(scene, parameters, Lawn.of(scene, matrix), driver_view(parameters).place, matrix)
    for name, view in _VIEWS.items():
        camera = _mark(name, _camera(_NAMES[name], view(parameters), matrix), scene)
        if name == current:
            scene.camera = camera


def remove_views(scene: bpy.types.Scene) -> None:
    """Remove what `add_views` added to a scene, with its data; the world stays."""
    remove_landscape(scene)
    remove_sward(scene)
    items = list(views_of(scene).values())
    data = [item.data for item in items if item.data is not None]
    bpy.data.batch_remove(items)
    bpy.data.batch_remove([block for block in data if not block.users])


def views_of(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """Return the scene's objects made by `add_views`, by kind: sun, haze, driver, aerial."""
    return {str(item[VIEW]): item for item in scene.objects if VIEW in item}


def cameras_of(scene: bpy.types.Scene) -> Iterator[tuple[str, bpy.types.Object]]:
    """Yield (name, object) of the scene's cameras made by `add_views`: driver, aerial."""
    views = views_of(scene)
    yield from ((name, views[name]) for name in _VIEWS if name in views)


def _mark(kind: str, item: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Object:
    item[VIEW] = kind
    scene.collection.objects.link(item)
    return item


def _world(scene: bpy.types.Scene, environment: Environment) -> bpy.types.World:
    """Return a world with the environment's sky: the scene's if made here, else a new one; the user's is kept."""
    world = scene.world
    if world is None or VIEW not in world:
        world = bpy.data.worlds.new(_NAMES[SKY])
        world[VIEW] = SKY
        if scene.world is not None:
            scene.world.use_fake_user = True
    fill_sky(world, environment.sun_elevation_deg, environment.sun_azimuth_deg, environment.sun_strength)
    _go_on_below_horizon(world)
    return world


def _go_on_below_horizon(world: bpy.types.World) -> None:
    """Change a world's nodes so that the sky's lowest colour continues below the horizon, where it would be black."""
    nodes, links = world.node_tree.nodes, world.node_tree.links
    kinds = ("TexCoord", "SeparateXYZ", "Math", "CombineXYZ")
    place, parts, height, joined = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    sky = next(node for node in nodes if node.type == "TEX_SKY")
    height.operation = "MAXIMUM"
    height.inputs[1].default_value = _LOWEST_SKY
    links.new(place.outputs["Generated"], parts.inputs[0])
    for axis in "XY":
        links.new(parts.outputs[axis], joined.inputs[axis])
    links.new(parts.outputs["Z"], height.inputs[0])
    links.new(height.outputs[0], joined.inputs["Z"])
    links.new(joined.outputs[0], sky.inputs["Vector"])


def _add_haze(scene: bpy.types.Scene, environment: Environment, sun: bpy.types.Object, middle: Vector) -> None:
    """Add the environment's haze around a place, and dim the scene's sun and sky by it."""
    elevation = math.radians(environment.sun_elevation_deg)
    across, level = sun_and_sky(environment)
    light = haze_light(environment.visibility, elevation, across, level)
    below = across * light.sun * max(math.sin(elevation), 0.0) + level * light.sky + math.pi * light.diffuse
    scene.view_settings.exposure = stops_for(below)
    sun.data.energy *= light.sun
    light_below(scene.world, light)
    item = _mark(HAZE, haze_body(_NAMES[HAZE], environment.visibility, light.air, middle), scene)
    item[SUPPORT] = True  # scans leave it out: they have weather of their own


def _camera(name: str, view: Viewpoint, matrix: Matrix) -> bpy.types.Object:
    data = bpy.data.cameras.new(name)
    data.lens, data.clip_start, data.clip_end = view.lens, 0.05, 5000.0
    item = bpy.data.objects.new(name, data)
    eye, target = (matrix @ Vector(_list(point)) for point in (view.place, view.target))
    item.location = eye
    item.rotation_euler = (target - eye).to_track_quat("-Z", "Y").to_euler()
    return item


def _list(point: NDArray[np.float64]) -> list[float]:
    return [float(value) for value in point]
