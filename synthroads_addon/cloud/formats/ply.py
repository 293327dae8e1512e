"""PLY, binary little endian, with coordinates in double precision: own code, since none that streams is about.

The number of points stands in the header and is known at the end only: the header is written again then, with a comment
that shrinks as the number grows. What the file says of itself stands as JSON in comments ``synthroads``, in pieces,
because common readers take lines of 1023 characters at most.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...base.arrays import AnyArray
from ...base.classes import class_scheme
from ...base.errors import InputError
from ...base.remarks import assume
from ..colours import EIGHT_BITS, SIXTEEN_BITS, sixteen_bits
from ..flags import FLAGS
from ..layers import LABELS, LAYERS, Column, columns
from ..points import PointBlock
from .header import header_from_notes
from .reader import PEEK, CloudReader, check_coordinates, damage_error
from .writer import CloudWriter

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
_SCALAR = "scalar_"
"""Beginning of the properties that CloudCompare loads as scalar fields, whatever else they are called."""
_FIELDS = {
    "intensity": ("intensity", "<f4"),
    "return_number": (f"{_SCALAR}return_number", "u1"),
    "number_of_returns": (f"{_SCALAR}number_of_returns", "u1"),
    "gps_time": (f"{_SCALAR}gps_time", "<f8"),
    "scan_angle_deg": (f"{_SCALAR}scan_angle", "<f4"),
    "strip": (f"{_SCALAR}strip", "<i4"),
}
"""Arrays that every block has -> their properties and types."""
_CHANNELS = ("red", "green", "blue")
_FIXED = (*((axis, "<f8") for axis in "xyz"), *((name, "u1") for name in _CHANNELS), *_FIELDS.values())
_CLASSES = ("classification", "class", "label", "classid")
"""Names that others give to classes, in this order, see `_plain`; only the first is said to be a LAS code."""
_OTHERS = {
    "intensity": ("intensity",),
    "return_number": ("returnnumber",),
    "number_of_returns": ("numberofreturns",),
    "gps_time": ("gpstime",),
    "scan_angle_deg": ("scanangle", "scananglerank"),
    "source": ("pointsourceid",),
    "class": _CLASSES,
    **{name: (name.replace("_", ""), f"{name.replace('_', '')}flag") for name in FLAGS},
    "scanner_channel": ("scannerchannel", "scanchannel"),
    "scan_direction_flag": ("scandirectionflag", "scandirection"),
    "red": ("red", "diffusered", "r"),
    "green": ("green", "diffusegreen", "g"),
    "blue": ("blue", "diffuseblue", "b"),
}
"""Names of each quantity in the files of others, as PDAL's, CloudCompare's and MeshLab's, see `_plain`."""
_PIECE = 160
_LONGEST_LINE = 1 << 16
_MOST_DIGITS = 18


def ply_name(column: Column) -> str:
    """Return the name of a column in PLY."""
    return _NAMES.get(column.name, f"{_SCALAR}{column.name}")


def _ply_type(column: Column) -> str:
    """Return a column's type: one of the four (uchar, int, float, double) that Open3D's tensor reader takes.

    No int holds all of 32 bits without a sign, but a double does.
    """
    if column.scale is None:
        return {"uint8": "u1", "uint16": "<i4", "uint32": "<f8"}[column.dtype]
    return "<f8" if column.unit == "m" else "<f4"


def _plain(name: str) -> str:
    """Return a property's name as `_OTHERS` has it: small letters and digits only, without CloudCompare's prefix."""
    return "".join(sign for sign in name.lower().removeprefix(_SCALAR) if sign.isalnum())


class PlyWriter(CloudWriter):
    """Writer of point blocks to a binary PLY file, with 8-bit colours and unclipped intensities."""

    def _open(self) -> None:
        """Create the file with a header for no points, which is written again in the end."""
        self._fields = [*_FIXED, *((ply_name(column), _ply_type(column)) for column in self.columns)]
        self._type = np.dtype(self._fields)
        self._file = self._temporary.open("wb")
        self._file.write(self._header(0))

    def _append(self, block: PointBlock) -> None:
        """Append a block's points as records."""
        record = np.zeros(len(block), dtype=self._type)
        record["x"], record["y"], record["z"] = self.check_finite(block.xyz, "xyz").T
        for name, channel in zip(_CHANNELS, block.rgb.T, strict=True):
            record[name] = self.to_integers(channel, "uint16", name) >> 8
        for array, (name, kind) in _FIELDS.items():
            record[name] = self.fit_values(block.array(array), kind, name)
        for column in self.columns:
            if column.array == "class_id":
                record[ply_name(column)] = self.file_class_ids(block)
            else:
                kind = "f8" if column.whole else _ply_type(column)
                values = self.check_finite(column.values(block), column.name, kind)
                record[ply_name(column)] = (
                    self.to_integers(values, column.dtype, column.name) if column.whole else values
                )
        self._file.write(record)

    def _finish(self) -> None:
        """Write the header again with the number of points, and close the file."""
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
            available_points = (path.stat().st_size - self._start) // self._type.itemsize
            if available_points < count:
                raise damage_error(path, max(0, available_points), count)
        except BaseException:
            self._file.close()
            raise
        self._own = {name: label for name in _own_names() if (label := self._stored_name(name))}
        self._others = {} if isinstance(notes, dict) else self._names_of_others()
        used_names = {*"xyz", *self._own.values(), *self._others.values()}
        has_color = all(name in self._own or name in self._others for name in _CHANNELS)
        names_for_header, usual = {*self._own, *(self._names - used_names)}, {*_own_names()}
        self.header = header_from_notes(
            path, "PLY", count, names_for_header, notes, name_of=ply_name, usual=usual, has_color=has_color
        )
        self._assumed_scheme = not self.header.labelled and {ply_name(column) for column in LABELS} <= self._own.keys()
        if self._assumed_scheme:  # one of ours that other software wrote again, without its notes
            self.header = replace(self.header, scheme=class_scheme("17"), labelled=True)

    def _stored_name(self, name: str) -> str | None:
        """Return the file's name of one of our properties, in older files without the prefix; None if it lacks it."""
        return next((candidate for candidate in (name, name.removeprefix(_SCALAR)) if candidate in self._names), None)

    def _names_of_others(self) -> dict[str, str]:
        """Return the names of properties in others' files by the quantity that they are, where ours are missing."""
        names_by_plain = {_plain(name): name for name in sorted(self._names, reverse=True)}
        names_by_kind = {
            quantity: next((names_by_plain[name] for name in names if name in names_by_plain), None)
            for quantity, names in _OTHERS.items()
        }
        if not all(names_by_kind[name] for name in _CHANNELS):
            names_by_kind |= dict.fromkeys(_CHANNELS)
        own_quantities = {**{array: name for array, (name, _) in _FIELDS.items()}, "source": f"{_SCALAR}strip"}
        return {
            quantity: name
            for quantity, name in names_by_kind.items()
            if name and own_quantities.get(quantity, quantity) not in self._own
        }

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points as blocks of at most ``size``, from the file's first point on."""
        label = self._others.get("class")
        if self._assumed_scheme:
            assume(f"{self.header.path.name}: its class_id is read as numbers of the 17 classes")
        elif label and _plain(label) != _CLASSES[0]:
            assume(f"{self.header.path.name}: its property {label} is read as LAS codes of classes")
        brightness = self._full_brightness() if self.header.has_color else SIXTEEN_BITS
        self._file.seek(self._start)
        for position in range(0, self.header.count, size):
            rows = min(size, self.header.count - position)
            data = self._file.read(rows * self._type.itemsize)
            if len(data) != rows * self._type.itemsize:
                raise damage_error(self.header.path, position, self.header.count)
            yield self._block(np.frombuffer(data, dtype=self._type), brightness, position)

    def _channels(self) -> list[str]:
        """Return the names of the properties of red, green and blue."""
        return [self._own.get(name) or self._others[name] for name in _CHANNELS]

    def _full_brightness(self) -> float:
        """Return the stored value of full brightness: of 8-bit properties 255, of others by the largest value."""
        kinds = [self._type[name] for name in self._channels()]
        if all(kind.itemsize == 1 for kind in kinds):
            return EIGHT_BITS

        def colors() -> Iterator[AnyArray]:
            """Yield the stored colours of the file's points, in parts (3, n)."""
            self._file.seek(self._start)
            for position in range(0, self.header.count, PEEK):
                rows = min(PEEK, self.header.count - position)
                data = self._file.read(rows * self._type.itemsize)
                record = np.frombuffer(data[: len(data) // self._type.itemsize * self._type.itemsize], dtype=self._type)
                yield np.stack([record[name] for name in self._channels()])

        return self._assumed_brightness(colors(), is_integer=all(kind.kind in "iu" for kind in kinds))

    def _block(self, record: AnyArray, brightness: float, position: int) -> PointBlock:
        """Return the block of points from records.

        Args:
            record: (n,) of the file's type.
            brightness: stored value of full brightness.
            position: points before these, for messages.
        """
        stored_names, properties_of_others = self._own, self._others
        arrays = {
            c.name: record[stored_names[ply_name(c)]]
            for c in columns(self.header.attributes)
            if ply_name(c) in stored_names
        }
        arrays |= {
            array: record[stored_names[name]].copy() for array, (name, _) in _FIELDS.items() if name in stored_names
        }
        arrays |= {
            name: record[field].copy() for name, field in properties_of_others.items() if name in (*_FIELDS, *FLAGS)
        }
        if "source" in properties_of_others:  # from 1, as in LAS; 0 is none, which strips count as 65535
            source = self._fit(record[properties_of_others["source"]], "strip", position)
            arrays["strip"] = source - np.uint16(1)
        if not self.header.labelled:
            arrays["class_id"] = (
                record[properties_of_others["class"]] if "class" in properties_of_others else np.zeros(len(record))
            )
        xyz = np.stack([record[name].astype(np.float64) for name in "xyz"], axis=1)
        arrays["xyz"] = check_coordinates(self.header.path, position, xyz)
        if self.header.has_color:
            arrays["rgb"] = sixteen_bits(np.stack([record[name] for name in self._channels()], axis=1), brightness)
        return self._points(arrays, len(record), position)


def _own_names() -> tuple[str, ...]:
    """Return the names of all properties of our own files."""
    layer_columns = (column for layer in LAYERS.values() for column in layer.columns)
    return (*(name for name, _ in _FIXED), *map(ply_name, LABELS), *map(ply_name, layer_columns))


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
