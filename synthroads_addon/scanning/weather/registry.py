"""All weathers: those of the files beside this one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base.discovery import discover_models, discriminated_union
from ...road.surroundings import Environment
from .base import Weather

WEATHERS = discover_models(__package__, Weather, "condition")
"""Condition and model of every weather."""


if TYPE_CHECKING:
    WeatherModel = Weather
else:
    WeatherModel = discriminated_union(WEATHERS, "condition")


def weather_of(environment: Environment) -> Weather:
    """Return the weather model of a road's environment, with its visibility or the condition's usual one.

    A visibility that its parameter set leaves at the default, that of a clear day, is the usual one of its condition:
    fog of 23 km is none.
    """
    model = WEATHERS[environment.weather]
    is_default = environment.visibility == Environment.model_fields["visibility"].default
    visibility = model.usual["visibility"] if is_default else environment.visibility
    return model(condition=environment.weather, visibility=visibility)
