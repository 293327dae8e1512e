"""Long operators that ask for a file first: the file browser calls `execute`, which mustn't hold up the window."""

from __future__ import annotations

import bpy

from .long_operator import LongOperator


class FileOperator(LongOperator):
    """Base of operators that work on a file which the user chooses. Called from Python they do it at once."""

    _asked = False

    def suggest(self, context: bpy.types.Context) -> None:
        """Set what the file browser shows at first, if there is something."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser."""
        self._asked = True
        self.suggest(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Work beside the window after the file browser, else at once."""
        return self.begin(context) if self._asked else super().execute(context)
