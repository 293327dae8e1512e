"""Many changes of a node tree, after which Blender updates the tree once, not after each."""

from __future__ import annotations

from collections.abc import Callable

import bpy

Change = Callable[[], object]


def make_changes(changes: list[Change]) -> None:
    """Make changes of links and inputs of one node tree, in order; the tree is updated at the last of them.

    Blender updates a whole tree at each change, so that a tree of 800 nodes takes seconds. It doesn't update any tree
    while it calls a node's method `update`, as it would call itself. So all changes but the last are made in the
    method of a node in a tree that exists only for that. If a release updated trees even then, this would only be slow.

    Args:
        changes: functions that add links or set inputs' values; a change may not add or remove nodes or sockets, as
            the next one wouldn't see that.

    Raises:
        Exception: an exception of a change.
    """
    if not changes:
        return
    *earlier_changes, last_change = changes
    _while_updating(earlier_changes)
    last_change()


def _while_updating(changes: list[Change]) -> None:
    """Make changes within a node's method `update`; raise the first exception among them."""
    pending_changes, errors = [changes], []

    class Updated(bpy.types.GeometryNodeCustomGroup):
        """A node that makes the changes when Blender calls its `update`, because its tree has changed."""

        bl_idname = "SynthRoadsUpdatedNode"
        bl_label = "Updated"

        def update(self) -> None:
            """Make the changes at the first call."""
            try:
                for change in pending_changes.pop() if pending_changes else ():
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
    assert not pending_changes, "Blender did not call the update of a new node"
