"""The lines' vote for the axis: a line whose distance changes, where a lane begins or ends, moves it nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.reconstruction.edges import Pavement
from synthroads_addon.reconstruction.layout import Band, RoadKind, RoadLayout, find_layout
from synthroads_addon.reconstruction.lines import Line
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles
from synthroads_addon.reconstruction.views.vote import axis_from_lines, axis_guides

STATIONS: Float = 5.0 * np.arange(60) + 2.5
ROWS: Float = np.arange(300) + 0.5
OFFSETS: Float = 0.1 * (np.arange(400) + 0.5) - 20.0


def profiles(paved: Bool) -> Profiles:
    """Return 300 m of level profiles with pavement in a mask (300, 400)."""
    path = CloudPath(np.column_stack([np.arange(301.0), np.zeros(301)]), np.zeros(301))
    ones = np.ones(paved.shape, np.float32)
    return Profiles(path, ROWS, OFFSETS, ones, 0.0 * ones, paved.astype(np.float32), 0.0 * ones, ones)


def layout(kind: RoadKind, *bands: Band) -> RoadLayout:
    """Return a layout of bands on ground that is paved everywhere."""
    ground = profiles(np.ones((len(ROWS), len(OFFSETS)), dtype=bool))
    return RoadLayout(kind, bands, Pavement(ground, ground.count), ())


def line(offset: float | Float, width: float = 0.15) -> Line:
    """Return a line at an offset or offsets (60,), m, with a centimetre of noise."""
    noise = np.random.default_rng(7).normal(0.0, 0.01, len(STATIONS))
    measured = np.asarray(np.broadcast_to(np.asarray(offset, dtype=float), STATIONS.shape) + noise)
    zeros = np.zeros(len(STATIONS))
    return Line(STATIONS, measured, measured, zeros + 0.01, zeros, zeros, 0.0, 300.0, width)


@pytest.mark.parametrize("begin", [60.0, 200.0])
def test_a_lane_that_ends_moves_the_axis_nowhere(begin: float) -> None:
    outwards = 3.5 * np.clip((STATIONS - begin) / 60.0, 0.0, 1.0)
    guides = line(-2.0), line(2.0)
    right = Band(
        -9.0, -1.5, [line(-9.0 - outwards), line(-5.5 - outwards), guides[0]], (line(-9.5, 0.0), line(-1.5, 0.0))
    )
    left = Band(1.5, 9.0, [guides[1], line(5.5), line(9.0)], (line(1.5, 0.0), line(9.5, 0.0)))
    gap = np.where((STATIONS > 100.0) & (STATIONS < 140.0), np.nan, 0.0)
    for guide in guides:  # where its own lines are hidden the others carry the axis on
        guide.measured[:] += gap
    axis = axis_from_lines(layout("dual", right, left))
    assert np.abs(axis.offsets).max() < 0.05
    assert np.isfinite(axis.raw).all()


def part_of(offset: float, start: float, end: float) -> Line:
    """Return a line that is there between two stations, m."""
    whole = line(offset)
    inside = (start < STATIONS) & (end > STATIONS)
    measured = np.where(inside, whole.measured, np.nan)
    return Line(STATIONS, measured, measured, whole.std, whole.spacing, whole.cover, start, end, 0.15)


def test_a_lane_that_begins_in_the_middle_leaves_the_section_of_the_longer_part() -> None:
    offsets, outer = OFFSETS, -9.5 - 3.5 * np.clip((ROWS - 135.0) / 30.0, 0.0, 1.0)
    paved = (offsets > outer[:, None]) & (offsets < -2.0) | (offsets > 2.0) & (offsets < 9.5)
    lasting = [line(-6.0), line(-2.5), line(2.5), line(6.0), line(9.25)]
    right, left = find_layout(
        profiles(paved), [part_of(-9.25, 0.0, 135.0), part_of(-12.75, 165.0, 300.0), *lasting]
    ).bands
    assert [right.place(one) for one in right.lines] == pytest.approx([-9.25, -6.0, -2.5], abs=0.02)
    assert (right.low, right.high) == (pytest.approx(-9.5, abs=0.1), pytest.approx(-2.0, abs=0.1))
    assert right.usual is not None
    assert left.usual is not None
    assert np.array_equal(right.usual, STATIONS < 142.0)
    assert left.usual.all()
    assert [left.place(one) for one in left.lines] == pytest.approx([2.5, 6.0, 9.25], abs=0.02)


def test_a_line_on_one_side_and_the_pavements_edge_on_the_other_make_no_middle() -> None:
    edges = line(-3.75, 0.0), line(3.75, 0.0)
    one_sided = Band(-3.75, 3.75, [line(3.2)], edges)
    assert axis_guides(layout("single", one_sided)) == edges
    both = Band(-3.75, 3.75, [line(-3.2), line(3.2)], edges)
    assert axis_guides(layout("single", both)) == tuple(both.lines)
    apart = Band(-3.75, 3.75, [part_of(-3.2, 0.0, 140.0), part_of(3.2, 150.0, 300.0)], edges)
    assert axis_guides(layout("single", apart)) == edges  # never seen together
