"""LAS 1.4 / LAZ, point format 7, written block by block under a temporary name.

Besides the standard fields each point has as extra bytes ``class_id`` (see `labels`; the standard field
``classification`` holds its LAS code), ``instance_id`` and the attributes asked for (`attributes.COLUMNS`). The scale
of the 16-bit intensity and the table of classes stand as JSON in the VLR ``SynthRoads`` 1.
"""

from __future__ import annotations

from contextlib import suppress
from datetime import date
from typing import Any

import laspy
import lazrs
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray

from ...base.errors import OutputError
from ...base.schema import canonical_json
from ..layers import Column
from ..points import PointBlock
from .writer import CloudWriter

SCALE = 0.001
"""Size of a coordinate's step, m."""
SCAN_ANGLE_STEP = 0.006
"""Degrees per step of the scan angle (LAS 1.4 R15, table 14)."""
NO_STRIP = 65535
"""`PointBlock.strip` of points of no strip, which LAS numbers 0; strips count from 1 there."""
_CHUNK = 50_000
"""Points in a chunk of LAZ, the unit of its compression: whole ones are compressed side by side."""
_BUFFER = 8 * _CHUNK
_SLICE = 16_384
"""Points that are packed at a time: their intermediate arrays then stay in the processor's cache."""


class LasWriter(CloudWriter):
    """Writes point blocks to a LAZ (or, by its ending, LAS) file; see `CloudWriter`."""

    faults = (OSError, lazrs.LazrsError)

    def _open(self) -> None:
        self._header = self._make_header()
        self._codes = self.scheme.las_codes()[self.scheme.ids]
        self._file = self._temporary.open("wb")
        self._writer = laspy.LasWriter(
            self._file,
            self._header,
            do_compress=self.path.suffix.lower() == ".laz",
            laz_backend=laspy.LazBackend.LazrsParallel,
            closefd=False,
        )
        self._buffer = np.zeros(_BUFFER, dtype=self._header.point_format.dtype())
        self._held = 0
        self._low = np.full(3, np.iinfo(np.int32).max, dtype=np.int64)
        self._high = np.full(3, np.iinfo(np.int32).min, dtype=np.int64)
        self._by_return = np.zeros(16, dtype=np.int64)

    def _append(self, block: PointBlock) -> None:
        first = 0
        while first < len(block):
            last = min(first + _SLICE, first + _BUFFER - self._held, len(block))
            self._pack(block.select(slice(first, last)), self._buffer[self._held : self._held + last - first])
            self._held += last - first
            first = last
            if self._held == _BUFFER:
                self._flush()

    def _finish(self) -> None:
        self._flush()
        header, count = self._writer.header, int(self._by_return.sum())
        header.mins = self._low * header.scales + header.offsets  # laspy writes 0 where there are no points
        header.maxs = self._high * header.scales + header.offsets
        header.point_count = count
        header.number_of_points_by_return = self._by_return[1:].astype(np.uint64)
        self._writer.close()
        self._file.close()

    def _abandon(self) -> None:
        with suppress(AttributeError, OSError):
            self._file.close()
        with suppress(OSError):
            self._temporary.unlink(missing_ok=True)

    def _flush(self) -> None:
        """Hand the packed points on. laspy's own bookkeeping sorts and searches them: ours is kept while packing."""
        if self._held:
            record = laspy.PackedPointRecord(self._buffer[: self._held], self._header.point_format)
            self._writer.point_writer.write_points(record)
            self._held = 0

    def _pack(self, block: PointBlock, record: NDArray[Any]) -> None:
        """Turn points into LAS records, in place."""
        self._pack_coordinates(block.xyz, record)
        brightness = block.intensity * self.intensity_scale
        np.rint(brightness, out=brightness)
        if not brightness.min() >= 0:  # nor where it is NaN
            raise OutputError(str(self.path), float(brightness.min()), "intensity must not be negative or NaN")
        if brightness.max() > 65535:
            self.clipped += int(np.count_nonzero(brightness > 65535))
            np.minimum(brightness, 65535, out=brightness)
        record["intensity"] = brightness
        rgb = self.integers(block.rgb, "uint16", "rgb")
        record["red"], record["green"], record["blue"] = rgb[:, 0], rgb[:, 1], rgb[:, 2]
        self._pack_returns(block, record)
        record["gps_time"] = self.finite(block.gps_time, "gps_time")
        record["scan_angle"] = self._scan_angle(block)
        record["point_source_id"] = self.integers(block.strip, "uint16", "strip") + np.uint16(1)
        for column in self.columns:
            record[column.name] = self.stored(column, block)
        record["classification"] = np.take(self._codes, self.integers(block.class_id, "uint8", "class_id"))

    def _pack_coordinates(self, xyz: NDArray[np.float64], record: NDArray[Any]) -> None:
        steps = np.empty((3, len(xyz)))  # a row per axis: its extremes are found ten times as fast
        np.subtract(xyz.T, self._header.offsets[:, None], out=steps)
        np.rint(np.multiply(steps, 1.0 / SCALE, out=steps), out=steps)
        low, high = steps.min(axis=1), steps.max(axis=1)
        if not (np.all(low >= -(2**31)) and np.all(high < 2**31)):
            worst = xyz[np.abs(steps).max(axis=0).argmax()]
            raise OutputError(str(self.path), worst.tolist(), "coordinates must lie within 2147 km of the offset")
        record["X"], record["Y"], record["Z"] = steps
        self._low = np.minimum(self._low, low.astype(np.int64))
        self._high = np.maximum(self._high, high.astype(np.int64))

    def _pack_returns(self, block: PointBlock, record: NDArray[Any]) -> None:
        """Pack return number and number of returns, four bits each."""
        number = self.integers(block.return_number, "uint8", "return_number")
        of = self.integers(block.number_of_returns, "uint8", "number_of_returns")
        most = max(number.max(), of.max())
        if most > 15:
            raise OutputError(str(self.path), int(most), "returns of a pulse must be at most 15")
        record["bit_fields"] = number | (of << np.uint8(4))
        self._by_return += [np.count_nonzero(number == k) for k in range(16)]  # faster than to sort them into bins

    def _scan_angle(self, block: PointBlock) -> NDArray[np.int16]:
        steps = self.integers(block.scan_angle_deg, "int16", "scan_angle", SCAN_ANGLE_STEP)
        if max(-int(steps.min()), int(steps.max())) > 30_000:
            raise OutputError(str(self.path), float(np.abs(block.scan_angle_deg).max()), "scan_angle is at most 180")
        return steps

    def _make_header(self) -> laspy.LasHeader:
        header = laspy.LasHeader(point_format=7, version="1.4")
        header.offsets, header.scales = self.offset, np.full(3, SCALE)
        header.system_identifier = "SynthRoads simulation"
        header.generating_software = "SynthRoads"
        # No wall clock in files: the same seed gives the same bytes on any day.
        header.creation_date = date(2000, 1, 1)
        header.global_encoding.wkt = True
        header.add_extra_dims([self._extra_bytes(column) for column in self.columns])
        for extra in header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs:
            # Smallest and largest value are optional, and unknown until the end.
            extra.options &= ~(extra.MIN_BIT_MASK | extra.MAX_BIT_MASK)
        notes = canonical_json(self.notes())
        header.vlrs.append(laspy.VLR("SynthRoads", 1, "intensity scale, classes", notes.encode()))
        if self.crs_text:
            header.vlrs.append(WktCoordinateSystemVlr(self.crs_text))
        return header

    def _extra_bytes(self, column: Column) -> laspy.ExtraBytesParams:
        if column.scale is None:
            return laspy.ExtraBytesParams(column.name, column.dtype, column.description)
        shift = self.offset[column.component] if column.local and column.component is not None else 0.0
        return laspy.ExtraBytesParams(
            column.name, column.dtype, column.description, offsets=[float(shift)], scales=[column.scale]
        )
