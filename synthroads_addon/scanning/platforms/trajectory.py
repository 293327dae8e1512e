"""A platform that moves as a trajectory file says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.rotations import angle_between, matrices, quaternions, rotation_matrix, slerp
from ...scenario.scan import Platform
from .base import KNOT_RANGE, Strip, knots_for, mounting, strips_of
from .guides import Float, Guide
from .trajectory_file import Trajectory, read_trajectory

_NEAREST = 8.0  # m, of the typical range
_GRID = 1e-6  # s, that times may lie beside an even grid
_SUBDIVISIONS = 50
_LARGEST_TURN = np.deg2rad(150.0)


class TrajectoryPath:
    """One strip through the poses of a file: positions joined linearly, attitudes by spherical interpolation.

    Attributes:
        strips: the only one.
        knot_spacing: s, see `Path`. Where the file's times lie on an even grid, knots do too, and positions between
            them are exact; otherwise it is short enough for the corners of the trajectory.
        typical_range: median height above the guide, but `_NEAREST` at least, m.
        deviation: 0.

    Args:
        platform: with a file and a mounting.
        guide: what the height is counted from.
        origin: map coordinates of the local origin, m; the guide's if not given.

    Raises:
        InputError: there is no file, it is wrong, or two rows are turned too far to know the way between them.
    """

    deviation = 0.0

    def __init__(self, platform: Platform, guide: Guide, origin: Sequence[float] | None = None) -> None:
        if platform.file is None:
            raise InputError("scan.platform.file", None, "a trajectory needs a CSV file")
        rows = read_trajectory(platform.file)
        base = guide.origin if origin is None else np.array(origin, dtype=np.float64)
        self._time = rows.time - rows.time[0]
        self._position = rows.position - base
        # North is local y: a heading clockwise from it is 90 degrees less itself, counter-clockwise from x.
        angles = np.deg2rad([90.0 - rows.heading, rows.pitch, rows.roll])
        self._attitude = quaternions(rotation_matrix(*angles))
        _refuse_wide_turns(platform.file, rows, self._attitude)
        self._mounting = mounting(platform)
        self.strips = strips_of([float(self._time[-1])])
        self.knot_spacing = self._knots()
        self.typical_range = max(_NEAREST, float(np.median(self._height_above(guide))))

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first row.

        Beyond the ends positions go on straight, and the attitude is that of the end.
        """
        wanted = np.asarray(time, dtype=np.float64)
        row = np.clip(np.searchsorted(self._time, wanted, side="right") - 1, 0, len(self._time) - 2)
        share = (wanted - self._time[row]) / (self._time[row + 1] - self._time[row])
        step = self._position[row + 1] - self._position[row]
        position = self._position[row] + share[:, None] * step
        turned = slerp(self._attitude[row], self._attitude[row + 1], np.clip(share, 0.0, 1.0))
        return position, matrices(turned) @ self._mounting

    def _height_above(self, guide: Guide) -> Float:
        rows = np.unique(np.linspace(0, len(self._time) - 1, 1000).astype(np.int64))
        station, _ = guide.project(self._position[rows, :2])
        return self._position[rows, 2] - guide.elevation(np.clip(station, 0.0, guide.length))

    def _knots(self) -> float:
        interval = np.diff(self._time)
        turning = angle_between(self._attitude[:-1], self._attitude[1:]) / interval
        # Between rows positions are linear, so only the turning bends; it does so evenly.
        within = knots_for(KNOT_RANGE * float(turning.max()) ** 2)
        for parts in range(1, _SUBDIVISIONS + 1):
            grid = float(interval.min()) / parts
            grid = float(self._time[-1]) / max(round(float(self._time[-1]) / grid), 1)
            if np.abs(self._time - np.round(self._time / grid) * grid).max() <= _GRID:
                return grid / np.ceil(grid / within)
        velocity = np.diff(self._position, axis=0) / interval[:, None]
        corner = np.linalg.norm(np.diff(velocity, axis=0), axis=1) + KNOT_RANGE * (turning[1:] + turning[:-1])
        return knots_for(KNOT_RANGE * float(turning.max()) ** 2, float(corner.max(initial=0.0)))


def _refuse_wide_turns(file: str, rows: Trajectory, attitude: Float) -> None:
    turn = angle_between(attitude[:-1], attitude[1:])
    if turn.max() > _LARGEST_TURN:
        row = int(turn.argmax()) + 1
        allowed = f"the platform turns by {np.rad2deg(turn[row - 1]):.0f} degrees since the row before, at most 150"
        raise InputError(f"{file}:{rows.lines[row]} heading", float(rows.heading[row]), allowed)
