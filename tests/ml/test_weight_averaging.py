"""Trainings that end with a running mean of the weights."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from ml.configuration import Configuration, Schedule
from ml.runs import CHECKPOINT, Run, stream_seed
from ml.segmentation import task
from ml.training_loop import MEAN, fit
from ml.weight_averaging import RunningMean, renew_statistics
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.segmentation_data import toy, weights, write_two_domains

torch.set_num_threads(1)
STEPS = 5
EPOCHS = 3


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have one task alone, whose configurations are without fields of their own."""
    monkeypatch.setitem(sys.modules, "toy", SimpleNamespace(CONFIGURATION=Configuration))
    monkeypatch.setattr("ml.configuration.TASKS", {"toy": "toy"})


def network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(3, 8), nn.BatchNorm1d(8), nn.Dropout(0.3), nn.ReLU(), nn.Linear(8, 1))


def batches(epoch: int, share: slice = slice(None)) -> Iterator[Tensor]:
    generator = torch.Generator().manual_seed(stream_seed(7, "toy", epoch))
    yield from [torch.randn(16, 3, generator=generator) for _ in range(STEPS)][share]


def loss(model: nn.Module, batch: Tensor) -> tuple[Tensor, dict[str, float]]:
    error = model(batch)[:, 0] - batch.sum(dim=1)
    return (error**2).mean(), {}


def train(
    folder: Path, averaging: float, *, stop_after: int | None = None, resume: bool = False
) -> tuple[nn.Module, Run[Any]]:
    """Train the toy; after ``stop_after`` epochs, the training is interrupted."""
    model, schedule = network(), Schedule(epochs=EPOCHS, learning_rate=0.05, averaging=averaging)
    run = Run.start(folder, Configuration(task="toy", seed=3, threads=1, schedule=schedule), resume=resume)

    def interrupted(epoch: int, share: slice) -> Iterator[Tensor]:
        if stop_after is not None and (run.last_checkpoint() or {"epoch": 0})["epoch"] == stop_after:
            raise KeyboardInterrupt
        yield from batches(epoch, share)

    fit(model, run, interrupted, STEPS, loss)
    return model, run


@pytest.mark.usefixtures("_toy")
def test_training_ends_with_the_mean_of_its_weights_after_each_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[list[Tensor]] = []
    add = RunningMean.add

    def noted(self: RunningMean, model: nn.Module, step: int) -> None:
        steps.append([weight.detach().clone() for weight in model.parameters()])
        add(self, model, step)

    monkeypatch.setattr(RunningMean, "add", noted)
    model, run = train(tmp_path / "run", 0.8)
    assert len(steps) == STEPS * EPOCHS
    means = [weight.detach() for weight in network().parameters()]
    for step, step_weights in enumerate(steps):
        kept = min(0.8, (1 + step) / (10 + step))
        means = [kept * mean + (1 - kept) * weight for mean, weight in zip(means, step_weights, strict=True)]
    for weight, mean, last in zip(model.parameters(), means, steps[-1], strict=True):
        torch.testing.assert_close(weight.detach(), mean)
        assert not torch.allclose(mean, last)
    state = run.last_checkpoint()
    assert state is not None
    assert MEAN not in state
    assert all(torch.equal(state["model"][name], value) for name, value in model.state_dict().items())


@pytest.mark.usefixtures("_toy")
def test_the_norms_have_the_statistics_of_the_mean_over_the_last_epoch(tmp_path: Path) -> None:
    model, _ = train(tmp_path / "run", 0.8)
    inner = torch.stack([model[0](batch).detach() for batch in batches(EPOCHS - 1)])
    torch.testing.assert_close(model[1].running_mean, inner.mean(dim=(0, 1)))
    torch.testing.assert_close(model[1].running_var, inner.var(dim=1).mean(dim=0))
    assert model[1].momentum == 0.1


@pytest.mark.usefixtures("_toy")
def test_without_averaging_training_ends_with_the_last_weights(tmp_path: Path) -> None:
    """Each epoch's weights are the same whether they are averaged or not: the mean alone is taken from them."""
    plain, run = train(tmp_path / "plain", 0.0)
    state = run.last_checkpoint()
    assert state is not None
    assert set(state) == {"model", "optimizer", "epoch"}
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "averaged", 0.8, stop_after=EPOCHS)
    averaged = Run.open(tmp_path / "averaged").last_checkpoint()
    assert averaged is not None
    assert all(torch.equal(averaged["model"][name], value) for name, value in plain.state_dict().items())
    assert not torch.equal(averaged[MEAN]["0.weight"], averaged["model"]["0.weight"])


@pytest.mark.usefixtures("_toy")
@pytest.mark.parametrize("stop_after", [1, EPOCHS])
def test_interrupted_training_ends_with_the_same_mean(tmp_path: Path, stop_after: int) -> None:
    whole = train(tmp_path / "whole", 0.8)[0].state_dict()
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "parts", 0.8, stop_after=stop_after)
    for _ in range(2):  # the second time, nothing is left to be done
        parts = train(tmp_path / "parts", 0.8, resume=True)[0].state_dict()
        assert all(torch.equal(parts[name], value) for name, value in whole.items())


@pytest.mark.usefixtures("_toy")
def test_a_checkpoint_that_lacks_its_mean_is_refused(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "run", 0.8, stop_after=1)
    run: Run[Any] = Run.open(tmp_path / "run")
    state = run.last_checkpoint()
    assert state is not None
    del state[MEAN]
    torch.save(state, tmp_path / "run" / CHECKPOINT)
    with pytest.raises(InputError, match="the checkpoint must belong to the network"):
        train(tmp_path / "run", 0.8, resume=True)


def test_a_network_without_norms_draws_no_batch() -> None:
    def none() -> Iterator[Tensor]:
        raise AssertionError("a batch was drawn")
        yield torch.zeros(1)

    renew_statistics(nn.Linear(3, 1), none(), lambda model, batch: model(batch))


def test_segmentations_average_too_and_mix_the_mean_with_the_start(tmp_path: Path) -> None:
    data = write_two_domains(tmp_path / "data")
    small = {"crop_points": 300, "crops_per_tile": 2, "set_up": "synthetic"}
    averaging = {"schedule": {"epochs": 2, "averaging": 0.9}}
    task.train(Run.start(tmp_path / "start", toy(data, **small)))
    start = {**small, "start": str(tmp_path / "start"), "seed": 2}
    task.train(Run.start(tmp_path / "last", toy(data, **start)))
    task.train(Run.start(tmp_path / "mean", toy(data, **start, **averaging)))
    task.train(Run.start(tmp_path / "mixed", toy(data, **start, **averaging, start_share=0.5)))
    begun, last, mean, mixed = (weights(tmp_path / name) for name in ("start", "last", "mean", "mixed"))
    assert not all(torch.allclose(mean[name], value) for name, value in last.items())
    for name, value in mixed.items():
        if value.is_floating_point():
            torch.testing.assert_close(value, 0.5 * (mean[name] + begun[name]))
