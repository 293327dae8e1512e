"""Choosing by tables of costs and errors, whatever these are."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.choose.options import Option, best_in_time, cheapest, combine

KINDS = {"beam": ("position", "intensity"), "relief": ("relief",), "colour": ("colour", "layers")}
Table = list[list[Option]]
sizes = st.floats(0.0, 10.0, allow_subnormal=False)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Return options of knobs of which each has its own kinds of errors."""
    knobs = []
    for name, kinds in KINDS.items():
        options = []
        for number in range(draw(st.integers(1, 4))):
            errors = {kind: draw(sizes) for kind in kinds}
            found = {kind: (error, error * draw(st.floats(1.0, 2.0))) for kind, error in errors.items()}
            options.append(Option({name: number}, found, draw(sizes), draw(sizes)))
        knobs.append(options)
    return knobs


limits_of = st.dictionaries(st.sampled_from(sorted(itertools.chain(*KINDS.values()))), sizes, max_size=3)


def every(knobs: Table) -> list[Option]:
    return list(map(combine, itertools.product(*knobs)))


def keeps(choice: Option, limits: dict[str, float]) -> bool:
    return all(choice.errors[kind][1] <= limit for kind, limit in limits.items())


def loss(choice: Option) -> float:
    return max(estimate for estimate, _ in choice.errors.values())


@given(tables(), limits_of)
def test_the_cheapest_settings_that_keep_the_tolerance(knobs: Table, limits: dict[str, float]) -> None:
    possible = [choice for choice in every(knobs) if keeps(choice, limits)]
    if not possible:
        with pytest.raises(InputError, match=r"smallest possible error|can't be reached together"):
            cheapest(knobs, limits)
        return
    choice = cheapest(knobs, limits)
    assert keeps(choice, limits)
    assert choice.cost == pytest.approx(min(one.cost for one in possible))


@given(tables(), limits_of, st.floats(1.0, 5.0))
def test_a_looser_tolerance_costs_no_more(knobs: Table, limits: dict[str, float], factor: float) -> None:
    try:
        strict = cheapest(knobs, limits)
    except InputError:
        return
    loose = cheapest(knobs, {kind: limit * factor for kind, limit in limits.items()})
    assert loose.cost <= strict.cost


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
    knobs = [options]
    with pytest.raises(InputError, match=r"tolerance.position is 0.005: can't be reached here: .* 12 mm"):
        cheapest(knobs, {"position": 0.005})
    with pytest.raises(InputError, match="position and intensity can't be reached together"):
        cheapest(knobs, {"position": 0.02, "intensity": 0.02})
    with pytest.raises(InputError, match=r"time_budget: too short: 4 s .* take about 7 s"):
        best_in_time([*knobs, [Option({}, {}, 0.0, 2.0)]], 4.0, {})
    with pytest.raises(InputError, match="that keep the tolerance take about 9 s"):
        best_in_time(knobs, 6.0, {}, {"position": 0.02})
    assert best_in_time(knobs, 6.0, {}).changes == {"a": 1}
