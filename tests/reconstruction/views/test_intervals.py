"""Intervals reach to rivals and are narrow where views agree; views of the same evidence count as one."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.views.fusion import fuse
from synthroads_addon.reconstruction.views.intervals import SLIPS, _quantile, half_width
from synthroads_addon.reconstruction.views.view import View

STATIONS: Float = 5.0 * np.arange(40) + 2.5


def interval(share: float, *views: tuple[str, float, float], more: float = 0.0) -> float:
    """Return the half-width, m, of the interval about the axis of views (name, offset, deviation), everywhere alike."""
    factor = {0.68: 1.0, 0.95: 1.96}[share]
    everywhere = np.ones(len(STATIONS))
    axis = fuse(STATIONS, [View(name, offset * everywhere, std * everywhere) for name, offset, std in views])
    return float(np.median(half_width(axis, share, factor, more)))


def test_views_that_agree_say_what_their_deviations_say() -> None:
    agreeing = ("lines", 0.0, 0.2), ("extent", 0.1, 0.8), ("cross-profile", 0.0, 0.25)
    assert interval(0.68, *agreeing) < 0.25
    assert interval(0.95, *agreeing) < 0.45


def test_a_rival_widens_the_interval_until_it_reaches_there() -> None:
    rival = ("lines", 0.0, 0.1), ("brightness", 2.0, 0.25), ("extent", 2.0, 0.6)
    assert interval(0.95, *rival) > 1.9
    assert interval(0.95, *rival[:1], ("brightness", 0.1, 0.25), ("extent", 0.1, 0.6)) < 0.35


@pytest.mark.parametrize(("share", "factor"), [(0.68, 0.994), (0.95, 1.96)])
def test_of_sure_views_the_intervals_are_those_of_a_normal_distribution(share: float, factor: float) -> None:
    kinds = "lines", "brightness", "extent", "network"
    found = interval(share, *((kind, 0.0, 0.4) for kind in kinds), more=0.3)
    assert found == pytest.approx(factor * np.hypot(0.2, 0.3), rel=0.02)


def test_a_view_alone_may_have_slipped() -> None:
    assert interval(0.68, ("lines", 0.0, 0.1)) == pytest.approx(0.12, abs=0.03)
    assert interval(0.95, ("lines", 0.0, 0.1)) > 1.0
    assert pytest.approx(0.1) == SLIPS


def test_views_of_the_same_evidence_slip_together() -> None:
    same = interval(0.95, ("brightness", 0.0, 0.25), ("skeleton", 0.0, 0.25))
    other = interval(0.95, ("brightness", 0.0, 0.25), ("lines", 0.0, 0.25))
    assert other < 0.5 * same


def test_what_all_of_the_axis_is_off_by_is_added() -> None:
    agreeing = ("lines", 0.0, 0.1), ("extent", 0.0, 0.6), ("brightness", 0.0, 0.25)
    assert interval(0.68, *agreeing, more=0.3) == pytest.approx(np.hypot(0.3, 0.1), abs=0.08)


def test_where_nothing_is_seen_the_deviation_alone_counts() -> None:
    offsets = np.where((STATIONS > 80.0) & (STATIONS < 120.0), np.nan, 0.0)
    axis = fuse(STATIONS, [View("lines", offsets, np.where(np.isfinite(offsets), 0.1, np.inf))])
    gap = np.isnan(offsets)
    assert half_width(axis, 0.95, 1.96)[gap] == pytest.approx(1.96 * axis.std[gap])
    nothing = fuse(STATIONS, [View("lines", np.full(40, np.nan), np.full(40, np.inf))])
    assert np.isinf(half_width(nothing, 0.95, 1.96)).all()


def test_a_narrow_density_has_its_share_within_the_middle_cell() -> None:
    step = 0.05
    cells = np.zeros((2, 5))
    cells[0] = [0.0, 0.0, 1.0, 0.0, 0.0]
    cells[1] = [0.0, 0.2, 0.6, 0.2, 0.0]
    # A density that is even within cells: the middle one reaches half a step to either side.
    assert _quantile(cells, 0.68) == pytest.approx([0.68 * 0.5 * step, (0.5 + 0.08 / 0.4) * step])
    assert _quantile(cells, 0.3) == pytest.approx([0.3 * 0.5 * step, 0.5 * 0.5 * step])
