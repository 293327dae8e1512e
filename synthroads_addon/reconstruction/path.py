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
        place = (station - self.start) / SPACING
        at = np.clip(place.astype(np.int64), 0, len(self.points) - 2)
        share = (place - at)[:, None]
        position = self.points[at] + share * (self.points[at + 1] - self.points[at])
        return position, np.interp(place, np.arange(len(self.heading)), self.heading)

    def place(self, station: ArrayLike, offset: ArrayLike) -> Float:
        """Return points (N, 2) at stations and offsets (N,), the offset positive to the left."""
        position, heading = self.frame(station)
        # Unit vector to the left of the heading.
        left = np.column_stack([-np.sin(heading), np.cos(heading)])
        return np.asarray(position + np.asarray(offset, dtype=np.float64)[:, None] * left)

    def project(self, points: Float) -> tuple[Float, Float]:
        """Return stations and offsets (N,), m, of points (N, 2); beyond the ends along the tangents there."""
        frames = np.column_stack([self.points, self.heading])
        station, offset = np.empty(len(points)), np.empty(len(points))
        for begin in range(0, len(points), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            station[block], offset[block] = _project(frames, points[block], self._near(points[block]))
        return self.start + station, offset

    def within(self, points: Float, distance: float) -> Bool:
        """Return a mask (N,) of the points (N, 2) within a distance (m) of the path, to the nearest cell of 4 m."""
        middles, owner = _cells(points)
        away, _ = cKDTree(self.points).query(middles)
        return np.asarray((away < distance + _CELL)[owner])

    def _near(self, points: Float) -> Float:
        """Return rough distances (N,), m, along the path of points (N, 2): of each cell of 4 m that of its middle."""
        middles, owner = _cells(points)
        _, nearest = cKDTree(self.points).query(middles)
        return np.asarray(SPACING * nearest[owner].astype(np.float64))

    def beside(self, offset: float) -> CloudPath:
        """Return the path that lies an offset, m, of a fraction of its spacing to the left, with the same stations."""
        return CloudPath(self.place(self.stations, np.full(len(self.points), offset)), self.heading, self.start)

    def shift_by(self, offset: Float) -> CloudPath:
        """Return a path whose points lie offsets (M,), m, to the left of this one's, spaced anew each metre."""
        return path_through(self.place(self.stations, offset))


def _cells(points: Float) -> tuple[Float, Index]:
    """Return the centres (C, 2) of the 4 m cells that points (N, 2) lie in, and each point's cell index (N,)."""
    cell = np.floor(points / _CELL).astype(np.int64)
    low = cell.min(axis=0)
    key = (cell[:, 0] - low[0]) * (cell[:, 1].max() - low[1] + 1) + (cell[:, 1] - low[1])
    _, first, owner = np.unique(key, return_index=True, return_inverse=True)
    return (cell[first] + 0.5) * _CELL, owner


def _project(frames: Float, points: Float, along: Float) -> tuple[Float, Float]:
    """Return distances along a path of frames (M, 3: x, y, heading), and offsets (N,), from rough distances."""
    last = len(frames) - 2
    offset = np.empty(0)
    for round_ in range(_ROUNDS):
        place = along / SPACING
        at = np.clip(place.astype(np.int64), 0, last)
        share = np.clip(place - at, 0.0, 1.0)
        low = frames[at]
        change = frames[at + 1] - low
        heading = low[:, 2] + share * change[:, 2]
        beyond = (place - at)[:, None]
        vector = points - low[:, :2] - beyond * change[:, :2]
        cos, sin = np.cos(heading), np.sin(heading)
        offset = vector[:, 1] * cos - vector[:, 0] * sin
        if round_ < _ROUNDS - 1:
            # On the inside of a curve a step along the path is a shorter one beside it.
            # ds along the path is dt / (1 - kappa offset), of a step dt beside it.
            shorter = np.maximum(1.0 - offset * change[:, 2] / SPACING, 0.2)
            along = along + (vector[:, 0] * cos + vector[:, 1] * sin) / shorter
    return along, offset


def path_through(points: Float) -> CloudPath:
    """Return a path with a point each metre along a polyline (K, 2).

    Raises:
        InputError: it is shorter than `SHORTEST`.
    """
    step = np.hypot(*np.diff(points, axis=0).T)
    kept = np.append(True, step > 1e-6)
    points, step = points[kept], step[kept[1:]]
    run = np.append(0.0, np.cumsum(step))
    if run[-1] < SHORTEST:
        raise InputError("road", round(float(run[-1]), 1), f"at least {SHORTEST:g} m of road are needed in the cloud")
    station = np.arange(0.0, run[-1], SPACING)
    even = np.column_stack([np.interp(station, run, points[:, i]) for i in range(2)])
    change = np.gradient(even, axis=0)
    return CloudPath(even, np.unwrap(np.arctan2(change[:, 1], change[:, 0])))


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
    start, direction, half = _march_start(cells, tree)
    ahead = _march(cells, tree, start, direction, half)
    back = _march(cells, tree, start, direction + np.pi, half)
    line = np.array([*back[::-1], *ahead[1:]])
    if (line[-1] - line[0]) @ (np.cos(0.01), np.sin(0.01)) < 0.0:
        line = line[::-1]
    return smooth_path(path_through(line), _WAVELENGTH)


def smooth_path(path: CloudPath, wavelength: float) -> CloudPath:
    """Return a path smoothed so that swings shorter than a wavelength (m) vanish."""
    kept = path.points[::5]
    weights = np.ones(len(kept))
    smoothed = [smooth(kept[:, i], weights, 5.0 * SPACING, wavelength).values for i in range(2)]
    return path_through(np.column_stack(smoothed))


def _march_start(cells: Float, tree: cKDTree) -> tuple[Float, float, float]:
    """Return the point (2,) at which the march begins, its direction (rad), and the surface's half width there (m)."""
    _, middle = tree.query(np.median(cells, axis=0))
    for radius in _START_RADII:
        near = cells[tree.query_ball_point(cells[middle], radius)]
        centre = near.mean(axis=0)
        # Principal axes: the surface runs along that of the larger variance.
        spread, axes = np.linalg.eigh(np.cov((near - centre).T)) if len(near) > 2 else (np.ones(2), np.eye(2))
        if np.sqrt(spread[1]) > _LONGISH * np.sqrt(max(spread[0], 1e-9)):
            half = float(np.percentile(np.abs((near - centre) @ axes[:, 0]), 98))
            return centre, float(np.arctan2(axes[1, 1], axes[0, 1])), min(half + _MARGIN, _REACH)
    raise InputError("road", None, "its surface in the cloud is nowhere longer than wide: --path says how it runs")


def _march(cells: Float, tree: cKDTree, start: Float, direction: float, half: float) -> list[Float]:
    """Return the points of a march along the surface's middle from a start in a direction (rad), to its end."""
    line, at, missing = [start], start, 0.0
    while missing <= _GAP:
        forward = np.array([np.cos(direction), np.sin(direction)])
        ahead = at + _STEP * forward
        near = cells[tree.query_ball_point(ahead, np.hypot(half, _STEP))] - ahead
        along, across = near @ forward, near @ (-forward[1], forward[0])
        inside = (np.abs(along) <= _STEP) & (np.abs(across) <= half)
        at = ahead
        if inside.sum() < _FEWEST_CELLS:
            missing += _STEP
            continue
        missing = 0.0
        # Percentiles: single cells of an entrance or a side road don't turn the march.
        low, high = np.percentile(across[inside], [3, 97])
        at = ahead + 0.5 * (low + high) * np.array([-forward[1], forward[0]])
        half = min(0.5 * (high - low) + _MARGIN, _REACH)
        line.append(at)
        direction = _march_direction(line, direction)
    return line


def _march_direction(line: list[Float], before: float) -> float:
    """Return the direction (rad) after a march's latest points, turned from the one before by 0.12 rad at most."""
    last = np.array(line[-6:])
    chord = last[-1] - last[max(0, len(last) - 4)] if len(last) > 2 else last[-1] - last[0]
    turn = float(np.angle(np.exp(1j * (np.arctan2(chord[1], chord[0]) - before))))
    return before + float(np.clip(turn, -0.12, 0.12))
