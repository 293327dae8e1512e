"""PLY, binary little endian, with coordinates in double precision: own code, since none that streams is about.

The number of points stands in the header and is known at the end only: the header is written again then, with a comment
that shrinks as the number grows. What the file says of itself stands as JSON in comments ``synthroads``, in pieces,
because common readers take lines of 1023 characters at most.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...base.arrays import AnyArray, UInt16
from ...base.errors import InputError
from ..layers import Column, columns, make_points
from ..points import PointBlock
from .base import CloudReader, CloudWriter, check_coordinates, damage_error, header_from_notes

_NAMES = {"NormalX": "nx", "NormalY": "ny", "NormalZ": "nz"}
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
_FIELDS = {
    "intensity": ("intensity", "<f4"),
    "return_number": ("return_number", "u1"),
    "number_of_returns": ("number_of_returns", "u1"),
    "gps_time": ("gps_time", "<f8"),
    "scan_angle_deg": ("scan_angle", "<f4"),
    "strip": ("strip", "<u2"),
}
"""Arrays that every block has -> their properties and types."""
_CHANNELS = ("red", "green", "blue")
_FIXED = (*((axis, "<f8") for axis in "xyz"), *((name, "u1") for name in _CHANNELS), *_FIELDS.values())
_CLASS_NAMES = ("classification", "class", "label", "scalar_Classification", "scalar_Label")
"""Where others keep classes."""
_PIECE = 160
_LONGEST_LINE = 1 << 16
_MOST_DIGITS = 18


def ply_name(column: Column) -> str:
    """Return the name of a column in PLY."""
    return _NAMES.get(column.name, column.name)


def _ply_type(column: Column) -> str:
    if column.scale is None:
        return {"uint8": "u1", "uint16": "<u2", "uint32": "<u4"}[column.dtype]
    return "<f8" if column.unit == "m" else "<f4"


class PlyWriter(CloudWriter):
    """Writer of point blocks to a binary PLY file, with 8-bit colours and unclipped intensities."""

    def _open(self) -> None:
        self._fields = [*_FIXED, *((ply_name(column), _ply_type(column)) for column in self.columns)]
        self._type = np.dtype(self._fields)
        self._file = self._temporary.open("wb")
        self._file.write(self._header(0))

    def _append(self, block: PointBlock) -> None:
        record = np.zeros(len(block), dtype=self._type)
        record["x"], record["y"], record["z"] = self.check_finite(block.xyz, "xyz").T
        for name, channel in zip(_CHANNELS, block.rgb.T, strict=True):
            record[name] = self.to_integers(channel, "uint16", name) >> 8
        for array, (name, kind) in _FIELDS.items():
            record[name] = self.fit_values(block.array(array), kind, name)
        for column in self.columns:
            if column.array == "class_id":
                record["class_id"] = self.file_class_ids(block)
            else:
                values = self.check_finite(column.values(block), column.name)
                record[ply_name(column)] = (
                    self.to_integers(values, column.dtype, column.name) if column.whole else values
                )
        self._file.write(record)

    def _finish(self) -> None:
        self._file.seek(0)
        self._file.write(self._header(self.count))
        self._file.close()

    def _header(self, count: int) -> bytes:
        """Return the PLY header for a number of points; it is equally long for any number."""
        notes = json.dumps(self.placed_notes(), separators=(",", ":"))
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            "comment " + "-" * (20 - len(str(count))),
            *(f"comment synthroads {notes[at : at + _PIECE]}" for at in range(0, len(notes), _PIECE)),
            f"element vertex {count}",
            *(f"property {_WORDS[kind][0]} {name}" for name, kind in self._fields),
            "end_header",
        ]
        return ("\n".join(lines) + "\n").encode("ascii")


class PlyReader(CloudReader):
    """Reader of binary little-endian PLY files whose points are scalars, the project's own and others'.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or it is truncated.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        try:
            count, self._type, notes = read_ply_header(path, self._file)
            self._names = set(self._type.names or ())
            if not {"x", "y", "z"} <= self._names:
                raise InputError(str(path), None, "has no x, y, z")
            self._start = self._file.tell()
            there = (path.stat().st_size - self._start) // self._type.itemsize
            if there < count:
                raise damage_error(path, max(0, there), count)
        except BaseException:
            self._file.close()
            raise
        usual = {name for name, _ in _FIXED} | {*_CLASS_NAMES}
        colored = set(_CHANNELS) <= self._names
        self.header = header_from_notes(
            path, "PLY", count, self._names, notes, name_of=ply_name, usual=usual, has_color=colored
        )

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points as blocks of at most ``size``, from the file's first point on."""
        self._file.seek(self._start)
        for done in range(0, self.header.count, size):
            rows = min(size, self.header.count - done)
            data = self._file.read(rows * self._type.itemsize)
            if len(data) != rows * self._type.itemsize:
                raise damage_error(self.header.path, done, self.header.count)
            yield self._block(np.frombuffer(data, dtype=self._type), done)

    def _block(self, record: AnyArray, done: int) -> PointBlock:
        stored = {c.name: record[ply_name(c)] for c in columns(self.header.attributes) if ply_name(c) in self._names}
        stored |= {name: record[field].copy() for name, (field, _) in _FIELDS.items() if field in self._names}
        if not self.header.labelled:
            label = next((name for name in _CLASS_NAMES if name in self._names), None)
            stored["class_id"] = record[label] if label else np.zeros(len(record))
        xyz = np.stack([record[name].astype(np.float64) for name in "xyz"], axis=1)
        stored["xyz"] = check_coordinates(self.header.path, done, xyz)
        dark = np.zeros(len(record), dtype=np.uint16)
        channels = (_sixteen_bits(record[name]) if name in self._names else dark for name in _CHANNELS)
        stored["rgb"] = np.stack(list(channels), axis=1)
        return make_points(stored, self.header.attributes, len(record))


def _sixteen_bits(channel: AnyArray) -> UInt16:
    """Return a colour channel as 16 bits, from 8 bits, 16 bits or floats of 0 to 1."""
    if channel.dtype.kind == "f":
        return np.rint(np.clip(channel, 0, 1) * 65535).astype(np.uint16)
    return channel.astype(np.uint16) * np.uint16(257 if channel.dtype.itemsize == 1 else 1)


def read_ply_header(path: Path, file: BinaryIO) -> tuple[int, np.dtype[Any], Any]:
    """Return the number and the record type of a PLY's points, and the project's notes (None without)."""
    if file.readline(8).strip() != b"ply":
        raise InputError(str(path), None, "is not a PLY file")
    fields: list[tuple[str, str]] = []
    count, element, notes = -1, "", ""
    for line in _header_lines(path, file):
        words = line.split()
        if line.startswith("comment synthroads "):
            notes += line[len("comment synthroads ") :]
        elif words[:1] == ["format"] and words[1:2] != ["binary_little_endian"]:
            raise InputError(str(path), " ".join(words[1:2]), "must be a PLY file of the kind binary_little_endian")
        elif words[:1] == ["element"] and len(words) == 3:
            element = words[1]
            if count < 0:
                count = _number_of_points(path, words)
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise InputError(str(path), line, "properties of points must be numbers")
            fields.append((words[2], PLY_TYPES[words[1]]))
    if count < 0 or not fields or len({name for name, _ in fields}) != len(fields):
        raise InputError(str(path), None, "is a PLY file without points")
    return count, np.dtype(fields), _notes(path, notes)


def _header_lines(path: Path, file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a PLY header up to ``end_header``; raise `InputError` if the file ends first."""
    while raw := file.readline(_LONGEST_LINE):
        line = raw.decode("ascii", errors="replace").rstrip("\r\n")
        if line.strip() == "end_header":
            return
        yield line
    raise InputError(str(path), None, "is a PLY file that ends within its header")


def _number_of_points(path: Path, words: list[str]) -> int:
    if words[1] != "vertex":
        raise InputError(str(path), words[1], "must begin with the element vertex")
    if not words[2].isdecimal() or len(words[2]) > _MOST_DIGITS:
        raise InputError(str(path), words[2], "must be a number of points")
    return int(words[2])


def _notes(path: Path, text: str) -> Any:
    try:
        return json.loads(text) if text else None
    except (ValueError, RecursionError):
        raise InputError(str(path), None, "its comments synthroads are damaged") from None
