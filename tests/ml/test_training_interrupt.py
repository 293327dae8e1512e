"""A training that is stopped by Ctrl-C says which epoch is kept and how it goes on, and does so."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from headless import cli
from ml import training_loop
from ml.runs import Run
from synthroads_addon.base.schema import canonical_json, read_json
from tests.helpers.clouds.segmentation_data import toy, write_two_domains


@pytest.fixture
def configuration(tmp_path: Path) -> Path:
    told = toy(write_two_domains(tmp_path / "data"), schedule={"epochs": 3}).to_dict()
    (tmp_path / "toy.yaml").write_text(canonical_json(told))
    return tmp_path / "toy.yaml"


def stop_after(epochs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have Ctrl-C pressed in the first step of a training that comes after so many epochs."""
    step, save, saved = training_loop.train_step, Run.save, list[int]()

    def counted(run: Run[Any], state: Any) -> None:
        save(run, state)
        saved.append(state["epoch"])

    def stopped(*given: Any) -> Any:
        if len(saved) == epochs:
            raise KeyboardInterrupt
        return step(*given)

    monkeypatch.setattr(Run, "save", counted)
    monkeypatch.setattr(training_loop, "train_step", stopped)


@pytest.mark.parametrize("done", [0, 2])
def test_an_interrupt_names_the_epoch_that_is_kept_and_how_to_go_on(
    done: int, configuration: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = configuration.parent / "a run"
    words = ["train", str(configuration), "--output", str(run), "--set", "seed=7"]
    with monkeypatch.context() as patch:
        stop_after(done, patch)
        assert cli.main(words) == 130
    said = capsys.readouterr().err.splitlines()
    assert said[-2] == "interrupted; nothing was left half-written"
    kept = "epoch 2 of 3 is kept" if done else "no epoch of 3 was finished"
    assert said[-1].startswith(f"{kept} in {run}; go on with: synthroads train ")
    going_on = shlex.split(said[-1].partition("go on with: synthroads ")[2])
    assert going_on == [*words, "--resume"]
    assert cli.main(going_on) == 0
    assert [epoch["epoch"] for epoch in read_json(run / "history.json")] == [1, 2, 3]


def test_a_note_of_one_command_is_not_said_by_the_next(capsys: pytest.CaptureFixture[str]) -> None:
    from headless import commands

    commands.note_at_interrupt(lambda: "of a training")

    def interrupted(arguments: Any) -> Any:
        raise KeyboardInterrupt

    parsed = cli.build_parser().parse_args(["check", "road.json"])
    assert commands.run(interrupted, parsed) == 130
    assert "of a training" not in capsys.readouterr().err


def test_a_trainings_lines_have_epoch_and_loss(
    configuration: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("headless.progress.PATIENCE", 0.0)
    monkeypatch.setattr("headless.progress.INTERVAL", 0.0)
    assert cli.main(["train", str(configuration), "--output", str(configuration.parent / "run")]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("training: ")]
    form = re.compile(r"training: \d+ % after \d+ s(?:, about \d+ s left)? \(epoch (\d) of 3, loss (\d\.?\d*)\)")
    found = [form.fullmatch(line) for line in said]
    assert all(found), said
    assert {line[1] for line in found if line} == {"1", "2", "3"}
