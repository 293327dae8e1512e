"""Clouds in the sky of pictures: a layer of noise above the road, as much of it as the environment says.

Cameras see them; what lights the road stays the clear sky, whose light the points' colours have as well, with the
shadows of clouds on the ground. Rain and snow fall from a closed cover.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import bpy

from ...road.surroundings import Environment
from ..sky import SUN_COLOR, SUN_STRENGTH

_HEIGHT = 1200.0
"""Height of the layer above the road, m."""
_SHADOW_TO_CLOUD = 2.2
"""Size of a cloud's features over that of its shadow's."""
_MEAN, _SPREAD, _EDGE = 0.5, 0.085, 0.16
"""Mean and standard deviation of the noise, and over which of its values a cloud's edge goes from clear to dense."""
_LOWEST, _FADED = 0.015, 0.10
"""Sines of the elevation at which clouds begin in the haze above the horizon, and from which on they are seen fully."""
_ALBEDO, _BASE = 0.9, 0.66
"""Share of the sun's light that a cloud's bright side throws back; its grey base against that side."""
_CLOSED = ("rain", "snow")


def cloud_share(environment: Environment) -> float:
    """Return the share of the sky that clouds cover."""
    return 1.0 if environment.weather in _CLOSED else environment.cloud_cover


def add_clouds(world: bpy.types.World, environment: Environment) -> None:
    """Change a world's nodes so that cameras see the environment's clouds before its sky; nothing if it has none."""
    share = cloud_share(environment)
    if share <= 0.0:
        return
    nodes, links = world.node_tree.nodes, world.node_tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_WORLD")
    seen = output.inputs["Surface"].links[0].from_socket
    density = _density(world.node_tree, environment, share)
    clouds, mixed = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeMixShader")
    links.new(_color(world.node_tree, environment, density), clouds.inputs["Color"])
    path = nodes.new("ShaderNodeLightPath")
    links.new(_math(world.node_tree, "MULTIPLY", density, path.outputs["Is Camera Ray"]), mixed.inputs[0])
    links.new(seen, mixed.inputs[1])
    links.new(clouds.outputs["Background"], mixed.inputs[2])
    links.new(mixed.outputs[0], output.inputs["Surface"])


def _density(tree: bpy.types.NodeTree, environment: Environment, share: float) -> bpy.types.NodeSocket:
    """Return a socket of how dense the clouds are in the direction that is seen, 0 to 1."""
    nodes, links = tree.nodes, tree.links
    place, parts, flat = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "CombineXYZ"))
    links.new(place.outputs["Generated"], parts.inputs[0])
    height = _math(tree, "MAXIMUM", parts.outputs["Z"], _LOWEST)
    for axis in "XY":
        links.new(_math(tree, "DIVIDE", parts.outputs[axis], height), flat.inputs[axis])
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = _HEIGHT / (_SHADOW_TO_CLOUD * environment.cloud_size)
    noise.inputs["Detail"].default_value, noise.inputs["Roughness"].default_value = 8.0, 0.6
    links.new(flat.outputs[0], noise.inputs["Vector"])
    clear = NormalDist(_MEAN, _SPREAD).inv_cdf(min(max(1.0 - share, 1e-4), 1.0 - 1e-4)) - _EDGE / 2.0
    value = noise.outputs[0] if noise.outputs[0].type == "VALUE" else noise.outputs[1]
    dense = _range(tree, value, clear, clear + _EDGE)
    return _math(tree, "MULTIPLY", dense, _range(tree, parts.outputs["Z"], _LOWEST, _FADED))


def _color(tree: bpy.types.NodeTree, environment: Environment, density: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return a socket of the clouds' radiance: bright at their thin edges, grey where they are dense."""
    sine = math.sin(math.radians(max(environment.sun_elevation_deg, 3.0)))
    bright = _ALBEDO * SUN_STRENGTH * environment.sun_strength * (0.35 + 0.65 * sine) / math.pi
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    colors = [entry for entry in mix.inputs if entry.type == "RGBA"]
    colors[0].default_value = (*(bright * part for part in SUN_COLOR), 1.0)
    grey = (0.97, 0.99, 1.03)
    colors[1].default_value = (*(bright * _BASE * part for part in grey), 1.0)
    tree.links.new(_math(tree, "MULTIPLY", density, density), mix.inputs[0])
    return next(out for out in mix.outputs if out.type == "RGBA")


def _math(
    tree: bpy.types.NodeTree, operation: str, first: bpy.types.NodeSocket, second: bpy.types.NodeSocket | float
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    tree.links.new(first, node.inputs[0])
    if isinstance(second, float):
        node.inputs[1].default_value = second
    else:
        tree.links.new(second, node.inputs[1])
    return node.outputs[0]


def _range(tree: bpy.types.NodeTree, value: bpy.types.NodeSocket, low: float, high: float) -> bpy.types.NodeSocket:
    """Return a socket that goes smoothly from 0 to 1 while a value goes from low to high."""
    node = tree.nodes.new("ShaderNodeMapRange")
    node.interpolation_type = "SMOOTHSTEP"
    node.inputs["From Min"].default_value, node.inputs["From Max"].default_value = low, high
    tree.links.new(value, node.inputs["Value"])
    return node.outputs[0]
