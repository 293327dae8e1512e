"""Clouds in the sky of pictures: a layer of noise above the road that covers the environment's share of the sky.

Only cameras see them: the clear sky lights the road, as it does in the points' colours, which have shadows of clouds on
the ground. Rain and snow have a closed cover.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import bpy

from ...road.surroundings import Environment
from ...scanning.colour.twilight import sky_share
from ..sky import SUN_COLOR, SUN_STRENGTH

_HEIGHT = 1200.0
"""Height of the layer above the road, m."""
_SHADOW_TO_CLOUD = 2.2
"""Size of a cloud's features divided by that of its shadow's; chosen."""
_MEAN, _SPREAD, _EDGE = 0.5, 0.085, 0.16
"""Mean and standard deviation of the noise (measured), and the range of its values in a cloud's edge (chosen)."""
_LOWEST, _FADED = 0.015, 0.10
"""Sines of the elevations above the horizon at which clouds begin, and from which on they are fully seen; chosen."""
_ALBEDO, _BASE = 0.9, 0.66
"""Albedo of a cloud's bright side; brightness of its base as a share of that side's; chosen."""
_CLOSED = ("rain", "snow")


def cloud_share(environment: Environment) -> float:
    """Return the share of the sky that clouds cover, 0 to 1."""
    return 1.0 if environment.weather in _CLOSED else environment.cloud_cover


def add_clouds(world: bpy.types.World, environment: Environment) -> None:
    """Change a world's nodes so that cameras see the environment's clouds in front of its sky, if it has any."""
    share = cloud_share(environment)
    if share <= 0.0:
        return
    nodes, links = world.node_tree.nodes, world.node_tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_WORLD")
    sky = output.inputs["Surface"].links[0].from_socket
    density = _density(world.node_tree, environment, share)
    clouds, mix = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeMixShader")
    links.new(_color(world.node_tree, environment, density), clouds.inputs["Color"])
    path = nodes.new("ShaderNodeLightPath")
    links.new(_math(world.node_tree, "MULTIPLY", density, path.outputs["Is Camera Ray"]), mix.inputs[0])
    links.new(sky, mix.inputs[1])
    links.new(clouds.outputs["Background"], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])


def _density(tree: bpy.types.NodeTree, environment: Environment, share: float) -> bpy.types.NodeSocket:
    """Return a socket with the density of the clouds in the view direction, 0 to 1."""
    nodes, links = tree.nodes, tree.links
    coordinates, direction, layer_place = (
        nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "CombineXYZ")
    )
    links.new(coordinates.outputs["Generated"], direction.inputs[0])
    sine = _math(tree, "MAXIMUM", direction.outputs["Z"], _LOWEST)
    # The view ray meets the layer at (x, y) / z times its height; the texture's scale has the height.
    for axis in "XY":
        links.new(_math(tree, "DIVIDE", direction.outputs[axis], sine), layer_place.inputs[axis])
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = _HEIGHT / (_SHADOW_TO_CLOUD * environment.cloud_size)
    noise.inputs["Detail"].default_value, noise.inputs["Roughness"].default_value = 8.0, 0.6
    links.new(layer_place.outputs[0], noise.inputs["Vector"])
    # The noise exceeds the middle of a cloud's edge in the environment's share of the sky: its normal quantile.
    threshold = NormalDist(_MEAN, _SPREAD).inv_cdf(min(max(1.0 - share, 1e-4), 1.0 - 1e-4)) - _EDGE / 2.0
    value = noise.outputs[0] if noise.outputs[0].type == "VALUE" else noise.outputs[1]
    density = _range(tree, value, threshold, threshold + _EDGE)
    return _math(tree, "MULTIPLY", density, _range(tree, direction.outputs["Z"], _LOWEST, _FADED))


def _color(tree: bpy.types.NodeTree, environment: Environment, density: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return a socket of the clouds' radiance: bright at their thin edges, grey where they are dense."""
    sine = math.sin(math.radians(max(environment.sun_elevation_deg, 3.0)))
    # Radiance of a Lambertian surface, albedo E / pi, less at a low sun by chosen weights.
    radiance = _ALBEDO * SUN_STRENGTH * environment.sun_strength * (0.35 + 0.65 * sine) / math.pi
    radiance *= sky_share(environment.sun_elevation_deg)
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    colors = [color_input for color_input in mix.inputs if color_input.type == "RGBA"]
    colors[0].default_value = (*(radiance * part for part in SUN_COLOR), 1.0)
    grey = (0.97, 0.99, 1.03)  # chosen: a base lit by the sky is slightly blue
    colors[1].default_value = (*(radiance * _BASE * part for part in grey), 1.0)
    # The square of the density keeps thin edges bright.
    tree.links.new(_math(tree, "MULTIPLY", density, density), mix.inputs[0])
    return next(color_output for color_output in mix.outputs if color_output.type == "RGBA")


def _math(
    tree: bpy.types.NodeTree, operation: str, operand: bpy.types.NodeSocket, other_operand: bpy.types.NodeSocket | float
) -> bpy.types.NodeSocket:
    """Add a math node of a socket and a socket or number; return its output."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    tree.links.new(operand, node.inputs[0])
    if isinstance(other_operand, float):
        node.inputs[1].default_value = other_operand
    else:
        tree.links.new(other_operand, node.inputs[1])
    return node.outputs[0]


def _range(tree: bpy.types.NodeTree, value: bpy.types.NodeSocket, start: float, end: float) -> bpy.types.NodeSocket:
    """Return a socket that rises smoothly from 0 to 1 while a value goes from `start` to `end`."""
    node = tree.nodes.new("ShaderNodeMapRange")
    node.interpolation_type = "SMOOTHSTEP"
    node.inputs["From Min"].default_value, node.inputs["From Max"].default_value = start, end
    tree.links.new(value, node.inputs["Value"])
    return node.outputs[0]
