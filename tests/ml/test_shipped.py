"""A trained run becomes a shipped model, and a shipped model is used like a run."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

import ml.cards
from headless.cli import main
from ml.cards import LARGEST_MB, ModelCard, model_names, read_card
from ml.centerline.task import _first_model, load_predictor
from ml.configuration import load_configuration
from ml.runs import Run
from ml.scores.calibration import IntervalCalibration
from ml.shipped import open_run, open_shipped, ship
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.schema import canonical_json
from tests.ml.test_choice import card


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder in the place of that of the shipped models."""
    monkeypatch.setattr(ml.cards, "WEIGHTS", tmp_path / "weights")
    (tmp_path / "weights").mkdir()
    return tmp_path / "weights"


def trained(folder: Path, epochs: int = 1) -> Run[object]:
    """Return a run as a training leaves it, of an untrained model."""
    configuration = load_configuration("centerline-single", ["schedule.epochs=1", "network.width=8", "network.heads=2"])
    run = Run.start(folder, configuration)
    model = _first_model(configuration)
    run.save({"model": model.state_dict(), "optimizer": {"large": torch.zeros(1000)}, "epoch": epochs})
    found = {"center": IntervalCalibration(2.0, (2.0, 4.0), (0.5, 0.9), (0.7, 0.95), 10).to_dict()}
    write_file(folder / "calibration.json", canonical_json(found).encode(), overwrite=True)
    return run


def shipped(weights: Path, run: Run[object], name: str = "small") -> ModelCard:
    """Ship a run under a name and write its card."""
    told = card(name, (8.0, 40.0), "airborne").model_copy(update={"task": "centerline"})
    write_file(weights / f"{name}.json", canonical_json(told.to_dict()).encode())
    ship(run, weights / f"{name}.safetensors")
    return told


def test_a_run_becomes_a_model_in_half_precision_without_optimiser(tmp_path: Path, weights: Path) -> None:
    run = trained(tmp_path / "run")
    shipped(weights, run)
    assert model_names() == model_names("centerline") == ["small"]
    assert model_names("segmentation") == []
    before = run.last_checkpoint()
    opened = open_run(Path("small"))
    after = opened.last_checkpoint()
    assert before is not None
    assert after is not None
    assert set(after) == {"model", "epoch"}
    for name, value in before["model"].items():
        assert torch.equal(after["model"][name], value.half().float() if value.is_floating_point() else value)
    assert opened.configuration == run.configuration
    predictor = load_predictor(opened)
    assert predictor.calibration["center"].factor == 2.0
    parameters = sum(value.numel() for value in before["model"].values())
    assert (weights / "small.safetensors").stat().st_size < 2 * parameters + 20_000


def test_a_folder_comes_before_a_name(tmp_path: Path, weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped(weights, trained(tmp_path / "run"))
    monkeypatch.chdir(tmp_path)
    trained(tmp_path / "small")
    assert open_run(Path("small")).folder == Path("small")
    with pytest.raises(MissingFileError):
        open_run(Path("none"))


def test_an_unfinished_run_or_one_too_large_is_not_shipped(tmp_path: Path, weights: Path) -> None:
    with pytest.raises(InputError, match="isn't finished"):
        ship(trained(tmp_path / "a", epochs=0), weights / "a.safetensors")
    run = trained(tmp_path / "b")
    run.save({"model": {"x": torch.zeros(round(LARGEST_MB * 1e6))}, "epoch": 1})
    with pytest.raises(InputError, match="less than 10 MB"):
        ship(run, weights / "b.safetensors")


def test_models_are_listed_and_misnamed_ones_refused(
    tmp_path: Path, weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped(weights, trained(tmp_path / "run"))
    assert main(["list", "models"]) == 0
    said = capsys.readouterr().out
    assert "small" in said
    assert "8 to 40" in said
    with pytest.raises(InputError, match="must be one of small"):
        open_shipped("smal")


def test_without_a_model_the_command_says_so(tmp_path: Path, weights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["predict", str(tmp_path / "scan.laz")]) == 2
    assert "the package has no model for segmentation" in capsys.readouterr().err
    assert main(["predict"]) == 2
    assert "one cloud is needed" in capsys.readouterr().err


@pytest.mark.parametrize("name", model_names())
def test_every_shipped_model_is_whole(name: str) -> None:
    told = read_card(name)
    assert told.name == name
    assert told.weights.stat().st_size < LARGEST_MB * 1e6
    opened = open_shipped(name)
    assert opened.configuration.task == told.task
    state = opened.last_checkpoint()
    assert state is not None
    assert told.parameters <= sum(value.numel() for value in state["model"].values())
    assert any(figure.inside for figure in told.figures)
    assert any(not figure.inside for figure in told.figures)
