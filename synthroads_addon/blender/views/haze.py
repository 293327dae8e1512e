"""Haze in pictures: a body of air that distant things fade into, and a world that lights the road as below it."""

from __future__ import annotations

import bpy
from mathutils import Vector

from ...base.arrays import Float
from ...scanning.colour.haze import HEIGHT, HazeLight

_REACH, _BELOW = 2500.0, 60.0
"""Half the width of the body of haze, and its depth below the road, m; chosen."""


def haze_body(name: str, extinction: float, air: Float, middle: Vector) -> bpy.types.Object:
    """Create an object of hazy air around a place, in no scene yet.

    Args:
        name: name of object, mesh and material.
        extinction: of the haze, 1/m.
        air: (3,) the air's radiance.
        middle: centre of the haze, a place on the road in the scene's coordinates.
    """
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (-_BELOW, HEIGHT) for y in (-_REACH, _REACH) for x in (-_REACH, _REACH)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(_air(name, extinction, air))
    item = bpy.data.objects.new(name, mesh)
    item.location = middle
    item.display_type, item.hide_select = "BOUNDS", True
    # Only cameras see the haze: sun and sky light the road as below it already.
    item.visible_shadow = item.visible_diffuse = item.visible_glossy = item.visible_transmission = False
    return item


def _air(name: str, extinction: float, air: Float) -> bpy.types.Material:
    """Return a volume material that absorbs and emits, but doesn't scatter: renderings of it have no noise."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    kinds = ("VolumeAbsorption", "Emission", "AddShader", "OutputMaterial")
    absorption, emission, sum_shader, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    absorption.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    absorption.inputs["Density"].default_value = extinction
    emission.inputs["Color"].default_value = (*air.tolist(), 1.0)
    emission.inputs["Strength"].default_value = extinction
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
