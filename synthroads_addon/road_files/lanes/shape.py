"""The boundaries of a carriageway's strips as an OpenDRIVE road has them: distances and heights by station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...road.turnout_geometry import TURNOUT_STRIPS
from .records import FileLane
from .strips import SideLayout
from .surface import Edge, FileSurface, LaneEdges

OUTSIDE = ("outer_edge_strip", "hard_shoulder", *TURNOUT_STRIPS, "verge")
"""Strips outside of the lanes, from the inside out."""


@dataclass(frozen=True)
class Boundaries:
    """Boundaries of a carriageway's strips at stations (N,), from the inside out.

    Attributes:
        distances: (N, B) from the reference line outwards, m.
        heights: (N, B) above its elevation, m: on the inner side of each boundary, but for the first.
        inner_heights: (N, B) on the outer side of each but the last, which differ where a lane is a step higher.
    """

    distances: Float
    heights: Float
    inner_heights: Float


class SideShape:
    """One side of a road of a file as strips: inner edge, inner edge strip, lanes, edge strip, shoulder, verge.

    Attributes:
        surface, layout: what it is made of.
        breaks: (B,) stations between which all is smooth, m.
        sections: (B - 1,) numbers of the lane sections there.
    """

    def __init__(self, surface: FileSurface, layout: SideLayout, breaks: Float) -> None:
        self.surface, self.layout, self.breaks = surface, layout, breaks
        starts = np.array([section.start for section in surface.road.sections])
        middle = 0.5 * (breaks[:-1] + breaks[1:])
        self.sections = np.clip(np.searchsorted(starts, middle, side="right") - 1, 0, None)

    @property
    def sign(self) -> int:
        """Return the sign of its offsets."""
        return self.layout.sign

    def inside(self, station: Float, stretch: int) -> Float:
        """Return places (N,) that choose the records of a stretch."""
        return np.full(np.shape(station), 0.5 * (self.breaks[stretch] + self.breaks[stretch + 1]))

    def lanes(self, station: Float, stretch: int) -> dict[int, list[LaneEdges]]:
        """Return the lanes of both sides at stations (N,) of a stretch."""
        section = self.surface.road.sections[self.sections[stretch]]
        return self.surface.lanes(section, station, self.inside(station, stretch))

    def boundaries(self, station: Float, stretch: int) -> Boundaries:
        """Return the boundaries at stations (N,) of a stretch."""
        number = int(self.sections[stretch])
        lanes = self.lanes(station, stretch)
        mine = {edges.lane.number: edges for edges in lanes[self.sign]}
        layout = self.layout
        edge = self.surface.centre(station, self.inside(station, stretch))
        across = {edges.lane.number: edges for edges in lanes[-self.sign]}
        inner = edge
        for lane in layout.across.get(number, ()):
            inner = across[lane.number].outer
        for lane in layout.of_strip(number, "median"):
            inner = edge = mine[lane.number].outer
        rows: list[tuple[Edge, Edge]] = [(inner, inner)]
        strip = _last(mine, layout.of_strip(number, "inner_edge_strip"), edge)
        rows.append((strip[0], inner) if layout.across.get(number) else strip)
        for slot in layout.slots:
            there = slot.lanes.get(number)
            rows.append(_last(mine, [] if there is None else [there], rows[-1][0]))
        for kind in OUTSIDE:
            rows.append(_last(mine, layout.of_strip(number, kind), rows[-1][0]))
        outer = np.stack([self.sign * row[0].offset for row in rows], axis=-1)
        heights = np.stack([row[0].height for row in rows], axis=-1)
        begins = np.stack([row[1].height for row in rows], axis=-1)
        return Boundaries(outer, heights, begins)

    def paved_points(self, station: Float, stretch: int, shares: Float) -> tuple[Float, Float, Float]:
        """Return points of the pavement at stations (N,): offsets, heights (N, M), m, and the widths they stand for."""
        number = int(self.sections[stretch])
        mine = {edges.lane.number: edges for edges in self.lanes(station, stretch)[self.sign]}
        layout = self.layout
        chosen = [lane for kind in ("inner_edge_strip", "outer_edge_strip", "hard_shoulder")
                  for lane in layout.of_strip(number, kind)]  # fmt: skip
        chosen += [slot.lanes[number] for slot in layout.slots if number in slot.lanes]
        offsets, heights, weights = [], [], []
        for lane in chosen:
            edges = mine[lane.number]
            width = np.abs(edges.outer.offset - edges.inner.offset)
            for share in shares.tolist():
                point = self.surface.profile_points(edges, share, station, self.inside(station, stretch))
                offsets.append(point.offset)
                heights.append(point.height)
                weights.append(width)
        if not offsets:
            nothing = np.zeros((len(station), 0))
            return nothing, nothing, nothing
        return np.stack(offsets, axis=-1), np.stack(heights, axis=-1), np.stack(weights, axis=-1)


def _last(mine: dict[int, LaneEdges], lanes: Sequence[FileLane], before: Edge) -> tuple[Edge, Edge]:
    """Return the outer edge of the last of some lanes, and the inner edge of the first; without any the one before."""
    if not lanes:
        return before, before
    return mine[lanes[-1].number].outer, mine[lanes[0].number].inner
