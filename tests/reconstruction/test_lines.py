"""Lines that lie hidden between rows of points for long come back as one; what isn't there isn't made up."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.reconstruction.lines import find_lines
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles

ROWS = 500
HIDDEN = slice(165, 365)


def profiles(apart: int, dash: float = 0.0, hidden: tuple[slice, ...] = (HIDDEN,)) -> Profiles:
    """Return 500 m of profiles with points in every n-th bin across, and a line 2 m to the left, hidden in places."""
    offsets = 0.1 * (np.arange(120) + 0.5) - 6.0
    there = np.zeros((ROWS, len(offsets)), dtype=bool)
    there[:, ::apart] = True
    paint = np.where(there, 0.0, np.nan)
    at = int(np.flatnonzero(there[0] & (offsets > 2.0))[0])
    station = np.arange(ROWS) + 0.5
    paint[:, at] = np.where(dash == 0.0, 1.0, station % 18.0 < dash)
    for rows in hidden:
        paint[rows, at] = 0.0
    path = CloudPath(np.column_stack([np.arange(ROWS + 1.0), np.zeros(ROWS + 1)]), np.zeros(ROWS + 1))
    grids = [there.astype(np.float32), paint.astype(np.float32), None, np.zeros(there.shape), np.ones(there.shape)]
    return Profiles(path, station, offsets, *grids)  # type: ignore[arg-type]


@pytest.mark.parametrize(("dash", "pattern"), [(0.0, (0.0, 0.0)), (6.0, (6.0, 12.0))])
def test_a_line_between_rows_of_points_is_one(dash: float, pattern: tuple[float, float]) -> None:
    (line,) = find_lines(profiles(3, dash))
    assert (line.start, line.end) == pytest.approx((0.0, 500.0), abs=15.0)
    assert (line.dash, line.gap) == pattern
    assert 300.0 <= line.length < 380.0
    assert np.isnan(line.measured[HIDDEN.start // 5 + 5 : HIDDEN.stop // 5 - 5]).all()


def test_what_is_hidden_for_longer_than_any_gap_makes_no_dashes() -> None:
    (line,) = find_lines(profiles(3, hidden=tuple(slice(first, first + 50) for first in (40, 140, 240, 340, 440))))
    assert line.solid
    assert line.painted > 0.9


def test_where_points_lie_densely_a_line_that_is_not_seen_is_not_there() -> None:
    first, second = find_lines(profiles(1))
    assert first.offset == pytest.approx(second.offset, abs=0.05)
    assert first.end < 190.0
    assert second.start > 340.0
    assert first.solid
    assert second.solid
