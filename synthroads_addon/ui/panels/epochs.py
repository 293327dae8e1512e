"""Epochs of the road that is shown: the next one is drawn, its changes are listed and stepped through, edits listed.

Annotations are not postponed here: Blender reads the properties from them.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...base.files import output_folder
from ...blender.model.build import BuildTarget
from ...blender.model.roads import ROAD
from ...blender.model.store import BUILT_FROM, EPOCHS, find_road, objects_of, recall
from ...blender.model.truth import read_road
from ...blender.things.deformation import SHARED
from ...road.changes.change import Change, ChangeList
from ...road.changes.diff import diff_roads
from ...road.changes.edits import apply_changes
from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject
from ...road.parameters import RoadParameters
from ...road.section import Carriageway
from ...road.terrain import known_elevation
from ...road.things.thing import StandingThing
from ...sampling.changes import next_epoch
from ...scenario.scenario import Scenario
from ..fields.room import buttons_row, draw_text
from ..translations.blender import said
from ..work.build import road_work
from ..work.common import Sidebar, column, has_road, is_free, refusing
from ..work.job import PanelJob, Work
from ..work.long_operator import LongOperator
from .presets import JsonFileChooser

_LISTED = 12
"""Most changes that are listed at once; chosen."""
_COLOURS = {"added": (0.1, 0.7, 0.2, 1.0), "removed": (0.8, 0.1, 0.1, 1.0), "moved": (0.1, 0.4, 0.9, 1.0)}
_SURFACE = "Road"
"""Role of the part of the model that shows the pavements."""
_OTHER_COLOUR, _PLAIN = (0.95, 0.6, 0.05, 1.0), (1.0, 1.0, 1.0, 1.0)
"""Colours of objects with changes, by kind, with other changes, and without."""


def kept_epochs(root: bpy.types.Object | None) -> dict[str, Any] | None:
    """Return what a road's root keeps of its epochs; None if it has none."""
    try:
        return dict(json.loads(root[EPOCHS])) if root is not None else None
    except (KeyError, TypeError, ValueError):
        return None


def kept_changes(root: bpy.types.Object | None) -> ChangeList | None:
    """Return the list of changes that a road's root keeps; None if it has none."""
    kept = kept_epochs(root)
    return None if kept is None else ChangeList.from_dict(kept["changes"], "changes")


def _keep(root: bpy.types.Object, **values: Any) -> None:
    """Keep values of a road's epochs in its root, beside those that are there."""
    root[EPOCHS] = json.dumps({**(kept_epochs(root) or {}), **values})


def change_text(change: Change) -> str:
    """Return a change in a few words: what happened, and at which station."""
    kind = said(change.kind.replace("_", " ").capitalize())
    return f"{change.number} {kind}: {change.extent.start_station:,.0f} m"


class _EpochWork(LongOperator):
    """Base of operators that build the road of an epoch."""

    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        operator: Any = cls
        return is_free(operator, context) and has_road(operator, context)

    def _build(self, parameters: RoadParameters, scenario: Scenario, root: bpy.types.Object, **kept: Any) -> Work[str]:
        """Build a road in place of the one that is shown, and keep values of its epochs; return its message."""
        place = BuildTarget(str(root[ROAD]))
        model = yield from road_work(parameters, scenario, str(root.get(BUILT_FROM, "")), place)
        _keep(model.root, **kept)
        return said("The road of this epoch is built")

    def succeed(self, context: bpy.types.Context, job: PanelJob[str]) -> str:
        """Mark the objects with changes; return the message."""
        root = find_road(context.scene)
        changes = kept_changes(root)
        if root is not None and changes is not None:
            mark_changes(root, changes)
        return str(job.result)


class SYNTHROADS_OT_next_epoch(_EpochWork, bpy.types.Operator):
    """Draw what happens to the road in the years until its next epoch, within the limits of Changes, and build the road after it"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.next_epoch"
    bl_label = "Next Epoch"

    def job(self, context: bpy.types.Context) -> PanelJob[str]:
        """Return the job that draws the changes and builds the road."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        scenario: Scenario = context.scene.synthroads.scenario()
        before = read_road(root, context.scene).known()
        number = int((kept_epochs(root) or {}).get("epoch", 0)) + 1
        after, changes = next_epoch(before, scenario.road.changes, scenario.seed, number)
        kept = {"before": before.to_json(), "changes": changes.to_dict(), "epoch": number}
        return PanelJob("Build", self._build(after, recall(root)[1], root, **kept, shown="after", chosen=-1))


class SYNTHROADS_OT_show_epoch(_EpochWork, bpy.types.Operator):
    """Build the road as it was before its changes, or as it is after them"""

    bl_idname = "synthroads.show_epoch"
    bl_label = "Show Epoch"
    shown: bpy.props.EnumProperty(
        name="Epoch",
        description="Which road is built: that before the changes, or that after them",
        items=[("before", "Before", "The road before its changes"), ("after", "After", "The road after its changes")],
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the road that is shown has changes, and no other work is running."""
        return super().poll(context) and _has_changes(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[str]:
        """Return the job that builds the epoch's road."""
        root = find_road(context.scene)
        kept = kept_epochs(root)
        assert root is not None  # the button is shown only then
        assert kept is not None
        road = RoadParameters.from_dict(json.loads(kept["before"]), "before")
        if self.shown == "after":
            road = apply_changes(road, ChangeList.from_dict(kept["changes"], "changes"))
        return PanelJob("Build", self._build(road, recall(root)[1], root, **{**kept, "shown": self.shown}))


class SYNTHROADS_OT_next_change(bpy.types.Operator):
    """Move the 3D cursor to the next change, and colour the objects that it is about"""

    bl_idname = "synthroads.next_change"
    bl_label = "Next Change"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012
    step: bpy.props.IntProperty(
        name="Step",
        description="1: the next change; -1: the one before",
        default=1,
        min=-1,
        max=1,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the road that is shown has changes."""
        return _has_changes(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Choose the next change, and show its place."""
        root = find_road(context.scene)
        changes, kept = kept_changes(root), kept_epochs(root)
        assert root is not None  # poll() has seen them
        assert changes is not None
        assert kept is not None
        if not changes.changes:
            self.report({"INFO"}, said("The road hasn't changed"))
            return
        number = (int(kept.get("chosen", -1)) + self.step) % len(changes.changes)
        _keep(root, chosen=number)
        change = changes.changes[number]
        geometry = RoadGeometry(recall(root)[0])
        extent = change.extent
        station = np.array([(extent.start_station + extent.end_station) / 2.0])
        offset = np.array([((extent.low_offset or 0.0) + (extent.high_offset or 0.0)) / 2.0])
        place = [*geometry.alignment.place(station, offset)[0], known_elevation(geometry, station, offset)[0]]
        context.scene.cursor.location = (root.matrix_world @ _vector(place))[:]
        mark_changes(root, changes, change)
        self.report({"INFO"}, change_text(change))


def _vector(place: list[float]) -> Any:
    """Return a place as Blender's vector."""
    return Vector([float(value) for value in place])


def mark_changes(root: bpy.types.Object, changes: ChangeList, only: Change | None = None) -> None:
    """Colour a road's objects by their changes, for solid shading by object; white those without, or but one's."""
    objects = recall(root)[0].objects
    colours = {
        _role(name, objects): _COLOURS.get(change.kind, _OTHER_COLOUR)
        for change in ((only,) if only else changes.changes)
        for name in change.things
    }
    for role, part in objects_of(root).items():
        part.color = colours.get(role.partition("/")[0], _PLAIN)


def _role(name: str, objects: Mapping[str, RoadObject]) -> str:
    """Return the role of the part of the model that shows an object: its own, or the one that it shares with others."""
    item = objects.get(name)
    if isinstance(item, Carriageway):
        return _SURFACE
    return SHARED.get(type(item), name) if isinstance(item, StandingThing) else name


def _has_changes(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether the road that is shown has changes, for `poll`; else set the tooltip to the reason."""
    if kept_epochs(find_road(context.scene)) is None:
        operator.poll_message_set(said("Draw the next epoch first, or list what was edited"))
        return False
    return True


def _set_before(root: bpy.types.Object) -> tuple[RoadParameters, float | None]:
    """Return the set that edits of a road are changes of, and the years since then, if known.

    After changes that were drawn or listed it is the set before these, so that what is edited is added to them.
    """
    kept, changes = kept_epochs(root), kept_changes(root)
    if kept is not None and changes is not None and kept.get("shown") == "after":
        return RoadParameters.from_dict(json.loads(kept["before"]), "before"), changes.years
    return recall(root)[0], None


class SYNTHROADS_OT_list_edits(bpy.types.Operator):
    """List what was edited by hand as changes of the road, beside those that were drawn"""

    bl_idname = "synthroads.list_edits"
    bl_label = "Edits as List"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no work is running."""
        return is_free(cls, context) and has_road(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Compare the edited road with the one before its changes, and keep the list."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        before, years = _set_before(root)
        changes = diff_roads(before, read_road(root, context.scene).known(), years)
        _keep(root, before=before.to_json(), changes=changes.to_dict(), shown="after", chosen=-1)
        mark_changes(root, changes)
        self.report({"INFO"}, said(f"{len(changes.changes)} changes of the road"))


class SYNTHROADS_OT_save_changes(JsonFileChooser, bpy.types.Operator):
    """Write the list of changes (changes.json)"""

    bl_idname = "synthroads.save_changes"
    bl_label = "Save List"

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the road that is shown has a list."""
        return _has_changes(cls, context)

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the file browser's path to `changes.json` beside the .blend file, if none is set."""
        if not self.filepath:
            name = "changes.json"
            self.filepath = str(Path(bpy.data.filepath).with_name(name)) if bpy.data.filepath else name

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Write the list; an existing file is replaced."""
        changes, path = kept_changes(find_road(context.scene)), self.chosen_file().with_suffix(".json")
        assert changes  # poll() has seen it
        with output_folder(path.parent, [path.name], overwrite=True) as folder:
            (folder / path.name).write_text(changes.to_json(), encoding="utf-8")
        self.report({"INFO"}, said(f"List of changes written to {path}"))


class SYNTHROADS_PT_epochs(Sidebar, bpy.types.Panel):
    """Panel of the road's epochs and the changes between them."""

    bl_label = "Epochs"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 22
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return find_road(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, and the list of changes around the chosen one."""
        layout = column(self)
        layout.operator(SYNTHROADS_OT_next_epoch.bl_idname, icon="FORWARD")
        layout.operator(SYNTHROADS_OT_list_edits.bl_idname, icon="GREASEPENCIL")
        root = find_road(context.scene)
        kept, changes = kept_epochs(root), kept_changes(root)
        if kept is None or changes is None:
            return
        row = buttons_row(layout, ("Before", "After"), align=True)
        for shown, text in (("before", "Before"), ("after", "After")):
            is_shown = kept.get("shown") == shown
            button = row.operator(SYNTHROADS_OT_show_epoch.bl_idname, text=text, depress=is_shown)
            button.shown = shown
        chosen = int(kept.get("chosen", -1))
        first = max(0, min(chosen - _LISTED // 2, len(changes.changes) - _LISTED))
        box = layout.box().column(align=True)
        for number, change in enumerate(changes.changes[first : first + _LISTED], first):
            draw_text(box, change_text(change), "TRIA_RIGHT" if number == chosen else "NONE")
        layout.operator(SYNTHROADS_OT_next_change.bl_idname, icon="TRIA_DOWN")
        layout.operator(SYNTHROADS_OT_save_changes.bl_idname, icon="EXPORT")
