"""Changes of JSON data by the dotted paths of fields, as ``--set`` gives them: ``road.length=800``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .errors import InputError
from .schema import Model
from .text.typed import typed_value

_DEEPEST = 20
"""Dots in the path of a change: more fields don't lie in each other."""


def apply_change(data: Any, change: str, model: type[Model]) -> Any:
    """Return JSON data with one ``path=value`` applied, the value being of the type of the model's field.

    Example:
        >>> from synthroads_addon.scenario.scenario import Scenario
        >>> apply_change({}, "road.length=800", Scenario)
        {'road': {'length': 800}}
    """
    path, value = parse_change(change, model)
    return _with_value(data, path, value)


def apply_values(data: Any, values: Mapping[str, Any]) -> Any:
    """Return JSON data with values set by their dotted paths; raise `InputError` where a path is none."""
    for path, value in values.items():
        if not _is_path(path):
            raise InputError("set", path, "must be the path of a field, e.g. road.length")
        data = _with_value(data, path, value)
    return data


def parse_change(change: str, model: type[Model]) -> tuple[str, Any]:
    """Return path and value of ``path=value``, see `typed_value`; raise `InputError` if it has another form."""
    path, equals, text = change.partition("=")
    if not equals or not _is_path(path):
        raise InputError("--set", change, "must be path=value, e.g. road.length=800")
    return path, typed_value(model, path, text)


def _is_path(text: str) -> bool:
    """Return whether a text may be the dotted path of a field, by its length and its number of dots."""
    return bool(text) and text.count(".") <= _DEEPEST


def _with_value(data: Any, path: str, value: Any, parent_path: str = "") -> Any:
    """Return a copy of JSON data with a value at a dotted path; `parent_path` is the path of the data, for messages."""
    key, dot, rest = path.partition(".")
    if not isinstance(data, dict):
        raise InputError(parent_path or "set", data, f"must be a JSON object before its field {key} can be set")
    key_path = f"{parent_path}.{key}" if parent_path else key
    return {**data, key: _with_value(data.get(key, {}), rest, value, key_path) if dot else value}
