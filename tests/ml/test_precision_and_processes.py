"""Trainings in bfloat16, and by several processes: both tasks learn as in one process and in single precision."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from ml.configuration import from_data
from ml.networks.base import full_precision
from ml.networks.centerline.losses import centerline_loss
from ml.runs import Run
from ml.segmentation.loading import CropBatches, read_domains
from ml.tasks import task
from ml.training_loop import optimizer_of, train_step
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.centerline_batches import MODELS, batch, small
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy, write_pointcept

torch.set_num_threads(1)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_pointcept(folder / "real", "train", [road_tile(500, 1 + k, f"real{k}", length=20.0) for k in range(2)])
    write_pointcept(folder / "real", "test", [road_tile(500, 3, "unseen", length=20.0)])
    write_data_set(folder / "roads")
    return folder


def centerline(data: Path, size: int = 4, steps: int = 4, **changes: Any) -> Any:
    plain = {
        "task": "centerline",
        "threads": 1,
        "device": "cpu",
        "data": {"data_sets": [str(data / "roads")]},
        "slices": {"half_width": 20.0, "points_per_slice": 64},
        "network": {"cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1, "heads": 2},
        "batches": {"size": size, "steps": steps, "passes": 2, "validation": 4},
        "schedule": {"epochs": 2, "learning_rate": 0.003},
    }
    return from_data(plain | changes, "test")


def segmentation(folder: Path, **changes: Any) -> Any:
    few = {"crop_points": 300, "crops_per_tile": 2, "batch": 2}
    return from_data(toy(folder).to_dict() | few | changes, "test")


def trained(folder: Path, configuration: Any) -> tuple[dict[str, torch.Tensor], list[dict[str, float]]]:
    run = Run.start(folder, configuration)
    task(configuration.task).train(run)
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    return state["model"], json.loads((folder / "history.json").read_text())


@pytest.mark.parametrize("name", MODELS)
def test_a_centerline_models_steps_are_nearly_the_same_in_bfloat16(data: Path, name: str) -> None:
    losses = []
    for precision in ("float32", "bfloat16"):
        model, settings = small(name), centerline(data, precision=precision)
        optimizer, loss = optimizer_of(model, settings.schedule), centerline_loss(settings.loss, 20.0)
        losses.append([train_step(model, optimizer, 0.003, settings, loss, batch(2))["loss"] for _ in range(2)])
        assert all(weight.dtype == torch.float32 for weight in model.parameters())
    assert losses[0] != losses[1]
    assert losses[1] == pytest.approx(losses[0], rel=0.02)


def test_a_segmentation_learns_nearly_the_same_in_bfloat16(data: Path, tmp_path: Path) -> None:
    weights, history = trained(tmp_path / "half", segmentation(data, precision="bfloat16"))
    exact, usual = trained(tmp_path / "single", segmentation(data))
    assert all(value.dtype == exact[name].dtype for name, value in weights.items())
    assert not all(torch.equal(value, exact[name]) for name, value in weights.items())
    assert [row["loss"] for row in history] == pytest.approx([row["loss"] for row in usual], rel=0.02)


def test_places_stay_exact_where_the_rest_is_bfloat16() -> None:
    @full_precision
    def moved(places: torch.Tensor, turn: torch.Tensor) -> torch.Tensor:
        return places @ turn

    places, turn = torch.tensor([[123.456, 60.017]]), torch.eye(2)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(moved(places, turn), places)
        assert moved(places.bfloat16(), turn).dtype == torch.float32
        assert (places @ turn - places).abs().max() > 0.03


@pytest.mark.slow
def test_two_processes_learn_as_one_with_batches_twice_as_large(data: Path, tmp_path: Path) -> None:
    two, history = trained(tmp_path / "two", centerline(data, size=2, steps=8, processes=2))
    one, usual = trained(tmp_path / "one", centerline(data, size=4, steps=4))
    alone, _ = trained(tmp_path / "alone", centerline(data, size=2, steps=8))
    assert distance(two, one) < 0.02 * distance(alone, one)
    assert [row["validation_mae"] for row in history] == pytest.approx([row["validation_mae"] for row in usual], 1e-3)


def distance(first: dict[str, torch.Tensor], second: dict[str, torch.Tensor]) -> float:
    return float(torch.sqrt(sum((value - second[name]).square().sum() for name, value in first.items())))


@pytest.mark.slow
def test_two_processes_fine_tune_and_go_on_where_they_were(data: Path, tmp_path: Path) -> None:
    """Norms take the statistics of each process's batches, so one process with larger ones isn't quite the same."""
    sources = {"real": [{"path": str(data / "real"), "split": "train"}]}
    sources |= {"synthetic": sources["real"], "tests": {"unseen": [{"path": str(data / "real"), "split": "test"}]}}
    changes: dict[str, Any] = {"set_up": "fine_tuned", "processes": 2, "data": sources, "fine_tuning": {"epochs": 1}}
    weights, history = trained(tmp_path / "two", segmentation(data, **changes))
    assert len(history) == 1
    assert all(torch.isfinite(value).all() for value in weights.values())
    again, _ = trained(tmp_path / "again", segmentation(data, **changes))
    assert all(torch.equal(value, again[name]) for name, value in weights.items())
    Run.start(tmp_path / "two", segmentation(data, **changes), resume=True)
    with pytest.raises(InputError, match="must not exceed the batches of an epoch, 2"):
        trained(tmp_path / "few", segmentation(data, **{**changes, "processes": 3}))


def test_shares_of_an_epoch_are_all_of_its_batches(data: Path) -> None:
    configuration = segmentation(data, effects={"jitter": 0.01})
    batches = CropBatches(configuration, read_domains(configuration).values(), torch.device("cpu"))

    def drawn(share: slice) -> list[torch.Tensor]:
        return [one["coord"] for one in batches(3, share)]

    whole = drawn(slice(None))
    parts = [drawn(slice(number, None, 2)) for number in range(2)]
    assert len(whole) == 2
    assert all(torch.equal(whole[number], parts[number][0]) for number in range(2))
