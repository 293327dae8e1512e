"""Offsets of class scores: the best thresholds are found, and a run has them added to its network once."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from ml.data.classes import class_names
from ml.data.crops import Item
from ml.data.tiles import scalings
from ml.networks.base import SegmentationNetwork
from ml.runs import Run
from ml.scores.confusion import Confusion
from ml.segmentation import task
from ml.segmentation.offsets import best_offsets, fit_offsets
from ml.segmentation.scoring import classifier, label_tile
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy, write_two_domains

torch.set_num_threads(1)


def blurred(share: float, count: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    """Return log posteriors (N, 2) and truths (N,) of a class of a share, seen through noise of one sigma of 1."""
    random = np.random.default_rng(5)
    truth = (random.random(count) < share).astype(np.int64)
    seen = truth + random.normal(0.0, 1.0, count)
    odds = np.log(share / (1.0 - share)) + seen - 0.5
    return np.stack([-np.logaddexp(0.0, odds), -np.logaddexp(0.0, -odds)], axis=1).astype(np.float32), truth


def mean_iou(scores: np.ndarray, truth: np.ndarray) -> float:
    best = scores.argmax(axis=1)
    return float(np.mean([((best == k) & (truth == k)).sum() / ((best == k) | (truth == k)).sum() for k in (0, 1)]))


def test_a_rare_class_is_found_at_the_best_threshold() -> None:
    scores, truth = blurred(0.02)
    offsets = best_offsets(scores, truth)
    found = mean_iou(scores + offsets.astype(np.float32), truth)
    reachable = max(mean_iou(scores + np.float32([0.0, step]), truth) for step in np.arange(0.0, 6.0, 0.05))
    assert (scores.argmax(axis=1) == 1).sum() < 10
    assert reachable > mean_iou(scores, truth) + 0.01
    assert found > reachable - 0.002


def test_good_scores_and_classes_without_points_get_no_offsets() -> None:
    scores, truth = blurred(0.5)
    scores = np.concatenate([scores * 20.0, np.full((len(scores), 1), -9.0, np.float32)], axis=1)
    assert best_offsets(scores, truth)[2] == 0.0
    sure = np.where(np.eye(3)[truth] > 0, 0.0, -50.0).astype(np.float32)
    assert best_offsets(sure, truth).tolist() == [0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_two_domains(tmp_path_factory.mktemp("data"))


def test_offsets_are_fitted_to_tiles_as_the_training_cuts_them(data: Path) -> None:
    """On strips without what isn't ground; on whole tiles where the configuration cuts none."""
    tile = road_tile(2000, 1, "road", 1.0, 40.0)
    tile = replace(tile, offset=tile.coord[:, 1])
    strip = {"probability": 1.0, "reach": [6.0, 6.0], "carriageway": 0.0, "ground_only": 1.0}
    seen: list[np.ndarray] = []

    def noted(batch: Item) -> torch.Tensor:
        seen.append(batch["coord"].numpy())
        return torch.zeros(len(batch["coord"]), 5)

    for effects, is_cut in (({}, False), ({"strip": strip}, True)):
        seen.clear()
        fit_offsets([tile], noted, toy(data, effects=effects))
        points = np.concatenate(seen)
        assert (np.ptp(points[:, 1]) <= 12.0) == is_cut
        assert (np.ptp(points[:, 2]) < 1.0) == is_cut


def test_a_run_has_its_offsets_once(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fits = []
    monkeypatch.setattr(task, "fit_offsets", lambda *_: fits.append(1) or np.array([0.5, 0.0, 1.25, 0.0, -0.25]))
    plain = toy(data, crop_points=300, crops_per_tile=2, class_weights=0.0)
    fitted = toy(data, crop_points=300, crops_per_tile=2, class_weights=0.0, fitted_offsets=True)
    task.train(Run.start(tmp_path / "plain", plain))
    task.train(Run.start(tmp_path / "fitted", fitted))
    before, after = (Run.open(tmp_path / name).last_checkpoint() or {} for name in ("plain", "fitted"))
    offsets = after[task.OFFSETS]
    changed = [name for name, value in after["model"].items() if not torch.equal(value, before["model"][name])]
    assert task.OFFSETS not in before
    assert offsets.tolist() == [0.5, 0.0, 1.25, 0.0, -0.25]
    assert len(changed) == 1
    added = after["model"][changed[0]] - before["model"][changed[0]]
    assert torch.allclose(added.double(), offsets.double(), atol=1e-6)
    task.train(Run.start(tmp_path / "fitted", fitted, resume=True))
    again = Run.open(tmp_path / "fitted").last_checkpoint() or {}
    assert torch.equal(again["model"][changed[0]], after["model"][changed[0]])
    assert len(fits) == 1


def test_offsets_are_fitted_to_the_training_tiles(data: Path, tmp_path: Path) -> None:
    """They are those of the scores of all their labelled points, and never make the mean IoU there less."""
    configuration = toy(data, crop_points=300, crops_per_tile=2)
    run = Run.start(tmp_path / "run", configuration)
    model, domains = task.train_network(run)
    tiles = [tile for several in domains.values() for tile in several]
    offsets = fit_offsets(tiles, classifier(model, configuration), configuration)
    there = sorted({int(label) for tile in tiles for label in tile.segment if label >= 0})
    shifted = deepcopy(model)
    configuration.network.shift_scores(shifted, torch.from_numpy(offsets))
    means = []
    for each in (model, shifted):
        confusion = Confusion(class_names(configuration.scheme()))
        for tile in tiles:
            scaling = scalings(tiles, configuration.intensity)[tile.scene]
            settings = configuration.crop_settings()
            confusion.add(tile.segment, label_tile(tile, scaling, classifier(each, configuration), settings))
        values = confusion.to_dict()["classes"]
        means.append(np.mean([list(values.values())[label]["iou"] for label in there]))
    assert means[1] >= means[0]


def test_a_network_without_a_last_linear_layer_is_refused() -> None:
    options = SegmentationNetwork.model_construct(name="own")
    with pytest.raises(InputError, match="own has none"):
        options.shift_scores(nn.Sequential(nn.Linear(3, 4), nn.ReLU()), torch.zeros(5))
