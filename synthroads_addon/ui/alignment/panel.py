"""The panel Alignment: lists of elements, vertical points, crossfall and widths, and the active row's fields."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from ...blender.model.store import STATED, find_road
from ...checking.checker import RULES
from ...road.tables.elements import KIND_NAMES
from ...road.tables.points import grades_percent
from ..fields.room import buttons_row, draw_text, fits, row_width, text_width, value_row
from ..translations.blender import said
from ..work.build import SYNTHROADS_OT_build_edited
from ..work.common import Sidebar, column
from .operators import (
    SYNTHROADS_OT_crossfall_by_rule,
    SYNTHROADS_OT_delete_element,
    SYNTHROADS_OT_delete_point,
    SYNTHROADS_OT_insert_element,
    SYNTHROADS_OT_insert_point,
    SYNTHROADS_OT_mend_rule,
    SYNTHROADS_OT_split_element,
)
from .profile_view import SYNTHROADS_OT_show_profile, draw_station
from .rows import KINDS
from .tables import TABLES, Table, fix_of, marks_of, sync_later, tables

_BOX_SHARE = 0.92
"""Share of a row's width that is within a box."""
_FEWEST_ROWS, _MOST_ROWS, _POINT_ROWS = 5, 15, 4
"""Rows that a list shows at once: of elements as many as there are, within limits; of points always as many."""
_LIST_EDGES = 25.0
"""Margins and scroll bar of a list, pixels at a resolution scale of 1."""
_ICON_ROOM, _NAME_ROOM, _VALUE_ROOM = 20.0, 16.0, 16.0
"""Pixels at a resolution scale of 1 that an icon before a name, the margins of a name and those of a value take."""
_ICONS = {"line": "IPO_LINEAR", "clothoid": "IPO_QUAD", "arc": "SPHERECURVE"}
_LONGEST_NAME, _VALUE = "Clothoid", "1188.6 m"
"""The longest name of a row, and a value as wide as most are."""


def _columns(values: int) -> tuple[bool, bool, float, int]:
    """Return whether a list's rows have names, and icons, the share of their first column, and how many values fit."""
    room, value_room = row_width() - _LIST_EDGES, text_width(_VALUE) + _VALUE_ROOM
    long_room, short_room = (text_width(text) + _NAME_ROOM for text in (f"12 {said(_LONGEST_NAME)}", "12"))
    values_room = values * value_room
    has_name = long_room + values_room <= room
    has_icon = not has_name or long_room + _ICON_ROOM + values_room <= room
    name_room = (long_room if has_name else short_room) + _ICON_ROOM * has_icon
    return has_name, has_icon, name_room / room, int(np.clip((room - name_room) / value_room, 1, values))


def _draw_headings(layout: bpy.types.UILayout, headings: Sequence[str]) -> None:
    """Draw the headings of a list's columns, as many as its rows have values."""
    _, _, name_share, count = _columns(len(headings))
    split = layout.row(align=True).split(factor=name_share)
    split.label(text="")
    columns = split.row(align=True)
    for heading in headings[:count]:
        columns.label(text=heading)


def _cells(
    layout: bpy.types.UILayout, number: int, name: str, icon: str, is_broken: bool, item: Any, fields: Sequence[str]
) -> None:
    """Draw a row of a list: number and name, an icon, and as many of its values as fit.

    Args:
        layout: a row.
        number: of the row, from 0.
        name: of the row; where it has no room beside the values, its icon goes, or else stands for it alone.
        icon: of the row; a warning takes its place beside a name where the row breaks a rule, which is red in any case.
        is_broken: whether it does.
        item: with the values.
        fields: names of the values, the most important first; empty for a gap.
    """
    row = layout.row(align=True)
    row.alert = is_broken
    has_name, has_icon, name_share, count = _columns(len(fields))
    text = f"{number + 1} {said(name)}".strip() if has_name else f"{number + 1}"
    icon = ("ERROR" if is_broken and has_name else icon) if has_icon else "NONE"
    split = row.split(factor=name_share)
    split.label(text=text, icon=icon)
    values = split.row(align=True)
    for field in fields[:count]:
        if field:
            values.prop(item, field, text="", emboss=False)
        else:
            values.label(text="")


class _RowList:
    """Base of the lists: the rows of a table, in their order."""

    table: Table

    def filter_items(self, context: bpy.types.Context, data: Any, field: str) -> tuple[list[int], list[int]]:
        """Return no filter and no other order: rows stand as they are on the road."""
        return [], []


class SYNTHROADS_UL_elements(_RowList, bpy.types.UIList):
    """List of the elements: kind, length, radius or A."""

    def draw_item(self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, active: str) -> None:
        """Draw one row."""
        tables.read(context.scene)
        if item.number >= len(tables.elements):
            return
        kind = tables.elements[item.number].kind
        last = {"line": "", "clothoid": "parameter", "arc": "radius"}[kind]
        broken = bool(marks_of(context.scene, "elements", item.number))
        _cells(layout, item.number, KIND_NAMES[kind], _ICONS[kind], broken, item, ("length", last))


class SYNTHROADS_UL_vertical(_RowList, bpy.types.UIList):
    """List of the vertical points: station, height."""

    def draw_item(self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, active: str) -> None:
        """Draw one row."""
        broken = bool(marks_of(context.scene, "vertical", item.number))
        _cells(layout, item.number, "", "BLANK1", broken, item, ("station", "elevation"))


class SYNTHROADS_UL_crossfall(_RowList, bpy.types.UIList):
    """List of a carriageway's crossfall: station, %."""

    def draw_item(self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, active: str) -> None:
        """Draw one row."""
        broken = bool(marks_of(context.scene, "crossfall", item.number))
        _cells(layout, item.number, "", "BLANK1", broken, item, ("station", "percent"))


class SYNTHROADS_UL_widths(_RowList, bpy.types.UIList):
    """List of a strip's widths: station, width."""

    def draw_item(self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, active: str) -> None:
        """Draw one row."""
        broken = bool(marks_of(context.scene, "widths", item.number))
        _cells(layout, item.number, "", "BLANK1", broken, item, ("station", "width"))


_TITLES: dict[Table, str] = {
    "elements": "Elements",
    "vertical": "Vertical Points",
    "crossfall": "Crossfall",
    "widths": "Widths",
}
_START = (("start_x", "X"), ("start_y", "Y"), ("start_heading", "Heading (°)"))
"""Fields of the axis' beginning, and their labels."""
_HEADINGS: dict[Table, tuple[str, ...]] = {
    "elements": ("Length", "R, A"),
    "vertical": ("Station", "Height"),
    "crossfall": ("Station", "%"),
    "widths": ("Station", "Width"),
}
"""Headings of a list's columns, with the unit where the values have none."""
_FIELDS = {
    "vertical": (("station", "Station"), ("elevation", "Height"), ("radius", "Radius")),
    "crossfall": (("station", "Station"), ("percent", "Crossfall (%)")),
    "widths": (("station", "Station"), ("width", "Width")),
}
"""Fields of the active row of a table of points, and their labels."""


class SYNTHROADS_PT_alignment(Sidebar, bpy.types.Panel):
    """Panel of the tables of the current road."""

    bl_label = "Alignment"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 19
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return find_road(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button of the profile, the count of broken rules, and a section for each table."""
        layout = column(self)
        scene = context.scene
        road = tables.read(scene)
        if road is None:
            draw_text(layout, tables.problem or "There is no road", "ERROR")
            return
        sync_later(scene)
        layout.operator(SYNTHROADS_OT_show_profile.bl_idname, icon="IPO_EASE_IN_OUT")
        draw_station(layout, scene)
        root = find_road(scene)
        if root is not None and STATED in root:
            layout.operator(SYNTHROADS_OT_build_edited.bl_idname, icon="FILE_REFRESH")
        if tables.refused:
            draw_text(layout, tables.refused, "ERROR")
        header, body = layout.panel("synthroads_alignment_start", default_closed=True)
        header.label(text="Beginning")
        if body:
            for field, text in _START:
                value_row(body, text).prop(scene.synthroads_alignment, field, text="")
        for table in TABLES:
            header, body = layout.panel(f"synthroads_alignment_{table}", default_closed=table != "elements")
            broken = _broken(table)
            header.label(text=_TITLES[table], icon="ERROR" if broken else "NONE")
            if body:
                _draw_table(body, scene, table)


def _broken(table: Table) -> int:
    """Return the number of broken rules in a table, of all carriageways and strips."""
    return sum(len(rows) for rows in getattr(tables.marks, table).values())


def _draw_table(layout: bpy.types.UILayout, scene: bpy.types.Scene, table: Table) -> None:
    """Draw a table: what it is of, its list, its buttons, the active row's fields and broken rules."""
    group = scene.synthroads_alignment
    if table in ("crossfall", "widths"):
        value_row(layout, "Carriageway").prop(group, "side", text="")
    if table == "widths":
        value_row(layout, "Strip").prop(group, "strip", text="")
    _draw_headings(layout, _HEADINGS[table])
    rows = min(max(len(getattr(group, table)), _FEWEST_ROWS), _MOST_ROWS) if table == "elements" else _POINT_ROWS
    layout.template_list(f"SYNTHROADS_UL_{table}", "", group, table, group, f"active_{table}", rows=rows)
    _draw_buttons(layout, table)
    rows, number = getattr(group, table), getattr(group, f"active_{table}")
    if not 0 <= number < len(rows):
        return
    box = layout.box().column(align=True)
    if table == "elements":
        _draw_element(box, rows[number], number)
    else:
        for field, text in _FIELDS[table]:
            if not (table == "widths" and field == "station" and len(rows) == 1):
                value_row(box, text).prop(rows[number], field, text="")
    if table == "vertical" and tables.road is not None:
        draw_text(box, f"Grade behind: {grades_percent(tables.road.alignment)[number]:.2f} %", share=_BOX_SHARE)
    _draw_marks(box, scene, table, number)


def _draw_buttons(layout: bpy.types.UILayout, table: Table) -> None:
    """Draw the buttons that insert, delete and split rows."""
    if table != "elements":
        row = buttons_row(layout, ("Insert", "Delete"), align=True)
        row.operator(SYNTHROADS_OT_insert_point.bl_idname, text="Insert", icon="ADD").table = table
        row.operator(SYNTHROADS_OT_delete_point.bl_idname, text="Delete", icon="REMOVE").table = table
        if table == "crossfall":
            layout.operator(SYNTHROADS_OT_crossfall_by_rule.bl_idname, icon="CHECKMARK")
        return
    names = [KIND_NAMES[kind] for kind in KINDS]
    row = buttons_row(layout, names, align=True)
    for kind, name in zip(KINDS, names, strict=True):
        row.operator(SYNTHROADS_OT_insert_element.bl_idname, text=name, icon="ADD").kind = kind
    row = buttons_row(layout, ("Delete", "Split"), align=True)
    row.operator(SYNTHROADS_OT_delete_element.bl_idname, text="Delete", icon="REMOVE")
    row.operator(SYNTHROADS_OT_split_element.bl_idname, text="Split", icon="UNLINKED")


def _draw_element(box: bpy.types.UILayout, item: Any, number: int) -> None:
    """Draw the active element's fields."""
    row = tables.elements[number]
    value_row(box, "Kind").prop(item, "kind", text="")
    draw_text(box, f"Station: {row.station:,.2f} m", share=_BOX_SHARE)
    value_row(box, "Length").prop(item, "length", text="")
    if row.kind == "arc":
        value_row(box, "Radius").prop(item, "radius", text="")
    if row.kind == "clothoid":
        value_row(box, "A").prop(item, "parameter", text="")
        value_row(box, "Radius at Beginning").prop(item, "start_radius", text="")
        value_row(box, "Radius at End").prop(item, "end_radius", text="")


def _draw_marks(box: bpy.types.UILayout, scene: bpy.types.Scene, table: Table, number: int) -> None:
    """Draw the rules that a row breaks: the rule's words, and a button with what mends it."""
    for index, violation in enumerate(marks_of(scene, table, number)):
        box.separator()
        draw_text(box, RULES[violation.rule].title, "ERROR", share=_BOX_SHARE)
        draw_text(box, violation.text, share=_BOX_SHARE)
        fix = fix_of(scene, table, number, violation)
        if fix is None:
            continue
        button = fix.text
        if not fits(button, _BOX_SHARE, 1):
            draw_text(box, button, share=_BOX_SHARE)
            button = "Mend"
        entry = box.operator(SYNTHROADS_OT_mend_rule.bl_idname, text=button, icon="MODIFIER")
        entry.table, entry.number, entry.index = table, number, index


class SYNTHROADS_MT_alignment(bpy.types.Menu):
    """Menu Object > SynthRoads > Alignment: edits of the tables' active rows."""

    bl_idname = "SYNTHROADS_MT_alignment"
    bl_label = "Alignment"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw an entry for each edit."""
        layout = self.layout
        for kind in KINDS:
            entry = layout.operator(
                SYNTHROADS_OT_insert_element.bl_idname, text=f"Insert {KIND_NAMES[kind]}", icon=_ICONS[kind]
            )
            entry.kind = kind
        layout.operator(SYNTHROADS_OT_delete_element.bl_idname, icon="REMOVE")
        layout.operator(SYNTHROADS_OT_split_element.bl_idname, icon="UNLINKED")
        layout.separator()
        for table, words in (("vertical", "Vertical Point"), ("crossfall", "Crossfall Point"), ("widths", "Width")):
            layout.operator(SYNTHROADS_OT_insert_point.bl_idname, text=f"Insert {words}", icon="ADD").table = table
            layout.operator(SYNTHROADS_OT_delete_point.bl_idname, text=f"Delete {words}", icon="REMOVE").table = table
        layout.operator(SYNTHROADS_OT_crossfall_by_rule.bl_idname, icon="CHECKMARK")
        layout.separator()
        layout.operator(SYNTHROADS_OT_mend_rule.bl_idname, icon="MODIFIER")
        layout.operator(SYNTHROADS_OT_show_profile.bl_idname, icon="IPO_EASE_IN_OUT")
