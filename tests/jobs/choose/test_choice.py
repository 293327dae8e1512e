"""Choosing by tables of costs and errors, whatever these are; and upper bounds of errors."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.choose.choice import (
    Chosen,
    Ladder,
    Rung,
    best_in_time,
    cheapest,
    quantile_bound,
    ratio_bound,
)

KINDS = {"beam": ("position", "intensity"), "relief": ("relief",), "colour": ("colour", "layers")}
sizes = st.floats(0.0, 10.0, allow_subnormal=False)


@st.composite
def tables(draw: st.DrawFn) -> list[Ladder]:
    """Return ladders of which each has its own kinds of errors."""
    found = []
    for name, kinds in KINDS.items():
        rungs = []
        for number in range(draw(st.integers(1, 4))):
            errors = {kind: draw(sizes) for kind in kinds}
            bounds = {kind: error * draw(st.floats(1.0, 2.0)) for kind, error in errors.items()}
            rungs.append(Rung({name: number}, errors, bounds, draw(sizes), draw(sizes)))
        found.append(Ladder(name, tuple(rungs)))
    return found


limits_of = st.dictionaries(st.sampled_from(sorted(itertools.chain(*KINDS.values()))), sizes, max_size=3)


def every(ladders: list[Ladder]) -> list[Chosen]:
    names = [ladder.name for ladder in ladders]
    return [
        Chosen(dict(zip(names, rungs, strict=True))) for rungs in itertools.product(*(one.rungs for one in ladders))
    ]


def keeps(choice: Chosen, limits: dict[str, float]) -> bool:
    return all(choice.bounds[kind] <= limit for kind, limit in limits.items())


def cost(choice: Chosen) -> float:
    return sum(rung.cost for rung in choice.rungs.values())


def loss(choice: Chosen) -> float:
    return max(choice.errors.values())


@given(tables(), limits_of)
def test_the_cheapest_settings_that_keep_the_tolerance(ladders: list[Ladder], limits: dict[str, float]) -> None:
    possible = [choice for choice in every(ladders) if keeps(choice, limits)]
    if not possible:
        with pytest.raises(InputError, match=r"best to be had|can't be kept together"):
            cheapest(ladders, limits)
        return
    choice = cheapest(ladders, limits)
    assert keeps(choice, limits)
    assert cost(choice) == pytest.approx(min(map(cost, possible)))


@given(tables(), limits_of, st.floats(1.0, 5.0))
def test_a_looser_tolerance_costs_no_more(ladders: list[Ladder], limits: dict[str, float], factor: float) -> None:
    try:
        strict = cheapest(ladders, limits)
    except InputError:
        return
    loose = cheapest(ladders, {kind: limit * factor for kind, limit in limits.items()})
    assert cost(loose) <= cost(strict)


@given(tables(), limits_of, st.floats(0.0, 30.0), st.floats(0.0, 20.0))
def test_the_best_settings_that_fit_the_time(
    ladders: list[Ladder], limits: dict[str, float], seconds: float, more: float
) -> None:
    reference = dict.fromkeys(itertools.chain(*KINDS.values()), 1.0)
    possible = [one for one in every(ladders) if keeps(one, limits) and (one.seconds or 0.0) <= seconds]
    if not possible:
        with pytest.raises(InputError):
            best_in_time(ladders, seconds, reference, limits)
        return
    choice = best_in_time(ladders, seconds, reference, limits)
    assert keeps(choice, limits)
    assert choice.seconds is not None
    assert choice.seconds <= seconds
    assert loss(choice) == pytest.approx(min(map(loss, possible)), abs=1e-5)
    longer = best_in_time(ladders, seconds + more, reference, limits)
    assert loss(longer) <= loss(choice) + 1e-5


def test_what_no_settings_keep_is_said_with_the_best() -> None:
    rungs = (
        Rung({"a": 1}, {"position": 0.02}, {"position": 0.03, "intensity": 0.01}, 1.0, 5.0),
        Rung({"a": 2}, {"position": 0.01}, {"position": 0.012, "intensity": 0.08}, 2.0, 9.0),
    )
    ladder = [Ladder("beam", rungs)]
    with pytest.raises(InputError, match=r"tolerance.position is 0.005: can't be kept here: .* 12 mm"):
        cheapest(ladder, {"position": 0.005})
    with pytest.raises(InputError, match="position and intensity can't be kept together"):
        cheapest(ladder, {"position": 0.02, "intensity": 0.02})
    with pytest.raises(InputError, match=r"time_budget: too short: 4 s .* take about 7 s"):
        best_in_time(ladder, 4.0, {}, apart=2.0)
    with pytest.raises(InputError, match="that keep the tolerance take about 9 s"):
        best_in_time(ladder, 6.0, {}, {"position": 0.02})
    assert best_in_time(ladder, 6.0, {}).changes == {"a": 1}


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
