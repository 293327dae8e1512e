"""Base of long-running operators: the window stays responsive, the status bar shows progress, Esc cancels.

A subclass says what is to be done in `job`, and what to say at the end in `succeed`; its annotations and `poll` are its
own. Called from Python (``bpy.ops.synthroads.scan()``) it does the same at once.
"""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import bpy

from ...base.errors import Cancelled, InputError
from ...blender.model.stage import remove_staged
from ..fields.room import draw_text
from ..translations.blender import said
from .common import is_free, redraw_sidebars, refuse
from .job import TICK, PanelJob, WorkPace, running_job, stop_job


class LongOperator:
    """Base of operators that run a `PanelJob`; `bl_options` must lack REGISTER, as Repeat Last would block."""

    nothing_done = "nothing was changed"
    """Message after the job was cancelled."""

    if TYPE_CHECKING:

        def report(self, kind: set[str], message: str, /) -> None:
            """Blender's own, of every operator."""

    _job: PanelJob[Any] | None = None
    _pace: WorkPace
    _shown = ""
    """The job's state in the window."""
    _drawing = 0.0
    """Seconds that the window took to be drawn the last time that any work was done in it."""
    _timer: bpy.types.Timer | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether Blender is in object mode and no job is running."""
        return is_free(cast("type[bpy.types.Operator]", cls), context)

    def job(self, context: bpy.types.Context) -> PanelJob[Any]:
        """Return the job to run; raises `InputError` if the input is wrong."""
        raise NotImplementedError

    def succeed(self, context: bpy.types.Context, job: PanelJob[Any]) -> str:
        """Take over the ended job's result and return the message to report."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the job when the button is pressed."""
        return self.begin(context)

    def refuse(self, error: InputError) -> set[str]:
        """Report an input error in the panel's words; return CANCELLED."""
        return refuse(cast("bpy.types.Operator", self), error)

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Start the job, run its first turn, and continue by a timer if that wasn't all."""
        try:
            self._job = self.job(context)
            self._job.start()
        except InputError as error:
            return self.refuse(error)
        # To have the window drawn first would take as long as a small work.
        self._pace = WorkPace(drawing=LongOperator._drawing)
        if not self._job.tick(self._pace.budget(), self._pace.patience):
            return self._end(context, self._job)
        self._pace.leave()
        self._shown = ""
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(_draw_status)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Run a turn of the job at each timer event; cancel it on Esc."""
        job = self._job
        assert job
        if event.type == "ESC" and event.value == "PRESS" and job.running:
            job.stop()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        budget = self._pace.budget()
        LongOperator._drawing = self._pace.drawing
        if job.tick(budget, self._pace.patience):
            if job.state != self._shown:  # what runs aside goes on between two turns
                self._shown = job.state
                context.workspace.status_text_set(_draw_status)
                redraw_sidebars(context)
            self._pace.leave()
            return {"PASS_THROUGH"}
        self._leave(context)
        return self._end(context, job)

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the job when Blender ends the operator, as another file is opened or the window is closed."""
        if self._job is not None:
            self._job.stop(wait=True)
        self._leave(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run the whole job before returning, as calls from Python do."""
        try:
            job = self.job(context)
            job.run()
        except InputError as error:
            return self.refuse(error)
        return self._say(self.succeed(context, job), job.remarks)

    def _end(self, context: bpy.types.Context, job: PanelJob[Any]) -> set[str]:
        if job.error is None:
            return self._say(self.succeed(context, job), job.remarks)
        if isinstance(job.error, Cancelled):
            self.report({"WARNING"}, said(f"{job.title} cancelled; {self.nothing_done}"))
            return {"CANCELLED"}
        if isinstance(job.error, InputError):
            return self.refuse(job.error)
        traceback.print_exception(job.error)
        self.report({"ERROR"}, said(f"{job.title} failed, {self.nothing_done}: {job.error!r} (see the console)"))
        return {"CANCELLED"}

    def _say(self, message: str, remarks: Sequence[str]) -> set[str]:
        for remark in remarks:
            self.report({"WARNING"}, said(remark))
        self.report({"INFO"}, said(message))
        return {"FINISHED"}

    def _leave(self, context: bpy.types.Context) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        _reset_status()
        redraw_sidebars(context)


class FileChooser:
    """Base of operators that open the file browser first and then work on the chosen file or folder."""

    if TYPE_CHECKING:
        filepath: str

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the path that the file browser opens with."""

    def chosen_file(self) -> Path:
        """Return the path of the chosen file, with Blender's ``//`` resolved.

        Raises:
            InputError: none was chosen, as where a script calls the operator without one.
        """
        path = self.optional_file(self.filepath)
        if path is None or not path.name:
            raise InputError("File", self.filepath or None, "choose a file")
        return path

    @staticmethod
    def optional_file(text: str) -> Path | None:
        """Return the path of a file that may be left out, with Blender's ``//`` resolved; None for an empty text."""
        return Path(bpy.path.abspath(text.strip())).expanduser() if text.strip() else None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser, which calls `execute`."""
        self.suggest(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class FileOperator(FileChooser, LongOperator):
    """Base of long-running operators on a file that the user chooses; called from Python they run to the end."""

    _asked = False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser, and note that `execute` is to run beside the window."""
        self._asked = True
        return super().invoke(context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run the job beside the window after the file browser, else to its end."""
        return self.begin(context) if self._asked else super().execute(context)


class SYNTHROADS_OT_cancel(bpy.types.Operator):
    """Stop the running work; everything stays as it was before"""

    bl_idname = "synthroads.cancel"
    bl_label = "Cancel"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Request the running job to stop."""
        job = running_job()
        if job is not None:
            job.stop()
        return {"FINISHED"}


def draw_job(layout: bpy.types.UILayout) -> bool:
    """Draw the running job's progress bar and cancel button; return whether a job is running."""
    job = running_job()
    if job is None:
        return False
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.progress(factor=job.share, text=said(job.state))
    row.operator(SYNTHROADS_OT_cancel.bl_idname, text="", icon="X")
    for note in job.notes:
        draw_text(layout, note, "INFO")
    return True


def _draw_status(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """Draw the status bar with the running job's progress."""
    job, layout = running_job(), header.layout
    if job is None:
        return
    layout.label(text="", icon="EVENT_ESC")
    layout.separator(factor=2.0)
    layout.label(text=said(f"Cancel {job.title}"))
    layout.separator_spacer()
    layout.label(text=f"SynthRoads: {said(job.state)}")  # Blender cuts texts off that stand on this bar
    layout.progress(factor=job.share)
    layout.separator_spacer()


def _reset_status() -> None:
    """Restore Blender's own status bar, in all workspaces."""
    bpy.data.workspaces[0].status_text_set(None)


@bpy.app.handlers.persistent
def _before_history(*_: object) -> None:
    """Handler that stops a job before undo, redo or opening a file frees the data-blocks it may hold."""
    job = running_job()
    if job is not None and job.touches_scene:
        job.stop(wait=True)


@bpy.app.handlers.persistent
def _after_history(*_: object) -> None:
    """Handler that removes half-built roads contained in an undo step or a file."""
    if running_job() is None:
        remove_staged()


HANDLERS = {f"{change}_pre": _before_history for change in ("undo", "redo", "load")}
HANDLERS |= {f"{change}_post": _after_history for change in ("undo", "redo", "load")}


def unregister() -> None:
    """Stop the running job and restore the status bar."""
    stop_job()
    _reset_status()
