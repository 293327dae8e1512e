"""Detection of a user's changes while a scene is read in steps."""

from __future__ import annotations

from types import TracebackType

import bpy


class Changes:
    """Context manager that notes changes of geometry, transforms or the frame in the open file.

    Attributes:
        seen: whether something changed since the last `forget`.
    """

    def __init__(self) -> None:
        self.seen = False

    def forget(self) -> None:
        """Reset `seen` to False."""
        self.seen = False

    def __enter__(self) -> Changes:
        bpy.app.handlers.depsgraph_update_post.append(self._note_updates)
        bpy.app.handlers.frame_change_post.append(self._note_frame)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for handlers, function in (
            (bpy.app.handlers.depsgraph_update_post, self._note_updates),
            (bpy.app.handlers.frame_change_post, self._note_frame),
        ):
            if function in handlers:  # opening a file removes handlers
                handlers.remove(function)

    def _note_updates(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Note updates of geometry and transforms; other updates, such as selections, don't count."""
        self.seen |= any(update.is_updated_geometry or update.is_updated_transform for update in depsgraph.updates)

    def _note_frame(self, *_: object) -> None:
        """Note a change of the frame."""
        self.seen = True
