"""Choosing by tables of costs and errors, whatever these are; and upper bounds of errors."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.choose.options import Choice, Option, best_in_time, cheapest
from synthroads_addon.jobs.measure.errors import quantile_bound, ratio_bound

KINDS = {"beam": ("position", "intensity"), "relief": ("relief",), "colour": ("colour", "layers")}
Table = dict[str, list[Option]]
sizes = st.floats(0.0, 10.0, allow_subnormal=False)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Return options of knobs of which each has its own kinds of errors."""
    knobs = {}
    for name, kinds in KINDS.items():
        options = []
        for number in range(draw(st.integers(1, 4))):
            errors = {kind: draw(sizes) for kind in kinds}
            found = {kind: (error, error * draw(st.floats(1.0, 2.0))) for kind, error in errors.items()}
            options.append(Option({name: number}, found, draw(sizes), draw(sizes)))
        knobs[name] = options
    return knobs


limits_of = st.dictionaries(st.sampled_from(sorted(itertools.chain(*KINDS.values()))), sizes, max_size=3)


def every(knobs: Table) -> list[Choice]:
    return [Choice(dict(zip(knobs, options, strict=True))) for options in itertools.product(*knobs.values())]


def keeps(choice: Choice, limits: dict[str, float]) -> bool:
    return all(choice.found[kind][1] <= limit for kind, limit in limits.items())


def cost(choice: Choice) -> float:
    return sum(option.cost for option in choice.options.values())


def loss(choice: Choice) -> float:
    return max(estimate for estimate, _ in choice.found.values())


@given(tables(), limits_of)
def test_the_cheapest_settings_that_keep_the_tolerance(knobs: Table, limits: dict[str, float]) -> None:
    possible = [choice for choice in every(knobs) if keeps(choice, limits)]
    if not possible:
        with pytest.raises(InputError, match=r"best to be had|can't be kept together"):
            cheapest(knobs, limits)
        return
    choice = cheapest(knobs, limits)
    assert keeps(choice, limits)
    assert cost(choice) == pytest.approx(min(map(cost, possible)))


@given(tables(), limits_of, st.floats(1.0, 5.0))
def test_a_looser_tolerance_costs_no_more(knobs: Table, limits: dict[str, float], factor: float) -> None:
    try:
        strict = cheapest(knobs, limits)
    except InputError:
        return
    loose = cheapest(knobs, {kind: limit * factor for kind, limit in limits.items()})
    assert cost(loose) <= cost(strict)


@given(tables(), limits_of, st.floats(0.0, 30.0), st.floats(0.0, 20.0))
def test_the_best_settings_that_fit_the_time(
    knobs: Table, limits: dict[str, float], seconds: float, more: float
) -> None:
    reference = dict.fromkeys(itertools.chain(*KINDS.values()), 1.0)
    possible = [one for one in every(knobs) if keeps(one, limits) and (one.seconds or 0.0) <= seconds]
    if not possible:
        with pytest.raises(InputError):
            best_in_time(knobs, seconds, reference, limits)
        return
    choice = best_in_time(knobs, seconds, reference, limits)
    assert keeps(choice, limits)
    assert choice.seconds is not None
    assert choice.seconds <= seconds
    assert loss(choice) == pytest.approx(min(map(loss, possible)), abs=1e-5)
    longer = best_in_time(knobs, seconds + more, reference, limits)
    assert loss(longer) <= loss(choice) + 1e-5


def test_what_no_settings_keep_is_said_with_the_best() -> None:
    options = [
        Option({"a": 1}, {"position": (0.02, 0.03), "intensity": (0.0, 0.01)}, 1.0, 5.0),
        Option({"a": 2}, {"position": (0.01, 0.012), "intensity": (0.0, 0.08)}, 2.0, 9.0),
    ]
    knobs = {"beam": options}
    with pytest.raises(InputError, match=r"tolerance.position is 0.005: can't be kept here: .* 12 mm"):
        cheapest(knobs, {"position": 0.005})
    with pytest.raises(InputError, match="position and intensity can't be kept together"):
        cheapest(knobs, {"position": 0.02, "intensity": 0.02})
    with pytest.raises(InputError, match=r"time_budget: too short: 4 s .* take about 7 s"):
        best_in_time(knobs | {"rest": [Option({}, {}, 0.0, 2.0)]}, 4.0, {})
    with pytest.raises(InputError, match="that keep the tolerance take about 9 s"):
        best_in_time(knobs, 6.0, {}, {"position": 0.02})
    assert best_in_time(knobs, 6.0, {}).changes == {"a": 1}


def test_the_bound_of_a_quantile_holds_for_what_is_drawn_alike() -> None:
    held, tight = 0, 0
    rng = np.random.default_rng(1)
    # Values within a part share its scale, as those of one place do.
    scale = np.exp(0.5 * rng.standard_normal(100_000))
    true = float(np.quantile(np.abs(rng.standard_normal((100_000, 40)) * scale[:, None]), 0.95))
    for _ in range(60):
        parts = [np.abs(rng.standard_normal(200)) * np.exp(0.5 * rng.standard_normal()) for _ in range(48)]
        estimate, bound = quantile_bound(parts, 0.95)
        assert bound >= estimate
        held += bound >= true
        tight += estimate >= true
    assert held >= 51
    assert tight < 45
    assert quantile_bound([np.empty(0)], 0.95) == (0.0, 0.0)
    assert quantile_bound([np.zeros(5)] * 4, 0.95) == (0.0, 0.0)


def test_the_bound_of_a_ratio_grows_with_how_uneven_the_parts_are() -> None:
    even, below = np.full(40, 5.0), np.full(40, 100.0)
    uneven = np.zeros(40)
    uneven[:4] = 50.0
    assert ratio_bound(even, below) == (0.05, pytest.approx(0.05))
    estimate, bound = ratio_bound(uneven, below)
    assert estimate == 0.05
    assert 0.07 < bound < 0.15
    assert ratio_bound(np.zeros(3), np.zeros(3)) == (0.0, 0.0)
