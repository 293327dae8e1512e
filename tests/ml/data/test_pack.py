"""Parts of a data set that are packed, and the command that packs it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from ml.data import pack
from ml.data.packed import pack_tile
from synthroads_addon.base.classes import class_scheme
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, write_cloud, write_pointcept


def test_limit_takes_tiles_of_every_scene_alike() -> None:
    packed = [pack_tile(road_tile(1500, seed, f"scene{seed % 3}")) for seed in range(12)]
    limit = (1 << 16) + 6 * (len(packed[0].content) + 900)
    chosen = pack.choose_tiles(packed, limit, 1)
    scenes = [tile.notes["scene"] for tile in chosen]
    assert len(chosen) == 6
    assert [scenes.count(f"scene{k}") for k in range(3)] == [2, 2, 2]
    assert [tile.content for tile in chosen] == [tile.content for tile in pack.choose_tiles(packed, limit, 1)]


def test_command_packs_a_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = write_pointcept(tmp_path / "set", "train", [road_tile(5000, 1, "a"), road_tile(5000, 2, "b")])
    target = tmp_path / "train.npz"
    words = ["pack", str(root), "--split", "train", "-o", str(target), "--limit-mb", "0.5", "-s", "3"]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["bytes"] == target.stat().st_size <= 500_000
    assert told["scenes"] == 2
    assert told["crops"] == told["points"] // 24_000
    assert main(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    before = target.read_bytes()
    assert main([*words, "--overwrite"]) == 0
    assert target.read_bytes() == before
    said = capsys.readouterr().out
    assert said.startswith(f"written {target}: {told['bytes'] / 1e6:.1f} MB with {told['tiles']} tiles of 2 scenes, ")


def test_corridor_of_a_scene_is_cut_along_its_road(tmp_path: Path) -> None:
    home = tmp_path / "scenes" / "one"
    home.mkdir(parents=True)
    block = road_block(60_000, 3, length=150.0)
    write_cloud(home / "cloud.laz", block)
    line = [[4e5 - 5.0, 5.6e6 + 20.0, 100.0], [4e5 + 155.0, 5.6e6 + 20.0, 100.0]]
    data = {"type": "LineString", "coordinates": line}
    (home / "centerline.geojson").write_text(json.dumps(data))
    tiles = list(pack.corridor_tiles(tmp_path / "scenes" / "one", class_scheme("5"), 0.2, 8.0))
    assert len(tiles) == 3
    north = np.concatenate([tile.coord[:, 1] + tile.origin[1] for tile in tiles])
    assert 11.9 < north.min() - 5.6e6 < 12.3
    assert 27.7 < north.max() - 5.6e6 < 28.1
    lengths = [np.ptp(tile.coord[:, 0]) for tile in tiles]
    assert lengths[1] == pytest.approx(60.0, abs=1.0)
    names = {int(label) for tile in tiles for label in np.unique(tile.segment)}
    assert names <= set(range(5))


@pytest.mark.parametrize(
    ("option", "value"),
    [("--voxel", "0.01"), ("--corridor", "4"), ("--limit-mb", "0.1"), ("--seed", "-1"), ("--output", "train.laz")],
)
def test_what_cannot_be_kept_to_is_refused(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pack", "set", "--output", "train.npz", option, value]) == 2
    assert capsys.readouterr().err.startswith(f"error: {option}")
