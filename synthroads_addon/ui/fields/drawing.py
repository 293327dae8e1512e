"""How fields of the scenario are drawn: one row each, its name to the left; a field that isn't given greyed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any

import bpy

from .declared import BY_HAND, has_effect
from .fields import (
    AUTOMATIC,
    ChoiceField,
    ChoicesField,
    Field,
    FilesField,
    FlagField,
    IntervalField,
    NumberField,
    OptionalField,
    TextField,
)
from .groups import GroupField, NamedOrByHandField
from .inherited import inherited_text

ADD_FILE, REMOVE_FILE = "synthroads.add_file", "synthroads.remove_file"
"""Operators that lengthen and shorten a list of files."""
_NAMES_SHARE = 0.45
"""Share of a row's width that its name takes."""


def draw_field(layout: bpy.types.UILayout, settings: Any, field: Field) -> None:
    """Draw one field of the scenario, unless the other settings leave it without meaning."""
    if not has_effect(settings, field.path):
        return
    owner = owner_of(settings, field.path)
    for kind, draw in _DRAWN.items():
        if isinstance(field, kind):
            draw(layout, settings, owner, field)
            return
    _simple(layout, settings, owner, field)


def owner_of(settings: Any, path: str) -> Any:
    """Return the property group that has the property of a field."""
    head, _, _ = path.rpartition(".")
    return attrgetter(head)(settings) if head else settings


def value_row(layout: bpy.types.UILayout, label: str) -> bpy.types.UILayout:
    """Draw a name, and return the place for its value: wide enough for two numbers, the name for three words."""
    split = layout.split(factor=_NAMES_SHARE)
    name = split.row()
    name.alignment = "RIGHT"
    name.label(text=label)
    row = split.row(align=True)
    row.use_property_split = False
    return row


def _simple(layout: bpy.types.UILayout, settings: Any, owner: Any, field: Field) -> None:
    value_row(layout, field.label).prop(owner, field.name, text="")


def _flag(layout: bpy.types.UILayout, settings: Any, owner: Any, field: Field) -> None:
    value_row(layout, "").prop(owner, field.name, text=field.label)


def _number(layout: bpy.types.UILayout, settings: Any, owner: Any, field: NumberField) -> None:
    if field.is_share and not field.optional:  # a slider has its name inside
        row = layout.row()
        row.use_property_split = False
        row.prop(owner, field.name, text=field.label)
        return
    _values(layout, settings, owner, field)


def _values(layout: bpy.types.UILayout, settings: Any, owner: Any, field: NumberField | IntervalField) -> None:
    row = _checkbox(layout, settings, owner, field) if field.optional else value_row(layout, field.label)
    if row:
        for name in field.values:
            row.prop(owner, name, text="")


def _checkbox(layout: bpy.types.UILayout, settings: Any, owner: Any, field: OptionalField) -> bpy.types.UILayout | None:
    """Draw the checkbox of a field that may be left out; return the place for its value if it is ticked."""
    row = value_row(layout, field.label)
    row.prop(owner, field.checkbox_name, text="")
    if getattr(owner, field.checkbox_name):
        return row
    _draw_greyed(row, inherited_text(settings, field.path, field.unit))
    return None


def _draw_greyed(row: bpy.types.UILayout, text: str) -> None:
    greyed = row.row(align=True)
    greyed.active = False
    greyed.label(text=text)


def _choice(layout: bpy.types.UILayout, settings: Any, owner: Any, field: ChoiceField) -> None:
    row = value_row(layout, field.label)
    row.prop(owner, field.name, text="")
    if field.optional and getattr(owner, field.name) == AUTOMATIC:
        _draw_greyed(row, inherited_text(settings, field.path, field.unit))


def _choices(layout: bpy.types.UILayout, settings: Any, owner: Any, field: ChoicesField) -> None:
    column = value_row(layout, field.label).column(align=True)
    for name in field.values:
        column.prop_enum(owner, field.name, name)


def _text(layout: bpy.types.UILayout, settings: Any, owner: Any, field: TextField) -> None:
    greyed = inherited_text(settings, field.path, "") if field.optional else ""
    value_row(layout, field.label).prop(owner, field.name, text="", placeholder=greyed)


def _files(layout: bpy.types.UILayout, settings: Any, owner: Any, field: FilesField) -> None:
    for number, item in enumerate(getattr(owner, field.name)):
        row = layout.row(align=True)
        row.use_property_split = False
        row.prop(item, "file", text="")
        remove = row.operator(REMOVE_FILE, text="", icon="X")
        remove.path, remove.number = field.path, number
    layout.operator(ADD_FILE, icon="ADD").path = field.path


def _group(layout: bpy.types.UILayout, settings: Any, owner: Any, field: GroupField) -> None:
    if field.optional:
        _checkbox(layout, settings, owner, field)
        if not getattr(owner, field.checkbox_name):
            return
    for inner in field.fields_in_use(owner).values():
        draw_field(layout, settings, inner)


def _by_hand(layout: bpy.types.UILayout, settings: Any, owner: Any, field: NamedOrByHandField) -> None:
    value_row(layout, field.label).prop(owner, field.name, text="")
    if getattr(owner, field.name) == BY_HAND:
        for inner in field.by_hand.fields.values():
            draw_field(layout, settings, inner)


_DRAWN: Mapping[type[Field], Callable[..., None]] = {
    FlagField: _flag,
    NumberField: _number,
    IntervalField: _values,
    ChoiceField: _choice,
    ChoicesField: _choices,
    TextField: _text,
    FilesField: _files,
    GroupField: _group,
    NamedOrByHandField: _by_hand,
}
