"""Tiles, classes and sources."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest

from ml.data.classes import IGNORED, LabelMapping, load_mapping, table_between
from ml.data.points import voxel_sample
from ml.data.sources import Source, read_tiles
from ml.data.tiles import CloudTile, robust_scaling, scalings
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from tests.helpers.clouds.road_tiles import road_points, road_tile
from tests.helpers.clouds.segmentation_data import NAMES, road_block, write_cloud, write_pointcept


def test_thinning_keeps_one_point_per_cell_whatever_the_order() -> None:
    random = np.random.default_rng(1)
    coord = random.uniform(-3.0, 3.0, (5000, 3))
    keep = voxel_sample(coord, 0.5)
    cells = np.floor(coord / 0.5)
    assert len(keep) == len(np.unique(cells, axis=0)) == len(np.unique(cells[keep], axis=0))
    away = np.abs(coord / 0.5 - cells - 0.5)
    for index in keep[:50]:
        same = np.flatnonzero((cells == cells[index]).all(axis=1))
        assert (away[same] ** 2).sum(axis=1).min() == (away[index] ** 2).sum()
    order = random.permutation(len(coord))
    assert set(order[voxel_sample(coord[order], 0.5)]) == set(keep)
    assert len(voxel_sample(np.zeros((0, 3)), 0.1)) == 0
    with pytest.raises(InputError, match="cells"):
        voxel_sample(np.array([[0.0, 0.0, 0.0], [1e9, 1e9, 1e9]]), 0.1)


def test_seventeen_classes_become_five_by_name_and_never_the_other_way() -> None:
    full, short = class_scheme("17"), class_scheme("5")
    table = table_between({row.id: row.name for row in full.rows}, short, "test")
    assert {NAMES[table[row.id]] for row in full.rows if row.name in ("guardrail", "vehicle", "bridge")} == {
        "road_furniture"
    }
    assert NAMES[table[15]] == "ground"
    assert table[255] == IGNORED
    with pytest.raises(InputError, match="road_furniture"):
        table_between({row.id: row.name for row in short.rows}, full, "test")


def test_mapping_names_groups_and_ignores_the_rest() -> None:
    mapping = load_mapping("ign")
    assert mapping.targets(NAMES) == ("ground", "vegetation", "other")
    assert mapping.label(np.array([2, 5, 6, 3]), NAMES).tolist() == [0, 1, IGNORED, 1]
    assert mapping.group_of(NAMES).tolist() == [0, 0, 0, 1, 2]
    assert load_mapping("semantickitti").label(np.array([40, 60, 99]), NAMES).tolist() == [1, 2, IGNORED]
    with pytest.raises(InputError, match="did you mean 'road'"):
        LabelMapping(classes={"1": "roads"}).targets(NAMES)
    with pytest.raises(InputError, match="semantickitti"):
        load_mapping("semantickity")


def test_data_set_and_clouds_give_the_same_points(tmp_path: Path) -> None:
    root = write_pointcept(tmp_path / "set", "train", [road_tile(2000)])
    (from_set,) = read_tiles(Source(path=str(tmp_path / "set"), split="train"), class_scheme("5"), None)
    xyz, rgb, _, label = road_points(2000, 1)
    assert np.abs(from_set.coord - xyz).max() < 1e-4
    assert (from_set.segment == label).all()
    folder = tmp_path / "clouds" / "train"
    folder.mkdir(parents=True)
    write_cloud(folder / "a.laz", road_block(2000, 1))
    (from_cloud,) = read_tiles(Source(path=str(folder.parent), split="train"), class_scheme("5"), None)
    there = from_cloud.coord + (from_cloud.origin - [4e5, 5.6e6, 100.0])
    assert np.abs(there - xyz).max() < 0.002
    assert (from_cloud.segment == label).all()
    assert (from_cloud.color == rgb).all()
    assert np.abs(from_cloud.strength - from_set.strength).max() < 2e-5
    with pytest.raises(MissingFileError, match="train"):
        next(read_tiles(Source(path=str(root), split="trian"), class_scheme("5"), None))
    with pytest.raises(MissingFileError):
        next(read_tiles(Source(path=str(tmp_path / "nowhere")), class_scheme("5"), None))


def test_scenes_that_are_links_are_read_once(tmp_path: Path) -> None:
    """As where they lie on another disk; a link that leads back adds nothing."""
    for name in ("set/scenes/a", "disk/b"):
        (tmp_path / name).mkdir(parents=True)
        write_cloud(tmp_path / name / "cloud.laz", road_block(3000, 1))
    (tmp_path / "set" / "scenes" / "b").symlink_to(tmp_path / "disk" / "b", target_is_directory=True)
    (tmp_path / "disk" / "b" / "loop").symlink_to(tmp_path / "set", target_is_directory=True)
    tiles = read_tiles(Source(path=str(tmp_path / "set")), class_scheme("5"), None)
    assert {tile.scene for tile in tiles} == {"scenes/a/cloud", "scenes/b/cloud"}


def test_tiles_of_a_data_set_that_are_links_are_read(tmp_path: Path) -> None:
    root = write_pointcept(tmp_path / "set", "train", [road_tile(3000, 1, "a"), road_tile(3000, 2, "b")])
    (root / "train" / "b-1").rename(tmp_path / "b-1")
    (root / "train" / "b-1").symlink_to(tmp_path / "b-1", target_is_directory=True)
    tiles = read_tiles(Source(path=str(tmp_path / "set"), split="train"), class_scheme("5"), None)
    assert [tile.scene for tile in tiles] == ["a", "b"]


def test_clouds_of_one_name_are_scenes_of_their_own(tmp_path: Path) -> None:
    """The scenes of a data set all hold a ``cloud.laz``; each has its own scanner, perhaps, and its own scaling."""
    for name, gain in (("a", 1.0), ("b", 0.1)):
        (tmp_path / name).mkdir()
        block = road_block(3000, 1)
        write_cloud(tmp_path / name / "cloud.laz", replace(block, intensity=gain * block.intensity))
    scheme = class_scheme("5")
    tiles = list(read_tiles(Source(path=str(tmp_path)), scheme, None))
    found = scalings(tiles, "robust")
    assert list(found) == ["a/cloud", "b/cloud"]
    assert found["a/cloud"].span == pytest.approx(10.0 * found["b/cloud"].span, rel=0.01)
    alone = read_tiles(Source(path=str(tmp_path / "a" / "cloud.laz")), scheme, None)
    assert {tile.scene for tile in alone} == {"cloud"}


def test_clouds_of_others_need_a_mapping(tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 0.001)
    header.add_extra_dim(laspy.ExtraBytesParams("label", "uint16"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.random.default_rng(1).uniform(0, 20, (3, 400))
    las.intensity = np.where(np.arange(400) < 100, 0, 20_000)
    las["label"] = np.where(np.arange(400) % 2, 40, 99)
    path = tmp_path / "sweep.laz"
    las.write(path)
    with pytest.raises(InputError, match="mapping"):
        list(read_tiles(Source(path=str(path)), class_scheme("5"), None))
    (tile,) = read_tiles(Source(path=str(path), mapping="semantickitti"), class_scheme("5"), None)
    assert len(tile) == 400
    assert (tile.segment == 1).sum() == 150
    assert (tile.segment == IGNORED).sum() == 250  # of another class, or without an intensity
    assert tile.color is None
    mapping = tmp_path / "own.json"
    mapping.write_text(json.dumps({"field": "label2", "classes": {"1": "road"}}))
    with pytest.raises(InputError, match="label2"):
        list(read_tiles(Source(path=str(path), mapping=str(mapping)), class_scheme("5"), None))


def test_robust_scaling_takes_gain_and_shift_out() -> None:
    strength = np.random.default_rng(1).random(1000).astype(np.float32)
    one, other = (robust_scaling([s]).apply(s) for s in (strength, strength * np.float32(0.2) + np.float32(0.1)))
    np.testing.assert_allclose(one, other, atol=1e-5)
    assert np.median(one) == pytest.approx(0.0, abs=1e-6)
    tiles: list[CloudTile] = [road_tile(500, 1, "a"), replace(road_tile(500, 2, "b"), strength=None)]
    assert scalings(tiles, "share")["a"].apply(strength) == pytest.approx(strength)
    assert scalings(tiles, "robust")["b"].span == 1.0


@pytest.mark.parametrize(
    ("name", "said"),
    [("set", r"labelled points; synthroads dataset RECIPE --output \S+set makes one$"), ("scan.laz", "points$")],
)
def test_a_data_set_that_is_missing_is_told_with_what_makes_it(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=said):
        list(read_tiles(Source(path=str(tmp_path / name), split="train"), class_scheme("5"), 0.3))
