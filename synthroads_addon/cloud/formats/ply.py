"""PLY, binary little endian, with coordinates in double precision: our code, since no library that streams is about.

What the file says of itself stands as JSON in comments ``synthroads``, in pieces.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...base.arrays import AnyArray
from ...base.errors import InputError
from ..layers import Column
from .records import CHANNELS, PIECE, RecordReader, RecordWriter

_NAMES = {"intensity": "intensity", "NormalX": "nx", "NormalY": "ny", "NormalZ": "nz"}
"""Columns that PLY has names of its own for."""
_WORDS = {
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "<i2": ("short", "int16"),
    "<u2": ("ushort", "uint16"),
    "<i4": ("int", "int32"),
    "<u4": ("uint", "uint32"),
    "<f4": ("float", "float32"),
    "<f8": ("double", "float64"),
}
PLY_TYPES = {word: kind for kind, words in _WORDS.items() for word in words}
"""Types by their names in headers, of which there are two."""
_READABLE_TYPES = {"<u2": "<i4", "<u4": "<f8"}
"""Types that Open3D's tensor reader takes, of those that it doesn't: no int holds all of 32 bits, but a double does."""
_SCALAR = "scalar_"
"""Beginning of the properties that CloudCompare loads as scalar fields, whatever else they are called."""
_LONGEST_LINE = 1 << 16
_MOST_DIGITS = 18


def _ply_name(name: str) -> str:
    """Return the name of a column in PLY."""
    return _NAMES.get(name, f"{_SCALAR}{name}")


class PlyWriter(RecordWriter):
    """Writer of point blocks to a binary PLY file, with 8-bit colours and unclipped intensities."""

    field_name = staticmethod(_ply_name)

    def _type(self, name: str, kind: str, column: Column | None) -> str:
        """Return a field's type: one of the four (uchar, int, float, double) that Open3D's tensor reader takes."""
        return _READABLE_TYPES.get(kind, kind)

    def _color_fields(self) -> list[tuple[str, str]]:
        """Return the three channels' names, in 8 bits each."""
        return [(name, "u1") for name in CHANNELS]

    def _set_colors(self, record: AnyArray, channels: list[AnyArray]) -> None:
        """Store the 8-bit channels, a property each."""
        for name, values in zip(CHANNELS, channels, strict=True):
            record[name] = values

    def _header(self, count: int) -> bytes:
        """Return the PLY header for a number of points; it is equally long for any number."""
        notes = json.dumps(self.placed_notes(), separators=(",", ":"))
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            "comment " + "-" * (20 - len(str(count))),
            *(f"comment synthroads {notes[at : at + PIECE]}" for at in range(0, len(notes), PIECE)),
            f"element vertex {count}",
            *(f"property {_WORDS[kind][0]} {name}" for name, kind in self._fields),
            "end_header",
        ]
        return ("\n".join(lines) + "\n").encode("ascii")


class PlyReader(RecordReader):
    """Reader of binary little-endian PLY files whose points are scalars; see `RecordReader`."""

    kind = "PLY"
    field_name = staticmethod(_ply_name)

    def _read_header(self, path: Path) -> tuple[int, np.dtype[Any], Any]:
        """Return number and record type of the points, and the project's notes (None without)."""
        return read_ply_header(path, self._file)

    def _stored_name(self, name: str) -> str | None:
        """Return the file's name of one of our properties, in older files without the prefix; None if it lacks it."""
        return next((candidate for candidate in (name, name.removeprefix(_SCALAR)) if candidate in self._names), None)

    def _plain_name(self, name: str) -> str:
        """Return a property's name in small letters and digits only, without CloudCompare's prefix."""
        return super()._plain_name(name.removeprefix(_SCALAR))


def read_ply_header(path: Path, file: BinaryIO) -> tuple[int, np.dtype[Any], Any]:
    """Return the number and the record type of a PLY's points, and the project's notes (None without)."""
    if file.readline(8).strip() != b"ply":
        raise InputError(str(path), None, "is not a PLY file")
    fields: list[tuple[str, str]] = []
    count, element, notes = -1, 0, ""
    for line in _header_lines(path, file):
        words = line.split()
        if line.startswith("comment synthroads "):
            notes += line[len("comment synthroads ") :]
        elif words[:1] == ["format"] and words[1:2] != ["binary_little_endian"]:
            raise InputError(str(path), " ".join(words[1:2]), "must be a PLY file of the kind binary_little_endian")
        elif words[:1] == ["element"] and len(words) == 3:
            element += 1
            if count < 0:
                count = _number_of_points(path, words)
        elif words[:1] == ["property"] and element == 1:
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise InputError(str(path), line, "properties of points must be numbers")
            fields.append((words[2], PLY_TYPES[words[1]]))
    if count < 0 or not fields or len({name for name, _ in fields}) != len(fields):
        raise InputError(str(path), None, "is a PLY file without points")
    return count, np.dtype(fields), _notes(path, notes)


def _header_lines(path: Path, file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a PLY header up to ``end_header``; raise `InputError` if the file ends first."""
    while line_bytes := file.readline(_LONGEST_LINE):
        line = line_bytes.decode("ascii", errors="replace").rstrip("\r\n")
        if line.strip() == "end_header":
            return
        yield line
    raise InputError(str(path), None, "is a PLY file that ends within its header")


def _number_of_points(path: Path, words: list[str]) -> int:
    """Return the number of points of an ``element`` line, split into words; raise `InputError` if it is none."""
    if not words[2].isdecimal() or len(words[2]) > _MOST_DIGITS:
        raise InputError(str(path), words[2], "must be a number of points")
    return int(words[2])


def _notes(path: Path, text: str) -> Any:
    """Return the notes that the comments hold as JSON; None without."""
    try:
        return json.loads(text) if text else None
    except (ValueError, RecursionError):
        raise InputError(str(path), None, "its comments synthroads are damaged") from None
