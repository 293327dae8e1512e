"""Widths say how sure they are: errors that all edges and lines of a road share are part of their deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.reconstruction.edges import Edge
from synthroads_addon.reconstruction.lines import Line, _measure_line
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles, SurfacePoints
from synthroads_addon.reconstruction.section import Estimate, SideSection, half_width

ROWS = 200


def test_a_pavements_width_has_what_both_edges_are_off_all_along_the_road() -> None:
    rng, zeros, width = np.random.default_rng(2), np.zeros(40), Estimate(3.5, 0.01)
    inner, outer = (Edge(place + rng.normal(0.0, 0.01, 40), zeros) for place in (2.0, 13.0))
    everywhere = np.ones(40, dtype=bool)
    side = SideSection(
        "left", [], inner, outer, everywhere, width, width, [width], width, width, width, edge_seen=True, closed=True
    )
    assert side.paved_width.value == pytest.approx(11.0, abs=0.01)
    assert side.paved_width.std < 0.01
    by_brightness = replace(side, edge_stds=(0.08, 0.08))
    assert by_brightness.paved_width.value == side.paved_width.value
    assert by_brightness.paved_width.std == pytest.approx(0.08 * np.sqrt(2.0), abs=0.005)


def line_between_rows(apart: float, low: float, high: float) -> Line:
    """Return a line that is painted between two offsets, m, measured by points in rows that lie so far apart, m."""
    stretches, each = ROWS // 5, 25
    row = np.arange(-3.0, 3.001, apart)
    offset = np.tile(np.repeat(row, each), stretches) + np.random.default_rng(4).normal(
        0.0, 0.001, stretches * each * len(row)
    )
    station = np.concatenate(
        [np.tile(np.linspace(0.1, 4.9, each) + 5.0 * number, len(row)) for number in range(stretches)]
    )
    stretch = (station // 5.0).astype(np.int64)
    order = np.lexsort((offset, stretch))
    offset, station = offset[order], station[order]
    marked = (offset > low) & (offset < high)
    points = SurfacePoints(
        np.arange(stretches + 1) * each * len(row),
        station.astype(np.float32),
        offset.astype(np.float32),
        marked | True,
        marked,
    )
    bins = 0.1 * (np.arange(80) + 0.5) - 4.0
    count = np.array([[float((np.abs(row - at) < 0.05).any()) for at in bins]] * ROWS)
    paint = np.where(count > 0.0, (bins > low - 0.05) & (bins < high + 0.05), np.nan)
    path = CloudPath(np.column_stack([np.arange(ROWS + 1.0), np.zeros(ROWS + 1)]), np.zeros(ROWS + 1))
    grids = [count, paint, count, 0.0 * count, count]
    profiles = Profiles(path, np.arange(ROWS) + 0.5, bins, *grids, points)  # type: ignore[arg-type]
    line = _measure_line(profiles, np.array([20.0, 180.0]), np.full(2, 0.5 * (low + high)))
    assert line is not None
    return line


def test_a_line_between_rows_is_as_wide_as_these_let_it_be() -> None:
    fine, coarse = line_between_rows(0.02, 1.90, 2.06), line_between_rows(0.25, 1.94, 2.06)
    assert fine.width == pytest.approx(0.16, abs=0.02)
    assert fine.width_std < 0.02
    assert coarse.width_std == pytest.approx(0.25 * np.sqrt(2.0 / 12.0), abs=0.02)
    assert abs(coarse.width - 0.12) < 2.0 * coarse.width_std
    for one in (fine, coarse):
        assert half_width(one, "outer_edge", "single", True)[1] == pytest.approx(0.5 * one.width_std)
    assert half_width(coarse, "outer_edge", "single", False)[1] == 0.0
