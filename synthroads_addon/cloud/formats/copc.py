"""COPC 1.0: LAZ whose points are ordered as an octree, so that viewers load over the network what they show.

Points are written as uncompressed LAS first, and are ordered when all are known. Our code on lazrs, which compresses
LAZ anyway: COPC is an order of its chunks, and copclib, the one library that writes it from Python, leaves the counts
of points by return and the range of times empty. Source: https://copc.io, version 1.0.
"""

import struct
from pathlib import Path
from typing import Any, BinaryIO

import laspy
import lazrs
import numpy as np
from laspy.vlrs.known import LasZipVlr

from ...base.arrays import AnyArray, Int
from .las import LasReader, LasWriter
from .octree import CELL_LEVELS, Node, octree_nodes

_USER = "copc"
_INFO, _HIERARCHY = 1, 1000
"""Record ids of the file's description and of its octree's table."""
_INFO_LAYOUT = "<5d2Q2d11Q"
_ENTRY_LAYOUT = "<4iQ2i"
"""Level, x, y, z, offset, bytes and points of a node."""
_EXTENDED_RECORD_LAYOUT = "<H16sHQ32s"
_BATCH_POINTS = 500_000
"""Points that are compressed at a time, about."""


class CopcWriter(LasWriter):
    """Writer of point blocks to a COPC file; see `CloudWriter`."""

    def _open(self) -> None:
        """Create the file of uncompressed points in place of the one that is wanted in the end."""
        self._ordered_path = self._temporary
        self._temporary = self._temporary.with_name("points.las")
        super()._open()

    def _compresses(self) -> bool:
        """Return that the points aren't compressed before they are ordered."""
        return False

    def _finish(self) -> None:
        """Complete the uncompressed file, and write its points in the order of the octree."""
        super()._finish()
        with self._temporary.open("rb") as source:
            header = laspy.LasHeader.read_from(source)
        points: AnyArray
        if self.count:
            points = np.memmap(
                self._temporary,
                dtype=header.point_format.dtype(),
                mode="r",
                offset=header.offset_to_point_data,
                shape=self.count,
            )
        else:
            points = np.zeros(0, dtype=header.point_format.dtype())
        with self._ordered_path.open("w+b") as file:
            _write_ordered(file, header, points, self._low, self._high, self._temporary.parent)
        del points
        self._temporary.unlink()
        self._temporary = self._ordered_path


class CopcReader(LasReader):
    """Reader of COPC files, which are LAZ files, in the order of their octree."""


def _write_ordered(
    file: BinaryIO, header: laspy.LasHeader, points: AnyArray, low: Int, high: Int, folder: Path
) -> None:
    """Write a COPC file.

    Args:
        file: new file, open for reading and writing.
        header: of the uncompressed file.
        points: (N,) its records.
        low: (3,) least steps of the coordinates.
        high: (3,) largest ones.
        folder: for temporary files.
    """
    if not len(points):
        low = high = np.zeros(3, dtype=np.int64)
    side = int((high - low).max()) + 1

    def steps(numbers: slice | Int) -> AnyArray:
        """Return coordinates (n, 3) in steps from the least ones."""
        part = points[numbers]
        return np.stack([part[axis].astype(np.int64) - low[i] for i, axis in enumerate("XYZ")], axis=1)

    vlr = lazrs.LazVlr.new_for_compression(header.point_format.id, header.point_format.num_extra_bytes, True)
    header.vlrs.insert(0, laspy.VLR(_USER, _INFO, "COPC info VLR", bytes(struct.calcsize(_INFO_LAYOUT))))
    header.vlrs.append(LasZipVlr(vlr.record_data()))
    header.are_points_compressed = True
    header.write_to(file)
    first_chunk = header.offset_to_point_data
    compressor = lazrs.ParLasZipCompressor(file, vlr)
    nodes, times = _compress_nodes(compressor, points, octree_nodes(steps, len(points), side, folder))
    compressor.done()
    file.flush()
    file.seek(first_chunk)
    chunk_sizes = [size for _, size in lazrs.read_chunk_table(file, vlr)] if nodes else []
    entries = _entries(nodes, chunk_sizes, first_chunk + struct.calcsize("<q"))
    end = file.seek(0, 2)
    record = struct.pack(_EXTENDED_RECORD_LAYOUT, 0, _USER.encode(), _HIERARCHY, len(entries), b"EPT Hierarchy")
    file.write(record + entries)
    half = 0.5 * side * header.scales[0]
    center = header.offsets + (low + 0.5 * side - 0.5) * header.scales
    spacing = 2.0 * half / 2**CELL_LEVELS
    table_place = (end + len(record), len(entries))
    header.vlrs[0].record_data = struct.pack(_INFO_LAYOUT, *center, half, spacing, *table_place, *times, *[0] * 11)
    header.start_of_first_evlr, header.number_of_evlrs = end, 1
    file.seek(0)
    header.write_to(file, ensure_same_size=True)


def _compress_nodes(compressor: Any, points: AnyArray, nodes: Any) -> tuple[list[tuple[Node, int]], list[float]]:
    """Write a chunk of compressed points for each node; return nodes without points, their counts, and times.

    Args:
        compressor: of lazrs, which takes several chunks at a time.
        points: (N,) records.
        nodes: in the order in which they are written.

    Returns:
        Each node with its number of points, and the least and the largest time of all points, s.
    """
    written: list[tuple[Node, int]] = []
    times = [np.inf, -np.inf]
    batch: list[AnyArray] = []

    def flush() -> None:
        """Compress the chunks that wait."""
        if batch:
            compressor.compress_chunks([np.frombuffer(records, dtype=np.uint8) for records in batch])
            batch.clear()

    for node in nodes:
        records = np.ascontiguousarray(points[node.points])
        times = [min(times[0], records["gps_time"].min()), max(times[1], records["gps_time"].max())]
        batch.append(records)
        written.append((Node(node.level, node.place, node.points[:0]), len(records)))
        if sum(map(len, batch)) >= _BATCH_POINTS:
            flush()
    flush()
    return written, [float(time) if np.isfinite(time) else 0.0 for time in times]


def _entries(nodes: list[tuple[Node, int]], chunk_sizes: list[int], start: int) -> bytes:
    """Return the octree's table: an entry for each node, and empty ones for nodes above that hold no point.

    Args:
        nodes: with their numbers of points, in the order of the chunks.
        chunk_sizes: bytes of each.
        start: place of the first chunk in the file.
    """
    entries: dict[tuple[int, ...], tuple[int, int, int]] = {}
    for (node, count), size in zip(nodes, chunk_sizes, strict=True):
        entries[node.level, *node.place] = (start, size, count)
        start += size
    for key in list(entries):
        above = key
        while above[0]:
            above = (above[0] - 1, *(number >> 1 for number in above[1:]))
            if above in entries:
                break
            entries[above] = (0, 0, 0)
    return b"".join(struct.pack(_ENTRY_LAYOUT, *key, *entries[key]) for key in sorted(entries))
