"""Haze in pictures: the air's light that distant things fade into, and sun and sky as a layer of it leaves them.

What is seen through d metres of air is L exp(-s d) + A (1 - exp(-s d)) with the extinction s = 3.912 / visibility
(Koschmieder 1924). The air's light A, and what falls on the road, are those of a layer that scatters and absorbs
nothing, in two streams (Bohren 1987, Multiple scattering of light and some of its observable consequences, Am. J. Phys.
55): fog throws back up a part of the light, takes its direction from the rest, and is bright itself. A renderer that
follows single scatterings only shows fog as dark as the asphalt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Vector

from ...base.arrays import Float

_CONTRAST = 3.912
"""Optical depth over the meteorological visibility: -ln 0.02, a contrast of 2 %."""
_REACH, _BELOW, _HEIGHT = 2500.0, 60.0, 300.0
"""Half the width of the body of haze, how far it reaches below the road, and the layer's height above it, m."""
_FORWARD = 0.85
"""Mean cosine of scattering angles of fog's droplets."""
_GROUND = 0.2
"""Share of the light that road and grass throw back."""
_DIFFUSIVITY = 1.66
"""Mean length of the ways of light from a whole sky through a layer, in its heights (Elsasser 1942)."""
_LOWEST = 0.02
"""Sine of the sun's elevation that a layer's length along its rays is limited by."""


class HazeLight(NamedTuple):
    """Light within and below a layer of haze.

    Attributes:
        sun: share of the sun's light that arrives straight.
        sky: share of the sky's light that does.
        diffuse: (3,) radiance, red, green and blue, that the layer adds all over the sky for what is below it.
        air: (3,) radiance of the air itself, along the road.
    """

    sun: float
    sky: float
    diffuse: Float
    air: Float


def extinction(visibility: float) -> float:
    """Return the extinction coefficient (1/m) of a meteorological visibility, m."""
    return _CONTRAST / visibility


def haze_light(visibility: float, elevation: float, sun: Float, sky: Float) -> HazeLight:
    """Return the light within and below a layer of haze.

    Args:
        visibility: the meteorological one, m.
        elevation: of the sun, rad.
        sun: (3,) the sun's irradiance across its rays, above the layer.
        sky: (3,) irradiance of level ground by the sky, above the layer.
    """
    depth, sine = extinction(visibility) * _HEIGHT, max(math.sin(elevation), _LOWEST)
    # Light that goes nearly straight on counts as not scattered.
    scaled = (1.0 - _FORWARD) * depth
    let_through = 2.0 / (2.0 + scaled)
    down = let_through * (sun * sine + sky) / (1.0 - _GROUND * (1.0 - let_through))
    straight, sky_left = math.exp(-depth / sine), math.exp(-_DIFFUSIVITY * depth)
    diffuse = (down - sun * sine * straight - sky * sky_left) / math.pi
    beam = sun * math.exp(-scaled / sine)
    air = beam / (4.0 * math.pi) + (down * (1.0 + _GROUND) - beam * sine) / (2.0 * math.pi)
    return HazeLight(straight, sky_left, np.maximum(diffuse, 0.0), np.maximum(air, 0.0))


def haze_body(name: str, visibility: float, air: Float, middle: Vector) -> bpy.types.Object:
    """Create an object of hazy air around a place, in no scene yet.

    Args:
        name: of object, mesh and material.
        visibility: m.
        air: (3,) the air's radiance.
        middle: place on the road, in the scene.
    """
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (-_BELOW, _HEIGHT) for y in (-_REACH, _REACH) for x in (-_REACH, _REACH)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(_air(name, visibility, air))
    item = bpy.data.objects.new(name, mesh)
    item.location = middle
    item.display_type, item.hide_select = "BOUNDS", True
    # What lights the road is in sun and sky already.
    item.visible_shadow = item.visible_diffuse = item.visible_glossy = item.visible_transmission = False
    return item


def _air(name: str, visibility: float, air: Float) -> bpy.types.Material:
    """Return a material that absorbs and shines: nothing is scattered while it is rendered, so it has no noise."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    kinds = ("VolumeAbsorption", "Emission", "AddShader", "OutputMaterial")
    absorbed, shine, both, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    absorbed.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    absorbed.inputs["Density"].default_value = extinction(visibility)
    shine.inputs["Color"].default_value = (*air.tolist(), 1.0)
    shine.inputs["Strength"].default_value = extinction(visibility)
    links.new(absorbed.outputs[0], both.inputs[0])
    links.new(shine.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Volume"])
    return material


def light_below(world: bpy.types.World, light: HazeLight) -> None:
    """Change a world's nodes so that it lights the scene as below haze; a camera sees its sky unchanged."""
    nodes, links = world.node_tree.nodes, world.node_tree.links
    seen = next(node for node in nodes if node.type == "BACKGROUND")
    output = next(node for node in nodes if node.type == "OUTPUT_WORLD")
    kinds = ("Background", "Background", "AddShader", "LightPath", "MixShader")
    left, added, both, path, mixed = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    left.inputs["Strength"].default_value = seen.inputs["Strength"].default_value * light.sky
    added.inputs["Color"].default_value = (*light.diffuse.tolist(), 1.0)
    links.new(seen.inputs["Color"].links[0].from_socket, left.inputs["Color"])
    links.new(left.outputs[0], both.inputs[0])
    links.new(added.outputs[0], both.inputs[1])
    links.new(path.outputs["Is Camera Ray"], mixed.inputs["Fac" if "Fac" in mixed.inputs else "Factor"])
    links.new(both.outputs[0], mixed.inputs[1])
    links.new(seen.outputs[0], mixed.inputs[2])
    links.new(mixed.outputs[0], output.inputs["Surface"])
