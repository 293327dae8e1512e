"""The two draws of the placement: a number from an interval of the scenario, and one of several choices."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ...base.schema import round_value
from ...road.things.limits import Interval

T = TypeVar("T")


def draw(rng: np.random.Generator, limits: Interval) -> float:
    """Return a number within limits, each with the same chance."""
    low, high = limits.minimum, limits.maximum
    return min(max(round_value(low + (high - low) * rng.random()), low), high)


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """Return one of several options, each with the same chance."""
    return options[int(rng.random() * len(options))]
