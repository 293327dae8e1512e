"""A path along the road, the frame that all is measured in: first from the cloud alone, at last the alignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..base.arrays import Bool, Float, Index
from ..base.errors import InputError
from ..road.alignment import Alignment
from .smoothing import smooth

SPACING = 1.0
"""Distance of a path's points, m. Chosen: headings change little within it."""
_ROUNDS = 3
"""Rounds of a projection: two of Newton's steps along the path, and the offset from there. Chosen: from a place within
`_CELL` they converge."""
_CELL = 4.0
"""Edge of the cells whose middle's place is the first guess of a projection, m. Chosen: far less than a road's
radius."""
_BLOCK = 500_000
"""Points that are projected at once. Chosen: bounds memory."""
_STEP = 10.0
"""Step of the march, m. Chosen: less than a carriageway's width."""
_REACH = 40.0
"""Distance to either side that the road's surface is looked for at first, m. Chosen: a wide motorway's half with its
verges."""
_MARGIN = 3.0
"""Distance that the surface may become wider by from one step to the next, m. Chosen: a lane."""
_GAP = 90.0
"""Length without any surface that is crossed, m. Chosen: a bridge above."""
_FEWEST_CELLS = 8
"""Cells of surface in a step at least. Chosen: fewer tell no middle."""
_START_RADII = (60.0, 120.0, 240.0)
"""Radii about the middle of the surface, m, at the smallest of which it is longish the march begins. Chosen: from a
rural road's to a motorway's with its verges."""
_LONGISH = 2.0
"""Ratio of the deviations along and across from which on a surface is longish. Chosen: a square has 1."""
_WAVELENGTH = 120.0
"""Wavelength of which half of the first path's swings is kept, m. Chosen: shorter ones are the march's."""
SHORTEST = 50.0
"""A shorter path than this, m, cannot be told from a square. Chosen: a motorway's width with its verges."""


@dataclass(frozen=True)
class CloudPath:
    """A polyline along the road with a point and heading each metre: the frame of stations and offsets.

    Attributes:
        points: (M, 2) m.
        heading: (M,) rad, counted on through full turns.
        start: station of the first point, m.
    """

    points: Float
    heading: Float
    start: float = 0.0

    @property
    def stations(self) -> Float:
        """Return the stations (M,) of the points, m."""
        return self.start + SPACING * np.arange(len(self.points))

    @property
    def length(self) -> float:
        """Return the distance from the first to the last point, m."""
        return SPACING * (len(self.points) - 1)

    def frame(self, station: ArrayLike) -> tuple[Float, Float]:
        """Return positions (N, 2) and headings (N,) at stations (N,), straight on beyond the ends."""
        station = np.asarray(station, dtype=np.float64)
        vertex_position = (station - self.start) / SPACING
        index = np.clip(vertex_position.astype(np.int64), 0, len(self.points) - 2)
        share = (vertex_position - index)[:, None]
        position = self.points[index] + share * (self.points[index + 1] - self.points[index])
        return position, np.interp(vertex_position, np.arange(len(self.heading)), self.heading)

    def place(self, station: ArrayLike, offset: ArrayLike) -> Float:
        """Return points (N, 2) at stations and offsets (N,), the offset positive to the left."""
        position, heading = self.frame(station)
        # Unit vector to the left of the heading.
        left_normal = np.column_stack([-np.sin(heading), np.cos(heading)])
        return np.asarray(position + np.asarray(offset, dtype=np.float64)[:, None] * left_normal)

    def project(self, points: Float) -> tuple[Float, Float]:
        """Return stations and offsets (N,), m, of points (N, 2); beyond the ends along the tangents there."""
        frames = np.column_stack([self.points, self.heading])
        station, offset = np.empty(len(points)), np.empty(len(points))
        for begin in range(0, len(points), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            station[block], offset[block] = _project(frames, points[block], self._near(points[block]))
        return self.start + station, offset

    def within(self, points: Float, distance: float) -> Bool:
        """Return a mask (N,) of the points (N, 2) within a distance (m) of the path, judged by their cells of 4 m."""
        middles, owner = _cells(points)
        path_distance, _ = cKDTree(self.points).query(middles)
        return np.asarray((path_distance < distance + _CELL)[owner])

    def _near(self, points: Float) -> Float:
        """Return rough distances (N,), m, along the path of points (N, 2): those of the middles of their 4 m cells."""
        middles, owner = _cells(points)
        _, nearest_index = cKDTree(self.points).query(middles)
        return np.asarray(SPACING * nearest_index[owner].astype(np.float64))

    def beside(self, offset: float) -> CloudPath:
        """Return the path shifted to the left by an offset, m, far below its spacing, with the same stations."""
        return CloudPath(self.place(self.stations, np.full(len(self.points), offset)), self.heading, self.start)

    def shift_by(self, offset: Float) -> CloudPath:
        """Return the path shifted to the left by offsets (M,), m, and sampled again each metre."""
        return path_through(self.place(self.stations, offset))


def _cells(points: Float) -> tuple[Float, Index]:
    """Return the centres (C, 2) of the 4 m cells that points (N, 2) lie in, and each point's cell index (N,)."""
    cell = np.floor(points / _CELL).astype(np.int64)
    lowest_cell = cell.min(axis=0)
    key = (cell[:, 0] - lowest_cell[0]) * (cell[:, 1].max() - lowest_cell[1] + 1) + (cell[:, 1] - lowest_cell[1])
    _, first_points, owner = np.unique(key, return_index=True, return_inverse=True)
    return (cell[first_points] + 0.5) * _CELL, owner


def _project(frames: Float, points: Float, station: Float) -> tuple[Float, Float]:
    """Return distances along a path and offsets (N,), m, of points (N, 2), by Newton's method.

    Args:
        frames: (M, 3) x, y (m) and heading (rad) of the path's points.
        points: (N, 2) m.
        station: (N,) rough distances along the path, m, to begin with.
    """
    last_index = len(frames) - 2
    offset = np.empty(0)
    for round_ in range(_ROUNDS):
        vertex_position = station / SPACING
        index = np.clip(vertex_position.astype(np.int64), 0, last_index)
        share = np.clip(vertex_position - index, 0.0, 1.0)
        frame = frames[index]
        change = frames[index + 1] - frame
        heading = frame[:, 2] + share * change[:, 2]
        step_share = (vertex_position - index)[:, None]
        vector = points - frame[:, :2] - step_share * change[:, :2]
        cos, sin = np.cos(heading), np.sin(heading)
        offset = vector[:, 1] * cos - vector[:, 0] * sin
        if round_ < _ROUNDS - 1:
            # On the inside of a curve a step along the path is a shorter one beside it.
            # ds along the path is dt / (1 - kappa offset), of a step dt beside it.
            shorter = np.maximum(1.0 - offset * change[:, 2] / SPACING, 0.2)
            station = station + (vector[:, 0] * cos + vector[:, 1] * sin) / shorter
    return station, offset


def path_through(points: Float) -> CloudPath:
    """Return a path with a point each metre along a polyline (K, 2).

    Raises:
        InputError: the polyline is shorter than `SHORTEST`.
    """
    step = np.hypot(*np.diff(points, axis=0).T)
    distinct_points = np.append(True, step > 1e-6)
    points, step = points[distinct_points], step[distinct_points[1:]]
    run = np.append(0.0, np.cumsum(step))
    if run[-1] < SHORTEST:
        raise InputError("road", round(float(run[-1]), 1), f"at least {SHORTEST:g} m of road are needed in the cloud")
    station = np.arange(0.0, run[-1], SPACING)
    even_points = np.column_stack([np.interp(station, run, points[:, i]) for i in range(2)])
    change = np.gradient(even_points, axis=0)
    return CloudPath(even_points, np.unwrap(np.arctan2(change[:, 1], change[:, 0])))


def alignment_path(alignment: Alignment) -> CloudPath:
    """Return an alignment sampled each metre as a path; its last point may lie just beyond the end."""
    station = np.arange(0.0, np.ceil(alignment.length) + 0.5, SPACING)
    position, heading, _ = alignment.frame(station)
    return CloudPath(position, heading)


def first_path(xy: Float) -> CloudPath:
    """Return a first path along the middle of the road's surface, from its points (N, 2), m, in any order.

    Metre cells, not points, count, so that neither density nor overlapping strips pull the path. It begins in the
    middle of the surface in its longest direction and is marched both ways in steps of 10 m; gaps of less than 90 m are
    crossed in the direction that the road had before. It runs towards the east (or due north).

    Raises:
        InputError: the surface is nowhere longer than wide, or too short.
    """
    cells = np.unique(np.floor(xy).astype(np.int64), axis=0) + 0.5
    tree = cKDTree(cells)
    start, direction, half_width = _march_start(cells, tree)
    forward_points = _march(cells, tree, start, direction, half_width)
    backward_points = _march(cells, tree, start, direction + np.pi, half_width)
    line = np.array([*backward_points[::-1], *forward_points[1:]])
    # Eastwards; the angle of 0.01 rad decides the way of a line that runs due north.
    if (line[-1] - line[0]) @ (np.cos(0.01), np.sin(0.01)) < 0.0:
        line = line[::-1]
    return smooth_path(path_through(line), _WAVELENGTH)


def smooth_path(path: CloudPath, wavelength: float) -> CloudPath:
    """Return a path smoothed so that swings shorter than a wavelength (m) vanish."""
    sparse_points = path.points[::5]
    weights = np.ones(len(sparse_points))
    smooth_coordinates = [smooth(sparse_points[:, i], weights, 5.0 * SPACING, wavelength).values for i in range(2)]
    return path_through(np.column_stack(smooth_coordinates))


def _march_start(cells: Float, tree: cKDTree) -> tuple[Float, float, float]:
    """Return start point (2,), direction (rad) and half width (m) of the march along surface cells (N, 2)."""
    _, middle = tree.query(np.median(cells, axis=0))
    for radius in _START_RADII:
        cells_around = cells[tree.query_ball_point(cells[middle], radius)]
        centre = cells_around.mean(axis=0)
        # Principal axes: the surface runs along that of the larger variance.
        spread, axes = (
            np.linalg.eigh(np.cov((cells_around - centre).T)) if len(cells_around) > 2 else (np.ones(2), np.eye(2))
        )
        if np.sqrt(spread[1]) > _LONGISH * np.sqrt(max(spread[0], 1e-9)):
            # Chosen: 2 % of the cells may lie off the road, in drives and junctions.
            half_width = float(np.percentile(np.abs((cells_around - centre) @ axes[:, 0]), 98))
            return centre, float(np.arctan2(axes[1, 1], axes[0, 1])), min(half_width + _MARGIN, _REACH)
    raise InputError("road", None, "its surface in the cloud is nowhere longer than wide: --path says how it runs")


def _march(cells: Float, tree: cKDTree, start: Float, direction: float, half_width: float) -> list[Float]:
    """Return the points of a march along the surface's middle, in steps of `_STEP`, until no surface follows.

    Args:
        cells: (N, 2) middles of the surface's metre cells.
        tree: of the cells.
        start: (2,) point at which it begins.
        direction: in which it begins, rad.
        half_width: distance to either side in which the surface is looked for first, m.
    """
    line, point, gap_length = [start], start, 0.0
    while gap_length <= _GAP:
        forward = np.array([np.cos(direction), np.sin(direction)])
        next_point = point + _STEP * forward
        relative_cells = cells[tree.query_ball_point(next_point, np.hypot(half_width, _STEP))] - next_point
        along_distance, across_distance = relative_cells @ forward, relative_cells @ (-forward[1], forward[0])
        in_window = (np.abs(along_distance) <= _STEP) & (np.abs(across_distance) <= half_width)
        point = next_point
        if in_window.sum() < _FEWEST_CELLS:
            gap_length += _STEP
            continue
        gap_length = 0.0
        # Percentiles: single cells of an entrance or a side road don't turn the march.
        right_edge, left_edge = np.percentile(across_distance[in_window], [3, 97])
        point = next_point + 0.5 * (right_edge + left_edge) * np.array([-forward[1], forward[0]])
        half_width = min(0.5 * (left_edge - right_edge) + _MARGIN, _REACH)
        line.append(point)
        direction = _march_direction(line, direction)
    return line


def _march_direction(line: list[Float], previous_direction: float) -> float:
    """Return the direction (rad) of a march's latest points, turned from the previous direction by 0.12 rad at most.

    0.12 rad in a step of 10 m is a curve of 83 m radius (chosen: sharper ones are faults).
    """
    latest_points = np.array(line[-6:])
    chord = (
        latest_points[-1] - latest_points[max(0, len(latest_points) - 4)]
        if len(latest_points) > 2
        else latest_points[-1] - latest_points[0]
    )
    turn = float(np.angle(np.exp(1j * (np.arctan2(chord[1], chord[0]) - previous_direction))))
    return previous_direction + float(np.clip(turn, -0.12, 0.12))
