"""Reading a trajectory from CSV; every fault is one line that names the file, the line, the column and the value."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, nearest_name
from ...base.files import read_text
from ...fitting.read import FARTHEST, fields_of

Float = NDArray[np.float64]

COLUMNS = ("time", "x", "y", "z", "roll", "pitch", "heading")
"""Names in the header; in any order and case, beside any others."""
_LARGEST = 1e10
"""Largest time (s: GPS time counts thousands of millions) and angle (deg)."""


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
    lines: NDArray[np.int64]


def read_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Return the poses of a CSV file with the columns `COLUMNS`.

    The first line that is neither empty nor a comment (``#``) is the header; columns are separated by commas,
    semicolons, tabs or spaces.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: a column is missing or there twice, a value is no finite number, the time doesn't increase, or
            there are fewer than two rows.
    """
    name = os.fspath(path)
    lines = [
        (number, line)
        for number, line in enumerate(_text(name).splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
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


def _text(name: str) -> str:
    kind = f"this is no text: CSV with columns {', '.join(COLUMNS)} is needed"
    return read_text(name, kind, "a trajectory file is needed here", encoding="utf-8-sig")


def _columns(place: str, head: list[str]) -> list[int]:
    names = [entry.lower() for entry in head]
    for wanted in COLUMNS:
        if names.count(wanted) != 1:
            often = "is missing" if wanted not in names else f"is there {names.count(wanted)} times"
            hint = nearest_name(wanted, set(names) - set(COLUMNS)) if wanted not in names else ""
            allowed = f"a header with the columns {', '.join(COLUMNS)} is needed: {wanted} {often}{hint}"
            raise InputError(place, ", ".join(head), allowed)
    return [names.index(wanted) for wanted in COLUMNS]


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
