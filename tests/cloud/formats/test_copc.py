"""COPC: every point once, in the node whose box holds it, and found by readers that aren't ours."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.cloud.formats import octree
from synthroads_addon.cloud.formats.registry import check_ending, open_cloud, open_writer, with_ending
from synthroads_addon.cloud.points import PointBlock, concatenate
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


def flat_points(count: int, seed: int = 3) -> PointBlock:
    """Return points on a road's surface, 600 m by 20 m, some of them at the same place."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 600.0, count), rng.uniform(-10.0, 10.0, count)
    xyz = ORIGIN + np.stack([x, y, 0.02 * np.abs(y)], axis=1)
    xyz[count // 2 :: 50] = xyz[0]
    return replace(make_points(count, seed), xyz=xyz, instance_id=np.arange(count, dtype=np.uint32))


def written(path: Path, *blocks: PointBlock) -> Path:
    with open_writer(path, 25832, ORIGIN, 1e6) as writer:
        for block in blocks:
            writer.write(block)
    return path


def coordinates(records: laspy.ScaleAwarePointRecord) -> np.ndarray:
    return np.stack([np.asarray(records[axis]) for axis in "xyz"], axis=1)


@pytest.fixture
def shallow(monkeypatch):
    """Nodes and buckets of few points, so that small clouds have many."""
    monkeypatch.setattr(octree, "_FEW_POINTS", 200)
    monkeypatch.setattr(octree, "_BUCKET_POINTS", 4_000)
    monkeypatch.setattr(octree, "_BLOCK", 3_000)


@pytest.mark.usefixtures("shallow")
def test_each_point_stands_once_in_the_node_whose_box_holds_it(tmp_path: Path) -> None:
    points = flat_points(40_000)
    path = written(tmp_path / "a.copc.laz", points)
    with laspy.CopcReader.open(str(path)) as reader:
        info, header = reader.copc_info, reader.header
        entries = dict(reader.root_page.entries)
        seen = []
        for key, entry in entries.items():
            if not entry.point_count:
                continue
            records = reader.query(level=key.level)
            xyz = coordinates(records)
            edge = 2.0 * info.halfsize / 2**key.level
            low = info.center - info.halfsize + edge * np.array([key.x, key.y, key.z])
            inside = np.all((xyz >= low - 1e-9) & (xyz < low + edge), axis=1)
            assert np.count_nonzero(inside) == entry.point_count
            seen.append(np.asarray(records["instance_id"])[inside])
        assert max(key.level for key in entries) >= 3
        assert [info.gps_min, info.gps_max] == [points.gps_time.min(), points.gps_time.max()]
        assert header.number_of_points_by_return[0] == np.count_nonzero(points.return_number == 1)
        assert info.spacing == pytest.approx(2.0 * info.halfsize / 128)
    assert sorted(np.concatenate(seen).tolist()) == list(range(40_000))
    assert [file.name for file in tmp_path.iterdir()] == ["a.copc.laz"]


@pytest.mark.usefixtures("shallow")
def test_a_level_alone_shows_the_whole_road_thinly(tmp_path: Path) -> None:
    """No two points of a level share one of its cells, unless nothing is left to be divided."""
    path = written(tmp_path / "a.copc.laz", flat_points(40_000))
    with laspy.CopcReader.open(str(path)) as reader:
        first, info = reader.query(level=0), reader.copc_info
        cells = np.floor((coordinates(first) - (info.center - info.halfsize)) / info.spacing)
        assert len(np.unique(cells, axis=0)) == len(first)
        assert np.ptp(coordinates(first)[:, 0]) > 590.0
        corners = {"mins": ORIGIN[:2] + [100.0, -20.0], "maxs": ORIGIN[:2] + [110.0, 20.0]}
        found = reader.query(bounds=laspy.copc.Bounds(**corners))
    xyz = flat_points(40_000).xyz
    assert len(found) == np.count_nonzero((xyz[:, 0] >= ORIGIN[0] + 100.0) & (xyz[:, 0] <= ORIGIN[0] + 110.0))


@pytest.mark.usefixtures("shallow")
def test_blocks_and_buckets_change_nothing(tmp_path: Path, monkeypatch) -> None:
    points = flat_points(20_000)
    whole = written(tmp_path / "a.copc.laz", points).read_bytes()
    parts = [points.select(slice(at, at + 777)) for at in range(0, 20_000, 777)]
    assert written(tmp_path / "b.copc.laz", *parts).read_bytes() == whole
    monkeypatch.setattr(octree, "_BUCKET_POINTS", 10**9)
    held = [set(node.points.tolist()) for node in nodes_of(points, tmp_path)]
    monkeypatch.setattr(octree, "_BUCKET_POINTS", 4_000)
    assert sorted(map(sorted, held)) == sorted(sorted(node.points.tolist()) for node in nodes_of(points, tmp_path))


def nodes_of(points: PointBlock, folder: Path) -> list[octree.Node]:
    steps = np.rint((points.xyz - points.xyz.min(axis=0)) / 0.001).astype(np.int64)
    return list(octree.octree_nodes(steps.__getitem__, len(steps), int(steps.max()) + 1, folder))


def test_no_point_and_one_point(tmp_path: Path) -> None:
    for count in (0, 1):
        path = written(tmp_path / "a.copc.laz", make_points(count))
        with open_cloud(path) as cloud:
            assert cloud.header.count == sum(len(block) for block in cloud.blocks()) == count


def test_the_description_stands_where_readers_look_for_it(tmp_path: Path) -> None:
    data = written(tmp_path / "a.copc.laz", make_points(100)).read_bytes()
    assert data[377:381] == b"copc"  # 375 bytes of header, 2 reserved ones (COPC 1.0, "COPC structure")
    size, place = struct.unpack("<H", data[395:397])[0], struct.unpack_from("<Q", data, 429 + 40)[0]
    assert size == 160
    assert data[place - 60 + 2 : place - 60 + 6] == b"copc"


@pytest.mark.parametrize(
    ("name", "ending", "other"),
    [("a.copc.laz", ".copc.laz", "a.ply"), ("a.b.LAZ", ".laz", "a.b.ply"), ("A.COPC.LAZ", ".copc.laz", "A.ply")],
)
def test_both_parts_of_the_ending_count(name: str, ending: str, other: str) -> None:
    assert check_ending(Path(name)) == ending
    assert with_ending(Path(name), ".ply") == Path(other)


def test_the_whole_cloud_comes_back_by_our_reader(tmp_path: Path) -> None:
    points = [flat_points(5_000, seed) for seed in (1, 2)]
    path = written(tmp_path / "a.copc.laz", *points)
    with open_cloud(path) as cloud:
        found = concatenate(list(cloud.blocks()))
    given = concatenate(points)
    order = [np.lexsort((block.gps_time, block.instance_id)) for block in (given, found)]
    assert np.abs(given.xyz[order[0]] - found.xyz[order[1]]).max() <= 5e-4 + 1e-9
    assert np.array_equal(given.class_id[order[0]], found.class_id[order[1]])
