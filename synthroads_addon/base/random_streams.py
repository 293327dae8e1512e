"""Random numbers keyed by what they are for, so that no result depends on order, worker or time.

Upper confidence bounds of samples are drawn by them as well: the bootstrap.
"""

import zlib
from collections.abc import Sequence

import numpy as np

from .arrays import Float

LEVEL = 0.95
"""Confidence of the upper bounds."""
_DRAWS = 400
_STEPS = 512
"""Places at which a distribution's shares are counted."""
_LEAST = 1e-9


def stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the random generator for one purpose, e.g. ``stream(seed, "range noise", strip, block)``.

    The same seed and purpose give the same numbers on every machine (PCG64 seeded by `SeedSequence`).

    Example:
        >>> first, again = stream(7, "range noise", 0), stream(7, "range noise", 0)
        >>> bool((first.random(5) == again.random(5)).all())
        True
        >>> bool((stream(7, "range noise", 1).random(5) == stream(7, "range noise", 0).random(5)).any())
        False
    """
    key = [zlib.crc32(part.encode()) if isinstance(part, str) else int(part) for part in purpose]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([int(seed), *key])))


def quantile_bound(parts: Sequence[Float], quantile: float, key: str = "") -> tuple[float, float]:
    """Return a quantile of all parts' values and its upper 95 % confidence bound by the bootstrap; 0, 0 of none.

    The parts (stretches of a path, say) are drawn anew, with replacement: values within a part are alike, so that their
    number says less than that of the parts. Efron & Tibshirani 1993, An Introduction to the Bootstrap.

    Args:
        parts: values (N,) of each part.
        quantile: 0 to 1.
        key: of the random numbers.
    """
    all_values = np.concatenate([*parts, np.empty(0)])
    if not len(all_values):
        return 0.0, 0.0
    estimate = float(np.quantile(all_values, quantile))
    places = np.unique(np.quantile(all_values, np.linspace(0.0, 1.0, _STEPS)))
    counts_below = np.stack([np.searchsorted(np.sort(part), places, side="right") for part in parts]).astype(np.float64)
    part_sizes = np.array([len(part) for part in parts], dtype=np.float64)
    # In each draw of the bootstrap: the share of all drawn values up to each place, and the first place at which that
    # share reaches the quantile.
    weights = _draw_parts(len(parts), key)
    shares = (weights @ counts_below) / np.maximum(weights @ part_sizes, 1.0)[:, None]
    first_place = np.minimum((shares < quantile).sum(axis=1), len(places) - 1)
    return estimate, max(estimate, float(np.quantile(places[first_place], LEVEL)))


def ratio_bound(numerators: Float, denominators: Float, key: str = "") -> tuple[float, float]:
    """Return the ratio of two sums over parts, and its upper 95 % confidence bound; see `quantile_bound`.

    Args:
        numerators, denominators: (S,) of each part.
        key: of the random numbers.
    """
    if not denominators.sum() > 0.0:
        return 0.0, 0.0
    estimate = float(numerators.sum() / denominators.sum())
    weights = _draw_parts(len(denominators), key)
    ratios = (weights @ numerators) / np.maximum(weights @ denominators, _LEAST)
    ratios = ratios[weights @ denominators > 0.0]
    return estimate, max(estimate, float(np.quantile(ratios, LEVEL)))


def _draw_parts(parts: int, key: str) -> Float:
    """Return how often each part is drawn (draws, parts) in the bootstrap's draws with replacement."""
    rng = stream(0, "choice", key)
    return rng.multinomial(parts, np.full(parts, 1.0 / parts), size=_DRAWS).astype(np.float64)
