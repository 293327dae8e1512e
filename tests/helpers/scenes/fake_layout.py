"""A layout that writes down what a panel draws, and complains of names that Blender wouldn't know."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy

from synthroads_addon.ui.fields.room import text_width


class FakeLayout:
    """Takes the place of `bpy.types.UILayout`; `lines` is what was drawn, a row in one line.

    Args:
        open_panels: whether panels within the layout are drawn as if opened.
    """

    def __init__(self, open_panels: bool = True, what: str = "", factor: float = 0.0) -> None:
        self.used: list[tuple[Any, str]] = []
        self.alert = False
        self._factor = factor
        self._shown: list[tuple[str, int]] = []
        self._items: list[str | FakeLayout] = []
        self._open = open_panels
        self._what = what

    @property
    def lines(self) -> list[str]:
        """Return what was drawn."""
        inner = [line for item in self._items for line in ([item] if isinstance(item, str) else item.lines)]
        if self._what in ("row", "split"):
            first, *more = inner or [""]
            whole = " | ".join([first, *(line for line in more if not line.startswith(" "))]).removeprefix(" | ")
            return [whole, *(line for line in more if line.startswith(" "))]
        return [f"{'  ' if self._what else ''}{line}" for line in inner]

    def parts(self) -> list[FakeLayout]:
        """Return the layouts within this one, in their order."""
        return [item for item in self._items if isinstance(item, FakeLayout)]

    def place_of(self, name: str) -> str | None:
        """Return the kind of the layout that a property was drawn in, such as row; None if it wasn't."""
        for item in self._items:
            place = item.place_of(name) if isinstance(item, FakeLayout) else None
            if place or (isinstance(item, str) and item.split()[1:2] == [name]):
                return place or self._what
        return None

    def texts(self, width: float) -> list[tuple[str, float, float]]:
        """Return the texts of labels, buttons and checkboxes in a layout of a width, pixels.

        Each comes with the width of its place and the width that it needs. Blender gives icons alone their own width,
        and shares the rest of a row evenly.
        """
        shown = iter(self._shown)
        items = [item if isinstance(item, FakeLayout) else next(shown) for item in self._items]
        found: list[tuple[str, float, float]] = []
        for item, place in zip(items, self._places(items, width), strict=True):
            if isinstance(item, FakeLayout):
                found += item.texts(place)
            elif item[0]:
                found.append((item[0], place, text_width(item[0]) + _PADDING + _ICON * item[1]))
        return found

    def _places(self, items: list[Any], width: float) -> list[float]:
        if self._what == "box":
            width *= 0.93
        if self._what == "split" and len(items) == 2:
            return [self._factor * width, (1.0 - self._factor) * width]
        if self._what not in ("row", "split"):
            return [width] * len(items)
        icons = [_is_icon(item) for item in items]
        rest = (width - _ICON * sum(icons)) / max(1, len(items) - sum(icons))
        return [_ICON if icon else rest for icon in icons]

    def _child(self, what: str, factor: float = 0.0) -> FakeLayout:
        child = FakeLayout(self._open, what, factor)
        child.used = self.used
        self._items.append(child)
        return child

    def _say(self, text: str, shown: str = "", icons: int = 0) -> None:
        self._items.append(text)
        self._shown.append((shown, icons))

    def row(self, align: bool = False, heading: str = "") -> FakeLayout:
        return self._child("row")

    def column(self, align: bool = False, heading: str = "") -> FakeLayout:
        return self._child("column")

    def split(self, factor: float = 0.0, align: bool = False) -> FakeLayout:
        return self._child("split", factor)

    def box(self) -> FakeLayout:
        return self._child("box")

    def separator(self, factor: float = 1.0) -> None:
        self._say("separator")

    def separator_spacer(self) -> None:
        self._say("spacer")

    def label(self, text: str = "", icon: str = "NONE", icon_value: int | None = None) -> None:
        self._say(f"label {text!r}{_icon(icon)}{'' if icon_value is None else ' <swatch>'}", text, _has(icon))

    def template_list(self, kind: str, idname: str, data: Any, name: str, owner: Any, index: str, rows: int) -> None:
        assert hasattr(bpy.types, kind)
        assert {index} <= set(owner.bl_rna.properties.keys())
        self._say(f"list {kind} of {len(getattr(data, name))}")

    def panel(self, idname: str, default_closed: bool = False) -> tuple[FakeLayout, FakeLayout | None]:
        self._say("panel, closed" if default_closed else "panel")
        return self._child("row"), self._child("body") if self._open else None

    def prop(
        self,
        data: Any,
        name: str,
        text: str | None = None,
        icon: str = "NONE",
        placeholder: str = "",
        emboss: bool = True,
    ) -> None:
        self.used.append((data, name))
        hint = f" [{placeholder}]" if placeholder else ""
        if name == "value" or name.startswith("["):  # a modifier's input, by Blender 5.2 or 4.5
            data.path_resolve(name)  # ValueError for one that isn't there
            self._say("input")
            return
        known = data.bl_rna.properties[name]
        shown = known.name if text is None else text
        self._say(
            f"{known.type.lower()} {name} {shown!r}{hint}{_icon(icon)} = {_value(getattr(data, name))}",
            *_beside(data, known, shown),
        )

    def prop_enum(self, data: Any, name: str, value: str) -> None:
        self.used.append((data, name))
        item = data.bl_rna.properties[name].enum_items[value]
        pressed = getattr(data, name)
        mark = "x" if value in pressed else " "
        self._say(f"[{mark}] {item.name!r}", item.name)

    def operator(
        self, idname: str, text: str | None = None, icon: str = "NONE", emboss: bool = True, depress: bool = False
    ) -> Any:
        module, name = idname.split(".")
        known = getattr(getattr(bpy.ops, module), name).get_rna_type()  # KeyError for one that Blender doesn't know
        shown = known.name if text is None else text
        self._say(
            f"button {known.name if text is None else text!r} {idname}{_icon(icon)}{' pressed' * depress}",
            shown,
            _has(icon),
        )
        return SimpleNamespace()

    def menu(self, idname: str, text: str | None = None, icon: str = "NONE") -> None:
        shown = getattr(bpy.types, idname).bl_label if text is None else text
        self._say(f"menu {shown!r} {idname}{_icon(icon)}", shown, 1 + _has(icon))

    def template_icon(self, icon_value: int, scale: float = 1.0) -> None:
        assert icon_value >= 0  # Blender gives pictures no number but 0 where it has no window
        assert scale > 0.0
        self._say("picture")

    def progress(self, factor: float = 0.0, text: str = "") -> None:
        self._say(f"progress {text!r}", text)


def drawn(panel: type, context: Any, **options: Any) -> FakeLayout:
    """Return the layout that a panel or menu has drawn on."""
    layout = FakeLayout(**options)
    stand_in = SimpleNamespace(layout=layout, **{k: v for k, v in vars(panel).items() if k == "sheet"})
    for base in reversed(panel.__mro__):
        for name, member in vars(base).items():
            if callable(member) and name.startswith("draw"):
                setattr(stand_in, name, member.__get__(stand_in))
    stand_in.draw(context)
    return layout


def _icon(icon: str) -> str:
    known = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
    assert icon in known, f"there is no icon {icon}"
    return "" if icon == "NONE" else f" <{icon}>"


_PADDING, _ICON = 12.0, 20.0
"""Margins of a text, and the width of an icon, pixels."""


def _has(icon: str) -> int:
    return int(icon != "NONE")


def _beside(data: Any, known: Any, shown: str) -> tuple[str, int]:
    """Return the text of a checkbox, and that of a menu without a label; other properties show theirs beside."""
    if known.type == "ENUM" and not known.is_enum_flag and not shown:
        item = known.enum_items.get(getattr(data, known.identifier))
        return (item.name, 1) if item else ("", 0)
    return (shown, 1) if known.type == "BOOLEAN" else ("", 0)


def _is_icon(item: Any) -> bool:
    """Return whether an item of a row is an icon, or a checkbox, without a text."""
    return not isinstance(item, FakeLayout) and item == ("", 1)


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(sorted(value)) if isinstance(value, set) else repr(value)
