"""Frames of slices across a road: along a path that was driven, flown or drawn, or found in the cloud itself.

The path is never the truth. For training it is the truth displaced at random (`displace_frames`); in use it comes from
a file (`read_path`) or from the points (`estimated_path`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import savgol_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree
from scipy.special import ndtr

from synthroads_addon.base.arrays import Bool, Float, Index
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

SPACING = 1.0
"""Distance of the frames along their path, m."""
_BIN = 4.0
"""Length along a path over which the points' extent across it is taken, m."""
_STRAY = 0.02
"""Share of the outermost points on either side that don't count for the extent, as they may be stray."""
_WHOLE = 0.75
"""Share of the median extent that a place must have to count."""
_WAVES = 12
"""Number of cosines that make up a random deviation."""


@dataclass(frozen=True)
class Frames:
    """M local frames along a path: x along it, y to its left, z up.

    Attributes:
        position: (M, 2) float64 origins in plan, m.
        direction: (M,) float64 directions of x, rad counter-clockwise from the coordinates' x.
        station: (M,) float64 running length along the path, m.
    """

    position: Float
    direction: Float
    station: Float

    def __len__(self) -> int:
        return len(self.station)

    def select(self, keep: Bool | Index | slice) -> Frames:
        """Return the frames chosen by a mask, indices or a slice."""
        return Frames(self.position[keep], self.direction[keep], self.station[keep])

    def at(self, y: ArrayLike) -> Float:
        """Return the points (M, 2) in plan that lie y (M,) to the left of the frames' origins."""
        left_normals = np.column_stack([-np.sin(self.direction), np.cos(self.direction)])
        return self.position + np.asarray(y, dtype=np.float64)[:, None] * left_normals

    def reverse(self) -> Frames:
        """Return the frames in reverse order, turned by pi: the path travelled the other way."""
        return Frames(self.position[::-1], self.direction[::-1] + np.pi, self.station[::-1])


def frames_along(path: MeasuredAxis, spacing: float = SPACING, reach: float = 5.0) -> Frames:
    """Return frames every ``spacing`` along a path, none in its gaps.

    Args:
        path: the path.
        spacing: between two frames, m.
        reach: distance before and behind a frame between which the path's chord gives its direction, m.
    """
    station = path.stations(spacing)
    return Frames(path.position(station), path.direction(station, reach), station)


def displace_frames(
    frames: Frames, rng: np.random.Generator, window: float, direction_deg: float, length: float
) -> Frames:
    """Return frames moved sideways and turned by smooth random amounts.

    Args:
        frames: frames without displacement.
        rng: random stream of the deviation.
        window: the deviation is uniform in -window / 2 to window / 2, m.
        direction_deg: standard deviation of the error of direction beside what the deviation's own slope makes, deg.
        length: correlation length of the deviation, m; that of the error of direction is a third of it.
    """
    share, slope = random_deviation(frames.station, rng, length)
    error, _ = random_deviation(frames.station, rng, length / 3.0)
    # A uniform share as a normal deviate, cut at two standard deviations.
    turn = np.deg2rad(direction_deg) * np.clip(np.sqrt(12.0) * error, -2.0, 2.0)
    return Frames(frames.at(window * share), frames.direction + np.arctan(window * slope) + turn, frames.station)


def random_deviation(station: Float, rng: np.random.Generator, length: float) -> tuple[Float, Float]:
    """Return smooth random values (M,) along stations (m), uniform in -0.5 to 0.5, and their slope (M,), 1/m.

    A Gaussian process of cosines with random wavelengths (Rahimi and Recht, "Random features", 2007; correlation length
    ``length``, m) passed through the normal distribution function.
    """
    rate = rng.standard_normal(_WAVES) / length
    phase = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    # Normal amplitudes make the sum normal whatever the number of waves.
    amplitude = rng.standard_normal(_WAVES) * np.sqrt(2.0 / _WAVES)
    angle = station[:, None] * rate + phase
    value = np.cos(angle) @ amplitude
    slope = -np.sin(angle) @ (amplitude * rate)
    density = np.exp(-0.5 * value**2) / np.sqrt(2.0 * np.pi)
    return ndtr(value) - 0.5, density * slope


def sequences(frames: Frames, length: int, step: int | None = None, spacing: float = SPACING) -> Index:
    """Return indices (K, length) of runs of frames at equal spacing that together cover all frames.

    A run never crosses a gap. The last of a stretch overlaps the one before; a shorter stretch repeats its last frame.
    Where frames lie closer together than the spacing, runs are interleaved: each takes every n-th frame.

    Args:
        frames: M frames in the order of their stations.
        length: frames per run.
        step: frames of a run from its start to that of the next one; ``length`` if not given.
        spacing: of a run's frames, m; to the nearest multiple of the frames' own.
    """
    step = step or length
    stride = interleave_count(frames, spacing)
    runs = []
    for stretch in stretches(frames, spacing):
        for frame_indices in (stretch[offset::stride] for offset in range(min(stride, len(stretch)))):
            starts = np.arange(0, max(1, len(frame_indices) - length + 1), step)
            if starts[-1] + length < len(frame_indices):
                starts = np.append(starts, len(frame_indices) - length)
            runs.append(frame_indices[np.minimum(starts[:, None] + np.arange(length), len(frame_indices) - 1)])
    return np.concatenate(runs) if runs else np.empty((0, length), dtype=np.intp)


def interleave_count(frames: Frames, spacing: float) -> int:
    """Return the ratio, rounded and at least 1, of a sequence's spacing (m) to the frames' own: every n-th is taken."""
    return max(1, round(spacing / _frame_spacing(frames, spacing)))


def stretches(frames: Frames, spacing: float = SPACING) -> list[Index]:
    """Return the frames' indices per gapless stretch; a gap is more than 1.5 times their spacing, `spacing` at most."""
    gaps = np.abs(np.diff(frames.station)) > 1.5 * _frame_spacing(frames, spacing)
    return [part for part in np.split(np.arange(len(frames)), np.flatnonzero(gaps) + 1) if len(part)]


def _frame_spacing(frames: Frames, largest: float) -> float:
    """Return the median distance of neighbouring frames, m, at most ``largest``."""
    return min(float(np.median(np.abs(np.diff(frames.station)))), largest) if len(frames) > 1 else largest


def read_path(
    file: Path, origin: ArrayLike = (0.0, 0.0, 0.0), tolerance: float = 0.3, place: Placement | None = None
) -> MeasuredAxis:
    """Read a path along the road from CSV or GeoJSON, a drawn line or a trajectory, thinned to `tolerance` (m).

    Args:
        file: CSV with columns x and y (trajectories have more) or GeoJSON, in the cloud's map coordinates.
        origin: (3,) map coordinates that were subtracted from the cloud's points.
        tolerance: points are dropped until one lies at least this far from the next, m: a platform that stands still
            has no direction.
        place: coordinate system of the cloud, see `read_axis`.

    Raises:
        MissingFileError, InputError: see `read_axis`.
    """
    full_path = MeasuredAxis.read(file, np.inf, place).translate(-np.asarray(origin, dtype=np.float64))
    keep, last_station = [0], 0.0
    for index, station in enumerate(full_path.station[1:], 1):
        if station - last_station >= tolerance:
            keep.append(index)
            last_station = station
    if len(keep) < 2:
        raise InputError(str(file), full_path.length, f"must be a path of at least {tolerance:g} m length")
    return MeasuredAxis(full_path.points[keep])


def estimated_path(xyz: Float, cell: float = 4.0, window: float = 60.0, half_width: float = 40.0) -> MeasuredAxis:
    """Return the line along the middle of a strip of points, found from the points alone, however the strip bends.

    The two ends of the strip are the cells of a grid that lie farthest apart along it. The shortest way between them is
    smoothed, then three times moved to the middle of the points' extent across it and smoothed.

    Args:
        xyz: (N, 2 or 3) points of the road, or of a strip around it, m.
        cell: edge of the grid's cells, m.
        window: length over which a parabola is fitted to smooth the line (Savitzky and Golay 1964), m.
        half_width: points farther from the line than this don't count, m.

    Raises:
        InputError: the points make up less than two cells.
    """
    plan = np.asarray(xyz, dtype=np.float64)[:, :2]
    cells = _cells(plan, cell)
    rough_path = MeasuredAxis(cells[_shortest_way(cells, cell)])
    path = (
        _smooth_line(rough_path.position(rough_path.stations(SPACING)), window)
        if rough_path.length > 4 * SPACING
        else rough_path
    )
    for _ in range(3):
        path = _centre_path(path, plan, window, half_width)
    return path


def _cells(plan: Float, cell: float) -> Float:
    """Return the mean (C, 2) of the points in every occupied cell of a grid of edge `cell`, m."""
    cell_index = np.floor((plan - plan.min(axis=0)) / cell).astype(np.int64)
    _, owner, counts = np.unique(cell_index @ np.array([1 << 32, 1]), return_inverse=True, return_counts=True)
    if len(counts) < 2:
        raise InputError("cloud", len(plan), f"must extend over more than {cell:g} m, so that its road can be found")
    return np.column_stack([np.bincount(owner, plan[:, column]) for column in (0, 1)]) / counts[:, None]


def _shortest_way(cells: Float, cell: float) -> Index:
    """Return the indices of the cells on the shortest path between the two farthest apart along the strip."""
    # Chosen: cells two apart are still neighbours, a tenth more as the means lie off their cells' middles.
    pairs = cKDTree(cells).query_pairs(2.1 * cell, output_type="ndarray")
    pairs = _bridge_cells(cells, pairs)
    graph = _graph(len(cells), pairs, np.hypot(*(cells[pairs[:, 0]] - cells[pairs[:, 1]]).T))
    start = 0
    for _ in range(2):
        start = int(np.argmax(dijkstra(graph, directed=False, indices=start)))
    distance, predecessors = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    way = [int(np.argmax(distance))]
    while way[-1] != start:
        way.append(int(predecessors[way[-1]]))
    # From the lower to the higher x (or y), so that the direction doesn't hang on the order of the points.
    return np.array(way if tuple(cells[way[0]]) < tuple(cells[way[-1]]) else way[::-1])


def _bridge_cells(cells: Float, pairs: Index) -> Index:
    """Return the pairs of neighbouring cells (P, 2), with the shortest links added that make the graph connected."""
    while True:
        count, part = connected_components(_graph(len(cells), pairs, np.ones(len(pairs))), directed=False)
        if count == 1:
            return pairs
        component, other_cells = np.flatnonzero(part == part[0]), np.flatnonzero(part != part[0])
        distance, nearest_index = cKDTree(cells[component]).query(cells[other_cells])
        closest_index = int(np.argmin(distance))
        pairs = np.concatenate([pairs, [[component[nearest_index[closest_index]], other_cells[closest_index]]]])


def _graph(count: int, pairs: Index, weights: Float) -> Any:
    """Return the sparse graph of cells whose linked pairs (P, 2) have weights (P,)."""
    return coo_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()


def _centre_path(path: MeasuredAxis, plan: Float, window: float, half_width: float) -> MeasuredAxis:
    """Return a path moved to the middle of the points' extent across it and smoothed over `window`, m."""
    station, offset = path.project(plan)
    is_near = np.abs(offset) <= half_width
    station, offset = station[is_near], offset[is_near]
    bins = ((station - station.min()) / _BIN).astype(int)
    order = np.lexsort((offset, bins))
    sorted_offset, occupied_bins = offset[order], np.unique(bins)
    start, end = (np.searchsorted(bins[order], occupied_bins, side) for side in ("left", "right"))
    # Not the outermost points, which may be stray.
    right_extent = sorted_offset[start + (_STRAY * (end - start)).astype(int)]
    left_extent = sorted_offset[end - 1 - (_STRAY * (end - start)).astype(int)]
    # Where a strip is cut off askew, or one side is hidden, the middle of what is left isn't the strip's.
    is_wide_enough = left_extent - right_extent >= _WHOLE * np.median(left_extent - right_extent)
    middle = station.min() + _BIN * (occupied_bins[is_wide_enough] + 0.5)
    right_extent = right_extent[is_wide_enough]
    left_extent = left_extent[is_wide_enough]
    stations = np.arange(station.min(), station.max() + 0.5 * SPACING, SPACING)
    return _smooth_line(
        _on_path(path, stations).at(np.interp(stations, middle, 0.5 * (right_extent + left_extent))), window
    )


def _on_path(path: MeasuredAxis, station: Float) -> Frames:
    """Return frames at stations (M,), m, of a path without gaps, extended straight beyond its ends."""
    clipped_station = np.clip(station, 0.0, path.length)
    direction = path.direction(clipped_station, reach=8.0)
    overshoot = (station - clipped_station)[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    return Frames(path.position(clipped_station) + overshoot, direction, station)


def _smooth_line(points: Float, window: float) -> MeasuredAxis:
    """Return the line through points (N, 2), `SPACING` apart, smoothed by a Savitzky-Golay filter over `window`, m."""
    size = min(int(window / SPACING), len(points) - 1) // 2 * 2 + 1
    return MeasuredAxis(savgol_filter(points, size, polyorder=min(2, size - 1), axis=0, mode="interp"))
