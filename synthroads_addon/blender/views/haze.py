"""Haze in pictures: the air's light that distant things fade into, and sunlight and skylight below a layer of haze.

A radiance L is seen through d metres of air as L exp(-s d) + A (1 - exp(-s d)) with the extinction s = 3.912 /
visibility (Koschmieder 1924). The air's radiance A, and the light on the road, follow from two-stream theory for a
layer that scatters but doesn't absorb (Bohren 1987, Multiple scattering of light and some of its observable
consequences, Am. J. Phys. 55): fog reflects a part of the light, transmits the rest diffusely, and is bright itself. A
renderer that follows single scattering only would show fog as dark as the asphalt.
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
"""Half the width of the body of haze, its depth below the road, and the layer's height above the road, m; chosen."""
_FORWARD = 0.85
"""Asymmetry parameter g of fog's droplets: mean cosine of their scattering angles."""
_GROUND = 0.2
"""Albedo of road and grass; chosen."""
_DIFFUSIVITY = 1.66
"""Diffusivity factor: mean path of light from the whole sky through a layer, divided by its height (Elsasser 1942)."""
_LOWEST = 0.02
"""Least sine of the sun's elevation in the path of its rays through the layer; chosen."""


class HazeLight(NamedTuple):
    """Light within and below a layer of haze.

    Attributes:
        sun: share of the sunlight that passes the layer unscattered.
        sky: share of the skylight that passes the layer unscattered.
        diffuse: (3,) radiance, red, green and blue, of scattered light, added to all of the sky as seen from below.
        air: (3,) radiance of the air itself, in views along the road.
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
        visibility: meteorological visibility, m.
        elevation: elevation of the sun, rad.
        sun: (3,) irradiance by the sun normal to its rays, above the layer.
        sky: (3,) irradiance by the sky on a level surface above the layer.
    """
    depth, sine = extinction(visibility) * _HEIGHT, max(math.sin(elevation), _LOWEST)
    # Similarity: forward scattering counts as none, so that the depth is (1 - g) tau.
    scaled_depth = (1.0 - _FORWARD) * depth
    # Two-stream transmittance T = 2 / (2 + (1 - g) tau) of a layer that doesn't absorb (Bohren 1987). Light goes back
    # and forth between the layer and the ground of albedo r: down = T E / (1 - r (1 - T)).
    transmittance = 2.0 / (2.0 + scaled_depth)
    down_irradiance = transmittance * (sun * sine + sky) / (1.0 - _GROUND * (1.0 - transmittance))
    sun_share, sky_share = math.exp(-depth / sine), math.exp(-_DIFFUSIVITY * depth)
    diffuse = (down_irradiance - sun * sine * sun_share - sky * sky_share) / math.pi
    beam = sun * math.exp(-scaled_depth / sine)
    air = beam / (4.0 * math.pi) + (down_irradiance * (1.0 + _GROUND) - beam * sine) / (2.0 * math.pi)
    return HazeLight(sun_share, sky_share, np.maximum(diffuse, 0.0), np.maximum(air, 0.0))


def haze_body(name: str, visibility: float, air: Float, middle: Vector) -> bpy.types.Object:
    """Create an object of hazy air around a place, in no scene yet.

    Args:
        name: name of object, mesh and material.
        visibility: meteorological visibility, m.
        air: (3,) the air's radiance.
        middle: centre of the haze, a place on the road in the scene's coordinates.
    """
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (-_BELOW, _HEIGHT) for y in (-_REACH, _REACH) for x in (-_REACH, _REACH)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(_air(name, visibility, air))
    item = bpy.data.objects.new(name, mesh)
    item.location = middle
    item.display_type, item.hide_select = "BOUNDS", True
    # Only cameras see the haze: sun and sky light the road as below it already.
    item.visible_shadow = item.visible_diffuse = item.visible_glossy = item.visible_transmission = False
    return item


def _air(name: str, visibility: float, air: Float) -> bpy.types.Material:
    """Return a volume material that absorbs and emits, but doesn't scatter: renderings of it have no noise."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    kinds = ("VolumeAbsorption", "Emission", "AddShader", "OutputMaterial")
    absorption, emission, sum_shader, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    absorption.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    absorption.inputs["Density"].default_value = extinction(visibility)
    emission.inputs["Color"].default_value = (*air.tolist(), 1.0)
    emission.inputs["Strength"].default_value = extinction(visibility)
    links.new(absorption.outputs[0], sum_shader.inputs[0])
    links.new(emission.outputs[0], sum_shader.inputs[1])
    links.new(sum_shader.outputs[0], output.inputs["Volume"])
    return material


def light_below(world: bpy.types.World, light: HazeLight) -> None:
    """Change a world's nodes so that it lights the scene as below haze; cameras see its sky unchanged."""
    nodes, links = world.node_tree.nodes, world.node_tree.links
    sky_background = next(node for node in nodes if node.type == "BACKGROUND")
    output = next(node for node in nodes if node.type == "OUTPUT_WORLD")
    kinds = ("Background", "Background", "AddShader", "LightPath", "MixShader")
    dimmed_background, diffuse_background, sum_shader, path, mix_shader = (
        nodes.new(f"ShaderNode{kind}") for kind in kinds
    )
    dimmed_background.inputs["Strength"].default_value = sky_background.inputs["Strength"].default_value * light.sky
    diffuse_background.inputs["Color"].default_value = (*light.diffuse.tolist(), 1.0)
    links.new(sky_background.inputs["Color"].links[0].from_socket, dimmed_background.inputs["Color"])
    links.new(dimmed_background.outputs[0], sum_shader.inputs[0])
    links.new(diffuse_background.outputs[0], sum_shader.inputs[1])
    links.new(path.outputs["Is Camera Ray"], mix_shader.inputs["Fac" if "Fac" in mix_shader.inputs else "Factor"])
    links.new(sum_shader.outputs[0], mix_shader.inputs[1])
    links.new(sky_background.outputs[0], mix_shader.inputs[2])
    links.new(mix_shader.outputs[0], output.inputs["Surface"])
