"""Runs whose files don't fit each other, and files of weights that say something odd: one line, exit code 2."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import torch

from headless import cli
from ml.centerline.task import _first_model
from ml.configuration import load_configuration
from ml.runs import CALIBRATION, CHECKPOINT, HISTORY, Run
from ml.safetensors import read_metadata, read_tensors, write_tensors
from ml.scores.calibration import IntervalCalibration
from ml.segmentation.network import build
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import canonical_json
from tests.helpers.clouds.segmentation_data import road_block, write_cloud

SMALL = {
    "centerline": ["schedule.epochs=1", "network.width=8", "network.heads=2", "network.layers=1"],
    "segmentation": ["schedule.epochs=1"],
}
SHIPPED = {"centerline": "centerline-single", "segmentation": "segmentation-small"}
KINDS = tuple(SMALL)


def finished(kind: str, folder: Path) -> dict[str, Any]:
    """Write a run as a training leaves it, of an untrained model; return its checkpoint."""
    configuration = load_configuration(SHIPPED[kind], SMALL[kind])
    model = _first_model(configuration) if kind == "centerline" else build(configuration)
    state = {"model": model.state_dict(), "optimizer": {}, "epoch": 1}
    Run.start(folder, configuration).save(state)
    (folder / CALIBRATION).write_text(canonical_json({"center": IntervalCalibration(2.0).to_dict() | PAIRS}))
    return state


PAIRS = {"before": [None, None], "after": [None, None]}


def told(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line that `synthroads predict` says of a run."""
    cloud = folder.parent / "cloud.laz"
    if not cloud.exists():
        write_cloud(cloud, road_block(2000, 4, 40.0))
    capsys.readouterr()
    assert cli.main(["predict", str(folder), str(cloud), "--overwrite"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("error: ")
    return said[0]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"model": [1, 2]}, "model is 'list': a dictionary of tensors is needed"),
        ({"model": {"weight": "text"}}, "model is 'dict': a dictionary of tensors is needed"),
        ({"model": None}, "model is 'NoneType': a dictionary"),
        ({"model": {"weight": torch.zeros(2)}}, "the checkpoint must belong to the network of the configuration"),
        ({"epoch": "one"}, "epoch is"),
        ({"epoch": None}, "epoch is 'NoneType': a whole number from 0 is needed"),
        ({"epoch": [1]}, "epoch is 'list': a whole number"),
        ({"epoch": -1}, "epoch is '-1': a whole number"),
        ({"epoch": 1.5}, "epoch is '1.5': a whole number"),
        ({"epoch": torch.zeros(3)}, "epoch is 'Tensor': a whole number"),
    ],
)
def test_a_checkpoint_that_does_not_fit_is_one_line(
    kind: str, change: dict[str, Any], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state = finished(kind, tmp_path / "run")
    torch.save(state | change, tmp_path / "run" / CHECKPOINT)
    assert expected in told(tmp_path / "run", capsys)


def with_weights(state: dict[str, Any], kind: str, number: float) -> dict[str, Any]:
    """Return a checkpoint one of whose tensors holds a number throughout: of the layer that sees the points."""
    name = {"centerline": "points.network.0.weight", "segmentation": "stem.weight"}[kind]
    return state | {"model": state["model"] | {name: torch.full_like(state["model"][name], number)}}


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
@pytest.mark.parametrize("kind", KINDS)
def test_weights_that_are_not_finite_are_refused(
    kind: str, number: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A network of them calls every point of a cloud the first class, without a word."""
    state = finished(kind, tmp_path / "run")
    torch.save(with_weights(state, kind, number), tmp_path / "run" / CHECKPOINT)
    assert re.search(
        r"all weights in the checkpoint must be finite, but some of [a-z.0]+weight aren't",
        told(tmp_path / "run", capsys),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_weights_that_are_no_real_numbers_are_refused(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """PyTorch would leave out the imaginary part, as a warning of its own says."""
    state = finished(kind, tmp_path / "run")
    complex_ones = {name: value.to(torch.complex64) for name, value in state["model"].items()}
    torch.save(state | {"model": complex_ones}, tmp_path / "run" / CHECKPOINT)
    assert "must not hold complex numbers" in told(tmp_path / "run", capsys)


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_network_says_is_finite_or_refused(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Numbers beyond reason overflow in the network."""
    state = finished(kind, tmp_path / "run")
    torch.save(with_weights(state, kind, 3e38), tmp_path / "run" / CHECKPOINT)
    assert "network: the output of the network must be finite" in told(tmp_path / "run", capsys)


@pytest.mark.parametrize(
    "content",
    [
        [],
        "text",
        3,
        {"center": 3},
        {"center": []},
        {"center": {}},
        {"center": {"factor": "x", "widths": [1, 2], "count": 1} | PAIRS},
        {"center": {"factor": None, "widths": [1, 2], "count": 1} | PAIRS},
        {"center": {"factor": -1.0, "widths": [1, 2], "count": 1} | PAIRS},
        {"center": {"factor": 1.0, "widths": [1], "count": 1} | PAIRS},
        {"center": {"factor": 1.0, "widths": {"a": 1, "b": 2}, "count": 1} | PAIRS},
        {"center": {"factor": 1.0, "widths": [1, 2], "count": "x"} | PAIRS},
    ],
)
def test_a_calibration_that_is_none_is_one_line(
    content: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finished("centerline", tmp_path / "run")
    (tmp_path / "run" / CALIBRATION).write_text(json.dumps(content))
    said = told(tmp_path / "run", capsys)
    assert "the file calibration.json must hold a positive, finite factor for each target" in said
    assert "--resume" in said


@pytest.mark.parametrize("content", ["{}", "3", "[3]"])
def test_a_history_that_is_none_is_one_line(content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    finished("centerline", tmp_path / "run")
    (tmp_path / "run" / HISTORY).write_text(content)
    assert "must be a list with an object for each epoch" in told(tmp_path / "run", capsys)


def weights_file(path: Path, change: dict[str, Any], metadata: Any = None) -> Path:
    """Write a file of weights whose header says something else of its tensor."""
    write_tensors(path, {"weight": torch.arange(4.0)}, {"format": "pt"})
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    header["weight"] |= change
    if metadata is not None:
        header["__metadata__"] = metadata
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])
    return path


@pytest.mark.parametrize(
    "change",
    [
        {"data_offsets": ["0", "16"]},
        {"data_offsets": "ab"},
        {"data_offsets": [0.0, 16.0]},
        {"data_offsets": [None, 16]},
        {"data_offsets": [[0], [16]]},
        {"data_offsets": [False, 16]},
        {"shape": ["4"]},
        {"shape": "4"},
        {"shape": [4.0]},
        {"shape": [None]},
        {"shape": {"4": 1}},
        {"dtype": ["F32"]},
        {"dtype": 3},
    ],
)
def test_what_is_no_number_in_a_file_of_weights_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"weight: (its shape and data_offsets must be whole numbers|its data must lie inside)"
    ):
        read_tensors(weights_file(tmp_path / "a.safetensors", change))


@pytest.mark.parametrize("metadata", [[], "text", 3, {"configuration": 3}, {"calibration": ["x"]}])
def test_metadata_that_is_no_text_is_refused(metadata: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="must be an object of names and texts"):
        read_metadata(weights_file(tmp_path / "a.safetensors", {}, metadata))
