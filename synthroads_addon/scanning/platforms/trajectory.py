"""A platform that moves as a trajectory file says, and reading that file; every fault of it is one line."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float, Int
from ...base.errors import InputError, nearest_name
from ...base.files import read_text
from ...base.rotations import angle_between, quaternion_matrices, quaternions, rotation_matrix, slerp
from ...road.centerline import FARTHEST, fields_of
from .guides import Guide
from .path import KNOT_RANGE, Strip, knot_spacing_for
from .platform import Platform

COLUMNS = ("time", "x", "y", "z", "roll", "pitch", "heading")
"""Names in the header; in any order and case, beside any others."""
_LARGEST = 1e10
"""Largest time (s: GPS time counts thousands of millions) and angle (deg)."""
_NEAREST = 8.0  # m, of the typical range
_GRID = 1e-6  # s, that times may lie beside an even grid
_SUBDIVISIONS = 50
_LARGEST_TURN = np.deg2rad(150.0)


class RecordedTrajectory(Platform):
    """Platform that moved as a file says, along a trajectory measured or made up."""

    order: ClassVar[int] = 4

    kind: Literal["trajectory"] = Field("trajectory", title="Platform", description="Platform.")
    file: str | None = Field(None, title="Trajectory", description="CSV with time, x, y, z, roll, pitch, heading.")

    def make_path(self, guide: Guide, origin: Sequence[float] | None = None) -> TrajectoryPath:
        """Return the path through the poses of the platform's file, as one strip."""
        return TrajectoryPath(self, guide, origin)


class TrajectoryPath:
    """One strip through the poses of a file: positions joined linearly, attitudes by spherical interpolation.

    Attributes:
        strips: the only one.
        knot_spacing: s, see `Path`. Where the file's times lie on an even grid, knots do too, and positions between
            them are exact; otherwise it is short enough for the corners of the trajectory.
        typical_range: median height above the guide, but `_NEAREST` at least, m.

    Args:
        platform: with a file and a mounting.
        guide: what the height is counted from.
        origin: map coordinates of the local origin, m; the guide's if not given.

    Raises:
        InputError: there is no file, it is wrong, or two rows are turned too far to know the way between them.
    """

    def __init__(self, platform: RecordedTrajectory, guide: Guide, origin: Sequence[float] | None = None) -> None:
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
        self._mounting = platform.mounting()
        self.strips = (Strip(0, 0.0, float(self._time[-1]), ends=True),)
        self.knot_spacing = self._knots()
        self.typical_range = max(_NEAREST, float(np.median(self._height_above(guide))))

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first row.

        Beyond the ends positions go on straight, and the attitude is that of the end.
        """
        time = np.asarray(time, dtype=np.float64)
        row = np.clip(np.searchsorted(self._time, time, side="right") - 1, 0, len(self._time) - 2)
        share = (time - self._time[row]) / (self._time[row + 1] - self._time[row])
        step = self._position[row + 1] - self._position[row]
        position = self._position[row] + share[:, None] * step
        turned = slerp(self._attitude[row], self._attitude[row + 1], np.clip(share, 0.0, 1.0))
        return position, quaternion_matrices(turned) @ self._mounting

    def _height_above(self, guide: Guide) -> Float:
        rows = np.unique(np.linspace(0, len(self._time) - 1, 1000).astype(np.int64))
        station, _ = guide.project(self._position[rows, :2])
        return self._position[rows, 2] - guide.elevation(np.clip(station, 0.0, guide.length))

    def _knots(self) -> float:
        interval = np.diff(self._time)
        turning = angle_between(self._attitude[:-1], self._attitude[1:]) / interval
        # Between rows positions are linear, so only the turning bends; it does so evenly.
        within = knot_spacing_for(KNOT_RANGE * float(turning.max()) ** 2)
        for parts in range(1, _SUBDIVISIONS + 1):
            grid = float(interval.min()) / parts
            grid = float(self._time[-1]) / max(round(float(self._time[-1]) / grid), 1)
            if np.abs(self._time - np.round(self._time / grid) * grid).max() <= _GRID:
                return grid / np.ceil(grid / within)
        velocity = np.diff(self._position, axis=0) / interval[:, None]
        corner = np.linalg.norm(np.diff(velocity, axis=0), axis=1) + KNOT_RANGE * (turning[1:] + turning[:-1])
        return knot_spacing_for(KNOT_RANGE * float(turning.max()) ** 2, float(corner.max(initial=0.0)))


def _refuse_wide_turns(file: str, rows: Trajectory, attitude: Float) -> None:
    turn = angle_between(attitude[:-1], attitude[1:])
    if turn.max() > _LARGEST_TURN:
        row = int(turn.argmax()) + 1
        allowed = f"the platform turns by {np.rad2deg(turn[row - 1]):.0f} degrees since the row before, at most 150"
        raise InputError(f"{file}:{rows.lines[row]} heading", float(rows.heading[row]), allowed)


@dataclass(frozen=True)
class Trajectory:
    """R measured poses of a platform.

    Attributes:
        time: (R,) s, increasing.
        position: (R, 3) map coordinates, m.
        roll: (R,) deg, positive right side down.
        pitch: (R,) deg, positive nose up.
        heading: (R,) deg, clockwise from north.
        lines: (R,) numbers of the file's lines.
    """

    time: Float
    position: Float
    roll: Float
    pitch: Float
    heading: Float
    lines: Int


def read_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read poses from a CSV file with the columns time, x, y, z, roll, pitch and heading (s, m, deg).

    The first line that is neither empty nor a comment (``#``) is the header; columns are separated by commas,
    semicolons, tabs or spaces.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: a column is missing or there twice, a value is no finite number, the time doesn't increase, or
            there are fewer than two rows.
    """
    name, kind = os.fspath(path), f"this is no text: CSV with columns {', '.join(COLUMNS)} is needed"
    text = read_text(name, kind, "a trajectory file is needed here", encoding="utf-8-sig")
    numbered = enumerate(text.splitlines(), 1)
    lines = [(number, line) for number, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(name, None, f"the file is empty: a header with {', '.join(COLUMNS)} is needed")
    separator = next((mark for mark in (";", ",", "\t") if mark in lines[0][1]), " ")
    head = f"{name}:{lines[0][0]}"
    places = _columns(head, fields_of(lines[0][1], separator, head))
    if len(lines) < 3:
        raise InputError(name, None, f"at least two rows below the header are needed, the file has {len(lines) - 1}")
    below = ((f"{name}:{number}", line) for number, line in lines[1:])
    rows = np.array([_row(place, fields_of(line, separator, place), places) for place, line in below])
    numbers = np.array([number for number, _ in lines[1:]])
    late = np.flatnonzero(np.diff(rows[:, 0]) <= 0.0)
    if len(late):
        before, row = late[0], late[0] + 1
        allowed = f"times must increase: more than {float(rows[before, 0])!r} s is needed"
        raise InputError(f"{name}:{numbers[row]} time", float(rows[row, 0]), allowed)
    return Trajectory(rows[:, 0], rows[:, 1:4], rows[:, 4], rows[:, 5], rows[:, 6], numbers)


def _columns(place: str, head: list[str]) -> list[int]:
    names = [entry.lower() for entry in head]
    for column in COLUMNS:
        if names.count(column) != 1:
            often = "is missing" if column not in names else f"is there {names.count(column)} times"
            hint = nearest_name(column, set(names) - set(COLUMNS)) if column not in names else ""
            allowed = f"a header with the columns {', '.join(COLUMNS)} is needed: {column} {often}{hint}"
            raise InputError(place, ", ".join(head), allowed)
    return [names.index(column) for column in COLUMNS]


def _row(place: str, entries: list[str], places: list[int]) -> list[float]:
    if len(entries) <= max(places):
        allowed = f"at least {max(places) + 1} columns are needed, this line has {len(entries)}"
        raise InputError(place, " ".join(entries), allowed)
    values = []
    for column, at in zip(COLUMNS, places, strict=True):
        try:
            value = float(entries[at])
        except ValueError:
            value = math.nan
        largest = FARTHEST if column in "xyz" else _LARGEST
        if not abs(value) <= largest:
            raise InputError(f"{place} {column}", entries[at], f"a finite number is needed, at most {largest:g}")
        if column == "pitch" and abs(value) > 90.0:
            raise InputError(f"{place} {column}", value, "from -90 to 90 deg")
        values.append(value)
    return values
