"""Update of what follows a move right after it: things along the road, and a gantry's signs, see `settle`."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...blender.model.settle import move_line, renew_moved_gantry
from ...blender.things.model_builder import ROLE
from .job import running_job

_DELAY = 0.02
"""Seconds from a move's end to the look at it."""
_AGAIN = 0.1
"""Seconds between two looks whether the user has let go."""
_moved: set[str] = set()
"""Names of the objects that were moved."""


@persistent
def _note_moves(scene: bpy.types.Scene, graph: bpy.types.Depsgraph) -> None:
    """Handler that records which parts are being moved."""
    for update in graph.updates:
        item = update.id
        if update.is_updated_transform and isinstance(item, bpy.types.Object) and ROLE in item:
            _moved.add(item.name)
    if _moved and not bpy.app.background and not bpy.app.timers.is_registered(_follow_later):
        bpy.app.timers.register(_follow_later, first_interval=_DELAY)


def _follow_later() -> float | None:
    """Timer that updates the moved parts once no transform operator is running any more, and no job.

    A job that builds a road with another axis puts its parts where the road's parameter set doesn't have them yet.
    """
    if running_job() is not None:
        return _AGAIN
    windows = bpy.context.window_manager.windows
    running = (operator for window in windows for operator in getattr(window, "modal_operators", ()))
    if any(operator.bl_idname.startswith("TRANSFORM_OT") for operator in running):
        return _AGAIN
    follow(bpy.context.scene)
    return None


def follow(scene: bpy.types.Scene) -> list[str]:
    """Write the recorded parts' moves to their station and offset inputs, or to their signs; return their names."""
    names, moved = sorted(_moved), []
    _moved.clear()
    for name in names:
        item = scene.objects.get(name)
        if item is not None and (move_line(item, scene) or renew_moved_gantry(item, scene)):
            moved.append(name)
    return moved


@persistent
def _forget(*_: Any) -> None:
    """Handler that clears the records when another file is opened."""
    _moved.clear()


HANDLERS = {"depsgraph_update_post": _note_moves, "load_pre": _forget}


def unregister() -> None:
    """Clear the records and cancel the timer."""
    _moved.clear()
    if bpy.app.timers.is_registered(_follow_later):
        bpy.app.timers.unregister(_follow_later)
