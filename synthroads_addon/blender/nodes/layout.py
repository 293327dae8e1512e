"""Positions of a group's nodes in the editor: frames below each other, and in each frame nodes from left to right."""

from __future__ import annotations

import bpy

COLUMN = 220.0
"""Width of a column of nodes, px of the node editor; these are chosen."""
ROW_GAP = 30.0
FRAME_GAP = 90.0


def arrange(group: bpy.types.NodeTree) -> None:
    """Lay out a group's nodes in the node editor, in place; hide unused sockets of its Group Input nodes."""
    incoming: dict[str, list[bpy.types.Node]] = {node.name: [] for node in group.nodes}
    for link in group.links:
        incoming[link.to_node.name].append(link.from_node)
    depths: dict[str, int] = {}
    for node in group.nodes:
        _depth(node, incoming, depths)
    top = 0.0
    places: dict[str, tuple[float, float]] = {}
    blocks: dict[str, list[bpy.types.Node]] = {}
    for node in group.nodes:
        if node.type != "FRAME":
            blocks.setdefault(node.parent.name if node.parent else "", []).append(node)
    for block in blocks.values():
        top -= _arrange_block(block, depths, top, places) + FRAME_GAP
    # One call for all: setting a node's place by itself updates the whole tree each time.
    group.nodes.foreach_set("location", [value for node in group.nodes for value in places.get(node.name, (0.0, 0.0))])
    for node in group.nodes:
        if node.type == "GROUP_INPUT":
            for socket in node.outputs:
                socket.hide = not socket.is_linked


def _depth(node: bpy.types.Node, incoming: dict[str, list[bpy.types.Node]], depths: dict[str, int]) -> int:
    """Return the length of the longest link path to a node within its own frame, kept in `depths`."""
    if node.name not in depths:
        sources = [source for source in incoming[node.name] if source.parent == node.parent]
        depths[node.name] = 1 + max((_depth(source, incoming, depths) for source in sources), default=-1)
    return depths[node.name]


def _arrange_block(
    block: list[bpy.types.Node], depths: dict[str, int], top: float, places: dict[str, tuple[float, float]]
) -> float:
    """Write the places of one frame's nodes, from `top` downwards, into `places`; return the block's height."""
    heights: dict[int, float] = {}
    for node in block:
        depth = depths[node.name]
        height = _height(node) + ROW_GAP
        places[node.name] = (COLUMN * depth, top - heights.get(depth, 0.0))
        heights[depth] = heights.get(depth, 0.0) + height
    return max(heights.values(), default=0.0)


def _height(node: bpy.types.Node) -> float:
    """Return a node's estimated height in the node editor, from its sockets and settings."""
    lines = sum(1 for socket in node.outputs if socket.enabled and not socket.hide)
    for socket in node.inputs:
        if socket.enabled and not socket.hide:
            lines += 4 if socket.type == "VECTOR" and not socket.is_linked else 1
    settings = len(set(node.bl_rna.properties.keys()) - set(bpy.types.Node.bl_rna.properties.keys()))
    return 40.0 + 22.0 * (lines + min(settings, 3))
