"""LAS and LAZ, block by block: written as version 1.4, point format 7, and read in any version and point format.

Besides the standard fields each written point has as extra bytes ``class_id`` (see `base.classes`; the standard field
``classification`` holds its LAS code), ``instance_id`` and the attributes asked for (`layers.ATTRIBUTES`). The scale
of the 16-bit intensity and the table of classes stand as JSON in the VLR ``SynthRoads`` 1.
"""

import json
import struct
from collections.abc import Iterator
from contextlib import suppress
from datetime import date
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import laspy
import lazrs
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray

from ...base.arithmetic.loops import PackedPoints, point_loops
from ...base.arrays import AnyArray, Float
from ...base.classes import ClassScheme, asprs_scheme, class_scheme, numbered_scheme, stored_scheme
from ...base.errors import InputError, OutputError
from ...base.schema import canonical_json
from ..colours import SIXTEEN_BITS, sixteen_bits
from ..flags import FLAGS
from ..layers import PREDICTED, Column, attributes_of, columns
from ..points import PointBlock
from .header import CloudHeader, intensity_scale, placed
from .las_system import declared_system
from .reader import CloudReader, damage_error
from .writer import CloudWriter

OWN = "SynthRoads"
"""User id of our records."""
NOTES, PREDICTED_CLASSES = 1, 2
"""Their ids: intensity scale and classes; the classes of the extra byte `PREDICTED`."""
SCALE = 0.001
"""Size of a coordinate's step, m."""
SCAN_ANGLE_STEP = 0.006
"""Degrees per step of the scan angle (LAS 1.4 R15, table 14)."""
_CHUNK = 50_000
"""Points in a chunk of LAZ, the unit of its compression: whole ones are compressed side by side."""
_BUFFER = 8 * _CHUNK
_FEW_CHUNKS = 4
_SLICE = 16_384
"""Points that are packed at a time: their intermediate arrays then stay in the processor's cache."""
_FIRST = 1024
"""Points that a writer has room for at first."""


class LasWriter(CloudWriter):
    """Writer of point blocks to a LAZ (or, by its ending, LAS) file; see `CloudWriter`."""

    keeps_flags = True
    faults = (OSError, lazrs.LazrsError)

    def _open(self) -> None:
        """Create the file with its header, and the buffer that records are packed in."""
        self._header = self._make_header()
        self._codes = self.scheme.las_codes()[self.scheme.ids]
        self._file = self._temporary.open("wb")
        self._writer = laspy.LasWriter(
            self._file,
            self._header,
            do_compress=self._compresses(),
            laz_backend=laspy.LazBackend.LazrsParallel,
            closefd=False,
        )
        self._buffer = np.zeros(_FIRST, dtype=self._header.point_format.dtype())
        self._held = 0
        self._low = np.full(3, np.iinfo(np.int32).max, dtype=np.int64)
        self._high = np.full(3, np.iinfo(np.int32).min, dtype=np.int64)
        self._by_return = np.zeros(16, dtype=np.int64)

    def _compresses(self) -> bool:
        """Return whether the points are compressed."""
        return self.path.suffix.lower() == ".laz"

    def _append(self, block: PointBlock) -> None:
        """Pack a block's points into records, slice by slice; the buffer is written whenever it is full."""
        begin = 0
        while begin < len(block):
            end = min(begin + _SLICE, begin + _BUFFER - self._held, len(block))
            self._make_room(self._held + end - begin)
            self._pack(block.select(slice(begin, end)), self._buffer[self._held : self._held + end - begin])
            self._held += end - begin
            begin = end
            if self._held == _BUFFER:
                self._flush()

    def _make_room(self, count: int) -> None:
        """Enlarge the buffer to a number of records; it grows by doubling, as many files of few points may be open."""
        if count > len(self._buffer):
            new_buffer = np.zeros(min(max(2 * len(self._buffer), count), _BUFFER), self._buffer.dtype)
            new_buffer[: self._held] = self._buffer[: self._held]
            self._buffer = new_buffer

    def _finish(self) -> None:
        """Write what is left in the buffer, and extent and numbers of points into the header, and close the file."""
        self._flush()
        header, count = self._writer.header, int(self._by_return.sum())
        header.mins = self._low * header.scales + header.offsets  # laspy writes 0 where there are no points
        header.maxs = self._high * header.scales + header.offsets
        header.point_count = count
        header.number_of_points_by_return = self._by_return[1:].astype(np.uint64)
        self._writer.close()
        self._file.close()

    def _flush(self) -> None:
        """Write the packed points without laspy's bookkeeping, which sorts them: ours is kept while packing."""
        if self._held:
            record = laspy.PackedPointRecord(self._buffer[: self._held], self._header.point_format)
            self._writer.point_writer.write_points(record)
            self._held = 0

    def _pack(self, block: PointBlock, record: AnyArray) -> None:
        """Fill in LAS records, in place, with the points of a block."""
        if not self._packed_by_loops(block, record):
            self._pack_standard(block, record)
        record["classification_flags"], record["user_data"] = self._pack_flags(block), block.more.get("user_data", 0)
        for column in self.columns:
            record[column.name] = self.stored_integers(column, block)

    def _packed_by_loops(self, block: PointBlock, record: AnyArray) -> bool:
        """Fill in what every LAS record has, without flags, by compiled loops; return False where NumPy has to."""
        if (loops := point_loops()) is None:
            return False
        points = PackedPoints(
            xyz=block.xyz,
            intensity=block.intensity,
            gps_time=block.gps_time,
            rgb=block.rgb,
            return_number=block.return_number,
            number_of_returns=block.number_of_returns,
            class_id=block.class_id,
            codes=self._codes,
            scan_angle_deg=block.scan_angle_deg,
            strip=block.strip,
            offset=self._header.offsets,
            per_metre=1.0 / SCALE,
            per_intensity=self.intensity_scale,
            per_degree=1.0 / SCAN_ANGLE_STEP,
        )
        extent_and_counts = loops.pack(record, points)
        if extent_and_counts is None:
            return False
        (least_steps, largest_steps), by_return = extent_and_counts
        self._low, self._high = (
            np.minimum(self._low, least_steps.astype(np.int64)),
            np.maximum(self._high, largest_steps.astype(np.int64)),
        )
        self._by_return += by_return
        return True

    def _pack_standard(self, block: PointBlock, record: AnyArray) -> None:
        """Fill in, in place, what every LAS record has, without flags."""
        self._pack_coordinates(block.xyz, record)
        brightness = block.intensity * self.intensity_scale
        np.rint(brightness, out=brightness)
        if not brightness.min() >= 0:  # nor where it is NaN
            raise OutputError(str(self.path), float(brightness.min()), "intensity must not be negative or NaN")
        if brightness.max() > 65535:
            self.clipped += int(np.count_nonzero(brightness > 65535))
            np.minimum(brightness, 65535, out=brightness)
        record["intensity"] = brightness
        rgb = self.to_integers(block.rgb, "uint16", "rgb")
        record["red"], record["green"], record["blue"] = rgb[:, 0], rgb[:, 1], rgb[:, 2]
        self._pack_returns(block, record)
        record["gps_time"] = self.check_finite(block.gps_time, "gps_time")
        record["scan_angle"] = self._scan_angle(block)
        record["point_source_id"] = self.to_integers(block.strip, "uint16", "strip") + np.uint16(1)
        record["classification"] = np.take(self._codes, self.to_integers(block.class_id, "uint8", "class_id"))

    def _pack_coordinates(self, xyz: Float, record: AnyArray) -> None:
        """Fill in, in place, the coordinates of records in steps of `SCALE`, and keep their extremes for the header."""
        steps = np.empty((3, len(xyz)))  # a row per axis: its extremes are found ten times as fast
        np.subtract(xyz.T, self._header.offsets[:, None], out=steps)
        np.rint(np.multiply(steps, 1.0 / SCALE, out=steps), out=steps)
        least_steps, largest_steps = steps.min(axis=1), steps.max(axis=1)
        if not (np.all(least_steps >= -(2**31)) and np.all(largest_steps < 2**31)):
            farthest_place = xyz[np.abs(steps).max(axis=0).argmax()]
            raise OutputError(
                str(self.path), farthest_place.tolist(), "coordinates must lie within 2147 km of the offset"
            )
        record["X"], record["Y"], record["Z"] = steps
        self._low = np.minimum(self._low, least_steps.astype(np.int64))
        self._high = np.maximum(self._high, largest_steps.astype(np.int64))

    def _pack_returns(self, block: PointBlock, record: AnyArray) -> None:
        """Fill in, in place, return number and number of returns, four bits each, and count points by return."""
        number = self.to_integers(block.return_number, "uint8", "return_number")
        return_count = self.to_integers(block.number_of_returns, "uint8", "number_of_returns")
        most_returns = max(number.max(), return_count.max())
        if most_returns > 15:
            raise OutputError(str(self.path), int(most_returns), "returns of a pulse must be at most 15")
        record["bit_fields"] = number | (return_count << np.uint8(4))
        self._by_return += [np.count_nonzero(number == k) for k in range(16)]  # faster than to sort them into bins

    def _pack_flags(self, block: PointBlock) -> AnyArray:
        """Return the byte (N,) of classification flags, scanner channel, scan direction and edge of the flight line."""
        flag_byte = np.zeros(len(block), dtype=np.uint8)
        for name, (shift, bits) in _FLAG_BITS.items():
            if name in block.more:
                value = self.to_integers(block.more[name], "uint8", name)
                if value.max() >= 1 << bits:
                    raise OutputError(str(self.path), int(value.max()), f"{name} must be at most {(1 << bits) - 1}")
                flag_byte |= value << np.uint8(shift)
        return flag_byte

    def _scan_angle(self, block: PointBlock) -> NDArray[np.int16]:
        """Return the scan angles (N,) in steps of `SCAN_ANGLE_STEP`; raise `OutputError` beyond 180 deg."""
        steps = self.to_integers(block.scan_angle_deg, "int16", "scan_angle", SCAN_ANGLE_STEP)
        if max(-int(steps.min()), int(steps.max())) > 30_000:
            raise OutputError(str(self.path), float(np.abs(block.scan_angle_deg).max()), "scan_angle is at most 180")
        return steps

    def _make_header(self) -> laspy.LasHeader:
        """Return the header of the file: scales, extra bytes, our notes and the coordinate system."""
        header = laspy.LasHeader(point_format=7, version="1.4")
        header.offsets, header.scales = self.offset, np.full(3, SCALE)
        header.file_source_id = self.source_id
        header.system_identifier = "SynthRoads simulation"
        header.generating_software = "SynthRoads"
        # No wall clock in files: the same seed gives the same bytes on any day.
        header.creation_date = date(2000, 1, 1)
        header.global_encoding.wkt = True
        if self.standard_time:
            header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
        header.add_extra_dims([self._extra_bytes(column) for column in self.columns])
        for attribute in header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs:
            # Smallest and largest value are optional, and unknown until the end.
            attribute.options &= ~(attribute.MIN_BIT_MASK | attribute.MAX_BIT_MASK)
        notes = _laid_out(json.dumps(self.notes()))
        header.vlrs.append(laspy.VLR(OWN, NOTES, "intensity scale, classes", notes.encode()))
        if self.crs_text:
            header.vlrs.append(WktCoordinateSystemVlr(self.crs_text))
        return header

    def _extra_bytes(self, column: Column) -> laspy.ExtraBytesParams:
        """Return the description of a column that is stored as extra bytes."""
        if column.scale is None:
            return laspy.ExtraBytesParams(column.name, column.dtype, column.description)
        shift = self.offset[column.component] if column.local and column.component is not None else 0.0
        return laspy.ExtraBytesParams(
            column.name, column.dtype, column.description, offsets=[float(shift)], scales=[column.scale]
        )


@lru_cache(maxsize=4)
def _laid_out(notes: str) -> str:
    """Return notes, given as JSON, in the project's layout; cached, as it takes long and tiles share notes."""
    return canonical_json(json.loads(notes))


_FAULTS = (
    *(laspy.errors.LaspyException, lazrs.LazrsError, ValueError, struct.error, OSError, EOFError, MemoryError),
    *(LookupError, ArithmeticError, TypeError, RecursionError),
)
"""Errors that laspy and lazrs raise where bytes aren't what they should be."""
_READ = {
    *("X", "Y", "Z", "intensity", "red", "green", "blue", "classification", "return_number", "number_of_returns"),
    *("gps_time", "scan_angle", "scan_angle_rank", "point_source_id", "class_id", "instance_id"),
}
"""Dimensions that are read besides attributes."""
_FLAG_BITS = {
    "synthetic": (0, 1),
    "key_point": (1, 1),
    "withheld": (2, 1),
    "overlap": (3, 1),
    "scanner_channel": (4, 2),
    "scan_direction_flag": (6, 1),
    "edge_of_flight_line": (7, 1),
}
"""First bit and number of bits of the flags that share a byte in point formats 6 and above (LAS 1.4 R15, table 16)."""
_LAYERED = 3
"""Compressor whose chunks store each attribute in a layer of its own."""
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Type of item (point, colour, colour with infrared, waveform; each of point formats 6 and above) -> its layers."""
_BYTES = 14
"""Type of item of extra bytes: each is a layer."""


class LasReader(CloudReader):
    """Reader of LAS and LAZ files of any version and point format.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no LAS file, or it is truncated.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        try:
            _check_start(path, self._file)
            self._reader = laspy.LasReader(
                self._file, closefd=False, read_evlrs=False, laz_backend=laspy.LazBackend.LazrsParallel
            )
            self.header = _header(path, self._reader.header)
            self._check_size(path)
        except InputError:
            self._file.close()
            raise
        except _FAULTS as problem:
            self._file.close()
            raise InputError(str(path), None, f"is not a LAS file that can be read ({problem})") from None

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points as blocks of at most ``size``, from the file's first point on."""
        position, path = 0, self.header.path
        if self._reader.points_read:
            self._reader.seek(0)
        brightness = self._full_brightness() if self.header.has_color else SIXTEEN_BITS
        while position < self.header.count:
            count = min(size, self.header.count - position)
            try:
                record = self._reader.read_points(count)
            except _FAULTS:
                raise damage_error(path, position, self.header.count) from None
            except BaseException as problem:
                if type(problem).__name__ == "PanicException":  # the decompressor's own way to fail
                    raise damage_error(path, position, self.header.count) from None
                raise
            if len(record) != count:
                raise damage_error(path, position + len(record), self.header.count)
            yield self._block(record, brightness, position)
            position += count

    def _check_size(self, path: Path) -> None:
        """Raise `InputError` if a LAS file ends before its points do or a LAZ file's chunks don't fill it."""
        header, size = self._reader.header, path.stat().st_size
        start = header.offset_to_point_data
        if not header.are_points_compressed:
            available_points = max(0, size - start) // header.point_format.size
            if available_points < header.point_count:
                raise damage_error(path, available_points, header.point_count)
        elif header.point_count:
            _check_chunks(path, start, header.vlrs.get("LasZipVlr")[0].record_data)

    def _full_brightness(self) -> float:
        """Return the stored value of full brightness: LAS has 16 bits, and many files hold 8 all the same."""
        channels = ("red", "green", "blue")

        def colors() -> Iterator[AnyArray]:
            """Yield the stored colours of the file's points, in parts (3, n)."""
            selection = laspy.DecompressionSelection.base() | laspy.DecompressionSelection.RGB
            with (
                suppress(*_FAULTS),  # damage is found where the points are read
                laspy.open(self.header.path, read_evlrs=False, decompression_selection=selection) as reader,
            ):
                # Ours have 16 bits, but were converted as they stood by earlier versions: a few chunks tell.
                chunk_limit = _FEW_CHUNKS if self.header.labelled else None
                for record in islice(reader.chunk_iterator(_CHUNK), chunk_limit):
                    yield np.stack([record[name] for name in channels])

        return self._assumed_brightness(colors(), is_integer=True)

    def _block(self, record: Any, brightness: float, position: int) -> PointBlock:
        """Return the block of points from a record.

        Args:
            record: of laspy, n points.
            brightness: stored value of full brightness.
            position: points before these, for messages.
        """
        header = self._reader.header
        names = set(record.point_format.dimension_names)
        present = [column.name for column in columns(self.header.attributes) if column.name in names]
        present += [name for name in FLAGS if name in names]
        fields = [name for name in ("return_number", "number_of_returns", "gps_time") if name in names]
        arrays = {name: np.array(record[name]) for name in (*present, *fields)}
        arrays["class_id"] = np.array(record["class_id" if self.header.labelled else "classification"])
        steps = np.stack([record.array[axis] for axis in "XYZ"], axis=1)
        arrays["xyz"] = steps * header.scales + header.offsets
        arrays["intensity"] = np.asarray(record["intensity"]).astype(np.float64) / (self.header.intensity_scale or 1.0)
        if self.header.has_color:
            rgb = np.stack([record[name] for name in ("red", "green", "blue")], axis=1)
            arrays["rgb"] = rgb if brightness == SIXTEEN_BITS else sixteen_bits(rgb, brightness)
        arrays["scan_angle_deg"] = _scan_angle(record, names)
        arrays["strip"] = np.asarray(record["point_source_id"]) - np.uint16(1)
        block = self._points(arrays, len(record), position)
        return block if self.header.predicted is None else block.with_arrays({PREDICTED: np.array(record[PREDICTED])})


def open_to_copy(path: Path) -> laspy.LasReader:
    """Open a LAS or LAZ file with laspy, including its extended records (EVLRs), to be copied.

    Raises:
        InputError: these records are damaged, or a header can't be written again as it is.
    """
    reader = laspy.open(path, read_evlrs=False, laz_backend=laspy.LazBackend.LazrsParallel)
    try:
        _check_attributes(path, reader.header)
        _check_records_behind(path, reader.header)
        reader.read_evlrs()
    except InputError:
        reader.close()
        raise
    except _FAULTS as problem:
        reader.close()
        raise InputError(str(path), None, f"the records behind its points are damaged ({problem})") from None
    return reader


def _check_attributes(path: Path, header: laspy.LasHeader) -> None:
    """Raise `InputError` if an extra attribute has no bytes: laspy has no type for it when it writes."""
    for dimension in header.point_format.extra_dimensions:
        if dimension.num_bits == 0:
            raise InputError(str(path), None, f"can't be copied: its attribute {dimension.name!r} has no bytes")


def _check_records_behind(path: Path, header: laspy.LasHeader) -> None:
    """Raise `InputError` if extended records (EVLRs) reach beyond the file's end, as laspy trusts their sizes."""
    offset, size = header.start_of_first_evlr or 0, path.stat().st_size
    with path.open("rb") as file:
        for _ in range(header.number_of_evlrs or 0):
            file.seek(min(offset + 20, size))
            offset += 60 + int.from_bytes(file.read(8), "little")
            if offset > size:
                raise InputError(str(path), None, "is truncated: the records behind its points reach beyond its end")


def _check_start(path: Path, file: BinaryIO) -> None:
    """Raise `InputError` if a header's records can't all lie before the points: laspy would seek them one by one."""
    start = file.read(104)
    file.seek(0)
    if start[:4] != b"LASF" or len(start) < 104:
        raise InputError(str(path), None, "is not a LAS file")
    header_size, points, records = struct.unpack_from("<HII", start, 94)
    if not header_size + 54 * records <= points <= path.stat().st_size:
        raise InputError(str(path), None, "is not a LAS file that can be read (its header is damaged or truncated)")


def _scan_angle(record: Any, names: set[str]) -> AnyArray:
    """Return the scan angles (N,), deg, from whichever field the point format has."""
    if "scan_angle" in names:
        return np.asarray(record["scan_angle"]).astype(np.float64) * SCAN_ANGLE_STEP
    return np.asarray(record["scan_angle_rank"])


def _header(path: Path, las: laspy.LasHeader) -> CloudHeader:
    """Return the header of a LAS file as that of a cloud.

    Raises:
        InputError: scales, offsets, coordinate system or our own notes are damaged.
    """
    names = set(las.point_format.dimension_names)
    notes = _notes(path, las, NOTES)
    if not (np.isfinite(las.offsets).all() and np.isfinite(las.scales).all() and np.all(las.scales != 0.0)):
        scales = [*las.scales.tolist(), *las.offsets.tolist()]
        raise InputError(f"{path}: scales and offsets", scales, "must be finite numbers, the scales not 0")
    labelled = bool(notes) and "class_id" in names
    attributes = attributes_of(names) if notes else ()
    read_names = _READ | {*FLAGS} | {column.name for column in columns(attributes)}
    if not labelled:
        read_names -= {"class_id"}
    scheme = asprs_scheme(range(256))
    if labelled:
        rows = notes.get("classes")
        scheme = stored_scheme(rows, str(path)) if isinstance(rows, dict) else class_scheme("17")
    place = placed(path, *declared_system(path, las))
    return CloudHeader(
        path,
        f"LAS {las.version}, point format {las.point_format.id}, {'LAZ' if las.are_points_compressed else 'LAS'}",
        int(las.point_count),
        place.in_metres(np.array(las.offsets, dtype=np.float64)),
        place=place,
        intensity_scale=intensity_scale(path, notes) if notes else None,
        scheme=scheme,
        labelled=labelled,
        attributes=attributes,
        has_color="red" in names,
        predicted=_predicted_classes(path, las),
        left_out=tuple(sorted(names - read_names)),
        standard_time=las.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD,
    )


def _notes(path: Path, las: laspy.LasHeader, number: int) -> dict[str, Any]:
    """Return the content of one of our own records, JSON; empty if there is none."""
    record = next((v.record_data_bytes() for v in las.vlrs if v.user_id == OWN and v.record_id == number), None)
    notes = json.loads(record) if record else {}
    if not isinstance(notes, dict):
        raise InputError(str(path), None, "its data on intensity scale and classes are damaged")
    return notes


def _predicted_classes(path: Path, las: laspy.LasHeader) -> ClassScheme | None:
    """Return the scheme of a file's predicted classes, of which only the numbers may be known; None if it has none."""
    if not any(
        dimension.name == PREDICTED and dimension.dtype == np.uint8 for dimension in las.point_format.extra_dimensions
    ):
        return None
    notes = _notes(path, las, PREDICTED_CLASSES)
    return stored_scheme(notes, str(path)) if notes else numbered_scheme()


def _check_chunks(path: Path, start: int, record: bytes) -> None:
    """Raise `InputError` if a LAZ file's chunks don't fill it, before the decompressor believes their sizes.

    The decompressor makes room for as many chunks, and for layers as long, as the bytes say: one flipped bit costs
    4 GB, or the process where there is no room. The layout is that of LASzip (Isenburg 2013, "LASzip: lossless
    compression of LiDAR data"; of the layered chunks of point formats 6 and above, "LAS 1.4 compression", rapidlasso
    2017).

    Args:
        path: the LAZ file, with one point at least.
        start: where its points begin, from the file's start.
        record: what its VLR of LASzip holds.

    Raises:
        InputError: the file is truncated, or the table or a chunk is damaged.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(start)
        table = int.from_bytes(file.read(8), "little", signed=True)
        if table == -1:  # written to a pipe: the place stands at the file's end
            file.seek(max(0, size - 8))
            table = int.from_bytes(file.read(8), "little", signed=True)
        if size < start + 8 or table > size - 8:
            raise InputError(str(path), None, f"is truncated: {size:,} bytes are left of more than {table:,}")
        file.seek(max(table, 0))
        _, count = struct.unpack("<II", file.read(8))
        if not start + 8 <= table or count > size - start:
            raise _damage_error(path)
        chunks = _chunk_sizes(path, file, start, record)
        if start + 8 + sum(chunks) > table:
            raise _damage_error(path)
        layers = _layers_of(record)
        offset = start + 8
        for number, length in enumerate(chunks):
            if layers and not _layers_add_up(file, offset, length, *layers):
                raise InputError(str(path), None, f"is damaged in chunk {number + 1:,} of {len(chunks):,}")
            offset += length


def _damage_error(path: Path) -> InputError:
    """Return, without raising, the `InputError` for a LAZ file whose table of chunks is damaged."""
    return InputError(str(path), None, "is damaged: its table of chunks doesn't match the file")


def _chunk_sizes(path: Path, file: BinaryIO, start: int, record: bytes) -> list[int]:
    """Return the size of each chunk, bytes, from the LAZ file's chunk table."""
    file.seek(start)
    try:
        table: list[tuple[int, int]] = lazrs.read_chunk_table(file, lazrs.LazVlr(record))
    except (lazrs.LazrsError, ValueError, OSError, TypeError):
        raise _damage_error(path) from None
    except BaseException as problem:
        if type(problem).__name__ == "PanicException":  # the decompressor's own way to fail
            raise _damage_error(path) from None
        raise
    return [length for _, length in table]


def _layers_of(record: bytes) -> tuple[int, int] | None:
    """Return a point's size, bytes, and the number of layers in a chunk; None if its chunks have no layers."""
    compressor, items = struct.unpack_from("<H", record)[0], struct.unpack_from("<H", record, 32)[0]
    if compressor != _LAYERED:
        return None
    kinds = list(struct.iter_unpack("<HHH", record[34 : 34 + 6 * items]))
    layers = sum(length if kind == _BYTES else _LAYERS.get(kind, 0) for kind, length, _ in kinds)
    return sum(length for _, length, _ in kinds), layers


def _layers_add_up(file: BinaryIO, offset: int, length: int, point: int, layers: int) -> bool:
    """Return whether a chunk is as long as its first point, point count, list of layers' lengths and layers.

    Args:
        file: the LAZ file.
        offset: at which the chunk begins, bytes.
        length: of the chunk, bytes.
        point: size of a point, bytes.
        layers: number of layers.
    """
    head = point + 4
    file.seek(offset + head)
    lengths = file.read(4 * layers)
    if len(lengths) < 4 * layers:
        return False
    return head + len(lengths) + sum(struct.unpack(f"<{layers}I", lengths)) == length
