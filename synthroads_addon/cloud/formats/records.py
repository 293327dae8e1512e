"""Clouds as records of fixed length behind a header of text: what PLY and PCD have in common."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float
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

CHANNELS = ("red", "green", "blue")
"""Names of a colour's channels."""
PIECE = 160
"""Characters of notes in one line of a header: common readers take lines of 1023 characters at most."""
_FIELDS = {
    "intensity": ("intensity", "<f4"),
    "return_number": ("return_number", "u1"),
    "number_of_returns": ("number_of_returns", "u1"),
    "gps_time": ("gps_time", "<f8"),
    "scan_angle_deg": ("scan_angle", "<f4"),
    "strip": ("strip", "<u2"),
}
"""Arrays that every block has -> their names in files, and types."""
_CLASSES = ("classification", "class", "label", "classid")
"""Names that others give to classes, in this order, see `plain_name`; only the first is said to be a LAS code."""
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
"""Names of each quantity in the files of others, as PDAL's, CloudCompare's and MeshLab's, see `plain_name`."""


class RecordWriter(CloudWriter):
    """Base of writers of point blocks as records of fixed length, with 8-bit colours and unclipped intensities.

    The number of points stands in the header and is known at the end only: the header is written again then, and must
    be equally long for any number.
    """

    coordinate_type = "<f8"
    """Type of x, y and z."""

    @staticmethod
    @abstractmethod
    def field_name(name: str) -> str:
        """Return the format's name of a field or column."""

    @abstractmethod
    def _type(self, name: str, kind: str, column: Column | None) -> str:
        """Return the type in which the format stores a field or a column, of which `kind` is the usual one."""

    @abstractmethod
    def _color_fields(self) -> list[tuple[str, str]]:
        """Return names and types of the fields of the colour."""

    @abstractmethod
    def _set_colors(self, record: AnyArray, channels: list[AnyArray]) -> None:
        """Store the 8-bit channels (3 of (n,)) in the records (n,)."""

    @abstractmethod
    def _header(self, count: int) -> bytes:
        """Return the header for a number of points; it is equally long for any number."""

    def _open(self) -> None:
        """Create the file with a header for no points."""
        self._fields = [
            *((axis, self.coordinate_type) for axis in "xyz"),
            *self._color_fields(),
            *((self.field_name(name), self._type(name, kind, None)) for name, kind in _FIELDS.values()),
            *((self.field_name(column.name), self._column_type(column)) for column in self.columns),
        ]
        self._record = np.dtype(self._fields)
        self._file = self._temporary.open("wb")
        self._file.write(self._header(0))

    def _column_type(self, column: Column) -> str:
        """Return the type of a column's field: whole numbers as they are, metres as doubles, else single precision."""
        if column.scale is None:
            usual = np.dtype(column.dtype).str.replace("|", "")
        else:
            usual = "<f8" if column.unit == "m" else "<f4"
        return self._type(column.name, usual, column)

    def _coordinates(self, block: PointBlock) -> Float:
        """Return the coordinates (n, 3) to be stored; raise `OutputError` if one isn't finite."""
        return self.check_finite(block.xyz, "xyz")

    def _append(self, block: PointBlock) -> None:
        """Append a block's points as records."""
        record = np.zeros(len(block), dtype=self._record)
        record["x"], record["y"], record["z"] = self._coordinates(block).T
        channels = zip(CHANNELS, block.rgb.T, strict=True)
        self._set_colors(record, [self.to_integers(values, "uint16", name) >> 8 for name, values in channels])
        for array, (name, kind) in _FIELDS.items():
            record[self.field_name(name)] = self.fit_values(block.array(array), kind, name)
        for column in self.columns:
            if column.array == "class_id":
                record[self.field_name(column.name)] = self.file_class_ids(block)
            else:
                kind = "f8" if column.whole else self._column_type(column)
                values = self.check_finite(column.values(block), column.name, kind)
                record[self.field_name(column.name)] = (
                    self.to_integers(values, column.dtype, column.name) if column.whole else values
                )
        self._file.write(record)

    def _finish(self) -> None:
        """Write the header again with the number of points, and close the file."""
        self._file.seek(0)
        self._file.write(self._header(self.count))
        self._file.close()


class RecordReader(CloudReader):
    """Base of readers of records of fixed length, the project's own and others'.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or it is truncated.
    """

    kind: str
    """Name of the format."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        try:
            count, self._record, notes = self._read_header(path)
            self._names = set(self._record.names or ())
            if not {"x", "y", "z"} <= self._names:
                raise InputError(str(path), None, "has no x, y, z")
            self._start = self._file.tell()
            self._check_length(path, count)
        except BaseException:
            self._file.close()
            raise
        self._own = {name: label for name in self._own_names() if (label := self._stored_name(name))}
        self._others = {} if isinstance(notes, dict) else self._names_of_others()
        used_names = {*"xyz", *self._own.values(), *self._others.values()}
        has_color = self._has_colors()
        names_for_header, usual = {*self._own, *(self._names - used_names)}, {*self._own_names()}
        self.header = header_from_notes(
            path,
            self.kind,
            count,
            names_for_header,
            notes,
            name_of=lambda column: self.field_name(column.name),
            usual=usual,
            has_color=has_color,
        )
        label_names = {self.field_name(column.name) for column in LABELS}
        self._assumed_scheme = not self.header.labelled and label_names <= self._own.keys()
        if self._assumed_scheme:  # one of ours that other software wrote again, without its notes
            self.header = replace(self.header, scheme=class_scheme("17"), labelled=True)

    def _check_length(self, path: Path, count: int) -> None:
        """Raise `InputError` if the file is too short for a number of points."""
        available_points = (path.stat().st_size - self._start) // self._record.itemsize
        if available_points < count:
            raise damage_error(path, max(0, available_points), count)

    @staticmethod
    @abstractmethod
    def field_name(name: str) -> str:
        """Return the format's name of a field or column."""

    @abstractmethod
    def _read_header(self, path: Path) -> tuple[int, np.dtype[Any], Any]:
        """Return number and record type of the open file's points, and the project's notes (None without)."""

    def _own_names(self) -> tuple[str, ...]:
        """Return the names of all fields of our own files."""
        layer_columns = (column for layer in LAYERS.values() for column in layer.columns)
        columns_of_files = (self.field_name(column.name) for column in (*LABELS, *layer_columns))
        fields = (self.field_name(name) for name, _ in _FIELDS.values())
        return (*"xyz", *self._color_names(), *fields, *columns_of_files)

    def _color_names(self) -> tuple[str, ...]:
        """Return the names of the fields of colour in our own files."""
        return CHANNELS

    def _stored_name(self, name: str) -> str | None:
        """Return the file's name of one of our fields; None if it lacks it."""
        return name if name in self._names else None

    def _plain_name(self, name: str) -> str:
        """Return a field's name as the table of others' names has it: small letters and digits only."""
        return "".join(sign for sign in name.lower() if sign.isalnum())

    def _has_colors(self) -> bool:
        """Return whether the file holds colours."""
        return all(name in self._own or name in self._others for name in CHANNELS)

    def _names_of_others(self) -> dict[str, str]:
        """Return the names of fields in others' files by the quantity that they are, where ours are missing."""
        names_by_plain = {self._plain_name(name): name for name in sorted(self._names, reverse=True)}
        names_by_kind = {
            quantity: next((names_by_plain[name] for name in names if name in names_by_plain), None)
            for quantity, names in _OTHERS.items()
        }
        if not all(names_by_kind[name] for name in CHANNELS):
            names_by_kind |= dict.fromkeys(CHANNELS)
        own_quantities = {array: self.field_name(name) for array, (name, _) in _FIELDS.items()}
        own_quantities["source"] = self.field_name("strip")
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
        elif label and self._plain_name(label) != _CLASSES[0]:
            assume(f"{self.header.path.name}: its property {label} is read as LAS codes of classes")
        brightness = self._full_brightness() if self.header.has_color else SIXTEEN_BITS
        self._file.seek(self._start)
        for position in range(0, self.header.count, size):
            rows = min(size, self.header.count - position)
            records = self._next_records(rows)
            if len(records) != rows:
                raise damage_error(self.header.path, position, self.header.count)
            yield self._block(records, brightness, position)

    def _next_records(self, rows: int) -> AnyArray:
        """Return the next records (n,) of the open file, fewer than ``rows`` where it ends."""
        data = self._file.read(rows * self._record.itemsize)
        whole = len(data) // self._record.itemsize * self._record.itemsize
        return np.frombuffer(data[:whole], dtype=self._record)

    def _color_channels(self) -> list[str]:
        """Return the names of the fields of red, green and blue."""
        return [self._own.get(name) or self._others[name] for name in CHANNELS]

    def _colors(self, record: AnyArray) -> AnyArray:
        """Return the stored colours (n, 3) of records (n,)."""
        return np.stack([record[name] for name in self._color_channels()], axis=1)

    def _full_brightness(self) -> float:
        """Return the stored value of full brightness: of 8-bit fields 255, of others by the largest value."""
        kinds = [self._record[name] for name in self._color_channels()]
        if all(kind.itemsize == 1 for kind in kinds):
            return EIGHT_BITS
        return self._assumed_brightness(self._color_parts(), is_integer=all(kind.kind in "iu" for kind in kinds))

    def _color_parts(self) -> Iterable[AnyArray]:
        """Yield the stored colours (n, 3) of the file's points, in parts."""
        self._file.seek(self._start)
        for position in range(0, self.header.count, PEEK):
            yield self._colors(self._next_records(min(PEEK, self.header.count - position)))

    def _block(self, record: AnyArray, brightness: float, position: int) -> PointBlock:
        """Return the block of points from records.

        Args:
            record: (n,) of the file's type.
            brightness: stored value of full brightness.
            position: points before these, for messages.
        """
        stored_names, fields_of_others = self._own, self._others
        arrays = {
            column.name: record[stored_names[self.field_name(column.name)]]
            for column in columns(self.header.attributes)
            if self.field_name(column.name) in stored_names
        }
        arrays |= {
            array: record[stored_names[self.field_name(name)]].copy()
            for array, (name, _) in _FIELDS.items()
            if self.field_name(name) in stored_names
        }
        arrays |= {name: record[field].copy() for name, field in fields_of_others.items() if name in (*_FIELDS, *FLAGS)}
        if "source" in fields_of_others:  # from 1, as in LAS; 0 is none, which strips count as 65535
            source = self._fit(record[fields_of_others["source"]], "strip", position)
            arrays["strip"] = source - np.uint16(1)
        if not self.header.labelled:
            arrays["class_id"] = (
                record[fields_of_others["class"]] if "class" in fields_of_others else np.zeros(len(record))
            )
        xyz = np.stack([record[name].astype(np.float64) for name in "xyz"], axis=1)
        arrays["xyz"] = check_coordinates(self.header.path, position, xyz)
        if self.header.has_color:
            arrays["rgb"] = sixteen_bits(self._colors(record), brightness)
        return self._points(arrays, len(record), position)
