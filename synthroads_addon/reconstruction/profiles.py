"""Cross profiles: what lies how far beside a path, each metre along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..base.arrays import Bool, Float, Index, Int
from .cloud import PointKind, RoadCloud
from .path import SPACING, CloudPath

Grid = NDArray[np.float32]

ACROSS = 0.1
"""Width of a bin across the path, m."""
STRETCH = 5
"""Metres along the path that one offset of a line or an edge is measured on."""
_BACKGROUND = (11, 25)  # bins along and across whose median is a surface without paint: 11 m, 2.5 m
_PAINT_PERCENTILE = 99.0
_ENOUGH = 1_500_000  # points to lay the road straight by
_BLUR = 0.8  # bins


@dataclass(frozen=True)
class SurfacePoints:
    """The surface's points by stretch and, within one, from right to left.

    Attributes:
        begins: (K + 1,) index of each stretch's first point.
        station, offset: (N,) m.
        paved, marked: (N,) by class.
    """

    begins: Index
    station: Grid
    offset: Grid
    paved: Bool
    marked: Bool

    def near(self, stretch: int, low: float, high: float) -> slice:
        """Return where the points of a stretch between two offsets (m) are."""
        begin, end = self.begins[stretch], self.begins[stretch + 1]
        first, last = np.searchsorted(self.offset[begin:end], [low, high])
        return slice(int(begin + first), int(begin + last))


@dataclass(frozen=True)
class Profiles:
    """Profiles of S metres along and U bins across a path. Bins without points hold NaN.

    Attributes:
        path: what they are measured along.
        stations: (S,) middles along the path, m.
        offsets: (U,) middles across, m, ascending (from right to left).
        count: (S, U) points of the surface.
        paint: (S, U) 0 where there is no paint, 1 where there is; in between where a bin is part of both.
        paved: (S, U) share of pavement (with its paint) among the surface's points; None if classes don't tell.
        height: (S, U) mean height of the surface's points, m.
        brightness: (S, U) mean intensity of the surface's points, in the file's unit.
        points: the surface's points themselves; None if classes don't tell, or nobody asked for them.
    """

    path: CloudPath
    stations: Float
    offsets: Float
    count: Grid
    paint: Grid
    paved: Grid | None
    height: Grid
    brightness: Grid
    points: SurfacePoints | None = None

    def column(self, offset: float) -> int:
        """Return the index of the bin at an offset, the nearest one if it lies outside."""
        return int(np.clip(round((offset - self.offsets[0]) / ACROSS), 0, len(self.offsets) - 1))


def make_profiles(cloud: RoadCloud, path: CloudPath, half_width: float, exact: bool = False) -> Profiles:
    """Return the profiles of a cloud along a path, up to half a width (m) to either side.

    Args:
        cloud: whose surface's points count.
        path: along which.
        half_width: m.
        exact: keep the points, so that lines and edges can be found more exactly than by bins.
    """
    surface = cloud.surface if exact else cloud.surface[:: max(1, len(cloud.surface) // _ENOUGH)]
    station, offset = path.project(cloud.xyz[surface, :2])
    rows, columns = len(path.points) - 1, 2 * int(np.ceil(half_width / ACROSS))
    row = np.floor((station - path.start) / SPACING).astype(np.int64)
    column = np.floor(offset / ACROSS).astype(np.int64) + columns // 2
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    cell = row[inside] * columns + column[inside]
    kind = cloud.kind[surface][inside]

    def total(values: NDArray[np.generic] | None) -> Grid:
        return np.bincount(cell, values, rows * columns).reshape(rows, columns).astype(np.float32)

    count = total(None)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = total(cloud.xyz[surface, 2][inside]) / count
        brightness = total(cloud.intensity[surface][inside]) / count
        paved = total(np.isin(kind, (PointKind.PAVEMENT, PointKind.MARKING))) / count if cloud.labelled else None
        marked = total(kind == PointKind.MARKING) / count if cloud.marked else None
    paint = paint_share(brightness, paved) if marked is None else marked
    stations = path.start + SPACING * (np.arange(rows) + 0.5)
    offsets = ACROSS * (np.arange(columns) - columns // 2 + 0.5)
    points = None
    if exact and cloud.marked:
        points = _by_stretch(row[inside], station[inside], offset[inside], kind, rows)
    return Profiles(path, stations, offsets, count, paint, paved, height, brightness, points)


def _by_stretch(row: Int, station: Float, offset: Float, kind: NDArray[np.uint8], rows: int) -> SurfacePoints:
    stretch = row // STRETCH
    order = np.argsort(stretch * 1000.0 + offset)  # offsets are less than 100 m
    begins = np.searchsorted(stretch[order], np.arange(-(-rows // STRETCH) + 1))
    return SurfacePoints(
        begins=begins,
        station=station[order].astype(np.float32),
        offset=offset[order].astype(np.float32),
        paved=np.isin(kind[order], (PointKind.PAVEMENT, PointKind.MARKING)),
        marked=kind[order] == PointKind.MARKING,
    )


def paint_share(brightness: Grid, paved: Grid | None) -> Grid:
    """Return how far towards paint (1) from the pavement around it (0) each bin (S, U) is, by its intensity.

    The pavement around is the median of 11 m by 2.5 m: lines are narrower than that, and verges wider. Where classes
    tell pavement from verge, only pavement counts.
    """
    known = np.isfinite(brightness)
    if paved is not None:
        known &= np.nan_to_num(paved) > 0.5
    if not known.any():
        return np.full(brightness.shape, np.nan, dtype=np.float32)
    filled = _fill_bins(brightness, known)
    above = np.where(known, filled - ndimage.median_filter(filled, size=_BACKGROUND), 0.0)
    spread = 1.4826 * float(np.median(np.abs(above[known] - np.median(above[known]))))
    full = max(float(np.percentile(above[known], _PAINT_PERCENTILE)), 4.0 * spread, 1e-12)
    return np.where(known, np.clip(above / full, -0.5, 1.5), np.nan).astype(np.float32)


def _fill_bins(values: Grid, known: Bool) -> Grid:
    """Return values (S, U) whose unknown bins hold the mean of what is known around, farther away the less is."""
    result = np.where(known, values, 0.0).astype(np.float32)
    done = known.copy()
    for sigma in (_BLUR, 2.0, 6.0, 20.0):
        weight = ndimage.gaussian_filter(known.astype(np.float32), sigma)
        mean = ndimage.gaussian_filter(np.where(known, values, 0.0).astype(np.float32), sigma)
        new = ~done & (weight > 1e-3)
        result[new] = mean[new] / weight[new]
        done |= new
    result[~done] = float(np.median(values[known]))
    return result
