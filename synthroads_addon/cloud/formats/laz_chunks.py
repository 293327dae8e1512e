"""The sizes that a LAZ file claims within itself, held against the file's own before its decompressor believes them.

The decompressor makes room for as many chunks, and for layers as long, as the bytes say: one flipped bit costs 4 GB, or
the process where there is no room. The layout is that of LASzip (Isenburg 2013, "LASzip: lossless compression of LiDAR
data"; of the layered chunks of point formats 6 and above, "LAS 1.4 compression", rapidlasso 2017).
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import lazrs

from ...base.errors import InputError

_LAYERED = 3
"""Compressor whose chunks store each attribute in a layer of its own."""
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Type of item (point, colour, colour with infrared, waveform; each of point formats 6 and above) -> its layers."""
_BYTES = 14
"""Type of item of extra bytes: each is a layer."""


def check_chunks(path: Path, start: int, record: bytes) -> None:
    """Refuse a file whose chunks don't fill it.

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
        at = start + 8
        for number, length in enumerate(chunks):
            if layers and not _layers_fill(file, at, length, *layers):
                raise InputError(str(path), None, f"is damaged in chunk {number + 1:,} of {len(chunks):,}")
            at += length


def _damage_error(path: Path) -> InputError:
    return InputError(str(path), None, "is damaged: the table of its chunks doesn't fit the file")


def _chunk_sizes(path: Path, file: BinaryIO, start: int, record: bytes) -> list[int]:
    """Return the bytes of each chunk, as the table says."""
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
    """Return size of a point, bytes, and number of layers of a chunk; None if its chunks have no layers."""
    compressor, items = struct.unpack_from("<H", record)[0], struct.unpack_from("<H", record, 32)[0]
    if compressor != _LAYERED:
        return None
    kinds = list(struct.iter_unpack("<HHH", record[34 : 34 + 6 * items]))
    layers = sum(length if kind == _BYTES else _LAYERS.get(kind, 0) for kind, length, _ in kinds)
    return sum(length for _, length, _ in kinds), layers


def _layers_fill(file: BinaryIO, at: int, length: int, point: int, layers: int) -> bool:
    """Return whether a chunk's layers are as long together as the chunk: its first point, a number, their lengths."""
    head = point + 4
    file.seek(at + head)
    lengths = file.read(4 * layers)
    if len(lengths) < 4 * layers:
        return False
    return head + len(lengths) + sum(struct.unpack(f"<{layers}I", lengths)) == length
