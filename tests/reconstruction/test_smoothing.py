"""Places between two rows of points are known no better than that, however long the rows run beside them."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.reconstruction.lines import _on_a_row
from synthroads_addon.reconstruction.smoothing import interval_mean, mean_with_std

TRUE = 7.3


def between_rows(row: np.ndarray, spacing: float) -> np.ndarray:
    """Return where an edge at `TRUE` seems to be in stretches whose rows (K,) are a spacing (m) apart: midway."""
    return row + spacing * (np.floor((TRUE - row) / spacing) + 0.5)


@pytest.mark.parametrize("phase", [0.01, 0.06, 0.12, 0.24])
def test_rows_beside_an_edge_say_once_what_they_say(phase: float) -> None:
    seen = between_rows(np.full(90, phase), 0.25) + np.random.default_rng(1).normal(0.0, 0.002, 90)
    mean, std = interval_mean(seen, np.full(90, 0.25))
    assert std == pytest.approx(0.25 / np.sqrt(12.0), rel=0.15)
    assert abs(mean - TRUE) < 2.0 * std
    assert mean_with_std(seen)[1] < 0.01  # what scatter alone says


def test_rows_that_wander_tell_an_edge_better_than_they_are_apart() -> None:
    seen = between_rows(np.linspace(0.0, 0.6, 90), 0.25)
    mean, std = interval_mean(seen, np.full(90, 0.25))
    assert std < 0.04
    assert abs(mean - TRUE) < 3.0 * std


def test_a_few_faults_and_nothing_at_all() -> None:
    seen = between_rows(np.full(60, 0.2), 0.25)
    seen[[3, 17, 40]] += 2.0
    mean, _ = interval_mean(seen, np.full(60, 0.25))
    assert abs(mean - TRUE) < 0.13
    assert interval_mean(np.full(4, np.nan), np.zeros(4)) == (pytest.approx(np.nan, nan_ok=True), np.inf)


def test_a_line_that_one_row_is_partly_on_lies_anywhere_about_that_row() -> None:
    offset = np.concatenate([np.full(20, 2.5), 2.75 + np.linspace(-0.01, 0.01, 20), np.full(20, 3.0)])
    middle, apart = _on_a_row(offset, 31, 40)  # its outer half is marked, by a wobble
    assert middle == pytest.approx(2.755, abs=0.01)
    assert apart == pytest.approx(0.25)


def test_rows_that_only_seem_to_wander_as_the_axis_does_say_no_more_than_rows_beside_it() -> None:
    axis = 0.07 * np.sin(np.linspace(0.0, 12.0, 90))
    seen = between_rows(np.full(90, 0.05), 0.25) + axis  # rows and edge keep their distance
    mean, std = interval_mean(seen, np.full(90, 0.25), 0.05)
    assert std > 0.05
    assert abs(mean - TRUE) < 2.5 * std
    assert interval_mean(seen, np.full(90, 0.25))[1] < 0.8 * std
