"""Cache of the roads' edits for the panels, updated by a timer a moment after each change, never while drawing."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...base.errors import InputError
from ...blender.model.roads import ROAD, road_of_id
from ...blender.model.store import find_road
from ...blender.model.truth import EditedRoad, read_road
from ...blender.things.model_builder import ROLE
from ..fields.room import draw_text
from .build import SYNTHROADS_OT_build_edited
from .common import redraw_sidebars
from .job import running_job

_DELAY = 0.5
"""Seconds after a change until the road is read; each further change begins anew."""


class Edits:
    """Cache of the last reading of each road's edits.

    Attributes:
        by_road: what was read, or what is wrong, by the road's id.
        objects: how many objects the scene had when it was looked at last.
    """

    def __init__(self) -> None:
        self.by_road: dict[str, EditedRoad | str] = {}
        self.objects = 0

    def forget(self) -> None:
        """Empty the cache."""
        self.by_road.clear()
        self.objects = 0

    def shown(self, scene: bpy.types.Scene) -> EditedRoad | str | None:
        """Return the cached reading of the current road, or its error message; None if it hasn't been read yet."""
        root = find_road(scene)
        return self.by_road.get(str(root[ROAD])) if root is not None else None

    def read(self, scene: bpy.types.Scene) -> None:
        """Read the current road's edits into the cache."""
        root = find_road(scene)
        if root is not None:
            self.by_road[str(root[ROAD])] = _read(scene, str(root[ROAD]))


edits = Edits()


def _read(scene: bpy.types.Scene, road: str) -> EditedRoad | str:
    root = road_of_id(scene, road)
    assert root is not None
    try:
        return read_road(root, scene)
    except InputError as error:
        return str(error)


def _read_later() -> float | None:
    """Timer that reads the current road and redraws the panels; waits while a job is running."""
    if running_job() is not None:
        return _DELAY
    edits.read(bpy.context.scene)
    redraw_sidebars(bpy.context)
    return None


@persistent
def _note_changes(scene: bpy.types.Scene, graph: bpy.types.Depsgraph | None = None) -> None:
    """Handler that schedules a reading after a change to one of a road's objects."""
    changes = [update.id for update in graph.updates] if graph else []
    count, edits.objects = edits.objects, len(scene.objects)
    touched = (
        graph is None
        or count != edits.objects
        or any(
            isinstance(item, bpy.types.Mesh) or (isinstance(item, bpy.types.Object) and (ROLE in item or ROAD in item))
            for item in changes
        )
    )
    if not touched or bpy.app.background:
        return
    if bpy.app.timers.is_registered(_read_later):
        bpy.app.timers.unregister(_read_later)
    bpy.app.timers.register(_read_later, first_interval=_DELAY)


@persistent
def _other_file(*_: Any) -> None:
    edits.forget()


def draw_edits(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the current road's edits: fit of the axis, button to rebuild, parts edited by hand with the reasons."""
    edited = edits.shown(context.scene)
    if edited is None:
        return
    if isinstance(edited, str):
        draw_text(layout, edited, "ERROR")
        return
    if edited.axis is not None:
        across, up = edited.axis.horizontal.worst, edited.axis.height.worst
        draw_text(layout, f"Axis fitted within {across:.3f} m, heights {up:.3f} m", "CURVE_PATH")
    if edited.stale:
        layout.operator(SYNTHROADS_OT_build_edited.bl_idname, icon="FILE_REFRESH")
    if edited.by_hand:
        box = layout.box().column(align=True)
        box.label(text="Edited by Hand", icon="SCULPTMODE_HLT")
        for edit in edited.by_hand:
            draw_text(box, f"{edit.name}: {edit.reason}", "BLANK1")


HANDLERS = dict.fromkeys(("depsgraph_update_post", "undo_post", "redo_post"), _note_changes)
HANDLERS["load_post"] = _other_file


def unregister() -> None:
    """Empty the cache and cancel the timer."""
    edits.forget()
    if bpy.app.timers.is_registered(_read_later):
        bpy.app.timers.unregister(_read_later)
