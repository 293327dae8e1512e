"""All weathers: those of the files beside this one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import BeforeValidator, Field

from ...base.discovery import discover_models
from ...road.surroundings import Environment
from .base import Weather

WEATHERS = discover_models(__package__, Weather, "condition")
"""Condition and model of every weather."""


def _name_condition(data: Any) -> Any:
    """Return data with the condition ``clear`` where there is none; refuse what only other weathers have."""
    if not isinstance(data, dict):
        return data
    if data.get("condition") is None:
        data = data | {"condition": "clear"}
    model = WEATHERS.get(str(data["condition"]))
    for key in data if model else ():
        others = [name for name, other in WEATHERS.items() if key in other.model_fields]
        if others and data["condition"] not in others:
            raise ValueError(f"{key} can't be given for {data['condition']}, only for {', '.join(others)}")
    return data


if TYPE_CHECKING:
    WeatherModel = Weather
else:
    WeatherModel = Annotated[
        Union[tuple(WEATHERS.values())],  # noqa: UP007
        Field(discriminator="condition"),
        BeforeValidator(_name_condition),
    ]


def weather_of(environment: Environment) -> Weather:
    """Return the weather that a road has.

    A visibility that its parameter set leaves at the default, that of a clear day, is the usual one of its condition:
    fog of 23 km is none.
    """
    given = environment.visibility != Environment.model_fields["visibility"].default
    model = WEATHERS[environment.weather]
    return model(
        condition=environment.weather, visibility=environment.visibility if given else model.usual_visibility
    )
