"""A folder is one training's: nobody else's at the same time, and nobody's before its data are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from headless import cli
from ml import training_loop
from ml.runs import CHECKPOINT, CONFIGURATION, LOCK, PRETRAINING
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.scratch.locks import exclusive
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.segmentation_data import toy, write_two_domains

KINDS = ("segmentation", "centerline")


def written(kind: str, folder: Path, **changes: Any) -> Path:
    """Write a configuration of one epoch, and its data; return it."""
    folder.mkdir(exist_ok=True)
    if kind == "segmentation":
        told = toy(write_two_domains(folder / "data"), schedule={"epochs": 1}).to_dict()
    else:
        told = {
            "task": "centerline",
            "threads": 1,
            "device": "cpu",
            "data": {"data_sets": [str(write_data_set(folder / "data"))]},
            "slices": {"half_width": 20.0, "points_per_slice": 48},
            "network": {"name": "transformer", "cells": 4, "point_width": 8, "width": 16, "layers": 1, "heads": 2},
            "batches": {"size": 2, "steps": 2, "passes": 1, "validation": 2},
            "schedule": {"epochs": 1},
        }
    (folder / "toy.yaml").write_text(canonical_json({**told, **changes}))
    return folder / "toy.yaml"


def misled(configuration: Path) -> Path:
    """Return a copy of a configuration whose data are nowhere."""
    data = configuration.parent / "data"
    other = configuration.with_name("misled.yaml")
    other.write_text(configuration.read_text().replace(str(data), str(data.with_name("gone"))))
    assert other.read_text() != configuration.read_text()
    return other


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("kind", KINDS)
def test_a_second_training_in_a_folder_is_refused_while_one_is_at_work(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another configuration, begun during the first one's first step; the first ends as if nothing had been."""
    words = ["train", str(written(kind, tmp_path / kind)), "--output", str(tmp_path / "run")]
    step, codes = training_loop.train_step, list[int]()

    def beside(*given: Any) -> Any:
        if not codes:
            codes.append(-1)
            before = content(tmp_path / "run")
            for more in (["--overwrite"], ["--resume"], []):
                codes.append(cli.main([*words, "--set", "seed=9", *more]))
            assert content(tmp_path / "run") == before
        return step(*given)

    monkeypatch.setattr(training_loop, "train_step", beside)
    assert cli.main([*words, "--quiet"]) == 0
    assert codes == [-1, 2, 2, 2]
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3
    for line in said:
        assert line.startswith(f"error: --output is '{tmp_path / 'run'}': another run is at work in it"), line
    assert json.loads((tmp_path / "run" / CONFIGURATION).read_text())["seed"] == 1
    assert not (tmp_path / "run" / LOCK).exists()


@pytest.mark.parametrize("kind", KINDS)
def test_a_training_without_its_data_leaves_nothing_behind(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    configuration = written(kind, tmp_path / kind)
    output = ["--output", str(tmp_path / "run")]
    assert cli.main(["train", str(misled(configuration)), *output]) == 2
    assert not (tmp_path / "run").exists(), "nor the folder"
    assert "Traceback" not in capsys.readouterr().err
    assert cli.main(["train", str(configuration), *output, "--resume", "--quiet"]) == 0
    before = content(tmp_path / "run")
    assert cli.main(["train", str(misled(configuration)), *output, "--overwrite", "--set", "seed=3"]) == 2
    assert content(tmp_path / "run") == before, "what is to be replaced stays as well"


def test_a_configuration_without_an_epoch_does_not_block_the_folder(tmp_path: Path) -> None:
    """As where the process was killed in its first epoch, or as earlier versions left it."""
    configuration = written("segmentation", tmp_path / "one")
    for more in ([], ["--resume"]):
        run = tmp_path / f"run{len(more)}"
        run.mkdir()
        (run / CONFIGURATION).write_text(json.dumps(json.loads(configuration.read_text()) | {"seed": 5}))
        assert cli.main(["train", str(configuration), "--output", str(run), "--quiet", *more]) == 0
        assert json.loads((run / CONFIGURATION).read_text())["seed"] == 1


def test_what_a_pretraining_has_kept_is_not_lost_by_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    configuration = written("segmentation", tmp_path / "one")
    (tmp_path / "run" / PRETRAINING).mkdir(parents=True)
    (tmp_path / "run" / CONFIGURATION).write_text(json.dumps(json.loads(configuration.read_text()) | {"seed": 5}))
    (tmp_path / "run" / PRETRAINING / CHECKPOINT).write_bytes(b"kept")
    before = content(tmp_path / "run")
    for more, told in (([], "already holds a run"), (["--resume"], "--resume: seed")):
        assert cli.main(["train", str(configuration), "--output", str(tmp_path / "run"), *more]) == 2
        assert told in capsys.readouterr().err
        assert content(tmp_path / "run") == before


def test_a_lock_that_goes_at_the_end_is_nobody_s_twice(tmp_path: Path) -> None:
    with exclusive(tmp_path / LOCK, keep=False):
        assert (tmp_path / LOCK).exists()
    assert not (tmp_path / LOCK).exists()
    with exclusive(tmp_path / LOCK, keep=False):
        pass


@pytest.mark.parametrize(
    ("kind", "more"), [*((kind, []) for kind in KINDS), (KINDS[0], ["--set", "set_up=fine_tuned"])]
)
def test_a_training_that_its_input_ends_before_an_epoch_leaves_nothing(
    kind: str, more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With one that is kept all stays, to go on with."""
    words = ["train", str(written(kind, tmp_path / kind)), "--set", "schedule.epochs=2", *more]
    step, left = training_loop.train_step, [0]

    def diverges(*given: Any) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise InputError("schedule.learning_rate", 0.01, "the loss became nan; a smaller rate may help")
        return step(*given)

    monkeypatch.setattr(training_loop, "train_step", diverges)
    assert cli.main([*words, "--output", str(tmp_path / "deep" / "run")]) == 2
    assert "the loss became nan" in capsys.readouterr().err
    assert not (tmp_path / "deep").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    assert cli.main([*words, "--output", str(tmp_path / "mine")]) == 2
    assert content(tmp_path / "mine") == {"notes.txt": b"mine"}
    left[0] = 3 if kind == "centerline" else 1
    assert cli.main([*words, "--output", str(tmp_path / "run")]) == 2
    assert any((tmp_path / "run").rglob(CHECKPOINT))
    assert (tmp_path / "run" / CONFIGURATION).is_file()
    left[0] = 1000
    assert cli.main([*words, "--output", str(tmp_path / "run"), "--resume"]) == 0
