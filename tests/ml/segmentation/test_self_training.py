"""Self-training on unlabelled clouds, and trainings that begin with the weights of another."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from ml.data.classes import IGNORED
from ml.data.sources import Source, read_tiles
from ml.experiments import configurations
from ml.runs import CONFIGURATION, PRETRAINING, Run
from ml.segmentation import task
from ml.segmentation.experiment import Experiment
from ml.segmentation.loading import ExchangedBatches, read_domains
from ml.segmentation.recipes import SegmentationConfiguration
from ml.segmentation.self_training import label_confident_points, target_tiles
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import write_file
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, same, toy, weights, write_cloud, write_pointcept

torch.set_num_threads(1)
CPU = torch.device("cpu")


@pytest.fixture(autouse=True)
def _only_this_task(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the other tasks' packages out of what is imported here."""
    monkeypatch.setattr("ml.configuration.TASKS", {"segmentation": "ml.segmentation.task"})


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a synthetic data set and a cloud of another domain, whose labels are wrong."""
    folder = tmp_path_factory.mktemp("data")
    write_pointcept(folder / "synthetic", "train", [road_tile(500, k, f"road{k}", 0.3, 20.0) for k in (1, 2)])
    block = road_block(700, 5, 20.0)
    write_cloud(folder / "target.laz", replace(block, class_id=np.zeros_like(block.class_id)))
    return folder


def self_trained(data: Path, /, **changes: Any) -> SegmentationConfiguration:
    """Return a short self-training on the target's cloud."""
    given = {
        "crop_points": 300,
        "crops_per_tile": 2,
        "set_up": "self_trained",
        "fine_tuning": {"epochs": 1, "learning_rate": 0.001},
        "data": {
            "synthetic": [{"path": str(data / "synthetic"), "split": "train"}],
            "target": [{"path": str(data / "target.laz"), "tile": 1000}],
        },
    }
    return SegmentationConfiguration.from_dict({**toy(data).to_dict(), **given, **changes})


def test_a_clouds_labels_are_not_looked_at(data: Path, tmp_path: Path) -> None:
    block = road_block(700, 5, 20.0)
    write_cloud(tmp_path / "labelled.laz", block)
    found = []
    for path in (data / "target.laz", tmp_path / "labelled.laz"):
        tiles = list(read_tiles(Source(path=str(path), tile=1000), class_scheme("5"), 0.3, labels=False))
        assert all((tile.segment == IGNORED).all() for tile in tiles)
        found.append(tiles)
    assert np.array_equal(found[0][0].coord, found[1][0].coord)
    with pytest.raises(MissingFileError):
        list(read_tiles(Source(path=str(tmp_path), split="none"), class_scheme("5"), 0.3, labels=False))


def test_of_each_class_the_surest_are_believed(data: Path) -> None:
    configuration = self_trained(data, self_training={"believed": 0.25})
    count = 400
    own = (np.arange(count) / 65535.0).astype(np.float32)  # tells the points apart
    tiles = [replace(road_tile(count, 3, "a", 1.0, 20.0), strength=own)]
    random = np.random.default_rng(1)
    label, sureness = random.integers(0, 3, count), random.uniform(0.1, 4.0, count)
    logits = np.zeros((count, 5), dtype=np.float32)
    logits[np.arange(count), label] = sureness

    def classifier(batch: Any) -> torch.Tensor:
        return torch.from_numpy(logits)[(batch["strength"][:, 0] * 65535.0).round().long()]

    (found,) = label_confident_points(tiles, classifier, configuration)
    for place in range(3):
        believed = found.segment == place
        assert believed.sum() == pytest.approx(0.25 * (label == place).sum(), abs=1)
        assert (label[believed] == place).all()
        assert sureness[believed].min() >= sureness[(label == place) & ~believed].max()
    assert (found.segment[found.segment != IGNORED] < 3).all()


def test_batches_hold_pairs_of_both_domains(data: Path) -> None:
    configuration = self_trained(data, batch=4, crops_per_tile=3)
    (synthetic,) = read_domains(configuration).values()
    target = [replace(tile, segment=np.full(len(tile), 4, np.int16)) for tile in target_tiles(configuration)]
    batches = ExchangedBatches(configuration, [synthetic, target], CPU)
    found = list(batches(0))
    assert len(found) == len(batches) == 3  # six pairs, two in a batch
    assert [len(batch["offset"]) for batch in found] == [4, 4, 4]
    again = list(ExchangedBatches(configuration, [synthetic, target], CPU)(0))
    assert all(torch.equal(one[name], other[name]) for one, other in zip(found, again, strict=True) for name in one)
    assert not torch.equal(found[0]["coord"], next(iter(batches(1)))["coord"])
    for batch in found:
        bounds = [0, *batch["offset"].tolist()]
        for number in (1, 3):  # the target's crop, with synthetic points behind
            part = batch["segment"][bounds[number] : bounds[number + 1]]
            assert (part[:300] == 4).all()
            assert len(part) > 300
    first, second = ({(draw.tile, draw.number) for draw in batches._draws(2, place, 0)} for place in (0, 1))
    assert not first & second  # effects of their own
    shares = [list(batches(0, slice(part, None, 2))) for part in range(2)]
    assert [len(share) for share in shares] == [2, 1]
    assert torch.equal(shares[1][0]["coord"], found[1]["coord"])


def test_an_interrupted_self_training_ends_as_an_undisturbed_one(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = self_trained(data)
    task.train(Run.start(tmp_path / "whole", configuration))
    assert (tmp_path / "whole" / PRETRAINING / "round-1" / "checkpoint.pt").is_file()
    for stop_at in (1, 3):  # within the first part, and after the first round
        with monkeypatch.context() as patch:
            saved, original = [], Run.save

            def save(
                self: Run[Any], state: Any, original: Any = original, saved: Any = saved, at: int = stop_at
            ) -> None:
                original(self, state)
                saved.append(1)
                if len(saved) == at:
                    raise KeyboardInterrupt

            patch.setattr(Run, "save", save)
            with pytest.raises(KeyboardInterrupt):
                task.train(Run.start(tmp_path / f"cut{stop_at}", configuration))
        task.train(Run.start(tmp_path / f"cut{stop_at}", configuration, resume=True))
        assert same(weights(tmp_path / "whole"), weights(tmp_path / f"cut{stop_at}"))


def test_a_training_begins_with_the_weights_of_another(data: Path, tmp_path: Path) -> None:
    first = self_trained(data, set_up="synthetic")
    task.train(Run.start(tmp_path / "first", first))
    nothing = {"epochs": 1, "learning_rate": 1e-12, "final_learning_rate": 0.0}
    start = {"start": str(tmp_path / "first")}
    told = json.loads((tmp_path / "first" / CONFIGURATION).read_text())
    write_file(tmp_path / "first" / CONFIGURATION, json.dumps({**told, "threads": 3}).encode(), overwrite=True)
    task.train(Run.start(tmp_path / "second", self_trained(data, set_up="synthetic", schedule=nothing, **start)))
    one, two = weights(tmp_path / "first"), weights(tmp_path / "second")
    learned = [name for name in one if not name.endswith(("running_mean", "running_var", "num_batches_tracked"))]
    assert all(torch.allclose(one[name], two[name], atol=1e-6) for name in learned)
    # A self-training that has a start doesn't learn the first part again.
    task.train(Run.start(tmp_path / "third", self_trained(data, self_training={"rounds": 1}, **start)))
    assert not (tmp_path / "third" / PRETRAINING / "checkpoint.pt").exists()
    assert not same(weights(tmp_path / "third"), one)
    assert torch.get_num_threads() == 1  # as this training says, not the one that it begins with


def test_a_stream_is_not_for_self_training(data: Path) -> None:
    sources = self_trained(data).to_dict()["data"] | {"stream": {"recipe": "small-roads"}}
    with pytest.raises(InputError, match=r"stream is not for self_trained"):
        self_trained(data, data=sources, crops_per_epoch=4)


def test_faults_of_a_start_and_of_a_target_are_told(data: Path, tmp_path: Path) -> None:
    sources = {"synthetic": [{"path": str(data / "synthetic"), "split": "train"}]}
    with pytest.raises(InputError, match=r"data\.target"):
        task.train(Run.start(tmp_path / "none", self_trained(data, data=sources)))
    with pytest.raises(MissingFileError, match="missing"):
        task.train(Run.start(tmp_path / "a", self_trained(data, set_up="synthetic", start=str(tmp_path / "missing"))))
    task.train(Run.start(tmp_path / "first", self_trained(data, set_up="synthetic")))
    other = self_trained(data, set_up="synthetic", start=str(tmp_path / "first"), features=["x", "y", "z"])
    with pytest.raises(InputError, match="the same features"):
        task.train(Run.start(tmp_path / "b", other))
    nothing = {**sources, "target": [{"path": str(tmp_path / "missing.laz")}]}
    with pytest.raises(MissingFileError, match="missing"):
        task.train(Run.start(tmp_path / "c", self_trained(data, data=nothing)))
    assert not (tmp_path / "c" / PRETRAINING).exists()  # before anything is trained


def test_an_experiments_targets_are_filled_in() -> None:
    told = Experiment.from_dict(
        {
            "title": "adapted",
            "data": {domain: [{"path": "{NAME}/" + domain}] for domain in ("real", "synthetic", "target")},
            "variants": {"adapted": {"set": {"set_up": "self_trained"}}},
        }
    )
    (found,) = configurations(told, {"NAME": "here"}).values()
    assert found.data.target[0].path == "here/target"
