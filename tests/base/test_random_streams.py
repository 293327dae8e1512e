"""Upper bounds of quantiles and ratios over parts whose values are alike."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.random_streams import quantile_bound, ratio_bound


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
