"""Data for learning and use, cut or flipped: taken or refused in one line, by every reader of its own."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
import torch
from laspy.vlrs.vlrlist import VLRList

from ml.data.crops import CropSettings, Item
from ml.data.packed import pack_tile, write_pack
from ml.data.points import read_ground
from ml.data.roads import read_scene
from ml.data.sources import Source, read_tiles
from ml.runs import CHECKPOINT, Run
from ml.segmentation.prediction import Labelling, predict_file
from ml.segmentation.recipes import SegmentationConfiguration
from synthroads_addon.base.classes import class_scheme
from tests.fuzz.test_bytes import every_cloud
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, write_cloud, write_pointcept
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz

SHORT = [token for token in TOKENS if len(token) < 100]
SCHEME = class_scheme("5")


def by_height(batch: Item) -> torch.Tensor:
    """Score classes by height, as a trained network would by more."""
    return -(batch["coord"][:, 2:] - torch.arange(5.0)).abs()


def clouds(folder: Path, ending: str) -> list[bytes]:
    """Return sound clouds: our own, others', and one with a record behind its points."""
    files = [*every_cloud(folder, ending), write_cloud(folder / f"labelled{ending}", road_block(500, 1)).read_bytes()]
    las = laspy.read(folder / f"labelled{ending}")
    las.evlrs = VLRList([laspy.VLR("others", 7, "behind the points", bytes(range(200)))])
    las.write(folder / f"behind{ending}")
    return [*files, (folder / f"behind{ending}").read_bytes()]


@fuzz(15, 800)
@pytest.mark.parametrize("ending", [".las", ".laz"])
def test_clouds_to_be_labelled(tmp_path: Path, ending: str, count: int) -> None:
    path, target = tmp_path / f"cloud{ending}", tmp_path / "out" / f"labelled{ending}"
    labelling = Labelling(by_height, CropSettings(voxel=2.0), SCHEME, "share")

    def body(content: bytes) -> None:
        path.write_bytes(content)
        shutil.rmtree(target.parent, ignore_errors=True)
        taken = accepted(lambda: predict_file(path, target, labelling, classification=True))
        assert target.exists() == taken
        assert {file.name for file in target.parent.glob("*")} <= {target.name}

    for_all(damaged(clouds(tmp_path, ending), SHORT, head=900), count, body)


@fuzz(10, 500)
@pytest.mark.parametrize("mapping", [None, "ign"])
def test_clouds_to_learn_from(tmp_path: Path, mapping: str | None, count: int) -> None:
    path = tmp_path / "cloud.las"
    source = Source(path=str(path), mapping=mapping)

    def use() -> None:
        for tile in read_tiles(source, SCHEME, 0.5):
            assert np.isfinite(tile.coord).all()

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(use)
        accepted(lambda: read_ground(path))

    for_all(damaged(clouds(tmp_path, ".las"), SHORT, head=900), count, body)


@fuzz(20, 800)
def test_packed_tiles(tmp_path: Path, count: int) -> None:
    path = tmp_path / "pack.npz"
    write_pack(path, [pack_tile(road_tile(500, seed)) for seed in (1, 2)], SCHEME, 0.1)
    sound = path.read_bytes()

    def use() -> None:
        for tile in read_tiles(Source(path=str(path)), SCHEME, None):
            assert len(tile.coord) == len(tile.segment)

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(use)

    for_all(damaged([sound], SHORT, head=900), count, body)


@fuzz(20, 800)
@pytest.mark.parametrize("name", ["coord.npy", "segment.npy", "color.npy", "strength.npy", "tile.json"])
def test_tiles_of_a_data_set(tmp_path: Path, name: str, count: int) -> None:
    root = write_pointcept(tmp_path, "train", [road_tile(200)])
    (path,) = root.glob(f"train/*/{name}")

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: list(read_tiles(Source(path=str(tmp_path)), SCHEME, 0.5)))

    for_all(damaged([path.read_bytes()], SHORT, head=130), count, body)


def checked(path: Path, body: Callable[[], object], count: int) -> None:
    """Run a body on damaged copies of a file."""

    def run(content: bytes) -> None:
        path.write_bytes(content)
        accepted(body)

    for_all(damaged([path.read_bytes()], SHORT), count, run)


@fuzz(10, 500)
def test_checkpoints(tmp_path: Path, count: int) -> None:
    run = Run.start(tmp_path, SegmentationConfiguration.from_dict({"task": "segmentation", "data": {"real": []}}))
    run.save({"model": torch.nn.Linear(4, 3).state_dict(), "epoch": 1})
    checked(tmp_path / CHECKPOINT, run.last_checkpoint, count)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a scene of a data set."""
    return write_data_set(tmp_path_factory.mktemp("set")) / "scenes" / "a-01"


@fuzz(3, 150)
@pytest.mark.parametrize("name", ["notes.json", "xyz.npy", "station.npy", "reference.npy", "class_id.npy"])
def test_roads_that_were_kept(scene: Path, tmp_path: Path, name: str, count: int) -> None:
    """A kept copy that is damaged is made anew from the cloud."""
    read_scene(scene, "road", tmp_path / "cache")
    (path,) = (tmp_path / "cache").glob(f"*/{name}")

    def use() -> None:
        (road,) = read_scene(scene, "road", tmp_path / "cache")
        assert len(road.station) == len(road.xyz) == len(road.class_id)

    checked(path, use, count)
