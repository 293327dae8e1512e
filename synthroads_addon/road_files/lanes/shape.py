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
        """Return the sign of the offsets on this side: 1 left, -1 right."""
        return self.layout.sign

    @property
    def traffic(self) -> int:
        """Return 1 where traffic runs with the stations, -1 where against them."""
        return self.sign if self.surface.road.left_hand else -self.sign

    def inside(self, station: Float, stretch: int) -> Float:
        """Return the middle of a stretch (N,), m: cubics are chosen by it, so that ends belong to their own stretch."""
        return np.full(np.shape(station), 0.5 * (self.breaks[stretch] + self.breaks[stretch + 1]))

    def lanes(self, station: Float, stretch: int) -> dict[int, list[LaneEdges]]:
        """Return the lanes of both sides at stations (N,) of a stretch."""
        section = self.surface.road.sections[self.sections[stretch]]
        return self.surface.lanes(section, station, self.inside(station, stretch))

    def boundaries(self, station: Float, stretch: int) -> Boundaries:
        """Return the boundaries of all strips at stations (N,) of a stretch, from the inner edge to the verge's."""
        section_number = int(self.sections[stretch])
        lanes = self.lanes(station, stretch)
        edges_by_number = {edges.lane.number: edges for edges in lanes[self.sign]}
        layout = self.layout
        line_edge = self.surface.centre(station, self.inside(station, stretch))
        other_edges = {edges.lane.number: edges for edges in lanes[-self.sign]}
        # A single carriageway reaches over the line to paved lanes there; one with a median begins at the median.
        inner_edge = line_edge
        for lane in layout.across.get(section_number, ()):
            inner_edge = other_edges[lane.number].outer
        for lane in layout.of_strip(section_number, "median"):
            inner_edge = line_edge = edges_by_number[lane.number].outer
        # Each row has the outer edge of a strip and its inner edge; a strip that the section lacks has no width.
        rows: list[tuple[Edge, Edge]] = [(inner_edge, inner_edge)]
        strip_edges = _strip_edges(edges_by_number, layout.of_strip(section_number, "inner_edge_strip"), line_edge)
        rows.append((strip_edges[0], inner_edge) if layout.across.get(section_number) else strip_edges)
        for slot in layout.slots:
            slot_lane = slot.lanes.get(section_number)
            rows.append(_strip_edges(edges_by_number, [] if slot_lane is None else [slot_lane], rows[-1][0]))
        for kind in OUTSIDE:
            rows.append(_strip_edges(edges_by_number, layout.of_strip(section_number, kind), rows[-1][0]))
        distances = np.stack([self.sign * row[0].offset for row in rows], axis=-1)
        heights = np.stack([row[0].height for row in rows], axis=-1)
        inner_heights = np.stack([row[1].height for row in rows], axis=-1)
        return Boundaries(distances, heights, inner_heights)

    def paved_points(self, station: Float, stretch: int, shares: Float) -> tuple[Float, Float, Float]:
        """Return points of the pavement at stations (N,): offsets, heights and widths they stand for, (N, M), m.

        `shares` (S,) are the places of the points across each lane, from 0 at its inner edge to 1 at its outer one.
        """
        section_number = int(self.sections[stretch])
        edges_by_number = {edges.lane.number: edges for edges in self.lanes(station, stretch)[self.sign]}
        layout = self.layout
        paved_lanes = [lane for kind in ("inner_edge_strip", "outer_edge_strip", "hard_shoulder")
                  for lane in layout.of_strip(section_number, kind)]  # fmt: skip
        paved_lanes += [slot.lanes[section_number] for slot in layout.slots if section_number in slot.lanes]
        offsets, heights, weights = [], [], []
        for lane in paved_lanes:
            edges = edges_by_number[lane.number]
            width = np.abs(edges.outer.offset - edges.inner.offset)
            for share in shares.tolist():
                point = self.surface.profile_points(edges, share, station, self.inside(station, stretch))
                offsets.append(point.offset)
                heights.append(point.height)
                weights.append(width)
        if not offsets:
            no_points = np.zeros((len(station), 0))
            return no_points, no_points, no_points
        return np.stack(offsets, axis=-1), np.stack(heights, axis=-1), np.stack(weights, axis=-1)


def _strip_edges(
    edges_by_number: dict[int, LaneEdges], lanes: Sequence[FileLane], previous_edge: Edge
) -> tuple[Edge, Edge]:
    """Return the outer edge of the last and the inner edge of the first of a strip's lanes; else the edge before."""
    if not lanes:
        return previous_edge, previous_edge
    return edges_by_number[lanes[-1].number].outer, edges_by_number[lanes[0].number].inner
