"""Training data of a whole data set in one small file: the corridor at the training voxel size, 8 bytes per point.

A point is one 64-bit word, lowest bits first: x, y, z in steps of 1 cm within a cube of 10.24 m (10 bits each), red,
green, blue (5, 6, 5 bits), intensity (the upper 13 of its 16 bits) and class (5 bits; 31 is ignored). Words are
ordered by cube and place, and packed by deflate column of bytes by column of bytes, which takes about a third off. The
file is an NPZ: ``notes`` (JSON) and one member per tile, so that tiles can be read one by one.
"""

import io
import json
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import AnyArray, Int
from synthroads_addon.base.classes import ClassScheme, stored_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import write_file
from synthroads_addon.cloud.formats.npz import ARCHIVE_FAULTS

from .classes import IGNORED
from .points import cell_keys
from .tiles import CloudTile

STEP = 0.01
"""Size of a coordinate's step, m."""
CUBE = 1024
"""Steps across a cube."""
_NO_CLASS = 31
_TIME = (1980, 1, 1, 0, 0, 0)
"""Fixed time of the archive's members, so that equal content gives equal files."""


@dataclass(frozen=True)
class Packed:
    """One tile of training data as it is stored: compressed points and notes.

    Attributes:
        notes: scene, origin, number of points, and whether there are colours and intensities.
        content: compressed cubes and points.
    """

    notes: dict[str, Any]
    content: bytes


def encode_words(tile: CloudTile) -> tuple[NDArray[np.uint64], NDArray[np.int32], Int]:
    """Return a tile's points as 64-bit words (N,) sorted by cube, the cubes' indices (B, 3) and point counts (B,).

    Raises:
        InputError: a class has no room in 5 bits.
    """
    if len(tile) and tile.segment.max() >= _NO_CLASS:
        raise InputError("classes", int(tile.segment.max()) + 1, f"must be at most {_NO_CLASS}")
    steps = np.rint(tile.coord.astype(np.float64) / STEP).astype(np.int64)
    cubes = steps // CUBE
    cube_steps = steps - cubes * CUBE
    keys = cell_keys(cubes.astype(np.float64))
    order = np.lexsort((cube_steps[:, 0], cube_steps[:, 1], cube_steps[:, 2], keys))
    starts = np.flatnonzero(np.r_[True, np.diff(keys[order]) != 0])
    counts = np.diff(np.r_[starts, len(order)])
    word = np.zeros(len(tile), dtype=np.uint64)
    for values, shift in _fields(tile, cube_steps):
        word |= values.astype(np.uint64) << np.uint64(shift)
    return word[order], cubes[order[starts]].astype(np.int32), counts


def _fields(tile: CloudTile, cube_steps: Int) -> Iterator[tuple[AnyArray, int]]:
    """Yield (values (N,), lowest bit) of each part of the points' 64-bit words, see the module."""
    for axis in range(3):
        yield cube_steps[:, axis], 10 * axis
    if tile.color is not None:
        color = tile.color.astype(np.int64)
        yield color[:, 0] >> 3, 30
        yield color[:, 1] >> 2, 35
        yield color[:, 2] >> 3, 41
    if tile.strength is not None:
        yield np.rint(np.clip(tile.strength, 0.0, 1.0).astype(np.float64) * 65535.0).astype(np.int64) >> 3, 46
    yield np.where(tile.segment == IGNORED, _NO_CLASS, tile.segment), 59


def pack_tile(tile: CloudTile) -> Packed:
    """Return a non-empty tile quantised to 8 bytes per point and compressed."""
    word, cubes, counts = encode_words(tile)
    planes = np.ascontiguousarray(word.astype("<u8").view(np.uint8).reshape(-1, 8).T)
    content = cubes.astype("<i4").tobytes() + counts.astype("<i4").tobytes() + planes.tobytes()
    notes = {
        "scene": tile.scene,
        "origin": [float(value) for value in tile.origin],
        "points": len(tile),
        "cubes": len(cubes),
        "color": tile.color is not None,
        "strength": tile.strength is not None,
    }
    return Packed(notes, zlib.compress(content, 9))


def unpack_tile(packed_tile: Packed) -> CloudTile:
    """Return the decompressed tile: coordinates to half a step (5 mm), colours and intensities to their stored bits."""
    notes = packed_tile.notes
    points, cubes = int(notes["points"]), int(notes["cubes"])
    content = zlib.decompress(packed_tile.content)
    # Per cube three int32 of place and one of its points' number; per point one word, stored byte by byte.
    if len(content) != 16 * cubes + 8 * points:
        raise ValueError("must be as long as its numbers of cubes and points say")
    cube_indices = np.frombuffer(content, "<i4", 3 * cubes).reshape(-1, 3).astype(np.int64)
    counts = np.frombuffer(content, "<i4", cubes, 12 * cubes)
    planes = np.frombuffer(content, np.uint8, 8 * points, 16 * cubes).reshape(8, points)
    word = np.ascontiguousarray(planes.T).view("<u8").reshape(-1)

    def bits(shift: int, count: int) -> Int:
        """Return the numbers (N,) in some bits of all words, from the lowest bit ``shift`` on."""
        return ((word >> np.uint64(shift)) & np.uint64((1 << count) - 1)).astype(np.int64)

    steps = np.stack([bits(10 * axis, 10) for axis in range(3)], axis=1) + np.repeat(
        cube_indices * CUBE, counts, axis=0
    )
    color = np.stack([bits(30, 5) * 255 / 31, bits(35, 6) * 255 / 63, bits(41, 5) * 255 / 31], axis=1)
    segment = bits(59, 5)
    return CloudTile(
        str(notes["scene"]),
        np.array(notes["origin"], dtype=np.float64),
        (steps * STEP).astype(np.float32),
        np.rint(color).astype(np.uint8) if notes["color"] else None,
        ((bits(46, 13) * 8 + 4) / 65535.0).astype(np.float32) if notes["strength"] else None,
        np.where(segment == _NO_CLASS, IGNORED, segment).astype(np.int16),
    )


def write_pack(path: Path, tiles: list[Packed], scheme: ClassScheme, voxel: float, overwrite: bool = False) -> int:
    """Write packed tiles, their class scheme and voxel size to one NPZ file; return its size in bytes.

    Raises:
        OutputError: the file is there already or can't be written.
    """
    notes = {
        "type": "SynthRoads training data",
        "version": "1.0",
        "voxel": voxel,
        "scheme": scheme.to_dict(),
        "tiles": [tile.notes for tile in tiles],
    }
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("notes.json", _TIME), json.dumps(notes))
        for tile_index, tile in enumerate(tiles):
            archive.writestr(zipfile.ZipInfo(f"{tile_index:06d}", _TIME), tile.content)
    write_file(path, content.getvalue(), overwrite=overwrite)
    return len(content.getvalue())


class PackReader:
    """Reader of a file of packed tiles, tile by tile.

    Attributes:
        scheme: classes that the tiles' ``segment`` counts.
        voxel: edge of the cells of which one point each was kept, m.
        notes: notes of each tile.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file holds no packed tiles, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise MissingFileError(str(path), None, "no such file")
        try:
            self._archive = zipfile.ZipFile(path)
            data = json.loads(self._archive.read("notes.json"))
            self.voxel = float(data["voxel"])
            self.notes: list[dict[str, Any]] = data["tiles"]
            self.scheme = stored_scheme(data["scheme"], str(path))
        except (*ARCHIVE_FAULTS, TypeError):
            raise InputError(str(path), None, "must be an undamaged file of `synthroads pack`") from None

    def __len__(self) -> int:
        return len(self.notes)

    def tile(self, tile_index: int) -> CloudTile:
        """Return the tile of an index, decompressed; raise `InputError` if the file is damaged there."""
        try:
            return unpack_tile(Packed(self.notes[tile_index], self._archive.read(f"{tile_index:06d}")))
        except (*ARCHIVE_FAULTS, TypeError):
            raise InputError(str(self.path), None, f"the file is damaged at tile {tile_index}: pack it again") from None
