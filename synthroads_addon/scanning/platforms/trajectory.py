"""A platform that moves as a trajectory file says, and reading that file; every fault of it is one line."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr

from ...base.arrays import Float, Int
from ...base.errors import InputError, nearest_name
from ...base.files import decoded, read_bytes
from ...base.maps.crs import MapSystem
from ...base.maps.places import Placement, bring, check_heights
from ...base.remarks import warn
from ...base.rotations import angle_between, quaternion_matrices, quaternions, rotation_matrix, slerp, wrap_angle
from ...base.schema import quantity
from ...road.axes.centerline import FARTHEST, csv_system, fields_of
from .guides import Guide
from .path import KNOT_RANGE, Strip, knot_spacing_for
from .platform import Platform
from .sbet import is_sbet, poses_on_map, read_records

COLUMNS = ("time", "x", "y", "z", "roll", "pitch", "heading")
"""Names in the header; in any order and case, beside any others."""
_HEAD = 4096
"""Bytes by which SBET is told from CSV."""
_LARGEST = 1e10
"""Largest time (s: GPS time counts thousands of millions) and angle (deg)."""
_NEAREST = 8.0
"""Least typical range, m. Chosen: a car's scanner to the road beside it."""
_GRID = 1e-6
"""Time that a row may lie beside an even grid, s. Chosen: files have six decimals."""
_SUBDIVISIONS = 50
"""Parts of the shortest interval that are tried as an even grid's step. Chosen: rows of files are thinned by less."""
_STILL = 0.5
"""Speed below which a platform has no course, m/s. Chosen: positions' noise is as fast."""
_ACROSS, _BESIDE, _ALONG = 35.0, 8.0, 4.0
"""Median angles (deg) between heading and course: too wide in any case; odd where another convention fits as well.
Chosen: crab angles of aircraft stay below the first."""
_CONVENTION = "degrees clockwise from grid north"
"""Convention of the headings that files must have."""
_LARGEST_TURN = np.deg2rad(150.0)
"""Turn from one row to the next that is refused, rad. Chosen: near half a turn its sense is lost."""


class RecordedTrajectory(Platform):
    """Platform that moved as a file says, along a trajectory measured or made up."""

    order: ClassVar[int] = 4

    kind: Literal["trajectory"] = Field("trajectory", title="Platform", description="Platform.")
    file: str | None = Field(
        None, title="Trajectory", description="CSV with time, x, y, z, roll, pitch, heading; or SBET."
    )
    keep_time: bool = Field(
        False, title="Keep Time", description="Keep the times of the file, instead of counting from its first."
    )
    height_shift: float = quantity(
        0.0, "m", "Added to the file's heights; minus the geoid height if they are ellipsoidal.", (-1000, 1000)
    )

    _content: TrajectoryContent | None = PrivateAttr(None)

    def opened(self) -> Self:
        """Return the platform with its file read, wherever its poses lie; itself where it has none."""
        if self.file is None:
            return self
        result = self.model_copy()
        result._content = TrajectoryContent.read(self.file)
        return result

    def rows(self, place: Placement) -> Trajectory:
        """Return the poses of the file, moved into the map's coordinate system; see `read_trajectory`.

        Raises:
            InputError: there is no file, or it is wrong.
        """
        if self.file is None:
            raise InputError("scan.platform.file", None, "a trajectory needs a CSV file")
        return (self._content or TrajectoryContent.read(self.file)).placed(place)

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
        epoch: what points' times count from, s: see `epoch_of`.

    Args:
        platform: with a file and a mounting.
        guide: what the height is counted from.
        origin: map coordinates of the local origin, m; the guide's if not given.

    Raises:
        InputError: there is no file, it is wrong, or two rows are turned too far to know the way between them.
    """

    def __init__(self, platform: RecordedTrajectory, guide: Guide, origin: Sequence[float] | None = None) -> None:
        rows, file = platform.rows(guide.place), str(platform.file)
        check_headings(Path(file).name, rows)
        base = guide.origin if origin is None else np.array(origin, dtype=np.float64)
        self._time = rows.time - rows.time[0]
        self._position = rows.position + (0.0, 0.0, platform.height_shift) - base
        self.epoch = float(rows.time[0]) if platform.keep_time else 0.0
        # North is local y: a heading clockwise from it is 90 degrees less itself, counter-clockwise from x.
        angles = np.deg2rad([90.0 - rows.heading, rows.pitch, rows.roll])
        self._attitude = quaternions(rotation_matrix(*angles))
        _refuse_wide_turns(file, rows, self._attitude)
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
        attitude = slerp(self._attitude[row], self._attitude[row + 1], np.clip(share, 0.0, 1.0))
        return position, quaternion_matrices(attitude) @ self._mounting

    def _height_above(self, guide: Guide) -> Float:
        """Return the heights (K,), m, of a thousand rows at most above a guide."""
        rows = np.unique(np.linspace(0, len(self._time) - 1, 1000).astype(np.int64))
        station, _ = guide.project(self._position[rows, :2])
        return self._position[rows, 2] - guide.elevation(np.clip(station, 0.0, guide.length))

    def _knots(self) -> float:
        """Return the time between two knots, s: a step of an even grid on which all rows lie, if there is one.

        Else it is as short as the corners of the trajectory ask.
        """
        interval = np.diff(self._time)
        turn_rate = angle_between(self._attitude[:-1], self._attitude[1:]) / interval
        # Between rows positions are linear, so only the turning bends; it does so evenly.
        bend = KNOT_RANGE * float(turn_rate.max()) ** 2
        largest_spacing = knot_spacing_for(bend)
        duration = float(self._time[-1])
        for parts in range(1, _SUBDIVISIONS + 1):
            # A part of the shortest interval, rounded so that whole steps fill the duration.
            step = float(interval.min()) / parts
            step = duration / max(round(duration / step), 1)
            if np.abs(self._time - np.round(self._time / step) * step).max() <= _GRID:
                return step / np.ceil(step / largest_spacing)
        velocity = np.diff(self._position, axis=0) / interval[:, None]
        velocity_jump = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
        jump = velocity_jump + KNOT_RANGE * (turn_rate[1:] + turn_rate[:-1])
        return knot_spacing_for(bend, float(jump.max(initial=0.0)))


def check_headings(name: str, rows: Trajectory) -> None:
    """Warn where headings lie across the course over ground, and say which other convention they would suit.

    Args:
        name: of the file.
        rows: the poses; where the platform stands still it has no course.
    """
    step, interval = np.diff(rows.position[:, :2], axis=0), np.diff(rows.time)
    is_moving = np.hypot(*step.T) > _STILL * interval
    if not is_moving.any():
        return
    course = np.rad2deg(np.arctan2(step[is_moving, 0], step[is_moving, 1]))
    heading = rows.heading[:-1][is_moving]

    def median_deviation(angle: Float) -> float:
        """Return the median angle, deg, between directions (K,) and the course."""
        return float(np.median(np.abs(np.rad2deg(wrap_angle(np.deg2rad(angle - course))))))

    deviation = median_deviation(heading)
    deviations = {convention: median_deviation(angle) for convention, angle in _conventions(heading).items()}
    best = min(deviations, key=lambda convention: deviations[convention])
    if deviation > _ACROSS or (deviation > _BESIDE and deviations[best] < _ALONG):
        suggestion = f"; they look like {best}" if deviations[best] < _ALONG + 0.1 * deviation else ""
        text = "%s: headings lie %.0f degrees across the course (median); %s is needed, and roll and pitch in degrees%s"
        warn(text, name, deviation, _CONVENTION, suggestion)


def _conventions(heading: Float) -> dict[str, Float]:
    """Return headings (K,), read by each of some other conventions, in ours: degrees clockwise from north."""
    degrees = np.rad2deg(heading)
    return {
        "radians clockwise from north": degrees,
        "degrees counter-clockwise from east": 90.0 - heading,
        "radians counter-clockwise from east": 90.0 - degrees,
        "degrees counter-clockwise from north": -heading,
        "radians counter-clockwise from north": -degrees,
        "degrees of where it comes from": heading + 180.0,
    }


def _refuse_wide_turns(file: str, rows: Trajectory, attitude: Float) -> None:
    """Raise `InputError` if the platform turns so far from one row to the next that its sense isn't known.

    Args:
        file: name of the file.
        rows: R poses.
        attitude: (R, 4) quaternions of these.
    """
    turn = angle_between(attitude[:-1], attitude[1:])
    if turn.max() > _LARGEST_TURN:
        row = int(turn.argmax()) + 1
        requirement = f"the platform turns by {np.rad2deg(turn[row - 1]):.0f} degrees since the row before, at most 150"
        raise InputError(f"{file}:{rows.lines[row]} heading", float(rows.heading[row]), requirement)


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


def read_trajectory(path: str | os.PathLike[str], place: Placement | None = None) -> Trajectory:
    """Read poses from SBET, or from a CSV file with the columns time, x, y, z, roll, pitch and heading (s, m, deg).

    Of CSV the first line that is neither empty nor a comment (``#``) is the header; columns are separated by commas,
    semicolons, tabs or spaces. A comment may name the coordinate system, as for `read_axis`.

    Args:
        path: the file.
        place: the map's coordinate system, which the poses are moved into; without one CSV stays as it is.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: a column is missing or there twice, a value is no finite number, the time doesn't increase, there
            are fewer than two rows, or there is no way to the map's system.
    """
    return TrajectoryContent.read(path).placed(place or Placement())


@dataclass(frozen=True)
class TrajectoryContent:
    """Poses as they stand in a trajectory file, wherever they lie.

    Attributes:
        name: of the file.
        rows: of SBET (R, 17) records, of CSV (R, 7) values of `COLUMNS`.
        lines: (R,) numbers of CSV's lines; None of SBET.
        system: that CSV names; None without.
    """

    name: str
    rows: Float
    lines: Int | None = None
    system: MapSystem | None = None

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> TrajectoryContent:
        """Read a trajectory file, of one opening; see `read_trajectory`.

        Raises:
            MissingFileError, InputError: it is no trajectory, or names no known coordinate system.
        """
        name = os.fspath(path)
        content = read_bytes(name, "a trajectory file is needed here")
        if is_sbet(content[:_HEAD], len(content)):
            return cls(name, read_records(name, content))
        kind = f"this is no text: CSV with columns {', '.join(COLUMNS)} is needed"
        text = decoded(content, name, kind, "utf-8-sig")
        return cls(name, *_read_csv(name, text), csv_system(name, text))

    def placed(self, place: Placement) -> Trajectory:
        """Return the poses moved into the map's coordinate system; without one CSV stays as it is.

        Raises:
            InputError: there is no way to the map's system.
        """
        name, rows = self.name, self.rows
        if self.lines is None:
            points, heading = poses_on_map(name, rows, place)
            roll, pitch = np.rad2deg(rows[:, 7]), np.rad2deg(rows[:, 8])
            return Trajectory(rows[:, 0], points, roll, pitch, heading, np.arange(1, len(rows) + 1))
        points = rows[:, 1:4]
        if self.system is None and place.system is None:  # a scene of no map, which may be as small as degrees are
            points = check_heights(name, points)
        else:
            points = bring(name, points, self.system, place)
        return Trajectory(rows[:, 0], points, rows[:, 4], rows[:, 5], rows[:, 6], self.lines)


def _read_csv(name: str, text: str) -> tuple[Float, Int]:
    """Return the values (R, 7) of `COLUMNS` in the text of a CSV file, and the numbers (R,) of their lines."""
    numbered_lines = enumerate(text.splitlines(), 1)
    lines = [(number, line) for number, line in numbered_lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(name, None, f"the file is empty: a header with {', '.join(COLUMNS)} is needed")
    separator = next((mark for mark in (";", ",", "\t") if mark in lines[0][1]), " ")
    header_place = f"{name}:{lines[0][0]}"
    column_numbers = _columns(header_place, fields_of(lines[0][1], separator, header_place))
    if len(lines) < 3:
        raise InputError(name, None, f"at least two rows below the header are needed, the file has {len(lines) - 1}")
    numbered_rows = ((f"{name}:{number}", line) for number, line in lines[1:])
    rows = np.array([_row(place, fields_of(line, separator, place), column_numbers) for place, line in numbered_rows])
    numbers = np.array([number for number, _ in lines[1:]])
    late_rows = np.flatnonzero(np.diff(rows[:, 0]) <= 0.0)
    if len(late_rows):
        row_before, row = late_rows[0], late_rows[0] + 1
        requirement = f"times must increase: more than {float(rows[row_before, 0])!r} s is needed"
        raise InputError(f"{name}:{numbers[row]} time", float(rows[row, 0]), requirement)
    return rows, numbers


def _columns(place: str, header: list[str]) -> list[int]:
    """Return the places, in a header, of the columns in `COLUMNS`; raise `InputError` if one is missing or there twice.

    Args:
        place: of the header in its file, for messages.
        header: its entries.
    """
    names = [entry.lower() for entry in header]
    for column in COLUMNS:
        if names.count(column) != 1:
            fault = "is missing" if column not in names else f"is there {names.count(column)} times"
            hint = nearest_name(column, set(names) - set(COLUMNS)) if column not in names else ""
            requirement = f"a header with the columns {', '.join(COLUMNS)} is needed: {column} {fault}{hint}"
            raise InputError(place, ", ".join(header), requirement)
    return [names.index(column) for column in COLUMNS]


def _row(place: str, entries: list[str], column_numbers: list[int]) -> list[float]:
    """Return the values of `COLUMNS` in a row of a CSV file; raise `InputError` for what is no number or too large.

    Args:
        place: of the row in its file, for messages.
        entries: of the row.
        column_numbers: see `_columns`.
    """
    if len(entries) <= max(column_numbers):
        requirement = f"at least {max(column_numbers) + 1} columns are needed, this line has {len(entries)}"
        raise InputError(place, " ".join(entries), requirement)
    values = []
    for column, number in zip(COLUMNS, column_numbers, strict=True):
        try:
            value = float(entries[number])
        except ValueError:
            value = math.nan
        limit = FARTHEST if column in "xyz" else _LARGEST
        if not abs(value) <= limit:
            raise InputError(f"{place} {column}", entries[number], f"a finite number is needed, at most {limit:g}")
        if column == "pitch" and abs(value) > 90.0:
            raise InputError(f"{place} {column}", value, "from -90 to 90 deg")
        values.append(value)
    return values
