"""The analytic road: where every strip's boundaries run and how high they lie, at any station, in float64.

This is the truth that the mesh, the cloud and the twin are measured against. The surface is ruled: along one station it
is a polyline through the boundaries; between stations it follows the alignment, the profile and the crossfall.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .alignment import Alignment, Element
from .model import Carriageway, LineMarking, Median, RoadParameters
from .profile import IntersectionPoint, Profile

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Strip:
    """A lengthwise strip of the road between two neighbouring boundaries.

    Attributes:
        kind: ``verge``, ``hard_shoulder``, ``outer_edge_strip``, ``lane``, ``inner_edge_strip`` or ``median``.
        class_name: semantic class of its surface.
        material: name in the material table.
        instance: instance number of the object that it belongs to.
    """

    kind: str
    class_name: str
    material: str
    instance: int


_SURFACES = {"verge": ("roadside", "verge"), "median": ("roadside", "median")}
_PAVED = ("road", "asphalt")


class RoadGeometry:
    """A parameter set's geometry, evaluated analytically in local coordinates.

    Attributes:
        alignment: the horizontal alignment in the local frame.
        profile: the vertical profile in local elevation.
        strips: the M strips from left to right.
        offsets: (M + 1,) offsets of their boundaries from left (largest) to right.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self.parameters = parameters
        axis = parameters.alignment
        self.alignment = Alignment(
            [Element(e.length, e.curvature_start, e.curvature_end) for e in axis.horizontal],
            axis.start_x,
            axis.start_y,
            np.deg2rad(axis.start_heading_deg),
        )
        self.profile = Profile([IntersectionPoint(p.station, p.elevation, p.radius) for p in axis.vertical])
        left, right = parameters.carriageway("left"), parameters.carriageway("right")
        strips: list[Strip] = []
        offsets: list[float] = []
        if left:
            strips, offsets = _half(left)
        if left and right:
            median = next(iter(parameters.of_type(Median).values()), None)
            strips.append(Strip("median", *_SURFACES["median"], median.instance if median else left.instance))
        if right:
            half_strips, half_offsets = _half(right)
            strips += half_strips[::-1]
            offsets += half_offsets[::-1]
        self.strips: tuple[Strip, ...] = tuple(strips)
        self.offsets: Float = np.array(offsets)

    @property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return self.alignment.length

    def crossfall(self, carriageway: Carriageway, station: ArrayLike) -> Float:
        """Return the crossfall (m/m, positive where the surface falls to the right) at the stations, same shape."""
        points = carriageway.crossfall
        return (
            np.interp(
                np.asarray(station, dtype=np.float64),
                [p.station for p in points],
                [p.crossfall_percent for p in points],
            )
            / 100.0
        )

    def boundary_elevations(self, station: ArrayLike) -> Float:
        """Return the (N, M + 1) local elevations of the strips' boundaries at N stations."""
        station = np.atleast_1d(np.asarray(station, dtype=np.float64))
        axis = self.profile.elevation(station)[:, None]
        left, right = self.parameters.carriageway("left"), self.parameters.carriageway("right")
        parts = []
        if left:
            parts.append(axis + self._relative(left, station))
        if right:
            parts.append(axis + self._relative(right, station)[:, ::-1])
        return np.hstack(parts)

    def elevation(self, station: ArrayLike, offset: ArrayLike) -> Float:
        """Return the surface's local elevation (N,); NaN outside the outermost boundaries."""
        station, offset = np.broadcast_arrays(
            np.asarray(station, dtype=np.float64).ravel(), np.asarray(offset, dtype=np.float64).ravel()
        )
        strip = self.strip_index(offset)
        inside = strip >= 0
        result = np.full(offset.shape, np.nan)
        heights = self.boundary_elevations(station[inside])
        index, row = strip[inside], np.arange(np.count_nonzero(inside))
        left, right = self.offsets[index], self.offsets[index + 1]
        share = (left - offset[inside]) / (left - right)
        result[inside] = heights[row, index] * (1.0 - share) + heights[row, index + 1] * share
        return result

    def strip_index(self, offset: ArrayLike) -> NDArray[np.intp]:
        """Return the index into `strips` of each offset (N,); -1 outside."""
        offset = np.asarray(offset, dtype=np.float64)
        index = np.searchsorted(-self.offsets, -offset, side="right") - 1
        last = len(self.strips) - 1
        index = np.where(offset == self.offsets[-1], last, index)
        return np.where((index < 0) | (index > last), -1, index)

    def point(self, station: ArrayLike, offset: ArrayLike) -> Float:
        """Return local points (N, 3) of the surface; z is NaN outside the road."""
        station, offset = np.broadcast_arrays(
            np.asarray(station, dtype=np.float64).ravel(), np.asarray(offset, dtype=np.float64).ravel()
        )
        position, heading, _ = self.alignment.frame(station)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        return np.column_stack([position + offset[:, None] * left, self.elevation(station, offset)])

    def marking_offsets(self, line: LineMarking) -> tuple[float, float]:
        """Return the left and right edge offsets of a line marking.

        A line between lanes is centred on the boundary; an edge line lies on the edge strip, so that the lane keeps
        its full width (`RMS`).
        """
        carriageway = self.parameters.objects[line.carriageway]
        assert isinstance(carriageway, Carriageway)
        boundary = lane_boundaries(carriageway)[line.boundary]
        shift = {"outer_edge": 0.5, "lane": 0.0, "inner_edge": -0.5}[line.kind] * line.width
        centre = carriageway.sign * (boundary + shift)
        return centre + line.width / 2, centre - line.width / 2

    def dashes(self, line: LineMarking) -> Float:
        """Return the (D, 2) start and end stations of a marking's dashes, clipped to the road and to its own range."""
        start, end = line.start_station, min(line.end_station, self.length)
        if line.dash_length == 0:
            return np.array([[start, end]]) if end > start else np.empty((0, 2))
        period = line.dash_length + line.gap_length
        first = start + period * np.arange(max(0, int(np.ceil((end - start) / period))))
        return np.column_stack([first, np.minimum(first + line.dash_length, end)])

    def _relative(self, carriageway: Carriageway, station: Float) -> Float:
        """Return (N, B) elevations of one carriageway's boundaries, outermost first, above the axis."""
        outward = np.array(_half(carriageway)[1]) * carriageway.sign
        paved = np.minimum(outward, carriageway.inner_offset + carriageway.paved_width)
        pivot = carriageway.inner_offset
        if carriageway.rotation_axis == "carriageway_axis":
            pivot += carriageway.paved_width / 2
        # A surface that falls to the right rises with the offset, and the offset is sign * distance outwards.
        rise = carriageway.sign * self.crossfall(carriageway, station)
        verge_fall = (outward - paved) * carriageway.verge_slope_percent / 100.0
        return rise[:, None] * (paved - pivot) - verge_fall


def lane_boundaries(carriageway: Carriageway) -> Float:
    """Return the distances of the lane boundaries from the centreline, outermost first, m (lanes + 1,)."""
    widths = np.array([lane.width for lane in carriageway.lanes])
    innermost = carriageway.inner_offset + carriageway.inner_edge_strip_width
    return innermost + np.concatenate([np.cumsum(widths[::-1])[::-1], [0.0]])


def _half(carriageway: Carriageway) -> tuple[list[Strip], list[float]]:
    """Return one carriageway's strips and the signed offsets of their boundaries, outermost first."""
    widths = [("verge", carriageway.verge_width), ("hard_shoulder", carriageway.hard_shoulder_width)]
    widths.append(("outer_edge_strip", carriageway.outer_edge_strip_width))
    widths += [("lane", lane.width) for lane in carriageway.lanes]
    widths.append(("inner_edge_strip", carriageway.inner_edge_strip_width))
    present = [(kind, width) for kind, width in widths if width > 0]
    strips = [Strip(kind, *_SURFACES.get(kind, _PAVED), carriageway.instance) for kind, _ in present]
    inwards = np.cumsum([width for _, width in present[::-1]])[::-1]
    distances = [*(carriageway.inner_offset + inwards), carriageway.inner_offset]
    return strips, [carriageway.sign * float(distance) for distance in distances]
