"""Draws: a number from an interval of the scenario, or between two others, and one of several choices."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ...base.schema import round_value
from ...road.things.limits import Interval

T = TypeVar("T")


def draw(rng: np.random.Generator, limits: Interval) -> float:
    """Return a number drawn uniformly from an interval of the scenario, rounded."""
    least, largest = limits.minimum, limits.maximum
    return min(max(round_value(least + (largest - least) * rng.random()), least), largest)


def draw_between(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """Return a number drawn uniformly between two limits, rounded."""
    return round_value(limits[0] + (limits[1] - limits[0]) * rng.random())


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """Return one of several options, each with the same chance."""
    return options[int(rng.random() * len(options))]
