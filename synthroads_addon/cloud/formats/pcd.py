"""PCD 0.7, the file format of the Point Cloud Library, binary.

Coordinates are in single precision, less the file's offset, because common readers take no others: the library's own
points are floats, and Open3D's `io.read_point_cloud` makes zeros of doubles. Our code: no library that streams is
about. What the file says of itself, the offset included, stands as JSON in comments ``synthroads``, in pieces. Source:
the Point Cloud Library's page "The PCD (Point Cloud Data) file format", version 0.7.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...base.arrays import AnyArray, Float
from ...base.errors import InputError, OutputError
from ..colours import EIGHT_BITS
from ..layers import Column
from ..points import PointBlock
from .reader import damage_error
from .records import PIECE, RecordReader, RecordWriter

_COLOR = "rgb"
"""Field of the colour: its channels as 0x00RRGGBB."""
_COLORS = (_COLOR, "rgba")
"""Names of such fields."""
_SHIFTS = (16, 8, 0)
"""Bits to the right of red, green and blue."""
_NAMES = {"NormalX": "normal_x", "NormalY": "normal_y", "NormalZ": "normal_z"}
"""Columns that PCD has names of its own for."""
_LETTERS = {"F": "f", "U": "u", "I": "i"}
"""Kinds of numbers by the letters of headers."""
_ENTRIES = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
"""First words of a header's lines."""
_STORAGES = ("binary", "ascii")
"""Kinds of data that are read."""
_FARTHEST = 16_384.0
"""Distance from the offset, m, up to which neighbouring numbers in single precision are less than 1 mm from another."""
_LONGEST_LINE = 1 << 16
_MOST_LINES = 10_000
_MOST_DIGITS = 18
_MOST_VALUES = 1 << 20
"""Most numbers of a field, per point."""


def _pcd_name(name: str) -> str:
    """Return the name of a column in PCD."""
    return _NAMES.get(name, name)


class PcdWriter(RecordWriter):
    """Writer of point blocks to a binary PCD file, with 8-bit colours and unclipped intensities."""

    field_name = staticmethod(_pcd_name)

    coordinate_type = "<f4"

    def _type(self, name: str, kind: str, column: Column | None) -> str:
        """Return a field's type: PCD has all of them."""
        return kind

    def _coordinates(self, block: PointBlock) -> Float:
        """Return coordinates (n, 3) less the offset; raise `OutputError` where single precision loses a millimetre."""
        local = super()._coordinates(block) - self.offset
        if np.abs(local).max(initial=0.0) > _FARTHEST:
            axis = int(np.abs(local).max(axis=0).argmax())
            largest = float(local[np.abs(local[:, axis]).argmax(), axis])
            requirement = (
                f"{'xyz'[axis]} must lie within {_FARTHEST:g} m of the offset, as PCD stores it: use .laz or .ply"
            )
            raise OutputError(str(self.path), largest, requirement)
        return local

    def _color_fields(self) -> list[tuple[str, str]]:
        """Return the one field of packed colours."""
        return [(_COLOR, "<u4")]

    def _set_colors(self, record: AnyArray, channels: list[AnyArray]) -> None:
        """Pack the 8-bit channels into one number each."""
        for shift, values in zip(_SHIFTS, channels, strict=True):
            record[_COLOR] |= values.astype(np.uint32) << np.uint32(shift)

    def _header(self, count: int) -> bytes:
        """Return the PCD header for a number of points; it is equally long for any number."""
        notes = json.dumps(self.placed_notes(), separators=(",", ":"))
        kinds = [np.dtype(kind) for _, kind in self._fields]
        lines = [
            "# .PCD v0.7 - Point Cloud Data file format",
            f"# map coordinates: x + {self.offset[0]:.0f}, y + {self.offset[1]:.0f}, z + {self.offset[2]:.0f}",
            "# " + "-" * 2 * (20 - len(str(count))),
            *(f"# synthroads {notes[at : at + PIECE]}" for at in range(0, len(notes), PIECE)),
            "VERSION 0.7",
            "FIELDS " + " ".join(name for name, _ in self._fields),
            "SIZE " + " ".join(str(kind.itemsize) for kind in kinds),
            "TYPE " + " ".join(kind.kind.upper() for kind in kinds),
            "COUNT " + " ".join("1" for _ in kinds),
            f"WIDTH {count}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {count}",
            "DATA binary",
        ]
        return ("\n".join(lines) + "\n").encode("ascii")


class PcdReader(RecordReader):
    """Reader of PCD files, binary or ASCII, the project's and others'; see `RecordReader`.

    Points without coordinates (NaN), which organised clouds have where nothing came back, are left out.
    """

    kind = "PCD"
    field_name = staticmethod(_pcd_name)

    def _read_header(self, path: Path) -> tuple[int, np.dtype[Any], Any]:
        """Return number and record type of the points, and the project's notes (None without)."""
        entries, notes = _entries(path, self._file)
        self._is_text = entries["DATA"][:1] == ["ascii"]
        stored_notes = _notes(path, notes)
        self._offset = stored_notes.get("offset", 0.0) if isinstance(stored_notes, dict) else 0.0
        return _number_of_points(path, entries), _record_type(path, entries), stored_notes

    def _check_length(self, path: Path, count: int) -> None:
        """Raise `InputError` if a binary file is too short for a number of points, a text if it has fewer bytes."""
        if not self._is_text:
            super()._check_length(path, count)
        elif path.stat().st_size - self._start < count:
            raise damage_error(path, 0, count)

    def _next_records(self, rows: int) -> AnyArray:
        """Return the next records (n,) of the open file, fewer than ``rows`` where it ends or is damaged."""
        if not self._is_text:
            return super()._next_records(rows)
        lines = list(islice(self._file, rows))
        try:
            numbers = np.loadtxt(lines, dtype=np.float64, comments=None, ndmin=2, encoding="ascii") if lines else None
        except (ValueError, UnicodeError):
            return np.zeros(0, dtype=self._record)
        records = np.zeros(len(lines), dtype=self._record)
        if numbers is None:
            return records
        first = 0
        for name in self._record.names or ():
            shape = self._record[name].shape
            width = int(np.prod(shape)) if shape else 1
            values = numbers[:, first : first + width]
            if values.shape != (len(lines), width):
                return np.zeros(0, dtype=self._record)
            kind = self._record[name].base
            fits = kind.kind == "f" or bool(
                np.all((values >= np.iinfo(kind).min) & (values <= np.iinfo(kind).max) & np.isfinite(values))
            )
            if not fits:
                return np.zeros(0, dtype=self._record)
            records[name] = values.astype(kind) if shape else values[:, 0].astype(kind)
            first += width
        return records

    def _color_names(self) -> tuple[str, ...]:
        """Return the field of packed colours."""
        return (_COLOR,)

    def _packed(self) -> str | None:
        """Return the name of the field of packed colours, None without."""
        return next((name for name in _COLORS if name in self._names and self._record[name].itemsize == 4), None)

    def _has_colors(self) -> bool:
        """Return whether the file holds colours, packed or as three fields."""
        return self._packed() is not None or super()._has_colors()

    def _full_brightness(self) -> float:
        """Return the stored value of full brightness: 255 of packed colours, else as `RecordReader`."""
        return EIGHT_BITS if self._packed() else super()._full_brightness()

    def _colors(self, record: AnyArray) -> AnyArray:
        """Return the stored colours (n, 3) of records (n,), unpacked where they are packed."""
        name = self._packed()
        if name is None:
            return super()._colors(record)
        bits = np.ascontiguousarray(record[name])
        if self._is_text and bits.dtype.kind == "f":
            bits = bits.astype("<f4")
        numbers = bits.view("<u4")
        return np.stack([((numbers >> np.uint32(shift)) & np.uint32(255)) for shift in _SHIFTS], axis=1).astype(
            np.uint8
        )

    def _block(self, record: AnyArray, brightness: float, position: int) -> PointBlock:
        """Return the block of the records that have coordinates; the others are counted in a remark."""
        is_missing = np.isnan(np.stack([record[name].astype(np.float64) for name in "xyz"], axis=1)).any(axis=1)
        if is_missing.any():
            self._remarks["points have no coordinates (NaN) and are left out"] += int(np.count_nonzero(is_missing))
            record = record[~is_missing]
        block = super()._block(record, brightness, position)
        return replace(block, xyz=block.xyz + np.asarray(self._offset, dtype=np.float64))


def _entries(path: Path, file: BinaryIO) -> tuple[dict[str, list[str]], str]:
    """Return the words of a PCD header's lines by their first one, and the project's notes as text."""
    entries: dict[str, list[str]] = {}
    notes = ""
    for line in _header_lines(path, file):
        if line.startswith("# synthroads "):
            notes += line[len("# synthroads ") :]
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0] == "COLUMNS":  # its name in version 0.5
            words[0] = "FIELDS"
        if words[0] not in _ENTRIES:
            raise InputError(str(path), None, "is not a PCD file")
        entries[words[0]] = words[1:]
        if words[0] == "DATA":
            break
    lacking = [name for name in ("FIELDS", "SIZE", "TYPE", "DATA") if not entries.get(name)]
    if lacking:
        raise InputError(str(path), None, f"is a PCD file without {', '.join(lacking)}")
    if entries["DATA"][0] not in _STORAGES:
        requirement = "must be binary or ascii (pcl_convert_pcd_ascii_binary IN OUT 1 makes it binary)"
        raise InputError(f"{path}: DATA", entries["DATA"][0], requirement)
    return entries, notes


def _header_lines(path: Path, file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a PCD header; raise `InputError` if the file ends before its data."""
    for _ in range(_MOST_LINES):
        line = file.readline(_LONGEST_LINE)
        if not line:
            break
        yield line.decode("ascii", errors="replace").rstrip("\r\n")
    raise InputError(str(path), None, "is not a PCD file, or ends within its header")


def _number_of_points(path: Path, entries: dict[str, list[str]]) -> int:
    """Return the number of points that POINTS says, or else WIDTH times HEIGHT."""
    counts = []
    for name in ("POINTS", "WIDTH", "HEIGHT"):
        text = (entries.get(name) or [""])[0]
        if name in entries and not (text.isdecimal() and len(text) <= _MOST_DIGITS):
            raise InputError(f"{path}: {name}", text, "must be a whole number")
        counts.append(int(text) if text else None)
    points, width, height = counts
    if points is not None:
        return points
    if width is None:
        raise InputError(str(path), None, "is a PCD file without POINTS")
    return width * (1 if height is None else height)


def _record_type(path: Path, entries: dict[str, list[str]]) -> np.dtype[Any]:
    """Return the record type that a header's FIELDS, SIZE, TYPE and COUNT say; padding gets names of its own."""
    names, sizes, letters = entries["FIELDS"], entries["SIZE"], entries["TYPE"]
    counts = entries.get("COUNT") or ["1"] * len(names)
    if not len(names) == len(sizes) == len(letters) == len(counts):
        raise InputError(str(path), None, "is a PCD file whose FIELDS, SIZE, TYPE and COUNT differ in length")
    fields: list[Any] = []
    for number, (name, size, letter, count) in enumerate(zip(names, sizes, letters, counts, strict=True)):
        try:
            kind = np.dtype(f"<{_LETTERS[letter]}{int(size)}")
            values = int(count)
        except (KeyError, TypeError, ValueError):
            requirement = "must be a type F, U or I with its size in bytes and a number of values"
            raise InputError(f"{path}: field {name}", f"{letter} {size} {count}", requirement) from None
        if not 1 <= values <= _MOST_VALUES:
            raise InputError(f"{path}: COUNT of {name}", count, f"must be from 1 to {_MOST_VALUES}")
        label = f"{name} {number}" if name == "_" or name in names[:number] else name
        fields.append((label, kind) if values == 1 else (label, kind, (values,)))
    return np.dtype(fields)


def _notes(path: Path, text: str) -> Any:
    """Return the notes that the comments hold as JSON; None without."""
    try:
        return json.loads(text) if text else None
    except (ValueError, RecursionError):
        raise InputError(str(path), None, "its comments synthroads are damaged") from None
