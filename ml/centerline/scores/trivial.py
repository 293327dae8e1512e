"""Predictors that learn nothing: a model counts only where it beats them.

Each looks at the points of one slice, or of `SEQUENCE` metres about it: as many as the models see that take ten slices
at once. As these lie apart, `SPANNED` ones are also taken from every slice of `SPAN` metres, by a parabola through what
each says. Where a slice has fewer than `FEWEST` points there is no prediction.

- `centroid`: the mean of the points;
- `middle of the extent`: between the outermost points;
- `middle of the bright`: between the outermost of the bright points, those above the middle of the intensity's range.
  The range is from the 5 % to the 95 % quantile; "outermost" are the 5 % and 95 % quantiles too, against stray points;
- `between the brightest`: between the brightest strip left of the extent's middle and the brightest right of it, as
  edge lines or verges of a rural road; strips of `STRIP`, with at least `FEWEST_OF_STRIP` points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Index = NDArray[np.intp]
Rule = Callable[[Float, Float], float]
"""From the points' y (N,), m, and intensities (N,) of one slice to the centre's y, m."""

SEQUENCE = 10.0
"""m."""
SPAN = 37.0
"""Length that ten slices of 1 m span which are 4 m apart, m."""
FEWEST = 5
STRIP = 0.25
"""m."""
FEWEST_OF_STRIP = 2
_TAIL = 0.05


def centroid(y: Float, intensity: Float) -> float:
    """Return the mean."""
    return float(y.mean())


def extent_middle(y: Float, intensity: Float) -> float:
    """Return the middle between the outermost points."""
    return float(y.min() + y.max()) / 2.0


def bright_middle(y: Float, intensity: Float) -> float:
    """Return the middle between the outermost bright points."""
    low, high = np.quantile(intensity, [_TAIL, 1.0 - _TAIL])
    bright = y[intensity >= (low + high) / 2.0]
    return float(np.quantile(bright, [_TAIL, 1.0 - _TAIL]).mean())


def between_brightest(y: Float, intensity: Float) -> float:
    """Return the middle between the brightest strip left and right of the extent's middle."""
    middle = extent_middle(y, intensity)
    number = np.floor((y - middle) / STRIP).astype(np.intp)
    first = int(number.min())
    count = np.bincount(number - first)
    mean = np.bincount(number - first, intensity) / np.maximum(count, 1)
    mean[count < FEWEST_OF_STRIP] = -np.inf
    right, left = mean[: max(0, -first)], mean[max(0, -first) :]
    if not np.isfinite(right).any() or not np.isfinite(left).any():
        return float("nan")
    numbers = (int(right.argmax()) + first, int(left.argmax()) + max(0, first))
    return middle + STRIP * (sum(numbers) + 1.0) / 2.0


RULES: dict[str, tuple[Rule, float]] = {
    "centroid": (centroid, 1.0),
    "middle of the extent": (extent_middle, 1.0),
    "middle of the bright": (bright_middle, 1.0),
    "between the brightest": (between_brightest, 1.0),
    "middle of the extent, 10 m": (extent_middle, SEQUENCE),
    "middle of the bright, 10 m": (bright_middle, SEQUENCE),
    "between the brightest, 10 m": (between_brightest, SEQUENCE),
}
"""Predictors by name: rule and length of the slice along the frame, m."""
SPANNED = ("middle of the extent", "middle of the bright")
"""Those that are also taken over `SPAN`."""


def centers(rule: Rule, number: Index, y: Float, intensity: Float, count: int) -> Float:
    """Return the centres' y (M,), m; NaN where a slice has too few points.

    Args:
        rule: one of `RULES`.
        number: (N,) the slice that each point lies in.
        y: (N,) across, in its slice's frame, m.
        intensity: (N,) of any scale.
        count: M, of slices.
    """
    result = np.full(count, np.nan)
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(np.bincount(number, minlength=count))
    for index, own in enumerate(np.split(order, ends[:-1])):
        if len(own) >= FEWEST:
            result[index] = rule(y[own], intensity[own])
    return result
