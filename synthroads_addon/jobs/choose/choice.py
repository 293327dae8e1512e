"""Choosing settings: the cheapest that keep a tolerance, or the best that fit a time.

The knobs stand on ladders. Each kind of error depends on one ladder alone, and the costs of several ladders add up, so
that the cheapest settings within a tolerance are the cheapest rung of every ladder that keeps its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.random_streams import stream
from ...scenario.tolerance import shown

Float = NDArray[np.float64]

LEVEL = 0.95
"""Confidence of the upper bounds that tolerances are held against."""
_DRAWS = 400
_STEPS = 512
"""Places at which a distribution's shares are counted."""
_LEAST = 1e-9


@dataclass(frozen=True)
class Rung:
    """One setting of a ladder's knobs.

    Attributes:
        changes: of the scenario: dotted path -> value.
        errors: expected, by `tolerance.KINDS`; a kind that isn't there has none.
        bounds: what these won't exceed, with the confidence `LEVEL`; the errors themselves where they are exact.
        cost: what tells cheap from dear: the same on every machine, unlike the time.
        seconds: expected on this machine; None if not known.
    """

    changes: Mapping[str, Any]
    errors: Mapping[str, float]
    bounds: Mapping[str, float]
    cost: float
    seconds: float | None = None


@dataclass(frozen=True)
class Ladder:
    """Settings of some knobs, of which one is taken."""

    name: str
    rungs: tuple[Rung, ...]


@dataclass(frozen=True)
class Chosen:
    """One rung of every ladder.

    Attributes:
        rungs: by name of the ladder.
        apart: seconds that the job takes besides.
    """

    rungs: Mapping[str, Rung]
    apart: float = field(default=0.0)

    @property
    def changes(self) -> dict[str, Any]:
        """Return the changes of the scenario."""
        return {path: value for rung in self.rungs.values() for path, value in rung.changes.items()}

    @property
    def errors(self) -> dict[str, float]:
        """Return the expected errors by kind."""
        return {name: error for rung in self.rungs.values() for name, error in rung.errors.items()}

    @property
    def bounds(self) -> dict[str, float]:
        """Return what the errors won't exceed."""
        return {name: error for rung in self.rungs.values() for name, error in rung.bounds.items()}

    @property
    def seconds(self) -> float | None:
        """Return the expected time, if it is known."""
        parts = [rung.seconds for rung in self.rungs.values()]
        return None if None in parts else self.apart + sum(part for part in parts if part is not None)


def within(ladders: Iterable[Ladder], limits: Mapping[str, float]) -> list[Ladder]:
    """Return the ladders with only the rungs that keep a tolerance.

    Raises:
        InputError: a ladder has none; says what is the best to be had.
    """
    result = []
    for ladder in ladders:
        kept = tuple(rung for rung in ladder.rungs if _keeps(rung, limits))
        if not kept:
            raise _impossible(ladder, limits)
        result.append(Ladder(ladder.name, kept))
    return result


def _keeps(rung: Rung, limits: Mapping[str, float]) -> bool:
    return all(rung.bounds.get(name, 0.0) <= limit for name, limit in limits.items())


def _impossible(ladder: Ladder, limits: Mapping[str, float]) -> InputError:
    """Return what to say of a tolerance that no rung keeps: the best of each kind, or of all together."""
    for name, limit in limits.items():
        best = min(rung.bounds.get(name, 0.0) for rung in ladder.rungs)
        if best > limit:
            text = f"can't be kept here: the best to be had is {shown(name, best)}"
            return InputError(f"tolerance.{name}", limit, text)
    own = [name for name in limits if any(name in rung.bounds for rung in ladder.rungs)]

    def worst(rung: Rung) -> float:
        return max(rung.bounds.get(name, 0.0) / max(limits[name], _LEAST) for name in own)

    best_of_all = min(ladder.rungs, key=worst)
    said = ", ".join(f"{name}={shown(name, best_of_all.bounds.get(name, 0.0))}" for name in own)
    return InputError("tolerance", None, f"{' and '.join(own)} can't be kept together: the nearest is {said}")


def cheapest(ladders: Iterable[Ladder], limits: Mapping[str, float], apart: float = 0.0) -> Chosen:
    """Return the cheapest settings that keep a tolerance.

    Raises:
        InputError: there are none; says what is the best to be had.
    """
    return Chosen(
        {ladder.name: min(ladder.rungs, key=lambda rung: rung.cost) for ladder in within(ladders, limits)}, apart
    )


def best_in_time(
    ladders: Sequence[Ladder],
    seconds: float,
    reference: Mapping[str, float],
    limits: Mapping[str, float] | None = None,
    apart: float = 0.0,
) -> Chosen:
    """Return the best settings that fit a time: their largest error, as a multiple of a reference, is the smallest.

    Of several as good in that, those whose errors' sum is the smallest, and of these the fastest.

    Args:
        ladders: all rungs' seconds are known.
        seconds: that the job may take.
        reference: error of each kind that is as bad as the others'; a kind without one doesn't count.
        limits: a tolerance that is to be kept as well.
        apart: see `Chosen`.

    Raises:
        InputError: not even the fastest settings fit, or none keeps the tolerance.
    """
    allowed = within(ladders, limits or {})
    choices = [
        Chosen(dict(zip([ladder.name for ladder in allowed], rungs, strict=True)), apart)
        for rungs in itertools.product(*(ladder.rungs for ladder in allowed))
    ]
    fitting = [choice for choice in choices if (choice.seconds or 0.0) <= seconds]
    if not fitting:
        fastest = min(choice.seconds or 0.0 for choice in choices)
        raise too_short(seconds, fastest, bool(limits))
    return min(fitting, key=lambda choice: _loss(choice, reference))


def too_short(seconds: float, fastest: float, tolerance: bool = False) -> InputError:
    """Return what to say of a time that nothing fits."""
    which = "that keep the tolerance " if tolerance else ""
    left = f"{max(seconds, 0.0):.0f} s of it can still be used"
    text = f"too short: {left}, and the fastest settings {which}take about {fastest:.0f} s"
    return InputError("time_budget", None, text)


def _loss(choice: Chosen, reference: Mapping[str, float]) -> tuple[float, float, float]:
    errors = choice.errors
    ratios = [errors.get(name, 0.0) / max(base, _LEAST) for name, base in reference.items()]
    return round(max(ratios, default=0.0), 6), round(sum(ratios), 6), choice.seconds or 0.0


def quantile_bound(parts: Sequence[Float], quantile: float, key: str = "") -> tuple[float, float]:
    """Return a quantile of all values and its upper confidence bound, drawn from whole parts.

    The parts (stretches of a path) are drawn anew, with replacement: values within a part are alike, so that their
    number says less than that of the parts. Efron & Tibshirani 1993, An Introduction to the Bootstrap.

    Args:
        parts: values (N,) of each part.
        quantile: 0 to 1.
        key: of the random numbers.
    """
    every = np.concatenate([*parts, np.empty(0)])
    if not len(every):
        return 0.0, 0.0
    estimate = float(np.quantile(every, quantile))
    places = np.unique(np.quantile(every, np.linspace(0.0, 1.0, _STEPS)))
    below = np.stack([np.searchsorted(np.sort(part), places, side="right") for part in parts]).astype(np.float64)
    total = np.array([len(part) for part in parts], dtype=np.float64)
    weights = _drawn(len(parts), key)
    share = (weights @ below) / np.maximum(weights @ total, 1.0)[:, None]
    first = np.minimum((share < quantile).sum(axis=1), len(places) - 1)
    return estimate, max(estimate, float(np.quantile(places[first], LEVEL)))


def ratio_bound(above: Float, below: Float, key: str = "") -> tuple[float, float]:
    """Return the ratio of two sums over parts, and its upper confidence bound; see `quantile_bound`.

    Args:
        above, below: (S,) of each part.
        key: of the random numbers.
    """
    if not below.sum() > 0.0:
        return 0.0, 0.0
    estimate = float(above.sum() / below.sum())
    weights = _drawn(len(below), key)
    ratios = (weights @ above) / np.maximum(weights @ below, _LEAST)
    ratios = ratios[weights @ below > 0.0]
    return estimate, max(estimate, float(np.quantile(ratios, LEVEL)))


def _drawn(parts: int, key: str) -> Float:
    """Return how often each part is drawn (draws, parts)."""
    rng = stream(0, "choice", key)
    return rng.multinomial(parts, np.full(parts, 1.0 / parts), size=_DRAWS).astype(np.float64)
