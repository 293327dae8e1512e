"""Stretches along the road: taken, free, and how something finds room between them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.sampling.placing.ranges import (
    Reservations,
    draw_start,
    free_ranges,
    lengthen_range,
    merge_ranges,
    nearest_free,
)

STRETCHES = st.lists(
    st.tuples(st.integers(0, 100), st.integers(1, 20)).map(lambda pair: (float(pair[0]), float(sum(pair)))), max_size=12
)


@given(STRETCHES, st.integers(0, 100), st.integers(1, 30))
def test_what_is_free_is_what_none_has_taken(stretches: list[tuple[float, float]], start: int, length: int) -> None:
    taken = Reservations(stretches)
    low, high = float(start), float(start + length)
    overlaps = any(a < high and b > low for a, b in stretches)
    assert taken.is_free(low, high) != overlaps
    middles = np.arange(120) + 0.5
    covered = np.array([any(a < middle < b for a, b in stretches) for middle in middles])
    free = free_ranges(0.0, 120.0, taken)
    assert [any(a < middle < b for a, b in free) for middle in middles] == (~covered).tolist()
    assert all(b > a for a, b in free)


def test_free_of_several() -> None:
    assert free_ranges(0.0, 10.0, Reservations([(1.0, 2.0), (4.0, 5.0)]), Reservations([(4.5, 7.0)])) == [
        (0.0, 1.0),
        (2.0, 4.0),
        (7.0, 10.0),
    ]
    assert free_ranges(0.0, 10.0) == [(0.0, 10.0)]
    assert free_ranges(0.0, 10.0, Reservations([(-5.0, 20.0)])) == []


def test_a_place_is_drawn_evenly_from_all_that_have_room() -> None:
    rng = np.random.default_rng(1)
    ranges = [(0.0, 4.0), (10.0, 11.5), (20.0, 26.0)]
    starts = np.array([draw_start(rng, ranges, 2.0) for _ in range(3000)])
    first, last = (starts >= 0.0) & (starts <= 2.0), (starts >= 20.0) & (starts <= 24.0)
    assert (first | last).all()
    assert 0.30 < first.mean() < 0.37
    assert starts[last].max() > 23.9
    assert draw_start(rng, ranges, 7.0) is None
    assert draw_start(rng, ranges, 6.0) == 20.0


def test_the_nearest_place() -> None:
    taken = Reservations([(9.0, 12.0)])
    assert nearest_free(5.0, 0.5, 3.0, 100.0, taken) == 5.0
    assert nearest_free(10.0, 0.5, 3.0, 100.0, taken) == 8.5
    assert nearest_free(11.0, 0.5, 3.0, 100.0, taken) == 12.5
    assert nearest_free(10.5, 0.5, 1.0, 100.0, taken) is None
    assert nearest_free(0.2, 0.5, 3.0, 100.0, Reservations([(0.0, 1.0)])) == 1.5
    # Nothing is moved off the road.
    assert nearest_free(99.8, 0.5, 3.0, 100.0, Reservations([(98.0, 99.6)])) == 97.5


def test_ranges_are_joined_and_made_longer() -> None:
    assert merge_ranges([(5.0, 6.0), (0.0, 3.0), (2.0, 4.0), (8.0, 9.0)], 1.5) == [(0.0, 6.0), (8.0, 9.0)]
    assert lengthen_range(10.0, 20.0, 30.0, 0.0, 100.0) == (0.0, 30.0)
    assert lengthen_range(50.0, 60.0, 30.0, 0.0, 100.0) == (40.0, 70.0)
    assert lengthen_range(95.0, 100.0, 30.0, 0.0, 100.0) == (70.0, 100.0)
    assert lengthen_range(40.0, 80.0, 30.0, 0.0, 100.0) == (40.0, 80.0)
    assert lengthen_range(5.0, 10.0, 30.0, 0.0, 20.0) == (0.0, 20.0)
