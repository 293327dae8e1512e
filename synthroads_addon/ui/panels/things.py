"""Fields of the road's things as properties: station, offset, rotation, sizes, number, text of the active object.

Each type of the registry has a property group of its own, made of its model. A property shows what the active object
stands for now, and changes it at once: its place, its modifier's input, or its shape anew.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, Literal, get_args, get_origin

import bpy
from pydantic.fields import FieldInfo

from ...base.errors import InputError
from ...blender.model.added import change_thing, present_thing
from ...blender.model.roads import root_of
from ...blender.things.model_builder import ROLE, SUPPORT
from ...road.objects import Color
from ...road.things.gantry import Gantry
from ...road.things.registry import THINGS
from ...road.things.sign_catalogue import sign_catalogue
from ...road.things.thing import Thing
from ..fields.numbers import exact, number_property
from ..fields.room import draw_text, value_row
from ..fields.wording import label, thing_name, title_case, tooltip, value_name
from ..work.common import panel_message

_SEPARATOR = " / "
"""Between two lines of a text."""
_BETWEEN_SIGNS = " | "
"""Between the texts of a gantry's signs."""
_HIDDEN = frozenset({"type", "signs", "twin_types", "library", "name", "class_name", "pier_offsets"})
"""Fields that can't be edited here: nested ones, and what an asset is."""
_LABELS = {"code": "Sign Number", "instance": "Instance Number", "elevation": "Above Surface", "color": "Colour"}
"""Fields whose names don't say enough."""
_FIRST = (
    "station",
    "start_station",
    "end_station",
    "offset",
    "end_offset",
    "rotation_deg",
    "elevation",
    "code",
    "text",
)
"""Fields that are shown first, in this order; the instance number is the last."""
_TEXTS = "sign_texts"


class _State:
    """Message of the last value that was refused, and the object that it was refused for."""

    refused: tuple[str, str] = ("", "")


def thing_of(item: bpy.types.Object | None, scene: bpy.types.Scene) -> Thing | None:
    """Return the thing of the registry that an object of a road shows now; None if it shows none."""
    if item is None or ROLE not in item or SUPPORT in item:
        return None
    root = root_of(item, scene)
    thing = None if root is None else present_thing(root, item)
    return thing if isinstance(thing, Thing) else None


def _active_thing() -> Thing | None:
    context = bpy.context
    return thing_of(context.view_layer.objects.active, context.scene)


def _set_values(values: dict[str, Any]) -> None:
    """Change fields of the active object's thing; a refused value stays as it was, with a message in the panel."""
    context = bpy.context
    item = context.view_layer.objects.active
    root = root_of(item, context.scene) if item else None
    if item is None or root is None:
        return
    try:
        change_thing(root, context.scene, item, values)
        _State.refused = ("", "")
    except InputError as error:
        _State.refused = (item.name, _with_labels(panel_message(error), _active_thing()))


def _with_labels(message: str, thing: Thing | None) -> str:
    """Return a message with the names of a thing's fields replaced by their labels."""
    if thing is None:
        return message
    for name in type(thing).model_fields:
        if "_" in name:
            message = re.sub(rf"\b{name}\b", field_label(type(thing), name), message)
    return message


def sign_numbers(self: Any, context: bpy.types.Context, typed: str) -> Iterator[tuple[str, str]]:
    """Yield (number, what the sign tells) of the catalogue's signs that contain the typed text, for a search field."""
    for number, sign in sign_catalogue().signs.items():
        if typed.lower() in f"{number} {sign.description}".lower():
            yield number, sign.description


def _getter(name: str, read: Callable[[Any], Any], empty: Any) -> Callable[[Any], Any]:
    def get(group: Any) -> Any:
        thing = _active_thing()
        return read(getattr(thing, name)) if thing is not None and name in type(thing).model_fields else empty

    return get


def _setter(name: str, write: Callable[[Any], Any]) -> Callable[[Any, Any], None]:
    def set_value(group: Any, value: Any) -> None:
        _set_values({name: write(value)})

    return set_value


def _number(value: float) -> float:
    """Return a typed number as its shortest decimal."""
    return float(exact(value, None))


def _lines(text: str) -> list[str]:
    """Return the lines of a text; none for an empty one."""
    return [line.strip() for line in text.split(_SEPARATOR.strip())] if text.strip() else []


def field_label(model: type[Thing], name: str) -> str:
    """Return a field's name in the panel, with its unit where Blender doesn't write it."""
    return _LABELS.get(name) or label(f"things.{name}", model.model_fields[name])


def _property(model: type[Thing], name: str, info: FieldInfo) -> Any:
    """Return the Blender property of a field; None for one of a kind that isn't edited here."""
    kind = info.annotation
    about: dict[str, Any] = {"name": field_label(model, name), "description": tooltip(info) or title_case(name)}
    if kind is float or kind is int:
        whole = kind is int
        write = int if whole else _number
        default = info.default if isinstance(info.default, int | float) else None
        read: Callable[[Any], Any] = (lambda value: min(int(value), 2**31 - 1)) if whole else float
        access: dict[str, Any] = {"get": _getter(name, read, 0 if whole else 0.0), "set": _setter(name, write)}
        return number_property(info, whole, default if default is not None or not whole else 1, **about, **access)
    if get_origin(kind) is Literal:
        values = list(get_args(kind))
        items = [(value, value_name(value, info), "") for value in values]
        get, put = _getter(name, values.index, 0), _setter(name, values.__getitem__)
        return bpy.props.EnumProperty(items=items, get=get, set=put, **about)
    if kind is str:
        if name == "code":
            about["search"] = sign_numbers
        return bpy.props.StringProperty(get=_getter(name, str, ""), set=_setter(name, str), **about)
    if kind == tuple[str, ...]:
        about["description"] += f". Lines are divided by{_SEPARATOR.rstrip()}"
        return bpy.props.StringProperty(get=_getter(name, _SEPARATOR.join, ""), set=_setter(name, _lines), **about)
    if name == "color" or kind == get_args(Color)[0]:
        get, put = _getter(name, tuple, (0.0, 0.0, 0.0)), _setter(name, lambda value: [_number(v) for v in value])
        return bpy.props.FloatVectorProperty(subtype="COLOR", size=3, min=0.0, max=1.0, get=get, set=put, **about)
    return None


def _sign_texts(group: Any) -> str:
    thing = _active_thing()
    return _BETWEEN_SIGNS.join(_SEPARATOR.join(sign.text) for sign in thing.signs) if isinstance(thing, Gantry) else ""


def _set_sign_texts(group: Any, text: str) -> None:
    thing = _active_thing()
    if not isinstance(thing, Gantry):
        return
    texts = [_lines(part) for part in text.split(_BETWEEN_SIGNS.strip())]
    signs = [
        sign.to_dict() | {"text": texts[number] if number < len(texts) else []}
        for number, sign in enumerate(thing.signs)
    ]
    _set_values({"signs": signs})


def edited_fields(model: type[Thing]) -> list[str]:
    """Return the names of a type's fields that are edited here, in the order in which they are shown."""
    names = [name for name in model.model_fields if name not in _HIDDEN]
    names = [name for name in names if _property(model, name, model.model_fields[name]) is not None]
    return sorted(names, key=lambda name: (name == "instance", _FIRST.index(name) if name in _FIRST else len(_FIRST)))


def _group(kind: str, model: type[Thing]) -> type[bpy.types.PropertyGroup]:
    """Create and return the property group class of a type."""
    annotations = {name: _property(model, name, model.model_fields[name]) for name in edited_fields(model)}
    if model is Gantry:
        about = "Texts of its signs, from the first on, divided by |; lines are divided by /"
        annotations[_TEXTS] = bpy.props.StringProperty(
            name="Sign Texts", description=about, get=_sign_texts, set=_set_sign_texts
        )
    return type(f"SYNTHROADS_PG_thing_{kind}", (bpy.types.PropertyGroup,), {"__annotations__": annotations})


_GROUPS = {kind: _group(kind, model) for kind, model in THINGS.items()}
_POINTERS = {kind: bpy.props.PointerProperty(type=group, name=thing_name(kind)) for kind, group in _GROUPS.items()}
SYNTHROADS_PG_things = type("SYNTHROADS_PG_things", (bpy.types.PropertyGroup,), {"__annotations__": _POINTERS})
CLASSES = (*_GROUPS.values(), SYNTHROADS_PG_things)
ATTACHED = (bpy.types.Scene, "synthroads_things", SYNTHROADS_PG_things)
"""Attached to the scene, so that Blender notes each change of a value as a step to undo."""


def draw_thing(layout: bpy.types.UILayout, scene: bpy.types.Scene, item: bpy.types.Object, thing: Thing) -> None:
    """Draw the fields of an object's thing, and the message of a value that was refused."""
    group = getattr(scene.synthroads_things, type(thing).__name__)
    for name in edited_fields(type(thing)):
        value_row(layout, field_label(type(thing), name)).prop(group, name, text="")
    if isinstance(thing, Gantry) and thing.signs:
        value_row(layout, "Sign Texts").prop(group, _TEXTS, text="")
    if _State.refused[0] == item.name and _State.refused[1]:
        draw_text(layout, _State.refused[1], "ERROR")


def unregister() -> None:
    """Drop the message of a refused value."""
    _State.refused = ("", "")
