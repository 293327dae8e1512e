"""Exits, entries and emergency bays of the current road: placed at the cursor's station, changed, deleted, listed.

Annotations are not postponed here: Blender reads the properties from them.
"""

from dataclasses import replace
from typing import Any

import bpy

from ...base.errors import InputError
from ...base.schema import round_value
from ...blender.model.roads import ROAD
from ...blender.model.settle import settle
from ...blender.model.store import find_road, recall
from ...blender.model.truth import read_road
from ...checking.checker import RULES, check
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.section import Turnout
from ...sampling.turnouts.on_road import ChangedRoad, place_of, with_changed_turnout, with_turnout, without_turnout
from ...scenario.road import StatedTurnout
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.room import buttons_row, draw_text
from ..fields.wording import title_case
from ..translations.blender import said
from ..work.common import Sidebar, column, has_road, is_free, panel_message, refusing
from .edit import open_parameters
from .placing import AT_CURSOR, place_at_cursor

KINDS = {"exit": "Exit", "entry": "Entry", "emergency_bay": "Emergency Bay"}
"""Names of the kinds, as menus have them."""
ICONS = {"exit": "TRIA_RIGHT", "entry": "TRIA_LEFT", "emergency_bay": "PAUSE"}
_ABOUT = {
    "exit": "Deceleration lane and the beginning of its ramp, with its markings and signs (RAA, RMS, StVO)",
    "entry": "End of a ramp and its acceleration lane, with its markings and sign (RAA, RMS)",
    "emergency_bay": "Bay outside the hard shoulder (RAA)",
}
_SIZES = ("taper_length", "lane_length", "lane_width", "ramp_length", "ramp_clothoid")
_RAMP = ("ramp_length", "ramp_clothoid")
_OTHER_OBSTACLES = 3
"""Most notes that are reported one by one."""


def _length(name: str, description: str, default: float, limits: tuple[float, float]) -> Any:
    return bpy.props.FloatProperty(
        name=name,
        description=description,
        default=default,
        min=limits[0],
        max=limits[1],
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )


class TurnoutSizes:
    """Properties of operators that state the sizes of an exit, entry or bay."""

    taper_length: _length(
        "Taper", "Length in m over which its width opens or closes; 30 m at least, of a bay 20 m (RAA)", 30.0, (1, 200)
    )
    lane_length: _length(
        "Lane Length",
        "Length of its lane at full width in m; 250 m at least on EKA 1, of a bay 40 m (RAA)",
        250.0,
        (5, 1000),
    )
    lane_width: _length("Lane Width", "Width of its lane in m; 3.5 m at least, of a bay 3 m (RAA)", 3.5, (2, 6))
    ramp_length: _length("Ramp Length", "Length of its ramp along the road in m, e.g. 85", 85.0, (10, 400))
    ramp_clothoid: _length(
        "Ramp's A",
        "Clothoid parameter of its ramp in m: the smaller, the sooner it turns away, e.g. 90; its radius at the end is "
        "A² / length",
        90.0,
        (30, 500),
    )

    def sizes(self) -> dict[str, float]:
        """Return the stated sizes by the fields of `StatedTurnout`."""
        has_ramp = self.kind != "emergency_bay"  # type: ignore[attr-defined]
        names = [name for name in _SIZES if has_ramp or name not in _RAMP]
        return {name: exact(getattr(self, name), None) for name in names}

    def show(self, place: StatedTurnout) -> None:
        """Show the sizes of a turnout."""
        for name in _SIZES:
            if (value := getattr(place, name)) is not None:
                setattr(self, name, value)

    def draw_sizes(self, layout: bpy.types.UILayout) -> None:
        """Draw the properties that a kind has."""
        for name in _SIZES:
            if self.kind != "emergency_bay" or name not in _RAMP:  # type: ignore[attr-defined]
                layout.prop(self, name)
        if self.kind != "emergency_bay":  # type: ignore[attr-defined]
            radius = self.ramp_clothoid**2 / max(self.ramp_length, 1e-6)
            draw_text(layout, f"Ramp's radius at its end: {radius:,.0f} m")


class _OnRoad:
    """Base of operators that need a road and no running work."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        operator: Any = cls
        return is_free(operator, context) and has_road(operator, context)


def _road(context: bpy.types.Context) -> tuple[bpy.types.Object, RoadParameters]:
    root = find_road(context.scene)
    assert root  # poll() has seen it
    return root, read_road(root, context.scene).known()


def _show(operator: bpy.types.Operator, context: bpy.types.Context, changed: ChangedRoad) -> None:
    """Build the current road as it was changed, and report what the user is to know of it."""
    root = find_road(context.scene)
    assert root
    edited = read_road(root, context.scene)
    before = {(item.rule, item.object) for item in check(edited.known())}
    settle(str(root[ROAD]), replace(edited, parameters=changed.parameters))
    broken = [item for item in check(changed.parameters) if (item.rule, item.object) not in before]
    notes = [*changed.notes, *(f"{item.object}: {RULES[item.rule].title} isn't kept. {item.text}" for item in broken)]
    for note in notes[:_OTHER_OBSTACLES]:
        operator.report({"WARNING"}, f"{note[0].upper()}{note[1:]}")
    if len(notes) > _OTHER_OBSTACLES:
        rest = len(notes) - _OTHER_OBSTACLES
        operator.report({"INFO"}, said(f"{rest} more things were moved, opened or left out: see Check Rules"))


class SYNTHROADS_OT_add_turnout(_OnRoad, TurnoutSizes, bpy.types.Operator):
    """Put an exit, entry or emergency bay beside the road at the 3D cursor's station, with its markings and signs. Barriers and what stands there make way; the road is built again"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.add_turnout"
    bl_label = "Add Exit or Bay"

    kind: bpy.props.EnumProperty(
        name="Kind", description="What is placed", items=[(kind, name, _ABOUT[kind]) for kind, name in KINDS.items()]
    )
    station: bpy.props.FloatProperty(
        name="Station",
        description="Its lowest station in m, e.g. 300. Negative: the cursor's",
        default=AT_CURSOR,
        min=AT_CURSOR,
        soft_min=0.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    side: bpy.props.EnumProperty(
        name="Side",
        description="Side of the road, seen along the stations",
        items=[("cursor", "Cursor's", "Side that the cursor is on"), ("left", "Left", ""), ("right", "Right", "")],
        options={"SKIP_SAVE"},
    )
    by_rule: bpy.props.BoolProperty(
        name="Sizes by Rule",
        description="The least sizes of the guidelines (RAA) and of the panel Turnouts; else as given below",
        default=True,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take station and side of the cursor into the redo panel, and place it."""
        return self.execute(context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Place the turnout and build the road again."""
        root, parameters = _road(context)
        cursor = place_at_cursor(context, root, RoadGeometry(parameters))
        if self.station < 0.0:
            self.station = round(cursor.station, 2)
        if self.side == "cursor":
            self.side = cursor.side
        sizes = {} if self.by_rule else self.sizes()
        station = exact(self.station, None)
        place = StatedTurnout(kind=self.kind, side=self.side, station=station, **sizes)
        changed = with_turnout(parameters, place, recall(root)[1].road.turnouts)
        _show(self, context, changed)
        self.show(place_of(changed.parameters, changed.name))
        self.report({"INFO"}, said(f"{changed.name} begins at station {station:,.2f} m"))

    def draw(self, context: bpy.types.Context) -> None:
        """Draw kind, place and sizes."""
        layout = column(self)
        for name in ("kind", "station", "side", "by_rule"):
            layout.prop(self, name)
        if not self.by_rule:
            self.draw_sizes(layout)


class SYNTHROADS_OT_change_turnout(_OnRoad, TurnoutSizes, bpy.types.Operator):
    """Move an exit, entry or emergency bay, or change its sizes. Its markings, signs and barriers follow; the road is built again"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.change_turnout"
    bl_label = "Change Exit or Bay"

    turnout: bpy.props.StringProperty(
        name="Exit or Bay", description="Id of the exit, entry or bay, e.g. exit-right", options={"SKIP_SAVE"}
    )
    kind: bpy.props.StringProperty(name="Kind", options={"HIDDEN", "SKIP_SAVE"})
    station: _length("Station", "Its lowest station in m, e.g. 300", 0.0, (0, 200_000))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show its station and sizes in a dialog, and ask for others."""
        _, parameters = _road(context)
        try:
            place = place_of(parameters, self.turnout)
        except InputError as error:
            self.report({"ERROR"}, panel_message(error))
            return {"CANCELLED"}
        self.kind, self.station = place.kind, place.station
        self.show(place)
        return context.window_manager.invoke_props_dialog(self)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Change the turnout and build the road again."""
        root, parameters = _road(context)
        now = place_of(parameters, self.turnout)
        self.kind = now.kind
        update: dict[str, float] = {}
        given = {"station": exact(self.station, None)} | self.sizes()
        for name, value in given.items():
            if self.properties.is_property_set(name):
                known = getattr(now, name)
                update[name] = known if abs(value - known) < 1e-5 * max(1.0, abs(known)) else round_value(value)
        place = StatedTurnout.from_dict(now.to_dict() | update, self.turnout)
        changed = with_changed_turnout(parameters, self.turnout, place, recall(root)[1].road.turnouts)
        _show(self, context, changed)
        self.report({"INFO"}, said(f"{changed.name} begins at station {place.station:,.2f} m"))

    def draw(self, context: bpy.types.Context) -> None:
        """Draw station and sizes."""
        layout = column(self)
        draw_text(layout, turnout_name(self.turnout))
        layout.prop(self, "station")
        self.draw_sizes(layout)


class SYNTHROADS_OT_delete_turnout(_OnRoad, bpy.types.Operator):
    """Delete an exit, entry or emergency bay with its ramp, markings and signs. The edge closes behind it; the road is built again"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.delete_turnout"
    bl_label = "Delete Exit or Bay"

    turnout: bpy.props.StringProperty(
        name="Exit or Bay", description="Id of the exit, entry or bay, e.g. exit-right", options={"SKIP_SAVE"}
    )

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Delete the turnout and build the road again."""
        _, parameters = _road(context)
        _show(self, context, without_turnout(parameters, self.turnout))
        self.report({"INFO"}, said(f"{self.turnout} was deleted"))


def turnout_name(name: str) -> str:
    """Return a turnout's id as a title: ``exit-right-2`` becomes Exit Right 2."""
    return title_case(name.replace("-", " "))


def turnouts_of(scene: bpy.types.Scene) -> dict[str, Turnout]:
    """Return the current road's exits, entries and bays by id, in the order of their stations; empty without a road."""
    parameters = open_parameters(scene)
    turnouts = {} if parameters is None else parameters.of_type(Turnout)
    return dict(sorted(turnouts.items(), key=lambda item: item[1].start_station))


class SYNTHROADS_PT_exits(Sidebar, bpy.types.Panel):
    """Panel of the current road's exits, entries and emergency bays."""

    bl_label = "Exits and Bays"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 21
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return find_road(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw each one with its station, and the buttons that change and delete it; then those that add one."""
        layout = column(self)
        for name, turnout in turnouts_of(context.scene).items():
            box = layout.box().column(align=True)
            draw_text(box, f"{said(turnout_name(name))}: {turnout.start_station:,.0f} m, {turnout.length:,.0f} m long")
            row = buttons_row(box, ("Change", "Delete"), align=True)
            change = row.operator(SYNTHROADS_OT_change_turnout.bl_idname, text="Change", icon="GREASEPENCIL")
            delete = row.operator(SYNTHROADS_OT_delete_turnout.bl_idname, text="Delete", icon="TRASH")
            change.turnout = delete.turnout = name
        for kind, text in KINDS.items():
            entry = layout.operator(SYNTHROADS_OT_add_turnout.bl_idname, text=said(f"Add {text}"), icon=ICONS[kind])
            entry.kind = kind
