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
from ..translations.blender import said
from .choices import ITEMS, is_offered
from .inherited import SOURCES, Value
from .numbers import clamp_32_bit, exact, is_share, list_as_text, number_property, numbers_in, push_along
from .room import draw_flag, draw_text, fits, value_row, value_share
from .wording import label, tooltip, value_name, written_unit

AUTOMATIC = "AUTOMATIC"
"""Item of a choice that stands for "not given"."""
Hooks = Mapping[str, Callable[[Any, Any], None]]
"""Path -> what Blender calls when that property has changed."""
ADD_FILE, REMOVE_FILE = "synthroads.add_file", "synthroads.remove_file"
"""Operators that lengthen and shorten a list of files."""


class Field:
    """One field of the scenario's schema as Blender properties, converted from and to JSON data (None: not given).

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
        """Return the schema's description with unit, limits and example, without a final full stop."""
        return tooltip(self.info)

    @property
    def checkbox_name(self) -> str:
        """Return the name of the checkbox property that says whether an optional field is given."""
        return f"own_{self.name}"

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the field's Blender properties by name, for a property group's annotations."""
        raise NotImplementedError

    def read(self, owner: Any, base: Any) -> Any:
        """Return the value in a property group as JSON data; `base` gives digits that Blender lost; or InputError."""
        raise NotImplementedError

    def write(self, owner: Any, value: Any) -> None:
        """Set the properties of a property group to a value given as JSON data."""
        setattr(owner, self.name, value)

    def state(self, owner: Any) -> Any:
        """Return what a property group's properties show for this field as JSON data, valid or not."""
        return getattr(owner, self.name)

    def classes(self) -> Iterator[type]:
        """Yield the property group classes to register before the group that holds this field."""
        return iter(())

    def owner(self, settings: Any) -> Any:
        """Return the property group in the panel's settings that holds this field."""
        head, _, _ = self.path.rpartition(".")
        return attrgetter(head)(settings) if head else settings

    def declared(self, settings: Any) -> tuple[FieldInfo | None, type[BaseModel]]:
        """Return the field's declaration in its part's chosen model (None if that lacks it), and the model."""
        model = self.part.model_of(settings) if self.part else Scenario
        return model.model_fields.get(self.name), model

    def has_effect(self, settings: Any) -> bool:
        """Return whether the field matters with the panel's settings, by the schema's note ``only_with``."""
        info, _ = self.declared(settings)
        if info is None:
            return False
        owner, needed = self.owner(settings), (note_of(info, "only_with") or {}).items()
        return all(getattr(owner, name) in values for name, values in needed)

    def inherited(self, settings: Any) -> Value:
        """Return the number, numbers or interval used while the field isn't given; None if there is none.

        The schema says where it comes from: the chosen kind of its part has ``usual`` values, others are named in the
        note ``inherits``, a source out of `SOURCES` and what is taken of it.
        """
        info, model = self.declared(settings)
        usual = getattr(model, "usual", {})
        if info is None or self.name in usual:
            return cast(Value, None if info is None else usual[self.name])
        source, _, name = (note_of(info, "inherits") or "").partition(".")
        return SOURCES[source](settings, name) if source else None

    def inherited_text(self, settings: Any) -> str:
        """Return the text for the value used while the field isn't given, with its unit, or Automatic."""
        info, value = self.declared(settings)[0], self.inherited(settings)
        if info is None or value is None:
            return str((info and note_of(info, "unset")) or "Automatic")
        return f"{self._written(value)} {written_unit(self.unit)}".removesuffix(" 1").rstrip()

    def _written(self, value: float | tuple[float, ...]) -> str:
        return list_as_text(value) if isinstance(value, tuple) else f"{value:.4g}"

    def draw(self, layout: bpy.types.UILayout, settings: Any) -> None:
        """Draw the field in a row, unless other settings make it meaningless."""
        if self.has_effect(settings):
            self.draw_row(layout, settings, self.owner(settings))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the row of the field: its label and its property of `owner`."""
        value_row(layout, self.label).prop(owner, self.name, text="")

    def _draw_inherited(self, row: bpy.types.UILayout, settings: Any, share: float = 1.0, beside: int = 0) -> None:
        greyed = row.row(align=True)
        greyed.active = False
        draw_text(greyed, self.inherited_text(settings), share=share * value_share(self.label), beside=beside)

    def _common(self, hooks: Hooks, name: str | None = None) -> dict[str, Any]:
        hook = {"update": hooks[self.path]} if self.path in hooks else {}
        return {"name": name or self.label, "description": self.tooltip, **hook}


class OptionalField(Field):
    """A field whose checkbox, `checkbox_name`, says whether its value is given, if it may be left out."""

    @property
    def values(self) -> tuple[str, ...]:
        """Return the names of the value's properties, without the checkbox."""
        return (self.name,)

    def read(self, owner: Any, base: Any) -> Any:
        """Return the value as JSON data, or None if the checkbox isn't ticked."""
        return None if self.optional and not getattr(owner, self.checkbox_name) else self.read_given(owner, base)

    def read_given(self, owner: Any, base: Any) -> Any:
        """Return the value as JSON data without regard to the checkbox; see `Field.read`."""
        raise NotImplementedError

    def state(self, owner: Any) -> Any:
        """Return what the value's properties show, or False if the checkbox isn't ticked; see `Field.state`."""
        return False if self.optional and not getattr(owner, self.checkbox_name) else self.given_state(owner)

    def given_state(self, owner: Any) -> Any:
        """Return what the value's properties show, without regard to the checkbox."""
        return [getattr(owner, name) for name in self.values]

    def write(self, owner: Any, value: Any) -> None:
        """Set the properties of a property group to a value; None unticks the checkbox."""
        if self.optional:
            setattr(owner, self.checkbox_name, value is not None)
        if value is not None:
            self.write_given(owner, value)

    def write_given(self, owner: Any, value: Any) -> None:
        """Set the value's properties to a value that isn't None."""
        raise NotImplementedError

    def checkbox(self, hooks: Hooks) -> dict[str, Any]:
        """Return the checkbox property by name; empty for a field that can't be left out."""
        if not self.optional:
            return {}
        hook = hooks.get(checkbox_path(self.path))

        def begin(group: Any, context: Any) -> None:
            self.begin_with_inherited(group)
            if hook:
                hook(group, context)

        text = f"{self.tooltip}. Tick to set your own value"
        about = {"name": f"Own {self.label}", "description": text, "default": self.default is not None}
        return {self.checkbox_name: bpy.props.BoolProperty(**about, update=begin)}

    def begin_with_inherited(self, owner: Any) -> None:
        """Set a field that was just ticked to its inherited value, in place."""
        value = self.inherited(owner.id_data.synthroads)
        if value is not None and getattr(owner, self.checkbox_name):
            for name, number in zip(self.values, value if isinstance(value, tuple) else (value,), strict=True):
                setattr(owner, name, type(getattr(owner, name))(number))

    def value_texts(self, owner: Any) -> tuple[str, ...]:
        """Return the values as they are shown, where they need more room than a row surely has."""
        return ()

    def draw_checkbox(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> bpy.types.UILayout | None:
        """Draw label and checkbox; return the layout for the value, or None if the value isn't given."""
        is_given = not self.optional or getattr(owner, self.checkbox_name)
        row = value_row(layout, self.label, self.value_texts(owner) if is_given else (), int(self.optional))
        if not self.optional:
            return row
        row.prop(owner, self.checkbox_name, text="")
        if getattr(owner, self.checkbox_name):
            return row
        self._draw_inherited(row, settings, beside=1)
        return None

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw label, checkbox and values, or the greyed inherited value if none is given."""
        row = self.draw_checkbox(layout, settings, owner)
        if row:
            for name in self.values:
                row.prop(owner, name, text="")


class FlagField(Field):
    """A boolean field, shown as a checkbox."""

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the boolean property by name."""
        return {self.name: bpy.props.BoolProperty(**self._common(hooks), default=bool(self.default))}

    def read(self, owner: Any, base: Any) -> bool:
        """Return whether the flag is set."""
        return bool(getattr(owner, self.name))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the checkbox with its label."""
        draw_flag(layout, owner, self.name, self.label)


class NumberField(OptionalField):
    """A number field within the limits of the schema."""

    @property
    def is_share(self) -> bool:
        """Return whether the number is a share or probability from 0 to 1, shown as a slider."""
        return is_share(self.info)

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the number property and, if it is optional, its checkbox, by name."""
        number = number_property(self.info, self.kind is int, self.default, **self._common(hooks))
        return self.checkbox(hooks) | {self.name: number}

    def read_given(self, owner: Any, base: Any) -> float:
        """Return the number, with the digits of the loaded value if it is still that one."""
        value = exact(getattr(owner, self.name), base)
        return round(value) if self.kind is int else value

    def write_given(self, owner: Any, value: Any) -> None:
        """Set the number, clamped to Blender's 32-bit range if it is an integer."""
        setattr(owner, self.name, clamp_32_bit(value) if isinstance(getattr(owner, self.name), int) else value)

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the number in a row, or a share as a slider with the label inside if that fits."""
        if not self.is_share or self.optional or not fits(f"{said(self.label)} 0.000"):
            super().draw_row(layout, settings, owner)
            return
        row = layout.row()
        row.use_property_split = False
        row.prop(owner, self.name, text=self.label)


class IntervalField(OptionalField):
    """An interval as two number properties, minimum and maximum."""

    @property
    def ends(self) -> tuple[str, str]:
        """Return the names of the properties for minimum and maximum."""
        return f"{self.name}_minimum", f"{self.name}_maximum"

    values = ends

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return both number properties and the checkbox; changing one end pushes the other along."""
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
        """Return the interval as ``minimum`` and ``maximum``."""
        loaded = base if isinstance(base, dict) else {}
        ends = zip(("minimum", "maximum"), self.ends, strict=True)
        return {end: exact(getattr(owner, name), loaded.get(end)) for end, name in ends}

    def write_given(self, owner: Any, value: Any) -> None:
        """Set the interval: the minimum first, which may push the maximum that is set next."""
        for name, end in zip(self.ends, ("minimum", "maximum"), strict=True):
            setattr(owner, name, value[end])

    def value_texts(self, owner: Any) -> tuple[str, ...]:
        """Return both ends with their unit."""
        unit = f" {self.unit}" if self.unit == "m" else ""
        return tuple(f"{getattr(owner, name):g}{unit}" for name in self.ends)

    def _written(self, value: float | tuple[float, ...]) -> str:
        return f"{value[0]:g} – {value[1]:g}" if isinstance(value, tuple) else super()._written(value)


class ChoiceField(Field):
    """One of several values, as a menu; an optional field has one more item, Automatic."""

    choice = True

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.values = {str(value): value for value in get_args(self.kind)}

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the enum property by name."""
        tips = note_of(self.info, "tooltips") or {}
        plain = [(name, value_name(name, self.info), tips.get(name, "")) for name in self.values]
        items = list(ITEMS.get(self.path, plain))
        if self.optional:
            items.insert(0, (AUTOMATIC, "Automatic", self.tooltip))
        default = AUTOMATIC if self.default is None else str(self.default)
        return {self.name: bpy.props.EnumProperty(**self._common(hooks), items=items, default=default)}

    def read(self, owner: Any, base: Any) -> Any:
        """Return the chosen value; None for Automatic."""
        return self.values.get(getattr(owner, self.name))

    def write(self, owner: Any, value: Any) -> None:
        """Select the menu item of a value; None selects Automatic."""
        setattr(owner, self.name, AUTOMATIC if value is None else str(value))

    def _written(self, value: float | str | tuple[float, ...]) -> str:
        return value_name(str(value), self.info)

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the menu, and beside Automatic, or below where it has no room, the greyed value that it stands for."""
        item = owner.bl_rna.properties[self.name].enum_items.get(getattr(owner, self.name))
        value: tuple[str, ...] = (item.name,) if item else ()
        icons = 2  # the menu's arrow takes as much room
        row, share = value_row(layout, self.label, value, icons), value_share(self.label, value, icons)
        row.prop(owner, self.name, text="")
        if not self.optional or getattr(owner, self.name) != AUTOMATIC:
            return
        if fits(said(self.inherited_text(settings)), 0.5 * share) and fits(said(value[0]), 0.5 * share, icons):
            self._draw_inherited(row, settings, share=0.5)
        else:
            self._draw_inherited(layout if share == 1.0 else value_row(layout, ""), settings)


class ChoicesField(Field):
    """Any number of several values, in the schema's order, unless they were loaded in another."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.values = tuple(str(value) for value in get_args(get_args(self.kind)[0]))

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the enum property with flags, of which several can be set, by name."""
        items = [(name, value_name(name, self.info), "") for name in self.values]
        flags = {"items": items, "default": set(self.default or ()), "options": {"ENUM_FLAG", "ANIMATABLE"}}
        return {self.name: bpy.props.EnumProperty(**self._common(hooks), **flags)}

    def read(self, owner: Any, base: Any) -> list[str]:
        """Return the names of the chosen values, in the loaded order if they are the same set."""
        chosen = getattr(owner, self.name)
        if isinstance(base, list) and set(base) == chosen:
            return base
        return [name for name in self.values if name in chosen]

    def state(self, owner: Any) -> list[str]:
        """Return the chosen values in order; see `Field.state`."""
        return sorted(getattr(owner, self.name))

    def write(self, owner: Any, value: Any) -> None:
        """Select exactly the given values."""
        setattr(owner, self.name, set(value or ()))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw a button for each value that is offered or chosen already, below each other."""
        chosen, items = getattr(owner, self.name), owner.bl_rna.properties[self.name].enum_items
        offered = [name for name in self.values if name in chosen or is_offered(self.path, name)]
        widest = max((said(items[name].name) for name in offered), key=len, default="")
        column = value_row(layout, self.label, (widest,)).column(align=True)
        for name in offered:
            column.prop_enum(owner, self.name, name)


class TextField(Field):
    """A text; an empty one means that an optional field isn't given."""

    choice = True

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the string property by name; as a path if the field names a file or a folder."""
        kind = "DIR_PATH" if self._mentions("folder") else "FILE_PATH"
        file = {"subtype": kind, "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}} if self.names_file else {}
        return {self.name: bpy.props.StringProperty(**self._common(hooks), **file, default=self.text(self.default))}

    def text(self, value: Any) -> str:
        """Return a value as the property's text; empty for None."""
        return value or ""

    @property
    def names_file(self) -> bool:
        """Return whether the field is optional and its name or tooltip mentions a file or a folder."""
        return self.optional and (self._mentions("file") or self._mentions("folder"))

    def _mentions(self, word: str) -> bool:
        return word in f"{self.name} {self.tooltip}".lower()

    def read(self, owner: Any, base: Any) -> Any:
        """Return the text, None if it is empty and optional; Blender's ``//`` in file paths is resolved."""
        text = str(getattr(owner, self.name))
        if self.optional and not text:
            return None
        return bpy.path.abspath(text) if text.startswith("//") and self.names_file else text

    def write(self, owner: Any, value: Any) -> None:
        """Set the property to a value's text."""
        setattr(owner, self.name, self.text(value))

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the text field, with the inherited value as placeholder if it is optional."""
        greyed = said(self.inherited_text(settings)) if self.optional else ""
        value_row(layout, self.label).prop(owner, self.name, text="", placeholder=greyed)


class NumbersField(TextField):
    """Several numbers as comma-separated text, without loss of digits."""

    choice = False
    names_file = False

    def text(self, value: Any) -> str:
        """Return numbers as comma-separated text; empty for None."""
        return list_as_text(value or ())

    def read(self, owner: Any, base: Any) -> list[float] | None:
        """Return the numbers in the text, None if it is empty and optional; InputError if they aren't numbers."""
        text = getattr(owner, self.name)
        if self.optional and not text.strip():
            return None
        try:
            return numbers_in(text)
        except ValueError:
            raise InputError(self.path, text, "must be numbers, separated by commas") from None


class JsonField(TextField):
    """A field of any other type, edited as JSON text."""

    choice = False
    names_file = False

    def text(self, value: Any) -> str:
        """Return data as JSON text; empty for None."""
        return "" if value is None else json.dumps(value)

    def read(self, owner: Any, base: Any) -> Any:
        """Return the data of the JSON text, None if it is empty; InputError if it isn't JSON."""
        text = getattr(owner, self.name).strip()
        try:
            return json.loads(text) if text else None
        except ValueError:
            raise InputError(self.path, text, "must be JSON") from None


class SYNTHROADS_PG_file(bpy.types.PropertyGroup):
    """One entry in a list of files."""

    __annotations__ = {
        "file": bpy.props.StringProperty(
            name="File", subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}, description="A JSON file"
        )
    }


class FilesField(Field):
    """A list of file paths, a row each."""

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the collection property by name; it starts empty."""
        return {self.name: bpy.props.CollectionProperty(type=SYNTHROADS_PG_file, **self._common({}))}

    def read(self, owner: Any, base: Any) -> list[str]:
        """Return the paths that aren't empty, with Blender's ``//`` resolved."""
        texts = [item.file for item in getattr(owner, self.name) if item.file]
        return [bpy.path.abspath(text) if text.startswith("//") else text for text in texts]

    def state(self, owner: Any) -> list[str]:
        """Return the paths as they are written; see `Field.state`."""
        return [item.file for item in getattr(owner, self.name)]

    def write(self, owner: Any, value: Any) -> None:
        """Replace the list of files with the given paths."""
        items = getattr(owner, self.name)
        items.clear()
        for text in value or ():
            items.add().file = text

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw a row with a remove button for each file, and a button to add one."""
        for number, item in enumerate(getattr(owner, self.name)):
            row = layout.row(align=True)
            row.use_property_split = False
            row.prop(item, "file", text="")
            remove = row.operator(REMOVE_FILE, text="", icon="X")
            remove.path, remove.number = self.path, number
        layout.operator(ADD_FILE, icon="ADD").path = self.path


def checkbox_path(path: str) -> str:
    """Return the path of a field's checkbox property: ``own_`` before the last part of the field's path."""
    head, dot, name = path.rpartition(".")
    return f"{head}{dot}own_{name}"
