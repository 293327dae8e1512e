"""Packed tiles: what they keep, and the file that holds them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ml.data.classes import IGNORED
from ml.data.packed import PackReader, pack_tile, unpack_tile, write_pack
from ml.data.sources import Source, read_tiles
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_tile


def test_packing_keeps_points_within_half_a_step() -> None:
    tile = road_tile(4000)
    labels = tile.segment.copy()
    labels[::9] = IGNORED
    tile = replace(tile, coord=tile.coord - np.float32(17.3), segment=labels)  # negative coordinates as well
    packed = pack_tile(tile)
    again = unpack_tile(packed)
    where = np.lexsort(np.rint(tile.coord.astype(float) / 0.01).T)
    there = np.lexsort(np.rint(again.coord.astype(float) / 0.01).T)
    assert np.abs(tile.coord[where] - again.coord[there]).max() < 0.00501
    assert (tile.segment[where] == again.segment[there]).all()
    assert np.abs(tile.color[where].astype(int) - again.color[there]).max() <= 8
    assert np.abs(tile.strength[where] - again.strength[there]).max() < 8.1 / 65535
    assert (again.origin == tile.origin).all()
    assert len(packed.content) <= 8 * len(tile) + 16 * packed.notes["cubes"] + 64


def test_packing_keeps_what_is_missing_missing() -> None:
    again = unpack_tile(pack_tile(replace(road_tile(500), color=None, strength=None)))
    assert again.color is None
    assert again.strength is None


def test_packed_file_is_read_back_and_damage_is_told(tmp_path: Path) -> None:
    tiles = [road_tile(3000, seed, f"scene{seed}") for seed in (1, 2)]
    path = tmp_path / "pack.npz"
    size = write_pack(path, [pack_tile(tile) for tile in tiles], class_scheme("5"), 0.1)
    assert size == path.stat().st_size
    before = path.read_bytes()
    write_pack(path, [pack_tile(tile) for tile in tiles], class_scheme("5"), 0.1, overwrite=True)
    assert path.read_bytes() == before
    found = list(read_tiles(Source(path=str(path)), class_scheme("5"), None))
    assert [tile.scene for tile in found] == ["scene1", "scene2"]
    assert sum(map(len, found)) == 6000
    middle = len(before) // 2
    path.write_bytes(before[:middle] + bytes(200) + before[middle + 200 :])
    with pytest.raises(InputError, match="damaged"):
        [PackReader(path).tile(place) for place in range(2)]
    path.write_bytes(before[: len(before) // 3])
    with pytest.raises(InputError):
        PackReader(path)
