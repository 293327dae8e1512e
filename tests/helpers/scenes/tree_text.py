"""A node group as text that it can be made from again: inputs and outputs, nodes with all their settings, and links."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import bpy

_NOT_SETTINGS = frozenset(bpy.types.Node.bl_rna.properties.keys()) | {"node_tree", "active_index", "active_item"}
_ITEMS = ("index_switch_items", "enum_items")
"""Collections of nodes whose length is a number of sockets."""
_CAPTURED = {"FLOAT_VECTOR": "VECTOR"}
"""Type of a captured value, as its node says it -> as it is made; the others are called the same."""
_PLAIN_KINDS = ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING")
_SOCKET_FIELDS = ("description", "subtype", "min_value", "max_value", "default_value")


def tree_text(group: bpy.types.NodeTree) -> str:
    """Return a group as text, JSON with a line per input, node and link; groups in it by their names."""
    nodes = list(group.nodes)
    numbers = {node.name: number for number, node in enumerate(nodes)}
    lines = [{"group": group.name, "modifier": group.is_modifier, "tag": group.color_tag, "about": group.description}]
    lines += [_interface_line(item) for item in group.interface.items_tree]
    lines += [_node_line(node, numbers) for node in nodes]
    lines += [_link_line(link, numbers) for link in _links(group)]
    return "\n".join(json.dumps(line, ensure_ascii=False) for line in lines) + "\n"


def tree_from_text(text: str) -> bpy.types.NodeTree:
    """Make a group from its text; the groups in it must be there."""
    head, *lines = [json.loads(line) for line in text.splitlines()]
    group = bpy.data.node_groups.new(head["group"], "GeometryNodeTree")
    group.is_modifier, group.color_tag, group.description = head["modifier"], head["tag"], head["about"]
    panels: dict[str, Any] = {"": None}
    for line in lines:
        if "panel" in line or "socket" in line:
            _make_interface_item(group, line, panels)
    nodes = [_make_node(group, line) for line in lines if "node" in line]
    for node, line in zip(nodes, (line for line in lines if "node" in line), strict=True):
        if line["frame"] is not None:
            node.parent = nodes[line["frame"]]
        node.location = line["place"]
    for line in lines:
        if "from" in line:
            (start, output), (end, into) = line["from"], line["to"]
            group.links.new(nodes[start].outputs[output], nodes[end].inputs[into])
    for node, line in zip(nodes, (line for line in lines if "node" in line), strict=True):
        for number in line["hidden"]:
            node.outputs[number].hide = True
    return group


def _interface_line(item: Any) -> dict[str, Any]:
    if item.item_type == "PANEL":
        return {"panel": item.name, "in": item.parent.name, "closed": item.default_closed}
    fields = {name: _plain(getattr(item, name)) for name in _SOCKET_FIELDS if hasattr(item, name)}
    return {"socket": item.name, "in": item.parent.name, "way": item.in_out, "kind": item.socket_type, **fields}


def _make_interface_item(group: bpy.types.NodeTree, line: dict[str, Any], panels: dict[str, Any]) -> None:
    interface = group.interface
    if "panel" in line:
        panel = interface.new_panel(line["panel"], default_closed=line["closed"])
        if line["in"]:
            interface.move_to_parent(panel, panels[line["in"]], len(panels[line["in"]].interface_items))
        panels[line["panel"]] = panel
        return
    socket = interface.new_socket(
        line["socket"], in_out=line["way"], socket_type=line["kind"], parent=panels[line["in"]]
    )
    for name in _SOCKET_FIELDS:
        if line.get(name) is not None:
            setattr(socket, name, line[name])


def _node_line(node: bpy.types.Node, numbers: dict[str, int]) -> dict[str, Any]:
    line: dict[str, Any] = {"node": node.bl_idname, "label": node.label}
    line["frame"] = numbers[node.parent.name] if node.parent else None
    line["place"] = list(node.location)
    line["settings"] = {name: _plain(getattr(node, name)) for name in _settings(node)}
    line["items"] = {name: len(getattr(node, name)) for name in _ITEMS if hasattr(node, name)}
    captured = getattr(node, "capture_items", ())
    line["captured"] = [[_CAPTURED.get(item.data_type, item.data_type), item.name] for item in captured]
    line["calls"] = node.node_tree.name if node.type == "GROUP" else None
    values = ((number, getattr(socket, "default_value", None)) for number, socket in enumerate(node.inputs))
    line["inputs"] = {str(number): _plain(value) for number, value in values if _plain(value) is not None}
    line["hidden"] = [number for number, socket in enumerate(node.outputs) if socket.hide]
    return line


def _make_node(group: bpy.types.NodeTree, line: dict[str, Any]) -> bpy.types.Node:
    node = group.nodes.new(line["node"])
    node.label = line["label"]
    if line["calls"]:
        node.node_tree = bpy.data.node_groups[line["calls"]]
    for name, value in line["settings"].items():
        setattr(node, name, value)
    for name, count in line["items"].items():
        while len(getattr(node, name)) < count:
            getattr(node, name).new()
    for kind, name in line["captured"]:
        node.capture_items.new(kind, name)
    for number, value in line["inputs"].items():
        node.inputs[int(number)].default_value = value
    return node


def _settings(node: bpy.types.Node) -> Iterator[str]:
    for name, prop in node.bl_rna.properties.items():
        if name not in _NOT_SETTINGS and not prop.is_readonly and prop.type in _PLAIN_KINDS:
            yield name


def _links(group: bpy.types.NodeTree) -> list[bpy.types.NodeLink]:
    """Return the links by where they end; those of one socket in the order in which they were made."""
    numbers = {node.name: number for number, node in enumerate(group.nodes)}

    def end(link: bpy.types.NodeLink) -> tuple[int, int, int]:
        return numbers[link.to_node.name], list(link.to_node.inputs).index(link.to_socket), link.multi_input_sort_id

    return sorted(group.links, key=end)


def _link_line(link: bpy.types.NodeLink, numbers: dict[str, int]) -> dict[str, Any]:
    start, end = list(link.from_node.outputs), list(link.to_node.inputs)
    return {
        "from": [numbers[link.from_node.name], start.index(link.from_socket)],
        "to": [numbers[link.to_node.name], end.index(link.to_socket)],
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON holds it; None for data-blocks, which groups don't have of their own."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, bpy.types.ID):
        return None
    return [_plain(entry) for entry in value]
