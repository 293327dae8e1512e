"""The point transformer in trainings: the same by one seed, in half precision, shipped, and used on whole clouds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from ml.runs import Run
from ml.safetensors import read_tensors
from ml.segmentation import task
from ml.segmentation.network import build
from ml.shipped import ship
from ml.tasks import Prediction
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, toy, write_cloud, write_pointcept

torch.set_num_threads(1)
NETWORK = {"name": "point-transformer", "cell": 0.4, "channels": [12, 24, 24], "blocks": [1, 1, 2], "patch": 32}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two tiles to learn from and one to be tested on."""
    folder = tmp_path_factory.mktemp("data")
    write_pointcept(folder / "real", "train", [road_tile(1200, 1 + k, f"real{k}", length=20.0) for k in range(2)])
    write_pointcept(folder / "real", "test", [road_tile(1200, 3, "unseen", length=20.0)])
    return folder


def trained(data: Path, folder: Path, **changes: Any) -> tuple[Run[Any], dict[str, torch.Tensor], list[float]]:
    configuration = toy(data, network={**NETWORK, "drop_path": 0.2}, crop_points=500, **changes)
    run = Run.start(folder, configuration)
    task.train(run)
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    return run, state["model"], [row["loss"] for row in json.loads((folder / "history.json").read_text())]


def test_two_trainings_with_one_seed_have_the_same_weights(data: Path, tmp_path: Path) -> None:
    adaptation = {"mix3d": 0.5, "adabn": True, "adabn_crops": 4}
    _, one, losses = trained(data, tmp_path / "one", adaptation=adaptation)
    _, two, _ = trained(data, tmp_path / "two", adaptation=adaptation)
    _, other, _ = trained(data, tmp_path / "other", adaptation=adaptation, seed=2)
    assert losses[1] < losses[0]
    assert all(torch.equal(value, two[name]) for name, value in one.items())
    assert not all(torch.equal(value, other[name]) for name, value in one.items())


def test_learns_nearly_the_same_in_bfloat16(data: Path, tmp_path: Path) -> None:
    _, half, losses = trained(data, tmp_path / "half", precision="bfloat16")
    _, exact, usual = trained(data, tmp_path / "single")
    assert all(value.dtype == exact[name].dtype for name, value in half.items())
    assert losses != usual
    assert losses == pytest.approx(usual, rel=0.02)


def test_a_trained_one_labels_clouds_and_is_shipped(data: Path, tmp_path: Path) -> None:
    run, weights, _ = trained(data, tmp_path / "run", schedule={"epochs": 25}, fitted_offsets=True)
    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    assert metrics["tests"]["unseen"]["mean_iou"] > 0.5
    write_cloud(tmp_path / "cloud.laz", road_block(4000, 5, length=20.0))
    told = task.predict(run, Prediction(tmp_path / "cloud.laz", tmp_path / "labelled.laz"))
    assert sum(told["classes"].values()) == told["points"] == 4000
    assert sum(number > 100 for number in told["classes"].values()) >= 3

    assert ship(run, tmp_path / "model.safetensors") < 1e6
    shipped = read_tensors(tmp_path / "model.safetensors")
    model = build(run.configuration)
    model.load_state_dict({name: value.to(weights[name].dtype) for name, value in shipped.items()})
    for name, value in weights.items():
        assert torch.allclose(model.state_dict()[name], value, rtol=1e-3, atol=1e-6), name
