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
    return bool(text) and text.count(".") <= _DEEPEST


def _with_value(data: Any, path: str, value: Any, above: str = "") -> Any:
    head, dot, rest = path.partition(".")
    if not isinstance(data, dict):
        raise InputError(above or "set", data, f"must be a JSON object before its field {head} can be set")
    here = f"{above}.{head}" if above else head
    return {**data, head: _with_value(data.get(head, {}), rest, value, here) if dot else value}
