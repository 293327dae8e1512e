"""Crops of two domains with parts of each other."""

from __future__ import annotations

import numpy as np

from ml.data.classes import IGNORED
from ml.data.exchange import exchange_classes
from ml.data.samples import Crop


def crop(labels: list[int], strength: float, *, at: float, color: bool = False) -> Crop:
    """Return a crop on a line along x, far from the origin, whose points are told by their intensity."""
    count = len(labels)
    coord = np.zeros((count, 3), dtype=np.float32)
    coord[:, 0] = at + np.arange(count)
    return Crop(
        coord,
        np.full(count, strength, dtype=np.float32),
        np.full((count, 3), strength, dtype=np.float32) if color else None,
        np.array(labels, dtype=np.int16),
    )


def test_each_crop_has_its_own_points_and_half_of_the_others_classes() -> None:
    one, other = crop([0, 0, 1, 2, 3], 0.25, at=100.0), crop([IGNORED, 1, 1, 2, IGNORED], 0.75, at=-300.0)
    chosen: list[set[int]] = []
    for seed in range(20):
        first, second = exchange_classes(one, other, np.random.default_rng(seed))
        for mixed, own, guest in ((first, one, other), (second, other, one)):
            assert np.array_equal(mixed.segment[:5], own.segment)
            assert mixed.strength is not None
            assert guest.strength is not None
            assert set(mixed.strength[5:].tolist()) == {guest.strength[0]}
            laid = set(mixed.segment[5:].tolist())
            classes = {label for label in guest.segment.tolist() if label != IGNORED}
            assert len(laid) == -(-len(classes) // 2)
            assert laid <= classes
            assert all((mixed.segment[5:] == label).sum() == (guest.segment == label).sum() for label in laid)
        chosen.append(set(first.segment[5:].tolist()))
        assert np.abs(first.coord).max() < 5  # both about their middles
        assert first.coord.dtype == np.float32
    assert len({frozenset(each) for each in chosen}) > 1


def test_without_labels_nothing_is_laid_in() -> None:
    one, nothing = crop([0, 1], 0.25, at=0.0), crop([IGNORED, IGNORED], 0.5, at=0.0)
    first, second = exchange_classes(one, nothing, np.random.default_rng(1))
    assert len(first) == 2
    assert len(second) == 3


def test_what_one_lacks_is_missing_in_both() -> None:
    first, second = exchange_classes(
        crop([0], 0.1, at=0.0, color=True), crop([1], 0.2, at=0.0), np.random.default_rng(1)
    )
    assert first.color is None
    assert second.color is None
    assert first.strength is not None
