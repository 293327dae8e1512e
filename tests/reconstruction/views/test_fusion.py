"""Views that agree are averaged by their deviations; one that is surer but alone gives way, and rivals are named."""

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.views.fusion import fuse, mean_axis
from synthroads_addon.reconstruction.views.view import View

STATIONS: Float = 5.0 * np.arange(40) + 2.5


def view(name: str, offset: float | Float, std: float) -> View:
    """Return a view with one deviation everywhere; NaN is unseen."""
    offsets = np.broadcast_to(np.asarray(offset, dtype=float), STATIONS.shape).copy()
    return View(name, offsets, np.where(np.isfinite(offsets), std, np.inf))


def test_agreeing_views_are_averaged_by_their_variances() -> None:
    axis = fuse(STATIONS, [view("a", 0.0, 0.1), view("b", 0.3, 0.2)])
    assert axis.offsets == pytest.approx(0.06, abs=1e-6)
    assert axis.std == pytest.approx(np.sqrt(1.8 / 125.0), rel=0.02)  # widened by the views' scatter, chi2 1.8
    assert all(member.all() for member in axis.members.values())
    assert not axis.open.any()


def test_one_sure_view_gives_way_to_several_that_agree() -> None:
    lines = view("lines", 2.8, 0.05)
    others = [view("brightness", 0.0, 0.25), view("skeleton", 0.1, 0.35), view("cross-profile", -0.1, 0.25)]
    axis = fuse(STATIONS, [lines, *others])
    assert axis.offsets == pytest.approx(0.0, abs=0.1)
    assert not axis.members["lines"].any()
    assert axis.open.all(), "a sure view elsewhere leaves it open"


def test_a_sure_view_is_followed_against_a_vague_one() -> None:
    axis = fuse(STATIONS, [view("lines", 0.0, 0.05), view("extent", 2.5, 1.0)])
    assert axis.offsets == pytest.approx(0.0, abs=0.05)
    assert not axis.open.any()


def test_a_view_that_agrees_with_all_brings_no_rivals_together() -> None:
    sides = [view("lines", 2.8, 0.1), view("brightness", 0.0, 0.25), view("skeleton", 0.0, 0.35), view("c", 0.0, 0.25)]
    axis = fuse(STATIONS, [*sides, view("extent", 0.1, 3.0)])
    assert axis.offsets == pytest.approx(0.0, abs=0.05)


def test_a_slip_of_one_view_on_part_of_the_road_is_outvoted_there() -> None:
    slipped = np.where(STATIONS < 80.0, 3.75, 0.0)
    others = [view("a", 0.05, 0.2), view("b", -0.05, 0.2), view("c", 0.0, 0.2)]
    axis = fuse(STATIONS, [view("lines", slipped, 0.1), *others])
    assert np.abs(axis.offsets).max() < 0.15
    assert not axis.members["lines"][:12].any()
    assert axis.members["lines"][20:].all()
    assert not axis.open.any(), "three views outweigh it"


def test_the_axis_is_bridged_and_less_sure_where_nothing_is_seen() -> None:
    offsets = np.full(40, 0.5)
    offsets[15:25] = np.nan
    axis = fuse(STATIONS, [view("lines", offsets, 0.05)])
    assert axis.offsets == pytest.approx(0.5, abs=1e-6)
    assert np.isnan(axis.raw[15:25]).all()
    assert axis.std[20] > axis.std[16] > 0.1 > axis.std[5]


def test_without_any_view_nothing_is_known() -> None:
    axis = fuse(STATIONS, [view("lines", np.nan, 0.05)])
    assert np.isnan(axis.raw).all()
    assert np.isinf(axis.std).all()


def test_axes_of_several_grids_are_averaged_but_for_slips() -> None:
    first, other = fuse(STATIONS, [view("a", 0.0, 0.1)]), fuse(STATIONS, [view("a", 0.02, 0.2)])
    slipped = fuse(STATIONS, [view("a", np.where(STATIONS < 100.0, 0.04, 3.75), 0.1)])
    axis = mean_axis(first, [other, slipped])
    assert axis.raw[:10] == pytest.approx(0.02, abs=1e-9)
    assert axis.raw[24:] == pytest.approx(0.01, abs=1e-9)
    assert axis.offsets[24:] == pytest.approx(0.01, abs=1e-6)
    assert axis.std[24:] == pytest.approx(0.15, rel=0.01), "no surer than the grids are"
    assert axis.views == first.views


def test_what_the_first_grid_does_not_show_is_not_measured_by_others() -> None:
    hidden = fuse(STATIONS, [view("a", np.where(STATIONS < 100.0, 0.0, np.nan), 0.1)])
    assert np.isnan(mean_axis(hidden, [fuse(STATIONS, [view("a", 0.0, 0.1)])]).raw[20:]).all()
