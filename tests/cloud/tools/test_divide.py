"""Clouds merged, cropped and cut into tiles: no point is lost, doubled or changed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.divide import crop, merge, points_in_rings, tile
from synthroads_addon.cloud.tools.subsample import keep_one_per_cell
from tests.helpers.clouds.random_points import make_points
from tests.helpers.files.listed_folders import listed_entries

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


def cloud(path: Path, seed: int = 1, epsg: int = 25832, scale: float = 65535.0) -> PointBlock:
    """Write a cloud of 150 m x 90 m and return it as it is read."""
    block = make_points(800, seed)
    place = np.random.default_rng(seed).uniform((0, 0, 0), (150, 90, 8), (800, 3))
    with open_writer(path, epsg, ORIGIN, scale) as writer:
        writer.write(replace(block, xyz=ORIGIN + np.round(place, 3), intensity=np.linspace(0.0, 1.0, 800)))
    return read(path)


def read(path: Path) -> PointBlock:
    """Return a file's points."""
    with open_cloud(path) as file:
        return concatenate(list(file.blocks()))


def same(one: PointBlock, other: PointBlock) -> None:
    """Compare all that points have."""
    for name, array in one.attributes().items():
        np.testing.assert_array_equal(array, other.array(name), name)


def test_merged_clouds_are_their_points_one_after_another(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.laz", "b.laz")]
    parts = [cloud(file, seed) for seed, file in enumerate(files, 1)]
    done = merge(files, tmp_path / "c.laz")
    assert (done["points"], done["files"]) == (1600, ["a.laz", "b.laz"])
    same(concatenate(parts), read(tmp_path / "c.laz"))


def test_clouds_that_do_not_fit_together_are_refused_by_what_differs(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.laz", "b.laz")]
    for file, epsg in zip(files, (25832, 25833), strict=True):
        cloud(file, epsg=epsg)
    with pytest.raises(InputError, match=r"b\.laz.*different coordinate system from a\.laz"):
        merge(files, tmp_path / "c.laz")
    with pytest.raises(InputError, match="two clouds"):
        merge(files[:1], tmp_path / "c.laz")
    with pytest.raises(OutputError, match="another file"):
        merge(files, files[0], overwrite=True)
    assert not (tmp_path / "c.laz").exists()


def test_crops_keep_what_lies_within_all_that_is_given(tmp_path: Path) -> None:
    points = cloud(tmp_path / "a.laz")
    x, y, z = (points.xyz - ORIGIN).T
    corners = [(20, 10), (120, 10), (120, 80), (20, 80)]
    hole = [(40, 30), (60, 30), (60, 50), (40, 50)]
    rings = [[list(ORIGIN[:2] + place) for place in (*ring, ring[0])] for ring in (corners, hole)]
    shape = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": rings}}
    (tmp_path / "p.json").write_text(json.dumps(shape))
    box = (ORIGIN[0] + 30, ORIGIN[1] + 5, ORIGIN[0] + 110, ORIGIN[1] + 85)
    crop(tmp_path / "a.laz", tmp_path / "b.laz", box, (182.0, 186.0), tmp_path / "p.json")
    within = (x >= 30) & (x <= 110) & (y > 10) & (y < 80) & (z >= 2) & (z <= 6)
    within &= ~((x > 40) & (x < 60) & (y > 30) & (y < 50))
    assert 100 < within.sum() < 600
    same(points.select(np.flatnonzero(within)), read(tmp_path / "b.laz"))
    for given, text in (({}, "--box"), ({"box": (0, 0, 1, 1)}, "no points within"), ({"heights": (3, 2)}, "--heights")):
        with pytest.raises(InputError, match=text):
            crop(tmp_path / "a.laz", tmp_path / "n.laz", **given)
    assert not (tmp_path / "n.laz").exists()


def test_points_in_a_star_are_those_of_the_winding_rule() -> None:
    angle = np.arange(10) * np.pi / 5
    star = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(10) % 2, 0.4, 1.0)[:, None]
    points = np.random.default_rng(2).uniform(-1.1, 1.1, (4000, 2))
    turn = np.unwrap(np.arctan2(*(np.vstack([star, star[:1]]) - points[:, None]).T[::-1]), axis=0)
    np.testing.assert_array_equal(points_in_rings(points, [star]), np.abs(turn[-1] - turn[0]) > 3.0)


@pytest.mark.parametrize("grid", [None, 5.0])
def test_tiles_hold_every_point_once(tmp_path: Path, grid: float | None) -> None:
    points = cloud(tmp_path / "a.laz")
    done = tile(tmp_path / "a.laz", tmp_path / "tiles", 60.0, grid, kind="npz")
    files = sorted((tmp_path / "tiles").iterdir())
    assert [file.name for file in files] == sorted(row["file"] for row in done["tiles"])
    assert files[0].name == "a_294000_5628000.npz"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.laz", "tiles"]
    parts = [read(file) for file in files]
    for file, part in zip(files, parts, strict=True):
        corner = np.array([int(number) for number in file.stem.split("_")[1:]])
        assert np.all((part.xyz[:, :2] >= corner) & (part.xyz[:, :2] < corner + 60))
    expected = points if grid is None else points.select(keep_one_per_cell(points, grid))
    found = concatenate(parts)
    assert len(found) == len(expected)
    order = (np.lexsort(block.xyz.T) for block in (found, expected))
    np.testing.assert_allclose(found.xyz[next(order)], expected.xyz[next(order)], atol=1e-9)


def test_small_tiles_are_left_out_and_nothing_is_written_where_all_are(tmp_path: Path) -> None:
    cloud(tmp_path / "a.laz")
    every = tile(tmp_path / "a.laz", tmp_path / "all", 60.0)["tiles"]
    fewest = max(row["points"] for row in every)
    assert len(tile(tmp_path / "a.laz", tmp_path / "some", 60.0, fewest=fewest)["tiles"]) < len(every)
    with pytest.raises(InputError, match="--fewest"):
        tile(tmp_path / "a.laz", tmp_path / "none", 60.0, fewest=10_000)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("count", [100, 600])
def test_names_that_are_listed_for_a_tile_dont_grow_with_their_number(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = listed_entries(monkeypatch)
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    corner = np.arange(count)
    las.x, las.y, las.z = corner % 25 * 2.0 + 1.0, corner // 25 * 2.0 + 1.0, 0.0 * corner
    las.write(tmp_path / "a.las")
    assert len(tile(tmp_path / "a.las", tmp_path / "tiles", 2.0)["tiles"]) == count
    assert 0 < sum(listed) < 60 * count
