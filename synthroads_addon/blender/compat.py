"""Differences between Blender 4.5 LTS and 5.2 LTS, and nothing else."""

from __future__ import annotations

from typing import Any

import bpy

_INPUTS_ARE_PROPERTIES = bpy.app.version >= (5, 2, 0)


def _identifier(modifier: bpy.types.NodesModifier, name: str) -> str:
    """Return the socket identifier of a Geometry Nodes modifier's input by its name."""
    for item in modifier.node_group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name:
            return item.identifier
    raise KeyError(f"{modifier.node_group.name} has no input '{name}'")


def set_modifier_input(modifier: bpy.types.NodesModifier, name: str, value: Any) -> None:
    """Set the input `name` of a Geometry Nodes modifier; KeyError if its group has no such input."""
    identifier = _identifier(modifier, name)
    if _INPUTS_ARE_PROPERTIES:
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value
    modifier.id_data.update_tag()


def modifier_input(modifier: bpy.types.NodesModifier, name: str) -> Any:
    """Return the value of the input `name` of a Geometry Nodes modifier; KeyError if its group has none."""
    return identified_input(modifier, _identifier(modifier, name))


def identified_input(modifier: bpy.types.NodesModifier, identifier: str) -> Any:
    """Return the value of a Geometry Nodes modifier's input by its socket identifier."""
    if _INPUTS_ARE_PROPERTIES:
        return getattr(modifier.properties.inputs, identifier).value
    return modifier[identifier]


def object_inputs(modifier: bpy.types.NodesModifier) -> list[str]:
    """Return the names of a Geometry Nodes modifier's inputs of the type object."""
    items = modifier.node_group.interface.items_tree
    sockets = (item for item in items if item.item_type == "SOCKET" and item.in_out == "INPUT")
    return [socket.name for socket in sockets if socket.socket_type == "NodeSocketObject"]


def shown_input(modifier: bpy.types.NodesModifier, identifier: str) -> tuple[Any, str]:
    """Return (data, property name), which `UILayout.prop` takes to show a modifier's input, by its identifier."""
    if _INPUTS_ARE_PROPERTIES:
        return getattr(modifier.properties.inputs, identifier), "value"
    return modifier, f'["{identifier}"]'


def sky_texture(nodes: bpy.types.Nodes, elevation: float, azimuth: float) -> bpy.types.ShaderNodeTexSky:
    """Add and return a physical sky texture node without sun disc; sun angles in rad, azimuth clockwise from north."""
    node = nodes.new("ShaderNodeTexSky")
    names = [item.identifier for item in node.bl_rna.properties["sky_type"].enum_items]
    # Blender 5.0 renamed the physical sky.
    node.sky_type = "NISHITA" if "NISHITA" in names else "SINGLE_SCATTERING"
    node.sun_disc = False
    node.sun_elevation, node.sun_rotation = elevation, azimuth
    return node
