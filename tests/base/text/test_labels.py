"""Texts that would cover each other are moved apart."""

from itertools import combinations

import numpy as np

from synthroads_addon.base.text.labels import apart


def covers(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Return whether two boxes (x, y, width, height) share an area."""
    return all(one[i] < other[i] + other[i + 2] - 1e-9 and other[i] < one[i] + one[i + 2] - 1e-9 for i in (0, 1))


def test_no_text_covers_another_and_those_with_room_stay() -> None:
    rng = np.random.default_rng(3)
    places = [tuple(place) for place in rng.uniform(0.0, 120.0, (40, 2)).tolist()]
    sizes = [tuple(size) for size in rng.uniform((10.0, 5.0), (60.0, 9.0), (40, 2)).tolist()]
    moved = apart(places, sizes)
    boxes = [(*place, *size) for place, size in zip(moved, sizes, strict=True)]
    assert not any(covers(one, other) for one, other in combinations(boxes, 2))
    assert any(covers((*a, *s), (*b, *t)) for (a, s), (b, t) in combinations(zip(places, sizes, strict=True), 2))
    for (x, y), (before_x, before_y) in zip(moved, places, strict=True):
        assert (x, y >= before_y) == (before_x, True)
    assert moved[0] == places[0]
    assert apart([(0.0, 0.0), (0.0, 20.0)], [(30.0, 10.0)] * 2) == [(0.0, 0.0), (0.0, 20.0)]
