"""NPZ: the arrays of `PointBlock` under their own names and types, and ``notes``, what the file says of itself as JSON.

The arrays are gathered in a file each and put together at the end, so that no more than a block is held in memory.
`numpy.load` reads the result, uncompressed.
"""

import json
import math
import shutil
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from ...base.arrays import AnyArray
from ...base.errors import InputError
from ..colours import EIGHT_BITS, SIXTEEN_BITS, sixteen_bits
from ..flags import FLAGS
from ..layers import columns, layer_arrays
from ..points import POINT_TYPES, PointBlock
from .header import header_from_notes
from .reader import PEEK, CloudReader, check_coordinates, damage_error
from .writer import CloudWriter

_ON_REQUEST = {name: (np.dtype(kind).str, width) for name, (kind, width) in layer_arrays().items()}
_KNOWN = POINT_TYPES | _ON_REQUEST | dict.fromkeys(FLAGS, ("|u1", 1))
ARCHIVE_FAULTS = (
    *(KeyError, ValueError, EOFError, OSError, RuntimeError, MemoryError, SyntaxError, OverflowError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)
"""Errors of reading a damaged archive: encrypted or unknown members, broken headers, lengths of any size."""
_LONGEST_NOTES = 1 << 26
_TIME = (1980, 1, 1, 0, 0, 0)
"""No wall clock in files."""


class NpzWriter(CloudWriter):
    """Writer of point blocks to an NPZ file, neither rounded nor clipped; see `CloudWriter`."""

    def _open(self) -> None:
        """Create a file for each array, in which its values are gathered."""
        names = {column.array for column in self.columns}
        self._arrays = POINT_TYPES | {name: kind for name, kind in _ON_REQUEST.items() if name in names}
        self._parts = self._temporary.with_name("parts")
        self._files: dict[str, IO[bytes]] = {}
        self._parts.mkdir()
        for name in self._arrays:
            self._files[name] = (self._parts / name).open("wb")

    def _append(self, block: PointBlock) -> None:
        """Append the block's values to the arrays' files."""
        for name, (kind, _) in self._arrays.items():
            values = self.file_class_ids(block) if name == "class_id" else block.array(name)
            self._files[name].write(np.ascontiguousarray(self.fit_values(values, kind, name), dtype=kind).data)

    def _finish(self) -> None:
        """Put the arrays' files together into one archive, with headers and notes."""
        for file in self._files.values():
            file.close()
        with zipfile.ZipFile(self._temporary, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, (kind, width) in self._arrays.items():
                shape = (self.count, width) if width > 1 else (self.count,)
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _TIME), "w", force_zip64=True) as member:
                    npy.write_array_header_1_0(member, {"descr": kind, "fortran_order": False, "shape": shape})
                    with (self._parts / name).open("rb") as part:
                        shutil.copyfileobj(part, member, 1 << 22)
                (self._parts / name).unlink()
            with archive.open(zipfile.ZipInfo("notes.npy", _TIME), "w") as member:
                npy.write_array(member, np.array(json.dumps(self.placed_notes())), allow_pickle=False)

    def _close(self) -> None:
        """Close the arrays' files, in whatever state they are."""
        for file in self._files.values():
            with suppress(OSError):
                file.close()


class NpzReader(CloudReader):
    """Reader of NPZ files with arrays named as those of `PointBlock`; ``xyz`` is needed.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or truncated, or its arrays differ in length.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = zipfile.ZipFile(path)
        except ARCHIVE_FAULTS:
            raise InputError(str(path), None, "is not an NPZ file, or truncated") from None
        try:
            self._kinds = self._read_kinds(path)
            notes = self._read_notes()
        except ARCHIVE_FAULTS as problem:
            self.close()
            raise InputError(str(path), None, f"is not an NPZ file that can be read ({problem})") from None
        except InputError:
            self.close()
            raise
        arrays = set(self._kinds)
        stored_names = {name.removesuffix(".npy") for name in self._file.namelist()}
        self.header = header_from_notes(
            path,
            "NPZ",
            self._kinds["xyz"][0][0],
            stored_names,
            notes,
            name_of=lambda column: column.array,
            usual=arrays | {"notes"},
            has_color="rgb" in arrays,
        )

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points as blocks of at most ``size``, read in step from all arrays."""
        brightness = self._full_brightness() if self.header.has_color else SIXTEEN_BITS
        members = {name: self._file.open(f"{name}.npy") for name in self._kinds}
        try:
            for member in members.values():
                _npy_header(member)
            for position in range(0, self.header.count, size):
                rows = min(size, self.header.count - position)
                try:
                    arrays = {name: self._rows(members[name], name, rows) for name in members}
                except ARCHIVE_FAULTS:
                    raise damage_error(self.header.path, position, self.header.count) from None
                check_coordinates(self.header.path, position, arrays["xyz"])
                if "rgb" in arrays and (brightness != SIXTEEN_BITS or arrays["rgb"].dtype.kind == "f"):
                    arrays["rgb"] = sixteen_bits(arrays["rgb"], brightness)
                yield self._block(arrays, rows, position)
        finally:
            for member in members.values():
                member.close()

    def _full_brightness(self) -> float:
        """Return the stored value of full brightness: of 8-bit arrays 255, of others' by the largest value."""
        kind = self._kinds["rgb"][1]
        if kind.itemsize == 1:
            return EIGHT_BITS

        def colors() -> Iterator[AnyArray]:
            """Yield the stored colours (n, 3) of the file's points, in parts."""
            with self._file.open("rgb.npy") as member, suppress(*ARCHIVE_FAULTS):  # damage is found with the points
                _npy_header(member)
                for position in range(0, self.header.count, PEEK):
                    yield self._rows(member, "rgb", min(PEEK, self.header.count - position))

        return self._assumed_brightness(colors(), is_integer=kind.kind in "iu")

    def _rows(self, member: IO[bytes], name: str, count: int) -> AnyArray:
        """Return the next ``count`` rows of an array from its open member."""
        shape, kind = self._kinds[name]
        rows = (count, *shape[1:])
        data = np.frombuffer(member.read(int(np.prod(rows)) * kind.itemsize), dtype=kind)
        return data.reshape(rows).copy()

    def _block(self, arrays: dict[str, AnyArray], count: int, position: int) -> PointBlock:
        """Return the block of points from arrays by their names.

        Args:
            arrays: n rows each.
            count: n.
            position: points before these, for messages.
        """
        stored = {
            c.name: arrays[c.array] if c.component is None else arrays[c.array][:, c.component]
            for c in columns(self.header.attributes)
            if c.array in arrays
        }
        return self._points(arrays | stored, count, position)

    def _read_kinds(self, path: Path) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        """Return shape and type of each array of the file that `PointBlock` knows, by name."""
        kinds = {}
        for name in _KNOWN:
            if f"{name}.npy" in self._file.namelist():
                with self._file.open(f"{name}.npy") as member:
                    kinds[name] = _npy_header(member)
        if "xyz" not in kinds:
            raise InputError(str(path), None, "has no array xyz")
        count = kinds["xyz"][0][0] if kinds["xyz"][0] else 0
        for name, (shape, kind) in kinds.items():
            width = _KNOWN[name][1]
            if shape != ((count, width) if width > 1 else (count,)) or kind.kind not in "fiub":
                expected_shape = f"({count}, {width})" if width > 1 else f"({count},)"
                raise InputError(f"{path}: {name}", shape, f"must be numbers of shape {expected_shape}")
        return kinds

    def _read_notes(self) -> Any:
        """Return the file's notes; None without. Raise ValueError if they are too long or no text."""
        if "notes.npy" not in self._file.namelist():
            return None
        if self._file.getinfo("notes.npy").file_size > _LONGEST_NOTES:
            raise ValueError("its metadata are too long")
        with self._file.open("notes.npy") as member:
            if math.prod(_npy_header(member)[0]) != 1:
                raise ValueError("its metadata are not text")
        with self._file.open("notes.npy") as member:
            return json.loads(str(npy.read_array(member, allow_pickle=False)))


def _npy_header(member: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the header of an NPY array from an open member; return the array's shape and type."""
    version = npy.read_magic(member)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran_order, kind = read_header(member)
    if fortran_order and len(shape) > 1:
        raise ValueError("arrays must be in C order")
    return shape, kind
