"""Many changes of a node tree, for which Blender updates the tree once instead of after each."""

from __future__ import annotations

from collections.abc import Callable

import bpy

Change = Callable[[], object]


def make_changes(changes: list[Change]) -> None:
    """Make changes of links and inputs of one node tree, in order; the tree is updated at the last of them.

    Blender updates a whole tree at each change, so that a tree of 800 nodes takes seconds. It doesn't while it tells a
    node that the node's own tree has changed (it would come back to where it is), so all but the last are made then,
    by a node of a tree that exists only for that. A release that updated all the same would only be slower.

    Args:
        changes: of links and of inputs' values; what a change adds or takes away of nodes and sockets would not be
            there for the next.

    Raises:
        Exception: what a change raises.
    """
    if not changes:
        return
    *most, last = changes
    _while_updating(most)
    last()


def _while_updating(changes: list[Change]) -> None:
    waiting, errors = [changes], []

    class Updated(bpy.types.GeometryNodeCustomGroup):
        """A node that makes the changes when it is told that its tree has changed."""

        bl_idname = "SynthRoadsUpdatedNode"
        bl_label = "Updated"

        def update(self) -> None:
            """Make the changes, the first time that this is called."""
            try:
                for change in waiting.pop() if waiting else ():
                    change()
            except Exception as error:  # Blender would only print it
                errors.append(error)

    bpy.utils.register_class(Updated)
    tree = bpy.data.node_groups.new("SynthRoads Changes", "GeometryNodeTree")
    try:
        tree.nodes.new(Updated.bl_idname)
    finally:
        bpy.data.node_groups.remove(tree)
        bpy.utils.unregister_class(Updated)
    if errors:
        raise errors[0]
    assert not waiting, "Blender did not tell a new node that its tree had changed"
