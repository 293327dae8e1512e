"""Every field of a class of JSON data by its path, down through all that it holds, and another value for it.

A path is dotted. ``[]`` stands for an entry of a list, ``[uav]`` for that member of a union: ``lanes[].width``,
``platform[uav].speed``; ``[2]`` is one entry of a list.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from synthroads_addon.base.schema import Model

_LEAST_STEP, _STEP = 0.1, 0.2


@dataclass(frozen=True)
class SchemaField:
    """A field of a class, at a path.

    Attributes:
        path: of it.
        info: its declaration.
    """

    path: str
    info: FieldInfo


def fields_of(model: type[Model], above: str = "") -> Iterator[SchemaField]:
    """Yield every field of a class that can have more than one value, and those of the models that it holds."""
    for name, info in model.model_fields.items():
        path = f"{above}.{name}" if above else name
        inner = list(models_in(info.annotation))
        if _has_one_value(info.annotation):
            continue
        if len(inner) != 1 or _is_list(info.annotation) or _has_plain_form(info.annotation):
            yield SchemaField(path, info)
        for kind in inner:
            key = tag_of(kind) if len(inner) > 1 else "" if _is_list(info.annotation) else None
            yield from fields_of(kind, path if key is None else f"{path}[{key}]")


def models_in(annotation: Any) -> Iterator[type[Model]]:
    """Yield the models in a type: members of unions, entries of lists."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        yield annotation
    elif get_origin(annotation) is not dict:
        for part in get_args(annotation):
            yield from models_in(part)


def tag_of(model: type[Model]) -> str:
    """Return the one value of a class's field that tells it from the others of a union."""
    for name in ("type", "kind", "condition"):
        if name in model.model_fields and _has_one_value(model.model_fields[name].annotation):
            return str(get_args(model.model_fields[name].annotation)[0])
    raise AssertionError(f"{model.__name__} has no field that tells it from others")


def _has_one_value(annotation: Any) -> bool:
    return get_origin(annotation) is Literal and len(get_args(annotation)) == 1


def _is_list(annotation: Any) -> bool:
    """Return whether a type is a list of models, or may be one."""
    if get_origin(annotation) is tuple:
        return any(models_in(annotation))
    return any(_is_list(part) for part in get_args(annotation) if get_origin(annotation) is not Literal)


def _has_plain_form(annotation: Any) -> bool:
    """Return whether a field that holds a model may be a number or a text instead."""
    if annotation in (int, float, str):
        return True
    return get_origin(annotation) not in (tuple, Literal) and any(map(_has_plain_form, get_args(annotation)))


def steps_of(path: str) -> list[str]:
    """Return the keys on the way to a field, from outside: ``lanes``, ``[]``, ``width``."""
    return re.findall(r"\[\d*\]|[^.\[\]]+", re.sub(r"\[[a-z_]+\]", "", path))


def value_at(data: Any, path: str) -> Any:
    """Return the value at a path in JSON data, that of the first entry of lists; None where none is given.

    Raises:
        LookupError: a list or an object on the way isn't there.
    """
    *way, last = steps_of(path)
    for step in way:
        data = _inside(data, step)
    if not isinstance(data, dict):
        raise LookupError(path)
    value = data.get(last)
    return None if isinstance(value, dict) else value


def with_value(data: Any, path: str, value: Any) -> Any:
    """Return JSON data with another value at a path."""
    return _changed(data, steps_of(path), value)


def _inside(data: Any, step: str) -> Any:
    if step.startswith("["):
        if not isinstance(data, list) or len(data) <= _entry(step):
            raise LookupError(step)
        return data[_entry(step)]
    if not isinstance(data, dict):
        raise LookupError(step)
    return data.get(step, {})


def _changed(data: Any, steps: list[str], value: Any) -> Any:
    if not steps:
        return value
    inner = _changed(_inside(data, steps[0]), steps[1:], value)
    if not steps[0].startswith("["):
        return {**data, steps[0]: inner}
    return [inner if number == _entry(steps[0]) else item for number, item in enumerate(data)]


def _entry(step: str) -> int:
    """Return which entry of a list a step goes to; the first if none is named."""
    return int(step[1:-1] or 0)


def other_values(info: FieldInfo, value: Any) -> Iterator[Any]:
    """Yield values that differ from a field's.

    Of a choice they are the others, of a share none or all, of numbers larger and smaller ones. Of a list of numbers
    the first is another, of a list of objects the last is left out. Texts and what isn't given have none.
    """
    choices = [choice for part in _literals(info.annotation) for choice in part]
    if isinstance(value, bool):
        yield not value
    elif choices and not isinstance(value, list):
        yield from (choice for choice in choices if choice != value)
    elif isinstance(value, float) and _limits(info.metadata) == (0, 1):
        yield 0.0 if value > 0.5 else 1.0
    elif isinstance(value, int | float):
        yield from _other_numbers(value, info.metadata)
    elif isinstance(value, list) and value and isinstance(value[0], int | float):
        yield from ([number, *value[1:]] for number in _other_numbers(value[0], []))
    elif isinstance(value, list) and value:
        yield value[:-1]


def _literals(annotation: Any) -> Iterator[tuple[Any, ...]]:
    if get_origin(annotation) is Literal:
        yield get_args(annotation)
    elif get_origin(annotation) is not tuple:
        for part in get_args(annotation):
            yield from _literals(part)


def _other_numbers(value: float, metadata: list[Any]) -> Iterator[float]:
    low, high = _limits(metadata)
    step = 1 if isinstance(value, int) else round(max(abs(value) * _STEP, _LEAST_STEP), 6)
    for number in (value + step, value - step, value + step / 100.0, value - step / 100.0):
        if low <= number <= high and (isinstance(number, int) or isinstance(value, float)):
            yield number


def _limits(metadata: list[Any]) -> tuple[float, float]:
    """Return the smallest and the largest value of a number."""
    low = max((item.ge for item in metadata if getattr(item, "ge", None) is not None), default=-1e15)
    return low, min((item.le for item in metadata if getattr(item, "le", None) is not None), default=1e15)
