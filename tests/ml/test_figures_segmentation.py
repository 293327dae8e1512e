"""The commands that measure segmentations and write the tables of docs/segmentation.md, on toy roads."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest
import torch

from ml.runs import Run
from ml.segmentation import projection, task
from ml.segmentation.metrics import Confusion
from ml.segmentation.pack import main as pack
from ml.segmentation.prediction import PREDICTED
from ml.segmentation.tables import by_class, by_test
from synthroads_addon.core.errors import InputError, MissingFileError
from synthroads_addon.core.marked import BEGIN
from tests.ml.segmentation_data import road_block, road_tile, toy, write_cloud, write_pointcept
from tools import figures_segmentation, measure_prediction

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "segmentation.md"
torch.set_num_threads(1)


def street(path: Path) -> None:
    """Write a cloud with the labels and without the colours of an airborne scan of others."""
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    block = road_block(3000, 4)
    las.header.scales, las.header.offsets = np.full(3, 0.001), np.array([4e5, 5.6e6, 100.0])
    las.x, las.y, las.z = block.xyz.T
    las.intensity = np.rint(block.intensity * 65535)
    las.classification = np.array([2, 2, 2, 5, 1])[block.class_id]
    las.write(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with toy data, a run that was trained on them, and a "real" cloud."""
    home = tmp_path_factory.mktemp("figures")
    for name in ("real", "synthetic"):
        for split in ("train", "test"):
            write_pointcept(home / name, split, [road_tile(3000, 1 + k, f"{name}{k}") for k in range(2)])
    task.train(Run.start(home / "run", toy(home, schedule={"epochs": 1})))
    street(home / "street.laz")
    return home


def part(document: Path, name: str) -> list[str]:
    """Return the lines of a table in a document."""
    return document.read_text(encoding="utf-8").partition(BEGIN.format(name))[2].partition("<!--")[0].splitlines()[1:]


def test_tables_come_from_what_was_measured_and_others_stay(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures_segmentation, "REAL_CLOUDS", {"ign": "street.laz"})
    document = folder / "segmentation.md"
    document.write_text(DOCUMENT.read_text(encoding="utf-8"), encoding="utf-8")
    words = ["--small", "run", "--run", "run", "--real", "", "--pictures", "pictures", "--document", "segmentation.md"]
    figures_segmentation.main([word if word.startswith("--") else str(folder / word) for word in words])
    scores = json.loads((folder / "run" / "metrics.json").read_text())["tests"]["unseen"]
    shown = {
        line.split("|")[1].strip(): line.split("|")[-2].strip() for line in part(document, "small")[2:] if "|" in line
    }
    assert list(shown) == [*scores["classes"], "mean"]
    assert shown["road"] == f"{100 * scores['classes']['road']['iou']:.1f}"
    assert shown["mean"] == f"{100 * scores['mean_iou']:.1f}"
    rows = [line.split("|")[1].strip() for line in part(document, "real-ign") if "|" in line]
    assert rows == ["class", "--:", "ground", "vegetation"] or rows[2:] == ["ground", "vegetation"]
    assert part(document, "mixing") == part(DOCUMENT, "mixing")
    picture = (folder / "pictures" / "segmentation-ign.png").read_bytes()
    assert picture[:4] == b"\x89PNG"
    assert len(picture) < 300_000


def test_an_experiments_table_has_its_seeds_and_times(folder: Path) -> None:
    scores = [json.loads((folder / "run" / "metrics.json").read_text())["tests"]] * 2
    home = folder / "experiment"
    for seed, seconds in ((1, 30.0), (2, 34.0)):
        (home / "tuned" / f"seed-{seed}" / "pretraining").mkdir(parents=True)
        (home / "tuned" / f"seed-{seed}" / "history.json").write_text(json.dumps([{"epoch": 1, "seconds": seconds}]))
        own = home / "tuned" / f"seed-{seed}" / "pretraining" / "history.json"
        own.write_text(json.dumps([{"epoch": 1, "seconds": 50.0}] * 2))
    results = {name: dict(zip("12", scores, strict=True)) for name in ("tuned", "adapted")}
    (home / "results.json").write_text(json.dumps(results))
    text = figures_segmentation.experiment(home)
    assert "| *training, s* |  | 132 (3) | - |" in text
    assert "Seeds: tuned 2, adapted 2." in text
    assert "**unseen**" in text


def test_a_document_without_the_markers_stays_as_it_is(folder: Path) -> None:
    document = folder / "other.md"
    document.write_text("nothing to replace\n")
    with pytest.raises(SystemExit, match="must stand in it once"):
        figures_segmentation.main(["--small", str(folder / "run"), "--document", str(document)])
    assert document.read_text() == "nothing to replace\n"


def test_every_table_has_its_place_in_the_document() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    names = [*figures_segmentation.READERS, *(f"real-{name}" for name in figures_segmentation.REAL_CLOUDS)]
    assert all(text.count(BEGIN.format(name)) == 1 for name in names)


def test_classes_that_do_not_occur_have_no_row_and_there_is_no_mean() -> None:
    confusion = Confusion(("a", "b", "c"))
    confusion.add(np.array([0, 0, 1, 1]), np.array([0, 1, 1, 2]))
    text = by_class([confusion.to_dict()] * 2)
    assert [line.split("|")[1].strip() for line in text.splitlines()] == ["class", "---", "a", "b"]
    assert "| a | 2 | 100.0 (0.0) | 50.0 (0.0) | 50.0 (0.0) |" in text
    confusion.add(np.array([2]), np.array([2]))
    assert "| mean | 5 |" in by_class([confusion.to_dict()])
    assert by_test({"one": {}}).endswith("Seeds: .")


def test_packed_points_are_told_in_crops(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(folder / "real"), "--split", "train", "--output", str(folder / "train.npz"), "--voxel", "0.02"]
    assert pack([*words, "--overwrite"]) == 0
    told = json.loads(capsys.readouterr().out)
    cells = [
        cell.strip() for cell in figures_segmentation.packed(folder / "train.npz").splitlines()[2].split("|")[1:-1]
    ]
    assert cells[1:4] == ["2", "2", f"{told['points']:,}"]
    assert cells[5] == str(told["points"] // 24_000)
    assert told["bytes_per_point"] == pytest.approx((folder / "train.npz").stat().st_size / told["points"], abs=1e-3)


def test_a_large_cloud_is_labelled_and_compared(folder: Path) -> None:
    cloud = write_cloud(folder / "cloud.laz", road_block(4000, 9))
    words = [str(folder / "run"), str(cloud), "--points", "10000", "--output", str(folder / "measured"), "--keep"]
    measure_prediction.main(words)
    file = folder / "measured" / "prediction.json"
    told = json.loads(file.read_text())
    assert (told["points"], told["copies"], told["changed"]) == (10_000, 3, [])
    assert sum(told["classes"].values()) == 10_000
    assert told["points_per_second"] > 0
    one, large = laspy.read(cloud), laspy.read(folder / "measured" / "large.laz")
    shift = np.asarray(large.x)[4000:8000] - np.asarray(one.x)
    assert np.ptp(shift) < 1e-6
    assert shift[0] > np.ptp(np.asarray(one.x))
    assert (np.asarray(large.y)[8000:] > np.asarray(one.y).max()).all()
    assert (np.asarray(large["instance_id"])[4000:8000] == np.asarray(one["instance_id"])).all()
    assert "| 10,000 |" in figures_segmentation.prediction(file)


def test_records_that_a_labelled_file_has_lost_are_found(folder: Path) -> None:
    las = laspy.read(write_cloud(folder / "before.laz", road_block(500, 9)))
    las.add_extra_dim(laspy.ExtraBytesParams(PREDICTED, "uint8"))
    note = [laspy.VLR("surveyor", 7, "note", content) for content in (b"one", b"two")]
    las.vlrs.extend(note)
    las.evlrs = laspy.vlrs.vlrlist.VLRList()
    las.evlrs.append(laspy.VLR("surveyor", 8, "long note", b"three"))
    las.write(folder / "before.laz")
    assert measure_prediction.differences(folder / "before.laz", folder / "before.laz") == []
    las.vlrs.remove(note[0])
    las.write(folder / "fewer.laz")
    assert measure_prediction.differences(folder / "before.laz", folder / "fewer.laz") == ["record surveyor 7"]
    las.evlrs.clear()
    las.write(folder / "fewer.laz")
    wanted = ["record surveyor 7", "record surveyor 8"]
    assert measure_prediction.differences(folder / "before.laz", folder / "fewer.laz") == wanted


def test_what_a_labelled_file_has_lost_is_found(folder: Path) -> None:
    cloud = write_cloud(folder / "before.laz", road_block(500, 9))
    assert measure_prediction.differences(cloud, cloud) == [PREDICTED]
    las = laspy.read(cloud)
    las.add_extra_dim(laspy.ExtraBytesParams(PREDICTED, "uint8"))
    las.write(folder / "same.laz")
    assert measure_prediction.differences(cloud, folder / "same.laz") == []
    las.gps_time[7] += 1.0
    las["instance_id"][3] += 1
    las.header.system_identifier = "other"
    las.header.file_source_id = 3
    las.x[5] -= 1000.0
    las.return_number[:2] = 2
    las.write(folder / "changed.laz")
    wanted = ["X", "bit_fields", "gps_time", "header: file_source_id", "header: mins"]
    wanted += ["header: number_of_points_by_return", "header: system_identifier", "instance_id"]
    assert measure_prediction.differences(cloud, folder / "changed.laz") == wanted
    las.points = las.points[:400]
    las.write(folder / "short.laz")
    assert measure_prediction.differences(cloud, folder / "short.laz") == ["number of points"]


def test_clouds_that_cannot_be_laid_side_by_side_are_refused(folder: Path) -> None:
    with pytest.raises(MissingFileError):
        measure_prediction.tile_cloud(folder / "no.laz", folder / "large.laz", 10)
    cloud = write_cloud(folder / "few.laz", road_block(3, 9))
    with pytest.raises(InputError, match="larger cloud"):
        measure_prediction.tile_cloud(cloud, folder / "large.laz", 10**15)


def test_a_trainings_time_is_its_steps_times_what_one_takes(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = toy(folder, schedule={"epochs": 5})
    (folder / "toy.yaml").write_text(json.dumps(configuration.to_dict()))
    monkeypatch.setattr(projection, "timed_steps", lambda *_: (90.0, 80.0))
    assert projection.main([str(folder / "toy.yaml"), "--output", str(folder / "projection.json")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((folder / "projection.json").read_text())
    assert (told["tiles"], told["steps_per_epoch"], told["steps"]) == (2, 2, 10)  # 4 crops a tile, 4 a batch
    assert told["hours"] == 0.25
    assert "| 2 | 3,200 | 90.0 |" in figures_segmentation.projection(folder / "projection.json")
    assert projection.main([str(folder / "toy.yaml"), "--set", "crop_points=100000"]) == 2
    assert "must not exceed the points" in capsys.readouterr().err


def test_measured_steps_take_time(folder: Path) -> None:
    told = projection.projection(toy(folder), 2)
    assert told["seconds_per_step"] > 0
    assert told["cpu_seconds_per_step"] > 0
