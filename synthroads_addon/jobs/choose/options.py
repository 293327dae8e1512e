"""Choosing among options: the cheapest that keep a tolerance, or the best that fit a time.

Each kind of error depends on the options of one knob alone, and the costs of several knobs add up, so that the cheapest
settings within a tolerance are the cheapest option of every knob that keeps its own.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...base.errors import InputError
from ...scenario.tolerance import error_text
from ..measure.errors import Errors

_LEAST = 1e-9


@dataclass(frozen=True)
class Option:
    """One setting of a knob (or, from `combine`, of all knobs) with its expected errors, cost and time.

    Attributes:
        changes: of the scenario: dotted path -> value.
        errors: expected error and its upper bound by `tolerance.KINDS`; a kind that isn't there has none.
        cost: what tells cheap from dear: the same on every machine, unlike the time.
        seconds: expected on this machine.
    """

    changes: Mapping[str, Any]
    errors: Errors
    cost: float
    seconds: float = 0.0

    def upper(self, kind: str) -> float:
        """Return the upper confidence bound of a kind of error; 0 for a kind that the option has no error of."""
        return self.errors.get(kind, (0.0, 0.0))[1]

    def keeps(self, limits: Mapping[str, float]) -> bool:
        """Return whether the upper bounds of all limited errors are within their limits."""
        return all(self.upper(kind) <= limit for kind, limit in limits.items())


Knobs = Sequence[Sequence[Option]]
"""Options of each knob; what no knob changes is one without a choice."""


def combine(options: Iterable[Option]) -> Option:
    """Return one option for several knobs together: changes and errors merged, costs and seconds summed."""
    combined_options = tuple(options)
    changes = {path: value for option in combined_options for path, value in option.changes.items()}
    errors = {kind: pair for option in combined_options for kind, pair in option.errors.items()}
    return Option(
        changes,
        errors,
        sum(member.cost for member in combined_options),
        sum(member.seconds for member in combined_options),
    )


def options_within(knobs: Knobs, limits: Mapping[str, float]) -> list[list[Option]]:
    """Return for each knob the options whose errors are within the limits.

    Raises:
        InputError: a knob has none; says what is the best to be had.
    """
    options_of_knobs = [[option for option in options if option.keeps(limits)] for options in knobs]
    if [] in options_of_knobs:
        raise _tolerance_error(knobs[options_of_knobs.index([])], limits)
    return options_of_knobs


def _tolerance_error(options: Sequence[Option], limits: Mapping[str, float]) -> InputError:
    """Return the InputError for limits that no option keeps, naming the best that can be had."""
    for kind, limit in limits.items():
        least_error = min(option.upper(kind) for option in options)
        if least_error > limit:
            text = f"can't be reached here: the smallest possible error is {error_text(kind, least_error)}"
            return InputError(f"tolerance.{kind}", limit, text)
    kinds = [kind for kind in limits if any(kind in option.errors for option in options)]
    nearest_option = min(
        options, key=lambda option: max(option.upper(kind) / max(limits[kind], _LEAST) for kind in kinds)
    )
    values = ", ".join(f"{kind}={error_text(kind, nearest_option.upper(kind))}" for kind in kinds)
    return InputError("tolerance", None, f"{' and '.join(kinds)} can't be reached together: the nearest is {values}")


def cheapest(knobs: Knobs, limits: Mapping[str, float]) -> Option:
    """Return the settings of the lowest total cost whose errors are within the limits.

    Raises:
        InputError: there are none; says what is the best to be had.
    """
    return combine(min(options, key=lambda option: option.cost) for options in options_within(knobs, limits))


def best_in_time(
    knobs: Knobs, seconds: float, reference: Mapping[str, float], limits: Mapping[str, float] | None = None
) -> Option:
    """Return the settings with the smallest largest error, relative to a reference, that take at most a time (s).

    Of several as good in that, those whose errors' sum is the smallest, and of these the fastest.

    Args:
        knobs: the options.
        seconds: that the job may take.
        reference: error of each kind that is as bad as the others'; a kind without one doesn't count.
        limits: a tolerance that is to be kept as well.

    Raises:
        InputError: not even the fastest settings fit, or none keeps the tolerance.
    """
    choices = list(map(combine, itertools.product(*options_within(knobs, limits or {}))))
    fitting_choices = [choice for choice in choices if choice.seconds <= seconds]
    if not fitting_choices:
        raise too_short_error(seconds, min(choice.seconds for choice in choices), bool(limits))
    return min(fitting_choices, key=lambda choice: _loss(choice, reference))


def too_short_error(seconds: float, fastest: float, has_tolerance: bool = False) -> InputError:
    """Return the InputError for a time budget that even the fastest settings exceed, in seconds."""
    condition = "that keep the tolerance " if has_tolerance else ""
    text = (
        f"too short: {max(seconds, 0.0):.0f} s of it can still be used, and the fastest settings {condition}take about "
    )
    return InputError("time_budget", None, f"{text}{fastest:.0f} s")


def _loss(choice: Option, reference: Mapping[str, float]) -> tuple[float, float, float]:
    """Return a choice's largest error relative to the reference, the sum of these, and its seconds, as a sort key."""
    ratios = [choice.errors.get(kind, (0.0, 0.0))[0] / max(base, _LEAST) for kind, base in reference.items()]
    return round(max(ratios, default=0.0), 6), round(sum(ratios), 6), choice.seconds
