"""Sun, sky, haze, landscape, sward, lamps and cameras of a road in the file, for the user's pictures, not for scans."""

import math
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...road.parameters import RoadParameters
from ...road.surroundings import Environment
from ...scanning.colour.haze import haze_light
from ...scanning.weather.extinction import visible_extinction
from ..sky import fill_sky, new_sun
from ..things.model_builder import SUPPORT
from .clouds import add_clouds
from .exposure import level_irradiance, stops_for, sun_and_sky
from .glow import add_glow, remove_glow
from .haze import haze_body, light_below
from .lamps import LIT_BELOW, add_lamps, remove_lamps
from .landscape import add_landscape, remove_landscape
from .sward import Lawn, add_sward, remove_sward
from .viewpoints import Viewpoint, aerial_view, driver_view

VIEW = "synthroads_view"
"""Custom property of the objects and the world that are made here: their kind."""
SUN, SKY, HAZE, DRIVER, AERIAL = "sun", "sky", "haze", "driver", "aerial"
_NAMES = {SUN: "SR Sun", SKY: "SR Sky", HAZE: "SR Haze", DRIVER: "SR Driver", AERIAL: "SR Aerial"}
_VIEWS = {DRIVER: driver_view, AERIAL: aerial_view}
_HAZE_BELOW = 10_000.0
"""Visibility (m) from which on a picture shows no haze; chosen."""
_LOWEST_SKY = 0.02
"""Sine of the elevation below which the sky keeps its colour; chosen."""


def add_views(scene: bpy.types.Scene, parameters: RoadParameters, matrix: Matrix) -> None:
    """Add a road's sun, sky with clouds, haze, landscape and cameras to a scene, replacing those of an earlier call.

    Other lights and cameras stay. A dense sward is added around the driver's camera. The driver's camera becomes the
    scene's if it has none; a camera of an earlier call is replaced by the same one. The scene is exposed for the light.
    From dusk on lamps shine, and signs, markings and delineators send the driver's headlights' light back.

    Args:
        scene: scene that shows the road.
        parameters: the road.
        matrix: matrix from the road's local coordinates to the scene's.
    """
    camera_kind = scene.camera.get(VIEW, "") if scene.camera else DRIVER
    remove_views(scene)
    environment = parameters.environment
    sun = _mark(SUN, new_sun(_NAMES[SUN], environment), scene)
    scene.world = _world(scene, environment)
    if environment.visibility < _HAZE_BELOW:
        haze_centre = matrix @ Vector(driver_view(parameters).place.tolist())
        _add_haze(scene, environment, sun, haze_centre)
    else:
        scene.view_settings.exposure = stops_for(level_irradiance(environment))
    add_clouds(scene.world, environment)
    add_landscape(scene, parameters, matrix)
    add_sward(scene, parameters, Lawn.of(scene, matrix), driver_view(parameters).place, matrix)
    for name, view in _VIEWS.items():
        camera = _mark(name, _camera(_NAMES[name], view(parameters), matrix), scene)
        if name == camera_kind:
            scene.camera = camera
        if name == DRIVER and environment.sun_elevation_deg < LIT_BELOW:
            add_glow(add_lamps(scene, parameters, matrix, camera))


def remove_views(scene: bpy.types.Scene) -> None:
    """Remove the objects that `add_views` added to a scene, with their data; the world stays."""
    remove_landscape(scene)
    remove_sward(scene)
    remove_lamps(scene)
    remove_glow()
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
    """Note an object's kind in it, and add it to a scene; return it."""
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
    _extend_below_horizon(world)
    return world


def _extend_below_horizon(world: bpy.types.World) -> None:
    """Change a world's nodes so that the sky's lowest colour continues below the horizon, where it would be black."""
    nodes, links = world.node_tree.nodes, world.node_tree.links
    kinds = ("TexCoord", "SeparateXYZ", "Math", "CombineXYZ")
    coordinates, direction, height, clamped_direction = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    sky = next(node for node in nodes if node.type == "TEX_SKY")
    height.operation = "MAXIMUM"
    height.inputs[1].default_value = _LOWEST_SKY
    links.new(coordinates.outputs["Generated"], direction.inputs[0])
    for axis in "XY":
        links.new(direction.outputs[axis], clamped_direction.inputs[axis])
    links.new(direction.outputs["Z"], height.inputs[0])
    links.new(height.outputs[0], clamped_direction.inputs["Z"])
    links.new(clamped_direction.outputs[0], sky.inputs["Vector"])


def _add_haze(scene: bpy.types.Scene, environment: Environment, sun: bpy.types.Object, middle: Vector) -> None:
    """Add the environment's haze around a place, and dim the scene's sun and sky by it."""
    elevation = math.radians(environment.sun_elevation_deg)
    sun_irradiance, sky_irradiance = sun_and_sky(environment)
    extinction = visible_extinction(environment.visibility)
    light = haze_light(extinction, elevation, sun_irradiance, sky_irradiance)
    ground_irradiance = (
        sun_irradiance * light.sun * max(math.sin(elevation), 0.0)
        + sky_irradiance * light.sky
        + math.pi * light.diffuse
    )
    scene.view_settings.exposure = stops_for(ground_irradiance)
    sun.data.energy *= light.sun
    light_below(scene.world, light)
    item = _mark(HAZE, haze_body(_NAMES[HAZE], extinction, light.air, middle), scene)
    item[SUPPORT] = True  # scans leave it out, as they simulate weather themselves


def _camera(name: str, view: Viewpoint, matrix: Matrix) -> bpy.types.Object:
    """Return a new camera object for a view, in no scene yet."""
    data = bpy.data.cameras.new(name)
    data.lens, data.clip_start, data.clip_end = view.lens, 0.05, 5000.0
    item = bpy.data.objects.new(name, data)
    eye, target = (matrix @ Vector(_list(point)) for point in (view.place, view.target))
    item.location = eye
    item.rotation_euler = (target - eye).to_track_quat("-Z", "Y").to_euler()
    return item


def _list(point: NDArray[np.float64]) -> list[float]:
    """Return a point (3,) as a list of floats."""
    return [float(value) for value in point]
