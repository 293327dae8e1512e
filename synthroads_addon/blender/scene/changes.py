"""Whether the user changes something while a scene is read in steps."""

from __future__ import annotations

from types import TracebackType

import bpy


class Changes:
    """Context manager that notes whether any geometry, transform or frame changes in the scene while it is entered.

    Attributes:
        seen: something changed since the last `forget`.
    """

    def __init__(self) -> None:
        self.seen = False

    def forget(self) -> None:
        """Reset `seen` to False."""
        self.seen = False

    def __enter__(self) -> Changes:
        bpy.app.handlers.depsgraph_update_post.append(self._look)
        bpy.app.handlers.frame_change_post.append(self._see)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for handlers, function in (
            (bpy.app.handlers.depsgraph_update_post, self._look),
            (bpy.app.handlers.frame_change_post, self._see),
        ):
            if function in handlers:  # opening a file removes it
                handlers.remove(function)

    def _look(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        # To select something is none.
        self.seen |= any(update.is_updated_geometry or update.is_updated_transform for update in depsgraph.updates)

    def _see(self, *_: object) -> None:
        self.seen = True
