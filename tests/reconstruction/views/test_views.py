"""Each view finds the axis of drawn profiles by its own evidence alone, and says when it sees nothing."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.edges import Pavement
from synthroads_addon.reconstruction.layout import Band, RoadLayout
from synthroads_addon.reconstruction.lines import Line
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles
from synthroads_addon.reconstruction.views.extent import view_extent
from synthroads_addon.reconstruction.views.look import rule_views
from synthroads_addon.reconstruction.views.pavement import pavement_edges, view_brightness
from synthroads_addon.reconstruction.views.period import view_period
from synthroads_addon.reconstruction.views.skeleton import view_skeleton
from synthroads_addon.reconstruction.views.symmetry import view_symmetry
from synthroads_addon.reconstruction.views.view import View
from synthroads_addon.reconstruction.views.vote import axis_from_lines

ROWS, HALF = 150, 12.0


def profiles(
    pavement: list[tuple[float, float]],
    dashes: tuple[float, ...] = (),
    contrast: float = 1.0,
    seen: tuple[float, float] = (-HALF, HALF),
) -> Profiles:
    """Return 150 m of profiles: dark pavement between some offsets (m) in grass, and dashed lines, 6 m every 18."""
    offsets = 0.1 * (np.arange(round(20.0 * HALF)) + 0.5) - HALF
    rng = np.random.default_rng(5)
    paved = np.any([(offsets > low) & (offsets < high) for low, high in pavement], axis=0)
    shape = (ROWS, len(offsets))
    stations = np.arange(ROWS) + 0.5
    paint = rng.normal(0.0, 0.1, shape)
    for at in dashes:
        paint[np.ix_(stations % 18.0 < 6.0, np.abs(offsets - at) < 0.1)] += contrast
    brightness = np.where(paved, 0.2, 0.5) + rng.normal(0.0, 0.02, shape) + 0.4 * np.clip(paint, 0.0, 1.0)
    height = np.where(paved, 0.0, 0.02) + rng.normal(0.0, 0.005, shape)
    hidden = (offsets < seen[0]) | (offsets > seen[1])
    for grid in (paint, brightness, height):
        grid[:, hidden] = np.nan
    count = np.where(np.isfinite(paint), 1.0, 0.0)
    path = CloudPath(np.column_stack([np.arange(ROWS + 1.0), np.zeros(ROWS + 1)]), np.zeros(ROWS + 1))
    return Profiles(path, stations, offsets, count, paint, None, height, brightness)  # type: ignore[arg-type]


def middle(view: View) -> float:
    """Return the median offset of a view, which must see something on most of the road."""
    assert view.seen > 0.5
    return float(np.nanmedian(view.offsets))


@pytest.mark.parametrize("shift", [-1.3, 0.0, 0.6])
def test_the_pavements_middle_is_seen_by_brightness_skeleton_and_symmetry(shift: float) -> None:
    road = profiles([(shift - 3.5, shift + 3.5)])
    assert middle(view_brightness(road, [shift], False)) == pytest.approx(shift, abs=0.1)
    assert middle(view_skeleton(road, [shift])) == pytest.approx(shift, abs=0.1)
    assert middle(view_symmetry(road)) == pytest.approx(shift, abs=0.2)


def test_of_two_carriageways_what_lies_between_them_is_seen() -> None:
    road = profiles([(-10.0, -1.0), (2.0, 11.0)])
    assert middle(view_brightness(road, [-5.5, 6.5], True)) == pytest.approx(0.5, abs=0.1)
    assert middle(view_skeleton(road, [-5.5, 6.5])) == pytest.approx(0.5, abs=0.15)


def test_a_repair_or_an_entrance_of_some_metres_is_no_edge() -> None:
    road, axis = profiles([(-3.5, 3.5)]), np.zeros(ROWS // 5)
    repair = np.ix_(np.arange(60, 75), np.flatnonzero((road.offsets > -3.5) & (road.offsets < -0.5)))
    entrance = np.ix_(np.arange(100, 115), np.flatnonzero((road.offsets > 3.0) & (road.offsets < 8.0)))
    road.brightness[repair] += 0.3
    road.brightness[entrance] = 0.2
    assert pavement_edges(road, [0.0], False) == pytest.approx(np.array([axis - 3.5, axis + 3.5]), abs=0.15)
    long = np.ix_(np.arange(60, 120), np.flatnonzero((road.offsets > 3.0) & (road.offsets < 8.0)))
    road.brightness[long] = 0.2
    assert pavement_edges(road, [0.0], False)[1, 14:22] == pytest.approx(8.0, abs=0.15)


def edges_of(place: float) -> Line:
    """Return an edge of the pavement at an offset, m, as a line without paint."""
    measured = np.full(ROWS // 5, place)
    zeros = np.zeros(len(measured))
    return Line(5.0 * np.arange(len(measured)) + 2.5, measured, measured, zeros, zeros, zeros, 0.0, float(ROWS))


@pytest.mark.parametrize(("outer", "uneven"), [(-11.0, 0.0), (-14.5, 1.75)])
def test_where_one_carriageway_is_wider_symmetry_says_little(outer: float, uneven: float) -> None:
    road = profiles([(max(outer, -11.5), -2.0), (2.0, 11.0)])
    bands = (
        Band(outer, -2.0, [], (edges_of(outer), edges_of(-2.0))),
        Band(2.0, 11.0, [], (edges_of(2.0), edges_of(11.0))),
    )
    layout = RoadLayout("dual", bands, Pavement(road, road.count), ())
    views = {view.name: view for view in rule_views(layout, axis_from_lines(layout))}
    alone = {"cross-profile": view_symmetry(road), "skeleton": view_skeleton(road, [0.5 * (outer - 2.0), 6.5])}
    for (name, own), share in zip(alone.items(), (1.0, 0.5), strict=True):
        assert views[name].std == pytest.approx(np.hypot(own.std, share * uneven))
    assert views["brightness"].std == pytest.approx(view_brightness(road, [0.5 * (outer - 2.0), 6.5], True).std)


def test_a_road_that_is_cut_off_within_its_pavement_pulls_no_view_but_the_extent() -> None:
    road = profiles([(-3.5, 3.5)], dashes=(0.0,), seen=(-2.0, HALF))
    assert view_brightness(road, [0.0], False).seen == 0.0
    assert view_skeleton(road, [0.0]).seen == 0.0
    assert middle(view_period(road, False, 0.0)) == pytest.approx(0.0, abs=0.05)
    assert middle(view_extent(road)) == pytest.approx(5.0, abs=0.1)
    symmetric = view_symmetry(road)
    seen = np.isfinite(symmetric.offsets)
    assert not seen.any() or np.abs(symmetric.offsets[seen]).max() < 0.5


@pytest.mark.parametrize("contrast", [1.0, 0.25])
def test_dashes_are_found_by_their_beat_however_faint(contrast: float) -> None:
    single = profiles([(-4.0, 4.0)], dashes=(0.3,), contrast=contrast)
    assert middle(view_period(single, False, 0.0)) == pytest.approx(0.3, abs=0.05)
    dual = profiles([(-11.0, -2.0), (2.0, 11.0)], dashes=(-6.3, 6.7), contrast=contrast)
    assert middle(view_period(dual, True, 0.0)) == pytest.approx(0.2, abs=0.05)


def test_lines_that_do_not_say_which_is_the_axis_leave_it_open() -> None:
    assert view_period(profiles([(-6.0, 6.0)], dashes=(-3.0, 3.0)), False, 0.0).seen == 0.0
    assert view_period(profiles([(-11.0, -2.0), (2.0, 11.0)], dashes=(-6.0,)), True, 0.0).seen == 0.0
    assert view_period(profiles([(-4.0, 4.0)]), False, 0.0).seen == 0.0


def test_the_markings_period_is_less_sure_near_the_ends_where_no_window_reaches_beyond() -> None:
    std = view_period(profiles([(-3.5, 3.5)], dashes=(0.0,)), False, 0.0).std
    assert std[10:20].max() < 0.15
    assert min(std[0], std[-1]) > 0.35


def test_without_contrast_nothing_is_seen() -> None:
    plain = profiles([])
    assert view_brightness(plain, [0.0], False).seen == 0.0
    assert view_symmetry(plain).seen < 0.1


def test_an_extent_is_trusted_the_less_the_wider_it_is() -> None:
    wide, narrow = view_extent(profiles([])), view_extent(profiles([], seen=(-2.0, 4.0)))
    assert middle(narrow) == pytest.approx(1.0, abs=0.1)
    assert wide.std[5] > 2.0 * narrow.std[5]
    assert narrow.std.min() >= 0.5


def test_an_offset_beside_its_neighbours_is_less_sure() -> None:
    offsets: Float = np.zeros(30)
    offsets[10], offsets[20] = 0.5, np.nan
    view = View.of("any", offsets, 0.1)
    assert view.std[5] == pytest.approx(0.1, abs=0.03)
    assert view.std[10] > 0.45
    assert np.isinf(view.std[20])
    assert View.of("any", np.full(30, np.nan), 0.1).seen == 0.0


@pytest.mark.parametrize("crossfall", [-0.06, 0.05])
def test_a_crossfall_on_a_grade_is_no_kerb(crossfall: float) -> None:
    road, axis = profiles([(-3.5, 3.5)]), np.zeros(ROWS // 5)
    rng = np.random.default_rng(9)
    inside = np.clip(road.offsets, -3.5, 3.5)
    plane = 0.05 * road.stations[:, None] + crossfall * inside - 0.08 * np.abs(road.offsets - inside)
    # Each row holds other bins, as points thrown by a scanner do: its median height is another one's.
    height = plane + rng.normal(0.0, 0.01, road.height.shape)
    road.height[:] = np.where(rng.random(height.shape) < 0.5, height, np.nan)
    assert pavement_edges(road, [0.0], False) == pytest.approx(np.array([axis - 3.5, axis + 3.5]), abs=0.15)


def test_a_kerb_beside_a_crossfall_is_seen() -> None:
    road, axis = profiles([(-3.5, 3.5)]), np.zeros(ROWS // 5)
    road.brightness[:] = 0.2
    road.height[:] = 0.05 * road.offsets + np.where(np.abs(road.offsets) > 3.5, 0.1, 0.0)
    assert pavement_edges(road, [0.0], False) == pytest.approx(np.array([axis - 3.5, axis + 3.5]), abs=0.5)
