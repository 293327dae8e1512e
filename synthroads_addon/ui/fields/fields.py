"""Fields of the schema as Blender properties: limits, units, defaults, tooltips, the way to JSON and back, their rows.

Each `Field` keeps one field of a pydantic model in one or several properties of a property group. `ui.fields.groups`
chooses the kind by the field's type, so that a new field of the schema has its properties without more being written.
Blender's numbers have 32 bits. What was loaded is kept beside (`base`), and given back where a property still shows it;
a number typed in is the shortest decimal that stands for its 32 bits (0.1, not 0.10000000149).

A field is drawn in a row, its name to the left; one that isn't given shows greyed what it follows meanwhile.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from operator import attrgetter
from typing import Any, cast, get_args

import bpy
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ...base.errors import InputError
from ...base.schema import note_of, unit_of
from ...road.things.limits import Interval
from ...scenario.scenario import Scenario
from .choices import ITEMS
from .inherited import SOURCES, Value
from .numbers import exact, fitting, is_share, list_as_text, number_property, numbers_in, push_along
from .room import draw_flag, draw_text, fits, value_row, value_share
from .wording import label, value_name, written_unit

AUTOMATIC = "AUTOMATIC"
"""Item of a choice that stands for "not given"."""
Hooks = Mapping[str, Callable[[Any, Any], None]]
"""Path -> what Blender calls when that property has changed."""
ADD_FILE, REMOVE_FILE = "synthroads.add_file", "synthroads.remove_file"
"""Operators that lengthen and shorten a list of files."""


class Field:
    """One field of the schema. Values are JSON data, as in a scenario's file; None is a field that isn't given.

    Attributes:
        path: where it stands in the scenario, e.g. ``road.turnouts.exits``; its last part is the property's name.
        info: the schema's declaration.
        kind: its type, without None.
        optional: whether None is allowed.
        default: value at first.
        choice: whether others can depend on it: written before them.
        part: the part of the scenario that it stands in, see `ui.fields.groups.GroupField`; None for the whole.
    """

    choice = False
    part: Any = None

    def __init__(self, path: str, info: FieldInfo, kind: Any, optional: bool, default: Any) -> None:
        self.path, self.info, self.kind, self.optional, self.default = path, info, kind, optional, default
        self.name = path.rpartition(".")[2]
        self.unit = unit_of(info)
        self.label = label(path, info)

    @property
    def tooltip(self) -> str:
        """Return the description without its final stop: Blender adds one."""
        return (self.info.description or "").removesuffix(".")

    @property
    def checkbox_name(self) -> str:
        """Return the name of the checkbox of a field that may be left out, where its kind has one."""
        return f"own_{self.name}"

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of its properties."""
        return (self.name,)

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return its properties by name, for the annotations of a property group."""
        raise NotImplementedError

    def read(self, owner: Any, base: Any) -> Any:
        """Return the value that a property group shows; `base` is what was loaded last. `InputError` if it is none."""
        raise NotImplementedError

    def write(self, owner: Any, value: Any) -> None:
        """Have a property group show a value."""
        setattr(owner, self.name, value)

    def classes(self) -> Iterator[type]:
        """Yield the property groups that must be registered before the one that it stands in."""
        return iter(())

    def owner(self, settings: Any) -> Any:
        """Return the property group that has its property."""
        head, _, _ = self.path.rpartition(".")
        return attrgetter(head)(settings) if head else settings

    def declared(self, settings: Any) -> tuple[FieldInfo | None, type[BaseModel]]:
        """Return its declaration as the panel is set, and the model; None if the chosen kind of its part lacks it."""
        model = self.part.model_of(settings) if self.part else Scenario
        return model.model_fields.get(self.name), model

    def has_effect(self, settings: Any) -> bool:
        """Return whether it means something as the panel is set; the schema says it with ``only_with``."""
        info, _ = self.declared(settings)
        if info is None:
            return False
        owner, needed = self.owner(settings), (note_of(info, "only_with") or {}).items()
        return all(getattr(owner, name) in values for name, values in needed)

    def inherited(self, settings: Any) -> Value:
        """Return the number, the numbers or the interval that it has while it isn't given; None if there is none.

        The schema says where it comes from: the chosen kind of its part has ``usual`` values, others are named in the
        note ``inherits``, a source out of `SOURCES` and what is taken of it.
        """
        info, model = self.declared(settings)
        usual = getattr(model, "usual", {})
        if info is None or self.name in usual:
            return cast(Value, None if info is None else usual[self.name])
        source, _, taken = (note_of(info, "inherits") or "").partition(".")
        return SOURCES[source](settings, taken) if source else None

    def inherited_text(self, settings: Any) -> str:
        """Return in words what it has while it isn't given."""
        info, value = self.declared(settings)[0], self.inherited(settings)
        if info is None or value is None:
            return str((info and note_of(info, "unset")) or "Automatic")
        return f"{self._written(value)} {written_unit(self.unit)}".removesuffix(" 1").rstrip()

    def _written(self, value: float | tuple[float, ...]) -> str:
        return list_as_text(value) if isinstance(value, tuple) else f"{value:.4g}"

    def draw(self, layout: bpy.types.UILayout, settings: Any) -> None:
        """Draw it, unless the other settings leave it without meaning."""
        if self.has_effect(settings):
            self.draw_row(layout, settings, self.owner(settings))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw its name and its value, a property of the owner."""
        value_row(layout, self.label).prop(owner, self.name, text="")

    def _draw_inherited(self, row: bpy.types.UILayout, settings: Any, share: float = 1.0, beside: int = 0) -> None:
        greyed = row.row(align=True)
        greyed.active = False
        draw_text(greyed, self.inherited_text(settings), share=share * value_share(self.label), beside=beside)

    def _common(self, hooks: Hooks, name: str | None = None) -> dict[str, Any]:
        hook = {"update": hooks[self.path]} if self.path in hooks else {}
        return {"name": name or self.label, "description": self.tooltip, **hook}


class OptionalField(Field):
    """A field of which a checkbox, `checkbox_name`, says whether it is given, where it may be left out."""

    @property
    def values(self) -> tuple[str, ...]:
        """Return the names of the properties beside the checkbox."""
        return (self.name,)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of its properties."""
        return (self.checkbox_name, *self.values) if self.optional else self.values

    def read(self, owner: Any, base: Any) -> Any:
        """Return the value, or None where the checkbox isn't ticked."""
        return None if self.optional and not getattr(owner, self.checkbox_name) else self.read_given(owner, base)

    def read_given(self, owner: Any, base: Any) -> Any:
        """Return the value that is given; see `read`."""
        raise NotImplementedError

    def write(self, owner: Any, value: Any) -> None:
        """Have a property group show a value, or that none is given."""
        if self.optional:
            setattr(owner, self.checkbox_name, value is not None)
        if value is not None:
            self.write_given(owner, value)

    def write_given(self, owner: Any, value: Any) -> None:
        """Show a value that is given."""
        raise NotImplementedError

    def checkbox(self, hooks: Hooks) -> dict[str, Any]:
        """Return the checkbox of a field that may be left out; none for others."""
        if not self.optional:
            return {}
        hook = hooks.get(checkbox_path(self.path))

        def begin(group: Any, context: Any) -> None:
            self.begin_with_inherited(group)
            if hook:
                hook(group, context)

        text = f"{self.tooltip}. Tick to give a value of your own"
        about = {"name": f"Own {self.label}", "description": text, "default": self.default is not None}
        return {self.checkbox_name: bpy.props.BoolProperty(**about, update=begin)}

    def begin_with_inherited(self, owner: Any) -> None:
        """Have a field that was just ticked begin with what it had before."""
        value = self.inherited(owner.id_data.synthroads)
        if value is not None and getattr(owner, self.checkbox_name):
            for name, number in zip(self.values, value if isinstance(value, tuple) else (value,), strict=True):
                setattr(owner, name, type(getattr(owner, name))(number))

    def draw_checkbox(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> bpy.types.UILayout | None:
        """Draw the checkbox, if there is one; return the place for the value if that is given."""
        row = value_row(layout, self.label)
        if not self.optional:
            return row
        row.prop(owner, self.checkbox_name, text="")
        if getattr(owner, self.checkbox_name):
            return row
        self._draw_inherited(row, settings, beside=1)
        return None

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw its name and its values, or what it has while none is given."""
        row = self.draw_checkbox(layout, settings, owner)
        if row:
            for name in self.values:
                row.prop(owner, name, text="")


class FlagField(Field):
    """Yes or no."""

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return a checkbox."""
        return {self.name: bpy.props.BoolProperty(**self._common(hooks), default=bool(self.default))}

    def read(self, owner: Any, base: Any) -> bool:
        """Return whether it is ticked."""
        return bool(getattr(owner, self.name))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the checkbox with its name."""
        draw_flag(layout, owner, self.name, self.label)


class NumberField(OptionalField):
    """A number with its limits."""

    @property
    def is_share(self) -> bool:
        """Return whether it is a share or a probability, which a slider shows."""
        return is_share(self.info)

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the number, and its checkbox."""
        number = number_property(self.info, self.kind is int, self.default, **self._common(hooks))
        return self.checkbox(hooks) | {self.name: number}

    def read_given(self, owner: Any, base: Any) -> float:
        """Return the number."""
        value = exact(getattr(owner, self.name), base)
        return round(value) if self.kind is int else value

    def write_given(self, owner: Any, value: Any) -> None:
        """Show a number, as far as Blender's numbers reach."""
        setattr(owner, self.name, fitting(value) if isinstance(getattr(owner, self.name), int) else value)

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the number; a slider has its name inside."""
        if not self.is_share or self.optional or not fits(f"{self.label} 0.000"):
            super().draw_row(layout, settings, owner)
            return
        row = layout.row()
        row.use_property_split = False
        row.prop(owner, self.name, text=self.label)


class IntervalField(OptionalField):
    """Two numbers, smallest and largest."""

    @property
    def ends(self) -> tuple[str, str]:
        """Return the names of the two numbers."""
        return f"{self.name}_minimum", f"{self.name}_maximum"

    values = ends

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the two numbers, of which the one pushes the other along."""
        low, high = self.ends
        default = self.default or {"minimum": 0.0, "maximum": 0.0}
        result = self.checkbox(hooks)
        pushes = (push_along(low, high, max), push_along(high, low, min))
        for name, end, push in zip(self.ends, ("minimum", "maximum"), pushes, strict=True):
            info = Interval.model_fields[end]
            text = f"{self.tooltip}: {end}" if self.tooltip else end
            arguments = {"name": f"{self.label} {end.title()}", "description": text, "update": push}
            beside = max(map(abs, default.values()))
            result[name] = number_property(info, False, default[end], self.unit, beside, **arguments)
        return result

    def read_given(self, owner: Any, base: Any) -> dict[str, float]:
        """Return the interval."""
        loaded = base if isinstance(base, dict) else {}
        ends = zip(("minimum", "maximum"), self.ends, strict=True)
        return {end: exact(getattr(owner, name), loaded.get(end)) for end, name in ends}

    def write_given(self, owner: Any, value: Any) -> None:
        """Show an interval: its minimum first, which may push the maximum that is written next."""
        for name, end in zip(self.ends, ("minimum", "maximum"), strict=True):
            setattr(owner, name, value[end])

    def _written(self, value: float | tuple[float, ...]) -> str:
        return f"{value[0]:g} – {value[1]:g}" if isinstance(value, tuple) else super()._written(value)


class ChoiceField(Field):
    """One of several values; one more item stands for "not given"."""

    choice = True

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.values = {str(value): value for value in get_args(self.kind)}

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return a menu."""
        tips = note_of(self.info, "tooltips") or {}
        plain = [(name, value_name(name, self.info), tips.get(name, "")) for name in self.values]
        items = list(ITEMS.get(self.path, plain))
        if self.optional:
            items.insert(0, (AUTOMATIC, "Automatic", self.tooltip))
        default = AUTOMATIC if self.default is None else str(self.default)
        return {self.name: bpy.props.EnumProperty(**self._common(hooks), items=items, default=default)}

    def read(self, owner: Any, base: Any) -> Any:
        """Return the chosen value."""
        return self.values.get(getattr(owner, self.name))

    def write(self, owner: Any, value: Any) -> None:
        """Choose a value."""
        setattr(owner, self.name, AUTOMATIC if value is None else str(value))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the menu, and beside "Automatic" what that is."""
        row = value_row(layout, self.label)
        row.prop(owner, self.name, text="")
        if self.optional and getattr(owner, self.name) == AUTOMATIC:
            self._draw_inherited(row, settings, share=0.5)


class ChoicesField(Field):
    """Any of several values; their order is the schema's, unless they were loaded in another."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.values = tuple(str(value) for value in get_args(get_args(self.kind)[0]))

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return buttons of which several can be pressed."""
        items = [(name, value_name(name, self.info), "") for name in self.values]
        flags = {"items": items, "default": set(self.default or ()), "options": {"ENUM_FLAG", "ANIMATABLE"}}
        return {self.name: bpy.props.EnumProperty(**self._common(hooks), **flags)}

    def read(self, owner: Any, base: Any) -> list[str]:
        """Return the chosen values."""
        chosen = getattr(owner, self.name)
        if isinstance(base, list) and set(base) == chosen:
            return base
        return [name for name in self.values if name in chosen]

    def write(self, owner: Any, value: Any) -> None:
        """Choose values."""
        setattr(owner, self.name, set(value or ()))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the buttons, one below the other."""
        column = value_row(layout, self.label).column(align=True)
        for name in self.values:
            column.prop_enum(owner, self.name, name)


class TextField(Field):
    """A text; nothing at all is "not given" where that is allowed."""

    choice = True

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return a line of text, with a button to choose a file where it names one."""
        file = {"subtype": "FILE_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}} if self.names_file else {}
        return {self.name: bpy.props.StringProperty(**self._common(hooks), **file, default=self.text(self.default))}

    def text(self, value: Any) -> str:
        """Return a value as text; nothing at all for None."""
        return value or ""

    @property
    def names_file(self) -> bool:
        """Return whether it can be nothing but a file."""
        return self.optional and "file" in f"{self.name} {self.tooltip}".lower()

    def read(self, owner: Any, base: Any) -> Any:
        """Return the text; a file beside the .blend file by its whole name."""
        text = str(getattr(owner, self.name))
        if self.optional and not text:
            return None
        return bpy.path.abspath(text) if text.startswith("//") and self.names_file else text

    def write(self, owner: Any, value: Any) -> None:
        """Show a value as text."""
        setattr(owner, self.name, self.text(value))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the text; greyed in it what it has while nothing is given."""
        greyed = self.inherited_text(settings) if self.optional else ""
        value_row(layout, self.label).prop(owner, self.name, text="", placeholder=greyed)


class NumbersField(TextField):
    """Several numbers as text, separated by commas: exact, and as many as are wanted."""

    choice = False
    names_file = False

    def text(self, value: Any) -> str:
        """Return numbers as text."""
        return list_as_text(value or ())

    def read(self, owner: Any, base: Any) -> list[float] | None:
        """Return the numbers; raise `InputError` if there is something else among them."""
        text = getattr(owner, self.name)
        if self.optional and not text.strip():
            return None
        try:
            return numbers_in(text)
        except ValueError:
            raise InputError(self.path, text, "must be numbers, separated by commas") from None


class JsonField(TextField):
    """Whatever else the schema may hold: its JSON text."""

    choice = False
    names_file = False

    def text(self, value: Any) -> str:
        """Return data as JSON."""
        return "" if value is None else json.dumps(value)

    def read(self, owner: Any, base: Any) -> Any:
        """Return the data; raise `InputError` if it isn't JSON."""
        text = getattr(owner, self.name).strip()
        try:
            return json.loads(text) if text else None
        except ValueError:
            raise InputError(self.path, text, "must be JSON") from None


class SYNTHROADS_PG_file(bpy.types.PropertyGroup):
    """One file of a list."""

    __annotations__ = {
        "file": bpy.props.StringProperty(
            name="File", subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}, description="A JSON file"
        )
    }


class FilesField(Field):
    """Files, one below the other."""

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return a list; it is empty at first."""
        return {self.name: bpy.props.CollectionProperty(type=SYNTHROADS_PG_file, **self._common({}))}

    def read(self, owner: Any, base: Any) -> list[str]:
        """Return the files that are named, those beside the .blend file by their whole names."""
        texts = [item.file for item in getattr(owner, self.name) if item.file]
        return [bpy.path.abspath(text) if text.startswith("//") else text for text in texts]

    def write(self, owner: Any, value: Any) -> None:
        """Show files."""
        items = getattr(owner, self.name)
        items.clear()
        for text in value or ():
            items.add().file = text

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw a row for each file, with buttons that add one and take it off."""
        for number, item in enumerate(getattr(owner, self.name)):
            row = layout.row(align=True)
            row.use_property_split = False
            row.prop(item, "file", text="")
            remove = row.operator(REMOVE_FILE, text="", icon="X")
            remove.path, remove.number = self.path, number
        layout.operator(ADD_FILE, icon="ADD").path = self.path


def checkbox_path(path: str) -> str:
    """Return the path of a field's checkbox."""
    head, dot, name = path.rpartition(".")
    return f"{head}{dot}own_{name}"
