"""Values of texts that somebody typed for a field, by the type that the field is declared with."""

import difflib
import json
from collections.abc import Iterator, Sequence
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from ..errors import SynthRoadsError


def typed_value(model: type[BaseModel], path: str, text: str) -> Any:
    """Return the value that a text stands for: JSON where the field takes that, else the text as it stands.

    ``5`` is a number for a field of numbers and the text "5" for one of text; ``null`` takes a value away everywhere.

    Args:
        model: that the path begins in.
        path: dotted, e.g. ``scan.platform.height``; of one that isn't there, JSON is taken where the text is JSON.
        text: what was typed, e.g. ``80``, ``draft`` or ``["laz"]``.
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return text
    if value is None or isinstance(value, str):
        return value
    kinds = [alternative for kind in declared_kinds(model, path.split(".")) for alternative in alternatives(kind)]
    if isinstance(value, (dict, list)) and set(kinds) - {str, NoneType}:
        return value
    return text if not _is_taken(value, kinds) and _is_taken(text, kinds) else value


def declared_kinds(kind: Any, path: Sequence[str]) -> list[Any]:
    """Return the types that the field at a path is declared with in all classes that it may lie in; none: no field.

    Args:
        kind: a class of fields, or any other type, in which the path begins.
        path: names of the fields, outermost first.
    """
    if not path:
        return [kind]
    kinds: list[Any] = []
    for alternative in alternatives(kind):
        if isinstance(alternative, type) and issubclass(alternative, BaseModel):
            matching_fields = (
                field for name, field in alternative.model_fields.items() if path[0] == (field.alias or name)
            )
            kinds += [
                inner_kind for field in matching_fields for inner_kind in declared_kinds(field.annotation, path[1:])
            ]
        elif get_origin(alternative) is dict:
            kinds += declared_kinds(get_args(alternative)[1], path[1:])
    return kinds


def nearest_path(model: type[BaseModel], name: str) -> str:
    """Return `` (did you mean 'road.length'?)`` for the field of a class, or within its groups, most like a name.

    Of several fields of that name the outermost is meant; an empty string if none is like it.
    """
    paths: dict[str, str] = {}
    level: list[tuple[str, Any]] = [("", model)]
    while level:
        next_level: list[tuple[str, Any]] = []
        for prefix, kind in level:
            for alternative in alternatives(kind):
                if not (isinstance(alternative, type) and issubclass(alternative, BaseModel)):
                    continue
                for key, field in alternative.model_fields.items():
                    field_name = field.alias or key
                    if field_name not in paths:
                        paths[field_name] = f"{prefix}{field_name}"
                        next_level.append((f"{prefix}{field_name}.", field.annotation))
        level = next_level
    close_names = difflib.get_close_matches(name, paths, n=1, cutoff=0.6)
    return f" (did you mean '{paths[close_names[0]]}'?)" if close_names else ""


def alternatives(kind: Any) -> Iterator[Any]:
    """Yield the types of which a type is the union, nested ones too, without annotations."""
    if get_origin(kind) is Annotated:
        yield from alternatives(get_args(kind)[0])
    elif get_origin(kind) in (Union, UnionType):
        for member in get_args(kind):
            yield from alternatives(member)
    else:
        yield kind


def _is_taken(value: Any, kinds: Sequence[Any]) -> bool:
    """Return whether a value is valid for one of some types; limits of the field don't count."""
    for kind in kinds:
        try:
            TypeAdapter(kind).validate_python(value)
        except (ValidationError, SynthRoadsError):
            continue
        return True
    return False
