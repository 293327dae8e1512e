"""Numbers of the schema as Blender's: limits, units, 32 bits, lists of them as text."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from typing import Any

import annotated_types
import bpy
import numpy as np
from pydantic.fields import FieldInfo

from ...base.schema import unit_of
from .wording import BLENDERS

LARGEST_INTEGER = 2**31 - 1
LENGTH_DIGITS = 5
"""Digits that a number with a unit of Blender's is shown with, those before the point included, as Blender's own
lengths are: with 2, 21.31 m would be shown as 21 m."""
_SMALL = 20.0
"""A number that is 0 at first and can't be larger than this is set in small steps."""


def is_share(info: FieldInfo) -> bool:
    """Return whether a schema field is a dimensionless number limited to 0 to 1."""
    return (*_limits(info), unit_of(info)) == (0, 1, "1")


def number_property(
    info: FieldInfo, whole: bool, default: Any, unit: str | None = None, beside: float = 0.0, **arguments: Any
) -> Any:
    """Return a Blender float or int property with the limits, default and unit of a schema field.

    `beside` is the other end of an interval: both show as many digits as the larger one needs.
    Blender's limits are inclusive: a limit that the schema excludes is refused when the scenario is made.
    Whole numbers that may be left out and be larger than 32 bits are limits of something: they have floats, as far as
    these reach, and begin where they do no harm.
    """
    unit = unit_of(info) if unit is None else unit
    low, high = _limits(info)
    large = default is None and whole and high > LARGEST_INTEGER
    first = high if large else min(max(default or 0, low), high)
    share = is_share(info)
    if whole and not large:
        pixels = {"subtype": "PIXEL"} if unit == "px" else {}
        limits = {"min": int(max(low, -LARGEST_INTEGER)), "max": int(min(high, LARGEST_INTEGER))}
        return bpy.props.IntProperty(default=clamp_32_bit(int(first)), **limits, **pixels, **arguments)
    largest = abs(first) or (1.0 if high > _SMALL else 0.0)
    fine = max(largest, abs(beside)) < 0.1 and not share
    return bpy.props.FloatProperty(
        default=first,
        min=low,
        max=high,
        step=1 if fine or share else 10 if abs(first) < 2 else 100,
        precision=LENGTH_DIGITS if unit in BLENDERS else 0 if large else 4 if fine else 2,
        subtype="FACTOR" if share else "NONE",
        unit=BLENDERS.get(unit, "NONE"),
        **arguments,
    )


def exact(value: float, loaded: Any) -> float:
    """Return a 32-bit property's value as the loaded number if it still equals that, else as the shortest decimal."""
    if isinstance(loaded, int | float) and not isinstance(loaded, bool):
        if isinstance(value, int) and clamp_32_bit(int(loaded)) == value:
            return loaded
        if isinstance(value, float) and float(np.float32(loaded)) == value:
            return loaded
    return value if isinstance(value, int) else float(str(np.float32(value)))


def push_along(name: str, other: str, limit: Callable[[float, float], float]) -> Callable[[Any, Any], None]:
    """Return an update hook that moves an interval's other end so that minimum <= maximum."""

    def push(group: Any, context: Any) -> None:
        pushed = limit(getattr(group, name), getattr(group, other))
        if pushed != getattr(group, other):
            setattr(group, other, pushed)

    return push


def clamp_32_bit(value: int) -> int:
    """Return an integer clamped to 32 bits."""
    return max(-LARGEST_INTEGER, min(value, LARGEST_INTEGER))


def list_as_text(values: Sequence[float]) -> str:
    """Return numbers as comma-separated text that `numbers_in` reads back exactly."""
    return ", ".join(json.dumps(value).removesuffix(".0") for value in values)


def _number(text: str) -> float:
    try:
        return int(text)
    except ValueError:
        return float(text)


def numbers_in(text: str) -> list[float]:
    """Return the numbers in a text, separated by commas, semicolons or blanks; ValueError if there is anything else."""
    return [_number(part) for part in re.split(r"[\s,;]+", text) if part]


def _limits(info: FieldInfo) -> tuple[float, float]:
    low, high = -float(np.finfo(np.float32).max), float(np.finfo(np.float32).max)
    for limit in info.metadata:
        if isinstance(limit, annotated_types.Ge | annotated_types.Gt):
            low = max(low, getattr(limit, "ge", getattr(limit, "gt", low)))
        if isinstance(limit, annotated_types.Le | annotated_types.Lt):
            high = min(high, getattr(limit, "le", getattr(limit, "lt", high)))
    return low, high
