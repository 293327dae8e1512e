"""Room in the sidebar: texts are measured, and what doesn't fit stands below each other or in several lines.

Blender cuts a text that is wider than its place. A layout can't say how wide it is, but the sidebar can.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import blf
import bpy

from ..translations.blender import said

NAMES_SHARE = 0.45
"""Share of a row's width that its name takes."""
_EDGES = 60.0
"""Tabs, margins and indents take so much of the sidebar's width, pixels at a resolution scale of 1."""
_PADDING = 22.0
"""Margins of a label or a button, and the gap to what stands beside it."""
_ICON = 20.0
_SHORTEST = 3
"""Letters that stay together however narrow it is."""
_USUAL = 300.0
"""Width where nothing is drawn into a region."""
_NARROW = 260.0
"""Width of the sidebar below which values stand below their names."""


_WORDS = re.compile(r"\S*\d (?:km|m|mm|cm|s|%|°)(?!\w)\S*|\S+")
"""Text that stays in one line: a word, or a number with its unit."""


def sidebar_width() -> float:
    """Return the width of the region being drawn, in pixels at a resolution scale of 1; 300 if there is none."""
    region, scale = bpy.context.region, bpy.context.preferences.system.ui_scale or 1.0  # 0 without a window
    return region.width / scale if region and region.width > 1 else _USUAL


def row_width() -> float:
    """Return the usable width of a row in a sidebar panel, in pixels at a resolution scale of 1."""
    return max(sidebar_width() - _EDGES, 60.0)


def is_narrow() -> bool:
    """Return whether the sidebar is too narrow for labels beside values."""
    return sidebar_width() < _NARROW


def text_width(text: str) -> float:
    """Return the width of a text in Blender's panel font, in pixels at a resolution scale of 1."""
    blf.size(0, 11.0)
    return float(blf.dimensions(0, text)[0])


def fits(text: str, share: float = 1.0, icons: int = 0) -> bool:
    """Return whether a text and a number of icons fit into a share of a row's width."""
    return text_width(text) + _PADDING + icons * _ICON <= share * row_width()


def text_lines(text: str, share: float = 1.0, icons: int = 0) -> list[str]:
    """Wrap a text into lines that fit into a share of a row beside icons; only words that are too long are broken."""
    lines: list[str] = []
    for word in _WORDS.findall(text):
        if lines and fits(f"{lines[-1]} {word}", share, icons):
            lines[-1] += f" {word}"
        else:
            lines += _pieces(word, share, icons)
    return lines or [""]


def _pieces(word: str, share: float, icons: int) -> list[str]:
    """Return a word broken into pieces that fit into a share of a row beside icons."""
    pieces = []
    while not fits(word, share, icons) and len(word) > _SHORTEST:
        count = next(n for n in range(len(word) - 1, 0, -1) if n <= _SHORTEST or fits(word[:n], share, icons))
        pieces.append(word[:count])
        word = word[count:]
    return [*pieces, word]


def draw_text(layout: bpy.types.UILayout, text: str, icon: str = "NONE", share: float = 1.0, beside: int = 0) -> None:
    """Draw a text as labels, wrapped to the available width, with an icon before the first line.

    Args:
        layout: a column.
        text: what is said.
        icon: before the text.
        share: of a row's width that the layout has.
        beside: icons and icon buttons in the same row.
    """
    has_icon = icon != "NONE"
    lines = text_lines(said(text), share, has_icon + beside)
    column = layout if len(lines) == 1 else layout.column(align=True)
    for number, line in enumerate(lines):
        column.label(text=line, icon="BLANK1" if has_icon and number else icon)


def buttons_row(layout: bpy.types.UILayout, texts: Sequence[str], align: bool = False) -> bpy.types.UILayout:
    """Return a row layout for buttons, or a column if their texts don't fit side by side."""
    side_by_side = all(fits(said(text), 1.0 / len(texts), 1) for text in texts)
    return layout.row(align=align) if side_by_side else layout.column(align=align)


def draw_menu(layout: bpy.types.UILayout, menu: str, title: str, label: str) -> None:
    """Draw a menu's button with the title of what is chosen; where that has no room it stands above, and `label` on it.

    Args:
        layout: a column.
        menu: the menu's name in Blender.
        title: of what is chosen.
        label: what the menu offers.
    """
    if not fits(said(title), icons=2):
        draw_text(layout, title)
        title = label
    title = said(title)
    layout.menu(menu, text=title, icon="PRESET")


def has_room_beside(label: str, values: Sequence[str] = (), icons: int = 0) -> bool:
    """Return whether a label, and beside it values with some icons, fit into one row."""
    if is_narrow() or not fits(said(label), NAMES_SHARE):
        return False
    return all(fits(said(value), (1.0 - NAMES_SHARE) / len(values), icons) for value in values)


def value_row(layout: bpy.types.UILayout, label: str, values: Sequence[str] = (), icons: int = 0) -> bpy.types.UILayout:
    """Draw a label and return the layout for its values: beside it if all fit, else below."""
    is_beside, label = has_room_beside(label, values, icons), said(label)
    if is_beside:
        split = layout.split(factor=NAMES_SHARE)
        name = split.row()
        name.alignment = "RIGHT"
        name.label(text=label)
        row = split.row(align=True)
    else:
        column = layout.column(align=True)
        if label:
            draw_text(column, label)
        row = column.row(align=True)
    row.use_property_split = False
    return row


def value_share(label: str, values: Sequence[str] = (), icons: int = 0) -> float:
    """Return the share of a row's width that `value_row` leaves for the values of a label."""
    return 1.0 - NAMES_SHARE if has_room_beside(label, values, icons) else 1.0


def draw_flag(layout: bpy.types.UILayout, owner: object, name: str, label: str) -> None:
    """Draw a checkbox with its label, in the column of values if it fits there, else over the whole row.

    Args:
        layout: a column.
        owner, name: the property.
        label: the text.
    """
    label = said(label)
    if not is_narrow() and fits(label, 1.0 - NAMES_SHARE, 1):
        value_row(layout, "").prop(owner, name, text=label)
        return
    row = layout.row()
    row.use_property_split = False
    if fits(label, icons=1):
        row.prop(owner, name, text=label)
        return
    row.prop(owner, name, text="")
    draw_text(row.column(align=True), label, beside=1)
