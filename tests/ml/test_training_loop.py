"""Configurations, runs and the training loop."""

import json
import math
import os
import signal
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor, distributed, nn

from ml.configuration import Configuration, Schedule, load_configuration
from ml.processes import helper_processes
from ml.runs import CHECKPOINT, CURVES, METRICS, Run, stream_seed
from ml.training_loop import fit, learning_rate
from synthroads_addon.base.errors import InputError, MissingFileError, OutputError

STEPS = 5


@pytest.fixture(autouse=True)
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have one task alone, whose configurations are without fields of their own."""
    monkeypatch.setitem(sys.modules, "toy", SimpleNamespace(CONFIGURATION=Configuration))
    monkeypatch.setattr("ml.configuration.TASKS", {"toy": "toy"})


def configuration(epochs: int = 6, seed: int = 3) -> Configuration:
    return Configuration(task="toy", seed=seed, threads=1, schedule=Schedule(epochs=epochs, learning_rate=0.05))


def network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(3, 8), nn.Dropout(0.3), nn.ReLU(), nn.Linear(8, 1))


def batches(epoch: int, share: slice = slice(None)) -> Iterator[Tensor]:
    generator = torch.Generator().manual_seed(stream_seed(7, "toy", epoch))
    yield from [torch.randn(16, 3, generator=generator) for _ in range(STEPS)][share]


def loss(model: nn.Module, batch: Tensor) -> tuple[Tensor, dict[str, float]]:
    error = model(batch)[:, 0] - batch.sum(dim=1)
    return (error**2).mean(), {"mae": float(error.detach().abs().mean())}


def train(folder: Path, *, stop_after: int | None = None, resume: bool = False, seed: int = 3) -> nn.Module:
    """Train the toy; ``stop_after`` epochs an interrupt comes in the middle of the next."""
    model = network()
    run = Run.start(folder, configuration(seed=seed), resume=resume)

    def interrupted(epoch: int, share: slice) -> Iterator[Tensor]:
        for step, batch in enumerate(batches(epoch, share)):
            if stop_after is not None and epoch == stop_after and step == 2:
                raise KeyboardInterrupt
            yield batch

    fit(model, run, interrupted, STEPS, loss)
    run.write_metrics({"done": 1, "undefined": math.nan})
    return model


def learn(run: Run[Any], size: int = 16) -> tuple[nn.Module, list[Tensor]]:
    """Train the toy without dropout on batches of some size; return it and its last gradients."""
    model = network().requires_grad_()
    model[1].p = 0.0

    def drawn(epoch: int, share: slice) -> list[Tensor]:
        generator = torch.Generator().manual_seed(stream_seed(7, "toy", epoch))
        return list(torch.randn(64, 3, generator=generator).split(size))[share]

    fit(model, run, drawn, 64 // size, loss)
    return model, [weight.grad for weight in model.parameters()]


@pytest.mark.slow
def test_two_processes_have_the_gradients_of_one_with_batches_twice_as_large(tmp_path: Path) -> None:
    one, gradients = learn(Run.start(tmp_path / "one", configuration(epochs=2)), size=32)
    run = Run.start(tmp_path / "two", configuration(epochs=2).model_copy(update={"processes": 2}))
    with helper_processes(run, learn, torch.device("cpu")):
        two, averaged = learn(run)
    assert not distributed.is_initialized()
    torch.testing.assert_close(averaged, gradients, rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(weights(two), weights(one), rtol=1e-4, atol=1e-5)
    assert (weights(learn(Run.start(tmp_path / "other", configuration(epochs=2)))[0]) - weights(one)).abs().max() > 0.01


@pytest.mark.slow
def test_a_lost_process_is_said_in_one_line(tmp_path: Path) -> None:
    run = Run.start(tmp_path / "run", configuration(epochs=2).model_copy(update={"processes": 2}))
    lost = pytest.raises(InputError, match="processes is 2: one of the processes ended")
    with lost, helper_processes(run, lose, torch.device("cpu")):
        learn(run)


def lose(run: Run[Any]) -> None:
    """End a helper as the system does where memory is short."""
    os.kill(os.getpid(), signal.SIGKILL)


def weights(model: nn.Module) -> Tensor:
    return torch.cat([weight.detach().ravel() for weight in model.parameters()])


@pytest.mark.usefixtures("drawn_curves")
def test_training_learns_and_writes_its_files(tmp_path: Path) -> None:
    train(tmp_path / "run")
    history = json.loads((tmp_path / "run/history.json").read_text())
    assert [epoch["epoch"] for epoch in history] == list(range(1, 7))
    assert history[-1]["loss"] < 0.7 * history[0]["loss"]
    assert history[-1]["learning_rate"] == pytest.approx(1e-5)
    assert json.loads((tmp_path / "run" / METRICS).read_text()) == {"done": 1, "undefined": None}
    picture = (tmp_path / "run" / CURVES).read_bytes()
    assert picture.startswith(b"\x89PNG\r\n")
    assert len(picture) > 1000


def test_interrupted_training_ends_with_the_same_weights(tmp_path: Path) -> None:
    whole = weights(train(tmp_path / "whole"))
    assert torch.equal(whole, weights(train(tmp_path / "again")))
    assert not torch.equal(whole, weights(train(tmp_path / "other", seed=4)))
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "parts", stop_after=3)
    assert torch.equal(whole, weights(train(tmp_path / "parts", resume=True)))
    first, second = (json.loads((tmp_path / name / "history.json").read_text()) for name in ("whole", "parts"))
    for epoch in (*first, *second):
        del epoch["seconds"]
    assert first == second


def test_a_run_is_not_lost_by_mistake(tmp_path: Path) -> None:
    train(tmp_path)
    with pytest.raises(OutputError, match="already holds a run"):
        Run.start(tmp_path, configuration())
    with pytest.raises(InputError, match="seed"):
        Run.start(tmp_path, configuration(seed=9), resume=True)
    Run.start(tmp_path, configuration().model_copy(update={"threads": 2}), resume=True)
    assert (tmp_path / CHECKPOINT).exists()
    Run.start(tmp_path, configuration(seed=9), overwrite=True).begin()
    assert not (tmp_path / CHECKPOINT).exists()


def test_a_finished_run_opens(tmp_path: Path) -> None:
    train(tmp_path)
    run = Run.open(tmp_path)
    assert run.configuration == configuration()
    assert len(run.history) == 6
    with pytest.raises(MissingFileError, match="must be the folder of a trained run"):
        Run.open(tmp_path / "nowhere")
    (tmp_path / CHECKPOINT).write_bytes(b"PK\x03\x04 torn")
    with pytest.raises(InputError, match="damaged"):
        run.last_checkpoint()


def test_a_loss_that_is_not_finite_ends_the_training(tmp_path: Path) -> None:
    run = Run.start(tmp_path, configuration())
    with pytest.raises(InputError, match=r"schedule\.learning_rate"):
        fit(network(), run, batches, STEPS, lambda model, batch: (loss(model, batch)[0] * math.nan, {}))
    assert not (tmp_path / CHECKPOINT).exists()


def test_the_rate_rises_then_falls() -> None:
    schedule = Schedule(learning_rate=1.0, final_learning_rate=0.1, warmup=0.25)
    rates = [learning_rate(schedule, step, 100) for step in range(100)]
    assert rates[0] == pytest.approx(1 / 26)
    assert max(rates) == pytest.approx(1.0) == rates[25]
    assert rates[-1] == pytest.approx(0.1)
    assert all(before > after for before, after in pairwise(rates[25:]))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("task: toi", "must be one of toy"),
        ("- 1", "must be one of toy"),
        ("{task: toy, sede: 3}", r"unknown key 'sede' \(did you mean 'seed'"),
        ("{task: toy, schedule: {epochs: 0}}", r"schedule\.epochs is 0"),
        ("{task: toy, schedule: {learning_rate: 1e-9}}", "final_learning_rate must not exceed"),
        ("task: [", "must be valid YAML"),
    ],
)
def test_wrong_configurations_are_refused(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        load_configuration(str(path))


def test_changes_reach_the_configuration(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("{task: toy, schedule: {epochs: 4}}")
    loaded = load_configuration(str(path), ["schedule.learning_rate=0.5", "seed=8"])
    assert (loaded.schedule.epochs, loaded.schedule.learning_rate, loaded.seed) == (4, 0.5, 8)
    with pytest.raises(InputError, match="one of"):
        load_configuration("no-such")


def test_accumulated_batches_are_one_step_of_their_mean_gradient(tmp_path: Path) -> None:
    """Two batches of 16 make the step of one batch of 32, and an odd number of them leaves none out."""

    def without_dropout() -> nn.Module:
        torch.manual_seed(0)
        return nn.Sequential(nn.Linear(3, 8), nn.ReLU(), nn.Linear(8, 1))

    def joined(epoch: int, share: slice = slice(None)) -> Iterator[Tensor]:
        drawn = list(batches(epoch))
        yield from [torch.cat(drawn[:2]), torch.cat(drawn[2:4]), drawn[4]][share]

    models = []
    for name, accumulation, source, count in (("two", 2, batches, STEPS), ("one", 1, joined, 3)):
        model = without_dropout()
        settings = configuration().model_copy(update={"accumulation": accumulation})
        run = Run.start(tmp_path / name, settings)
        fit(model, run, source, count, loss)
        models.append(model)
        assert len(run.history) == 6
    for first, second in zip(models[0].parameters(), models[1].parameters(), strict=True):
        assert torch.allclose(first, second, atol=1e-5)
