"""Parts of the schema as property groups, and the fields that a part of the scenario has."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import bpy
from pydantic import BaseModel, create_model
from pydantic.fields import FieldInfo

from ...road.things.limits import Interval
from . import fields as kinds
from .choices import BY_HAND, BY_HAND_ENDING, STANDARD_PARTS, Items
from .fields import Field, FilesField, Hooks, OptionalField


class GroupField(OptionalField):
    """A nested model of the scenario as a property group of its own.

    Attributes:
        fields: what it holds, by name.
        group: its class.
    """

    def __init__(self, path: str, info: FieldInfo, kind: Any, optional: bool, default: Any, hooks: Hooks) -> None:
        super().__init__(path, info, kind, optional, default)
        self.fields = make_fields(kind, _defaults(kind) | (default or {}), path, hooks)
        for field in self.fields.values():
            field.part = self
        annotations = {name: p for field in self.fields.values() for name, p in field.properties(hooks).items()}
        name = f"SYNTHROADS_PG_{path.replace('.', '_')}"
        self.group = type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations})

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the pointer property to the nested group and, if it is optional, its checkbox, by name."""
        pointer = bpy.props.PointerProperty(type=self.group, name=self.label, description=self.tooltip)
        return self.checkbox(hooks) | {self.name: pointer}

    def read_given(self, owner: Any, base: Any) -> dict[str, Any]:
        """Return the nested group's values as JSON data, without fields that aren't given."""
        return read_fields(self.fields_of(self.model_in(owner)), getattr(owner, self.name), base)

    def model_of(self, settings: Any) -> type[BaseModel]:
        """Return the pydantic model that declares the nested fields, with the panel's settings."""
        return self.model_in(self.owner(settings))

    def model_in(self, owner: Any) -> type[BaseModel]:
        """Return the pydantic model that declares the nested fields, from the property group that holds it."""
        model: type[BaseModel] = self.kind
        return model

    def fields_of(self, model: type[BaseModel]) -> dict[str, Field]:
        """Return those of the nested fields, by name, that a model declares."""
        return {name: field for name, field in self.fields.items() if name in model.model_fields}

    def write_given(self, owner: Any, value: Any) -> None:
        """Set the nested group's properties to JSON data."""
        write_fields(self.fields, getattr(owner, self.name), value)

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the checkbox, if it is optional, and the nested fields if they are given."""
        if not self.optional or self.draw_checkbox(layout, settings, owner):
            self.draw_fields(layout, settings)

    def given_state(self, owner: Any) -> Any:
        """Return the states of those of the nested fields that are declared; see `Field.state`."""
        return shown_state(self.fields_of(self.model_in(owner)), getattr(owner, self.name))

    def draw_fields(self, layout: bpy.types.UILayout, settings: Any) -> None:
        """Draw those of the nested fields that have an effect."""
        for field in self.fields.values():
            field.draw(layout, settings)

    def classes(self) -> Iterator[type]:
        """Yield the property group classes of nested groups, then its own."""
        for field in self.fields.values():
            yield from field.classes()
        yield self.group


class KindField(GroupField):
    """A union of models as one property group with the fields of all kinds; only those of the chosen kind count.

    A kind may have a ``label`` for people, and `usual` values of fields that aren't given.

    Attributes:
        tag: name of the field that says the kind.
        kinds: model of each kind, by its value of the tag.
    """

    def __init__(
        self, path: str, info: FieldInfo, union: Any, tag: str, optional: bool, default: Any, hooks: Hooks
    ) -> None:
        models = get_args(union)
        self.tag, self.kinds = tag, {model.model_fields[tag].default: model for model in models}
        every = [field for model in reversed(models) for field in model.model_fields.items()]
        fields: dict[str, Any] = {name: (info.annotation, info) for name, info in every}
        first = models[0].model_fields[tag]
        labels = {kind: model.label for kind, model in self.kinds.items() if hasattr(model, "label")}
        tips = {kind: (model.__doc__ or "").partition("\n")[0].removesuffix(".") for kind, model in self.kinds.items()}
        about: dict[str, Any] = {"title": first.title, "description": first.description}
        choice = FieldInfo(default=first.default, **about, json_schema_extra={"labels": labels, "tooltips": tips})
        fields[tag] = (Literal[tuple(self.kinds)], choice)
        super().__init__(path, info, create_model(models[0].__name__, **fields), optional, default, hooks)

    def write_given(self, owner: Any, value: Any) -> None:
        """Set the group's properties to JSON data, and those of other kinds to their defaults."""
        super().write_given(owner, _defaults(self.kind) | value)

    def model_in(self, owner: Any) -> type[BaseModel]:
        """Return the pydantic model of the chosen kind."""
        return self.kinds[getattr(getattr(owner, self.name), self.tag)]


class NamedOrByHandField(Field):
    """A standard part chosen by name in a menu, or a part by hand in a nested group, ``NAME_by_hand``.

    Attributes:
        by_hand: the part by hand.
        items: names of the standard parts, as a menu has them.
    """

    choice = True

    def __init__(self, path: str, info: FieldInfo, model: Any, default: Any, items: Items, hooks: Hooks) -> None:
        super().__init__(path, info, model, False, default)
        self.items = items
        start = default if isinstance(default, dict) else _first_values(model)
        self.by_hand = GroupField(path + BY_HAND_ENDING, info, model, False, start, hooks)

    def properties(self, hooks: Hooks) -> dict[str, Any]:
        """Return the menu property and the pointer to the nested group, by name."""
        items = [*self.items, (BY_HAND, "By Hand", "Widths of your own")]
        default = self.default if isinstance(self.default, str) else BY_HAND
        menu = bpy.props.EnumProperty(**self._common(hooks), items=items, default=default)
        return {self.name: menu} | self.by_hand.properties({})

    def read(self, owner: Any, base: Any) -> Any:
        """Return the standard part's name, or the JSON data of the part by hand."""
        chosen = getattr(owner, self.name)
        return self.by_hand.read(owner, base if isinstance(base, dict) else {}) if chosen == BY_HAND else chosen

    def write(self, owner: Any, value: Any) -> None:
        """Select a standard part by its name, or By Hand with the part's JSON data."""
        setattr(owner, self.name, BY_HAND if isinstance(value, dict) else value)
        if isinstance(value, dict):
            self.by_hand.write(owner, value)

    def state(self, owner: Any) -> Any:
        """Return the menu's choice and, if that is By Hand, the states of the nested fields; see `Field.state`."""
        chosen = getattr(owner, self.name)
        return [chosen, self.by_hand.state(owner)] if chosen == BY_HAND else chosen

    def draw_row(self, layout: bpy.types.UILayout, settings: Any, owner: Any) -> None:
        """Draw the menu and, if By Hand is chosen, the nested fields."""
        super().draw_row(layout, settings, owner)
        if getattr(owner, self.name) == BY_HAND:
            self.by_hand.draw_fields(layout, settings)

    def classes(self) -> Iterator[type]:
        """Yield the property group classes of the part by hand."""
        return self.by_hand.classes()


NOT_HERE = ("tolerance", "time_budget")
"""Fields that the panel doesn't have: its road is built before it is scanned, with knobs that are seen and set."""


def make_fields(model: type[BaseModel], default: dict[str, Any], path: str, hooks: Hooks) -> dict[str, Field]:
    """Return the fields of a pydantic model by name, without constants and those that the panel lacks."""
    infos, before = model.model_fields.items(), f"{path}." if path else ""
    fields = (make_field(f"{before}{name}", info, default.get(name), hooks) for name, info in infos)
    return {field.name: field for field in fields if field}


def make_field(path: str, info: FieldInfo, default: Any, hooks: Hooks) -> Field | None:
    """Return the `Field` for a schema field by its type; None for a constant, or if the panel lacks it."""
    if path in NOT_HERE:
        return None
    kind, optional = _without_none(info.annotation)
    tag = _discriminator(info)
    if tag:
        return KindField(path, info, kind, tag, optional, default, hooks)
    if get_origin(kind) is Union or isinstance(kind, types.UnionType):
        models = [part for part in map(_bare, get_args(kind)) if _is_model(part)]
        if path in STANDARD_PARTS and len(models) == 1 and not optional:
            return NamedOrByHandField(path, info, models[0], default, STANDARD_PARTS[path], hooks)
        return kinds.JsonField(path, info, kind, optional, default)
    if kind is not Interval and _is_model(kind):
        return GroupField(path, info, kind, optional, default, hooks)
    if get_origin(kind) is Literal and len(get_args(kind)) == 1:
        return None
    return _simple(kind)(path, info, kind, optional, default)


def _simple(kind: Any) -> type[Field]:
    if get_origin(kind) is Literal:
        return kinds.ChoiceField
    if get_origin(kind) is tuple:
        member = _bare(get_args(kind)[0])
        if get_origin(member) is Literal:
            return kinds.ChoicesField
        return {str: FilesField, float: kinds.NumbersField, int: kinds.NumbersField}.get(member, kinds.JsonField)
    by_type: dict[Any, type[Field]] = {
        bool: kinds.FlagField,
        int: kinds.NumberField,
        float: kinds.NumberField,
        str: kinds.TextField,
        Interval: kinds.IntervalField,
    }
    return by_type.get(kind, kinds.JsonField)


def read_fields(fields: Mapping[str, Field], owner: Any, base: Any) -> dict[str, Any]:
    """Return a property group's values as JSON data by field name, without fields that aren't given."""
    loaded = base if isinstance(base, dict) else {}
    values = {name: field.read(owner, loaded.get(name)) for name, field in fields.items()}
    return {name: value for name, value in values.items() if value is not None}


def write_fields(fields: Mapping[str, Field], owner: Any, data: Mapping[str, Any]) -> None:
    """Set a property group to JSON data, choices first, as choosing resets fields that depend on it."""
    for field in sorted(fields.values(), key=lambda field: not field.choice):
        field.write(owner, data.get(field.name))


def shown_state(fields: Mapping[str, Field], owner: Any) -> list[Any]:
    """Return the states of a group's fields as JSON data, valid or not, for fast comparison; see `Field.state`."""
    return [field.state(owner) for field in fields.values()]


def leaves(fields: Mapping[str, Field]) -> Iterator[Field]:
    """Yield the fields that are drawn by themselves: fields of nested groups, and optional groups as a whole."""
    for field in fields.values():
        if isinstance(field, GroupField) and not field.optional:
            yield from leaves(field.fields)
        else:
            yield field


def _without_none(kind: Any) -> tuple[Any, bool]:
    """Return a type without None and annotations, and whether None was allowed."""
    kind = _bare(kind)
    if get_origin(kind) is Union or isinstance(kind, types.UnionType):
        parts = [part for part in get_args(kind) if part is not type(None)]
        optional = len(parts) < len(get_args(kind))
        return (_bare(parts[0]) if len(parts) == 1 else Union[tuple(parts)]), optional  # noqa: UP007
    return kind, False


def _discriminator(info: FieldInfo) -> str:
    """Return the name of the discriminator field of a union of models, e.g. ``condition``; empty if there is none."""
    if isinstance(info.discriminator, str):
        return info.discriminator
    for part in [info.annotation, *get_args(info.annotation)]:
        for note in get_args(part)[1:] if get_origin(part) is Annotated else ():
            if isinstance(note, FieldInfo) and isinstance(note.discriminator, str):
                return note.discriminator
    return ""


def _bare(kind: Any) -> Any:
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    return kind


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _defaults(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON defaults of a model's fields, without required fields."""
    data: dict[str, Any] = {}
    for name, info in model.model_fields.items():
        value = info.get_default(call_default_factory=True)
        if isinstance(value, BaseModel):
            data[name] = value.model_dump(mode="json")
        elif not info.is_required():
            data[name] = list(value) if isinstance(value, tuple) else value
    return data


def _first_values(model: type[BaseModel]) -> dict[str, Any]:
    """Return the initial JSON values of a part by hand: its defaults, and two lanes of 3.75 m."""
    return {"lanes": [3.75, 3.75]} | _defaults(model)
