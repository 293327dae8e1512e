"""How long a training will take, told from a few of its steps."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch

from headless.cli import main
from ml.segmentation import forecast
from ml.segmentation.recipes import SegmentationConfiguration
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy, write_pointcept

torch.set_num_threads(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two tiles to learn from."""
    home = tmp_path_factory.mktemp("forecast")
    write_pointcept(home / "real", "train", [road_tile(1500, 1 + k, f"real{k}") for k in range(2)])
    return home


def test_a_trainings_time_is_its_steps_times_what_one_takes(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = toy(folder, schedule={"epochs": 5})
    (folder / "toy.yaml").write_text(json.dumps(configuration.to_dict()))
    monkeypatch.setattr(forecast, "timed_steps", lambda *_: (90.0, 80.0))
    words = ["forecast", str(folder / "toy.yaml"), "--output", str(folder / "forecast.json")]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((folder / "forecast.json").read_text())
    assert (told["tiles"], told["steps_per_epoch"], told["steps"]) == (2, 2, 10)  # 4 crops a tile, 4 a batch
    assert (told["seconds_per_step"], told["batch_points"]) == (90.0, 3200)
    assert told["hours"] == 0.25
    assert main(words) == 0
    said = capsys.readouterr().out
    assert said.startswith("0.2 hours for 10 steps of 90.00 s, ")
    assert "2 tiles, 3,200 points of a batch" in said
    assert main(["forecast", str(folder / "toy.yaml"), "--set", "crop_points=100000"]) == 2
    assert "must not exceed the points" in capsys.readouterr().err


def test_crops_of_an_epoch_are_counted_as_stated_and_a_stream_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forecast, "timed_steps", lambda *_: (90.0, 80.0))
    assert forecast.forecast(toy(folder, crops_per_epoch=21), 2)["steps_per_epoch"] == 6
    data = toy(folder).data.to_dict() | {"stream": {"recipe": "small-roads"}}
    streamed = SegmentationConfiguration.from_dict(toy(folder, crops_per_epoch=21).to_dict() | {"data": data})
    with pytest.raises(InputError, match="name existing data"):
        forecast.forecast(streamed, 2)


def test_measured_steps_take_time(folder: Path) -> None:
    told = forecast.forecast(toy(folder, crop_points=300), 2)
    assert told["seconds_per_step"] > 0
    assert told["cpu_seconds_per_step"] > 0
