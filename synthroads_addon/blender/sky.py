"""Sun and sky of a road's environment, as lamp and world."""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

from ..road.surroundings import Environment
from ..scanning.colour.light import sun_direction
from .compat import sky_texture

SUN_STRENGTH = 4.2
"""Irradiance of a sun of strength 1, in Blender's unit W/m2; chosen to suit the sky's radiance."""
SUN_COLOR = (1.0, 0.93, 0.84)
"""Linear red, green and blue of sunlight; chosen."""
SUN_ANGLE = math.radians(0.53)
"""Diameter of the sun's disc as seen from the Earth, rad."""
_SKY_STRENGTH = 0.16
"""Factor of the sky texture's radiance at a sun of strength 1; chosen."""
_LOWEST_SUN = 1.0
"""Least elevation of the sun, deg, for which the sky's model is used."""


def new_sun(name: str, environment: Environment, angle: float = SUN_ANGLE) -> bpy.types.Object:
    """Create a sun lamp object aimed by the environment, in no scene yet; `angle` (rad) is the disc's diameter."""
    lamp = bpy.data.lights.new(name, "SUN")
    lamp.energy, lamp.color, lamp.angle = SUN_STRENGTH * environment.sun_strength, SUN_COLOR, angle
    sun = bpy.data.objects.new(name, lamp)
    sun.rotation_euler = Vector(sun_direction(environment)).to_track_quat("Z", "Y").to_euler()
    return sun


def fill_sky(world: bpy.types.World, elevation_deg: float, azimuth_deg: float, sun_strength: float) -> None:
    """Replace a world's nodes by a clear physical sky for the sun's elevation and azimuth (degrees) and strength."""
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    texture = sky_texture(nodes, math.radians(max(elevation_deg, _LOWEST_SUN)), math.radians(azimuth_deg))
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = _SKY_STRENGTH * (0.4 + 0.6 * sun_strength)
    links.new(texture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
