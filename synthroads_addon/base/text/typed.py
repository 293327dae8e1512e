"""Values of texts that somebody typed for a field, by the type that the field is declared with."""

import json
from collections.abc import Iterator, Sequence
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from ..errors import MOST_NAMES, SynthRoadsError, similar_names


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


def similar_paths(model: type[BaseModel], name: str) -> list[str]:
    """Return the paths, such as ``road.length``, of the fields of a class, or within its groups, most like a name.

    Of several fields of the same name only the outermost are returned; the list is empty if no field is like it.
    """
    paths: dict[str, list[str]] = {}
    level: list[tuple[str, Any]] = [("", model)]
    while level:
        outer_names = set(paths)
        next_level: list[tuple[str, Any]] = []
        for prefix, kind in level:
            for alternative in alternatives(kind):
                if not (isinstance(alternative, type) and issubclass(alternative, BaseModel)):
                    continue
                for key, field in alternative.model_fields.items():
                    field_name = field.alias or key
                    path = f"{prefix}{field_name}"
                    if field_name not in outer_names and path not in paths.get(field_name, ()):
                        paths.setdefault(field_name, []).append(path)
                        next_level.append((f"{path}.", field.annotation))
        level = next_level
    return [path for field_name in similar_names(name, paths) for path in paths[field_name]][:MOST_NAMES]


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
