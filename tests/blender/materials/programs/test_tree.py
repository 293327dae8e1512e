"""Links are followed as Cycles follows them: through groups, whose sockets have types, reroutes and muted nodes."""

from __future__ import annotations

import bpy
import pytest

from synthroads_addon.scanning.scene.surface_values import SurfaceInput
from tests.helpers.scenes.node_cases import VALUES, material_deviations, show


def _group(kind: str) -> bpy.types.NodeTree:
    """Return a group that gives on what it gets, by sockets of a type."""
    tree = bpy.data.node_groups.new("Passing", "ShaderNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Value", in_out=way, socket_type=f"NodeSocket{kind}")
    begin, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(begin.outputs[0], end.inputs[0])
    return tree


@pytest.mark.parametrize("kind", ["Float", "Vector", "Color"])
@pytest.mark.parametrize("way", ["group", "muted", "reroute"])
@pytest.mark.parametrize("given", ["Color", "Vector", "Fac"])
def test_what_lies_between(kind: str, way: str, given: str) -> None:
    item = bpy.data.materials.new("Case")
    if item.node_tree is None:
        item.use_nodes = True
    tree = item.node_tree
    tree.nodes.clear()
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "a"
    # A copy's inputs are colours: so it is made what it is asked for.
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    mixed = tree.nodes.new("ShaderNodeMix")
    mixed.data_type = {"Color": "RGBA", "Vector": "VECTOR", "Fac": "FLOAT"}[given]
    tree.links.new(attribute.outputs["Vector"], parts.inputs[0])
    first = next(entry for entry in mixed.inputs if entry.enabled and entry.name == "A")
    tree.links.new(parts.outputs[1] if given == "Fac" else attribute.outputs["Vector"], first)
    next(entry for entry in mixed.inputs if entry.enabled and entry.name == "Factor").default_value = 0.0
    source = next(output for output in mixed.outputs if output.enabled)
    if way == "group":
        between = tree.nodes.new("ShaderNodeGroup")
        between.node_tree = _group(kind)
    elif way == "muted":
        names = {"Float": "Math", "Vector": "VectorMath", "Color": "Invert"}
        between = tree.nodes.new(f"ShaderNode{names[kind]}")
        between.mute = True
    else:
        between = tree.nodes.new("NodeReroute")
    entry = between.inputs["Color"] if way == "muted" and kind == "Color" else between.inputs[0]
    tree.links.new(source, entry)
    end = tree.nodes.new("ShaderNodeVectorMath")
    tree.links.new(between.outputs[0], end.inputs[0])
    show(tree, end.outputs[0])
    (apart,) = material_deviations([item], [{SurfaceInput("attribute", "a"): VALUES["small"]["a"]}])
    if bpy.app.version >= (5, 0, 0) and kind == "Float" and way != "reroute" and given != "Fac":
        assert str(apart).endswith(" as a number")
        return
    assert apart == pytest.approx(0.0, abs=1e-5)
