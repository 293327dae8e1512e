"""Tolerances and times in words, and as fields of a scenario."""

from __future__ import annotations

import math
from argparse import Namespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from headless.options import choice_changes
from headless.tradeoff_table import ROW_TITLES
from synthroads_addon.base.errors import InputError
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.scenario.tolerance import KINDS, TIMES, Tolerance, error_text, parse_tolerance, with_unit


def test_every_kind_is_a_field_and_a_column() -> None:
    assert list(KINDS) == list(Tolerance.model_fields)
    assert {kind.column for kind in KINDS.values()} == ROW_TITLES.keys() - {"colour_median"}


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("height=5mm,colour=2,intensity=5%", {"height": 0.005, "colour": 2.0, "intensity": 0.05}),
        (" position = 1.5 cm , labels=0.5 ", {"position": 0.015, "labels": 0.5}),
        ("height=0.01m", {"height": 0.01}),
        ("relief=500um,layers=2e-2", {"relief": 0.0005, "layers": 0.02}),
        ("density=3‰", {"density": 0.003}),
    ],
)
def test_tolerances_in_words(text: str, data: dict[str, float]) -> None:
    assert parse_tolerance(text) == data


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("heigth=5mm", "did you mean 'height'"),
        ("height=5", "has no unit"),
        ("height=5kg", "has the unit 'kg': must be a number with a unit of um, µm, mm, cm, m"),
        ("intensity=5mm", "has the unit 'mm'"),
        ("colour=2%", "must be a number without a unit"),
        ("labels=120%", "labels is 1.2: must be less than or equal to 1"),
        ("height=-1mm", "greater than or equal to 0"),
        ("height=5mm,height=2mm", "names height twice"),
        ("height", "must be KIND=VALUE"),
        ("", "must be KIND=VALUE"),
        ("height=nanmm", "must be a number"),
        ("height=1e400mm", "height"),
        ("height=,colour=2", "must be KIND=VALUE"),
    ],
)
def test_wrong_words_are_refused(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_tolerance(text)
    assert said in str(caught.value)


@given(st.floats(1e-6, 9.9), st.sampled_from(sorted(KINDS["height"].units)))
def test_units_are_only_words(value: float, unit: str) -> None:
    text = f"height={value / KINDS['height'].units[unit]:.12g}{unit}"
    assert parse_tolerance(text)["height"] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize(("text", "seconds"), [("60s", 60), ("2min", 120), ("1.5 h", 5400), ("90", 90)])
def test_times_in_words(text: str, seconds: float) -> None:
    assert with_unit("--time-budget", text, TIMES) == seconds
    assert load_scenario("rq31-600m", [f'time_budget="{text}"']).time_budget == seconds


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("time_budget=2days", "has the unit 'days'"),
        ("time_budget=0", "greater than 0"),
        ("time_budget=-1s", "greater than 0"),
        ("tolerance.height=5kg", "tolerance: height has the unit 'kg'"),
        ("tolerance.hight=1", "did you mean 'height'"),
        ("tolerance=hight=1mm", "hight"),
    ],
)
def test_wrong_fields_are_refused(change: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("rq31-600m", [change])
    assert said in str(caught.value)


def test_a_scenario_takes_the_same_words() -> None:
    found = load_scenario("rq31-600m", ["tolerance=height=5mm,intensity=5%,colour=2"])
    assert found.tolerance is not None
    assert found.tolerance.limits() == {"height": 0.005, "intensity": 0.05, "colour": 2.0}
    assert found.chooses
    assert load_scenario("rq31-600m", ["tolerance.height=5mm", "tolerance.colour=2"]).tolerance is not None
    assert not load_scenario("rq31-600m").chooses


def test_the_command_line_says_the_same() -> None:
    words = Namespace(tolerance="height=5mm", time_budget="2min", fidelity=None)
    found = load_scenario("rq31-600m", choice_changes(words))
    assert (found.tolerance and found.tolerance.height, found.time_budget) == (0.005, 120.0)
    assert choice_changes(Namespace(tolerance=None, time_budget=None, fidelity="draft")) == []
    with pytest.raises(InputError, match="--fidelity is 'high'"):
        choice_changes(Namespace(tolerance="height=5mm", time_budget=None, fidelity="high"))


def test_errors_are_shown_in_their_units() -> None:
    assert error_text("height", 0.005) == "5 mm"
    assert error_text("intensity", 0.0512) == "5.12 %"
    assert error_text("colour", 2.0) == "2"
    assert not math.isnan(float(error_text("layers", 0.01)))
