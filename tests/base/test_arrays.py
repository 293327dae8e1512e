"""Arrays of values that repeat."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.arrays import without_repeats


@given(st.lists(st.tuples(st.floats(0.0, 9.0), st.integers(1, 5))))
def test_values_come_back_by_their_indices(runs: list[tuple[float, int]]) -> None:
    values = np.array([value for value, count in runs for _ in range(count)])
    once, index = without_repeats(values)
    assert np.array_equal(once[index], values)
    assert len(once) <= max(len(values), 1)


@pytest.mark.parametrize(("count", "left"), [(1, 100), (2, 100), (40, 100)])
def test_what_repeats_is_left_out(count: int, left: int) -> None:
    once, _ = without_repeats(np.repeat(np.arange(100.0), count))
    assert len(once) == left


def test_what_is_no_number_equals_nothing() -> None:
    once, index = without_repeats(np.array([1.0, 1.0, 1.0, np.nan, np.nan, 2.0, 2.0, 2.0, 2.0, 2.0]))
    assert np.array_equal(once, [1.0, np.nan, np.nan, 2.0], equal_nan=True)
    assert index.tolist() == [0, 0, 0, 1, 2, 3, 3, 3, 3, 3]
