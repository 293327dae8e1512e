"""A layout that writes down what a panel draws, and complains of names that Blender wouldn't know."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy


class FakeLayout:
    """Takes the place of `bpy.types.UILayout`; `lines` is what was drawn, a row in one line.

    Args:
        open_panels: whether panels within the layout are drawn as if opened.
    """

    def __init__(self, open_panels: bool = True, what: str = "") -> None:
        self.used: list[tuple[Any, str]] = []
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

    def _child(self, what: str) -> FakeLayout:
        child = FakeLayout(self._open, what)
        child.used = self.used
        self._items.append(child)
        return child

    def _say(self, text: str) -> None:
        self._items.append(text)

    def row(self, align: bool = False, heading: str = "") -> FakeLayout:
        return self._child("row")

    def column(self, align: bool = False, heading: str = "") -> FakeLayout:
        return self._child("column")

    def split(self, factor: float = 0.0, align: bool = False) -> FakeLayout:
        return self._child("split")

    def box(self) -> FakeLayout:
        return self._child("box")

    def separator(self) -> None:
        self._say("separator")

    def label(self, text: str = "", icon: str = "NONE", icon_value: int | None = None) -> None:
        self._say(f"label {text!r}{_icon(icon)}{'' if icon_value is None else ' <swatch>'}")

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
        self._say(f"{known.type.lower()} {name} {shown!r}{hint}{_icon(icon)} = {_value(getattr(data, name))}")

    def prop_enum(self, data: Any, name: str, value: str) -> None:
        self.used.append((data, name))
        item = data.bl_rna.properties[name].enum_items[value]
        pressed = getattr(data, name)
        mark = "x" if value in pressed else " "
        self._say(f"[{mark}] {item.name!r}")

    def operator(self, idname: str, text: str | None = None, icon: str = "NONE", emboss: bool = True) -> Any:
        module, name = idname.split(".")
        known = getattr(getattr(bpy.ops, module), name).get_rna_type()  # KeyError for one that Blender doesn't know
        self._say(f"button {known.name if text is None else text!r} {idname}{_icon(icon)}")
        return SimpleNamespace()

    def menu(self, idname: str, text: str | None = None, icon: str = "NONE") -> None:
        known = getattr(bpy.types, idname)
        self._say(f"menu {known.bl_label if text is None else text!r} {idname}{_icon(icon)}")

    def progress(self, factor: float = 0.0, text: str = "") -> None:
        self._say(f"progress {text!r}")


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


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(sorted(value)) if isinstance(value, set) else repr(value)
