"""Sun and sky of a road's environment, as lamp and world."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector

from ..base.arrays import Float
from ..road.surroundings import Environment
from ..scanning.colour.light import sun_direction
from ..scanning.colour.twilight import FADING_FROM, LOWEST_SKY_SUN, sky_share, sky_tint, sun_share
from .compat import sky_texture

SUN_STRENGTH = 4.2
"""Irradiance of a sun of strength 1, in Blender's unit W/m2; chosen to suit the sky's radiance."""
SUN_COLOR = (1.0, 0.93, 0.84)
"""Linear red, green and blue of sunlight; chosen."""
SUN_ANGLE = math.radians(0.53)
"""Diameter of the sun's disc as seen from the Earth, rad."""
_SKY_STRENGTH = 0.16
"""Factor of the sky texture's radiance at a sun of strength 1; chosen."""


def new_sun(name: str, environment: Environment, angle: float = SUN_ANGLE) -> bpy.types.Object:
    """Create a sun lamp object aimed by the environment, in no scene yet; `angle` (rad) is the disc's diameter."""
    lamp = bpy.data.lights.new(name, "SUN")
    lamp.energy, lamp.color, lamp.angle = SUN_STRENGTH * environment.sun_strength, SUN_COLOR, angle
    if environment.sun_elevation_deg < FADING_FROM:
        lamp.color = np.array(SUN_COLOR) * sun_share(environment.sun_elevation_deg)
    sun = bpy.data.objects.new(name, lamp)
    sun.rotation_euler = Vector(sun_direction(environment)).to_track_quat("Z", "Y").to_euler()
    return sun


def sun_irradiance(environment: Environment) -> Float:
    """Return the irradiance (3,) of an environment's sun normal to its rays: red, green, blue, in Blender's unit."""
    return np.array(SUN_COLOR) * SUN_STRENGTH * environment.sun_strength * sun_share(environment.sun_elevation_deg)


def fill_sky(
    world: bpy.types.World, elevation_deg: float, azimuth_deg: float, sun_strength: float, exposed: bool = False
) -> None:
    """Replace a world's nodes by a clear physical sky for the sun's elevation and azimuth (degrees) and strength.

    Below `LOWEST_SKY_SUN` it is a low sun's sky that turns blue, and fades into the night; with `exposed` it keeps the
    low sun's brightness, as a camera shows it that is exposed longer.
    """
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    texture = sky_texture(nodes, math.radians(max(elevation_deg, LOWEST_SKY_SUN)), math.radians(azimuth_deg))
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = _SKY_STRENGTH * (0.4 + 0.6 * sun_strength)
    color = texture.outputs["Color"]
    if elevation_deg < LOWEST_SKY_SUN:
        fade = nodes.new("ShaderNodeVectorMath")
        fade.operation = "MULTIPLY"
        fade.inputs[1].default_value = sky_tint(elevation_deg) * (1.0 if exposed else sky_share(elevation_deg))
        links.new(color, fade.inputs[0])
        color = fade.outputs[0]
    links.new(color, background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
