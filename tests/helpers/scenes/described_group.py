"""A node group as text: what tests compare, and a reader of a change sees."""

from __future__ import annotations

import bpy


def describe(group: bpy.types.NodeTree) -> str:
    """Return the group's inputs, nodes, settings and links as lines, the same on every version of Blender."""
    lines = [group.name]
    for item in group.interface.items_tree:
        if item.item_type == "SOCKET":
            limits = f" [{item.min_value:g}, {item.max_value:g}]" if hasattr(item, "min_value") else ""
            lines.append(f"{item.in_out.lower()} {item.name}: {item.socket_type}{limits}")
    names = {node.name: f"{index}" for index, node in enumerate(n for n in group.nodes if n.type != "FRAME")}
    for node in group.nodes:
        if node.type == "FRAME":
            continue
        frame = f" in '{node.parent.label}'" if node.parent else ""
        lines.append(f"{names[node.name]} {_kind(node)}{frame}")
        for socket in node.inputs:
            lines += [f"   {socket.name} <- {_source(link, names)}" for link in _incoming(group, socket)]
    return "\n".join(lines) + "\n"


def _incoming(group: bpy.types.NodeTree, socket: bpy.types.NodeSocket) -> list[bpy.types.NodeLink]:
    if not socket.is_linked:
        return []
    return [link for link in group.links if link.to_socket == socket]


def _source(link: bpy.types.NodeLink, names: dict[str, str]) -> str:
    return f"{names[link.from_node.name]} {link.from_socket.name}"


def _kind(node: bpy.types.Node) -> str:
    if node.type == "GROUP":
        return f"group {node.node_tree.name}"
    return " ".join([node.bl_idname, str(getattr(node, "operation", ""))]).strip()
