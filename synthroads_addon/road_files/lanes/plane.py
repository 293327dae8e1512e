"""The planes of a road's carriageways: heights along the line, and how each rises to the left, by station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...base.arrays import Float
from ..heights import HeightPiece
from .corners import Polyline, height_pieces, polyline
from .shape import SideShape

RotationAxis = Literal["carriageway_axis", "inner_edge", "centreline"]
TOLERANCE = 2e-4
"""Height, m, that linear crossfall may be off at the pavement's edge."""
_PROFILE_TOLERANCE = 1e-5
_SAME = 1e-4
"""Heights, m, that differ by less are the same."""
_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Places across a lane at which its height is taken, as shares of its width (chosen)."""
_REACH = 15.0
"""Distance from the line, m, at which the tolerance holds."""


@dataclass(frozen=True)
class Planes:
    """The planes of a road's carriageways.

    Attributes:
        rises: by sign of the side, values of one column by station, m/m.
        heights: cubics of the profile; None where it is the file's elevation.
        axis: line about which the crossfall turns.
    """

    rises: dict[int, Polyline]
    heights: list[HeightPiece] | None
    axis: RotationAxis


def planes(sides: Sequence[SideShape]) -> Planes:
    """Return the planes of one road's sides: its own, or those that fit its surface best."""
    surface, breaks = sides[0].surface, sides[0].breaks
    if surface.is_plane and not (len(sides) > 1 and surface.has_tilted_lanes):

        def rise(station: Float, stretch: int) -> Float:
            return _REACH * surface.rise(station, sides[0].inside(station, stretch))[:, None]

        plane = _scaled(polyline(rise, breaks, TOLERANCE))
        return Planes({side.sign: plane for side in sides}, None, "centreline")

    def fitted(station: Float, stretch: int) -> Float:
        """Return height on the line and rises (N, 1 + sides), each as a height (m) at `_REACH`."""
        return _best_planes(sides, station, stretch) * np.array([1.0, *(_REACH for _ in sides)])

    fit = polyline(fitted, breaks, TOLERANCE)
    rises = {
        side.sign: Polyline(fit.stations, fit.values[:, [n]] / _REACH, fit.jumps) for n, side in enumerate(sides, 1)
    }
    line_height = Polyline(fit.stations, fit.values[:, :1], fit.jumps)
    if np.abs(line_height.values).max() < _SAME:
        return Planes(rises, None, "centreline")
    stretch_ends = np.union1d(breaks, fit.stations)

    def height(station: Float, stretch: int) -> Float:
        """Return the heights (N,), m, of the profile that fits both sides."""
        middle = np.full(station.shape, 0.5 * (stretch_ends[stretch] + stretch_ends[stretch + 1]))
        return surface.road.elevation.at(station, middle) + line_height.at(station)[:, 0]

    return Planes(rises, height_pieces(height, stretch_ends, _PROFILE_TOLERANCE), "centreline")


def _scaled(line: Polyline) -> Polyline:
    """Return a polyline of heights (m) at `_REACH` from the line as one of rises (m/m)."""
    return Polyline(line.stations, line.values / _REACH, line.jumps)


def _best_planes(sides: Sequence[SideShape], station: Float, stretch: int) -> Float:
    """Return the height on the line (m) and the rise of each side (m/m), (N, 1 + sides), that fit the pavement best.

    Least squares, weighted by the widths that the pavement's points stand for.
    """
    columns, values, weights = [], [], []
    for n, side in enumerate(sides):
        offset, height, width = side.paved_points(station, stretch, _SHARES)
        # Unknowns of a station: the height on the line, and the rise of each side; h = h0 + rise * offset.
        design = np.zeros((*offset.shape, 1 + len(sides)))
        design[..., 0], design[..., 1 + n] = 1.0, offset
        columns.append(design)
        values.append(height)
        weights.append(width)
    designs, heights = np.concatenate(columns, axis=1), np.concatenate(values, axis=1)
    weight = np.sqrt(np.concatenate(weights, axis=1) + 1e-9)
    if not designs.shape[1]:
        return np.zeros((len(station), 1 + len(sides)))
    designs, heights = designs * weight[..., None], heights * weight
    inverses = np.linalg.pinv(designs, rcond=1e-9)
    return np.asarray(np.einsum("nij,nj->ni", inverses, heights))


def joined(right: SideShape, left: SideShape, breaks: Float, pivots: dict[RotationAxis, dict[int, Polyline]]) -> Planes:
    """Return the planes of two roads along one line, each with a plane of its own, as carriageways of one profile.

    The crossfall turns about one of the lines of `pivots`: the one on which both planes have the same heights, or else
    the one with the smallest step between them.

    Args:
        right, left: a side of each.
        breaks: (B,) stations between which all of both is smooth, m.
        pivots: for each rotation axis and side its distance from the line, a column by station, m.
    """
    rises: dict[int, Polyline] = {}
    for side in (right, left):
        rises |= planes([side]).rises
    middle = 0.5 * (breaks[:-1] + breaks[1:])

    def heights(axis: RotationAxis, side: SideShape, station: Float, stretch: int) -> Float:
        """Return the heights (N,), m, of a side's plane at a rotation axis."""
        stretch_middle = np.full(station.shape, middle[stretch])
        level = side.surface.road.elevation.at(station, stretch_middle)
        pivot = pivots[axis][side.sign].at(station)[:, 0]
        return np.asarray(level + side.surface.rise(station, stretch_middle) * side.sign * pivot)

    def largest_step(axis: RotationAxis) -> float:
        """Return the largest height, m, between both planes at a rotation axis."""
        largest = 0.0
        for stretch in range(len(middle)):
            station = np.linspace(breaks[stretch], breaks[stretch + 1], 5)
            steps = heights(axis, right, station, stretch) - heights(axis, left, station, stretch)
            largest = max(largest, float(np.abs(steps).max()))
        return largest

    steps_by_axis = {axis: largest_step(axis) for axis in pivots}
    axis = min(steps_by_axis, key=lambda name: steps_by_axis[name] if steps_by_axis[name] > _SAME else 0.0)

    def height(station: Float, stretch: int) -> Float:
        return 0.5 * (heights(axis, right, station, stretch) + heights(axis, left, station, stretch))

    return Planes(rises, height_pieces(height, breaks, _PROFILE_TOLERANCE), axis)
