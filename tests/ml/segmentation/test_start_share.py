"""Weights that a training ends with as a mean of those that it began with and its own."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from ml.runs import Run
from ml.segmentation import task
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.segmentation_data import same, toy, weights, write_two_domains

torch.set_num_threads(1)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_two_domains(tmp_path_factory.mktemp("data"))


def test_weights_are_mixed_with_the_starts_once(data: Path, tmp_path: Path) -> None:
    small = {"crop_points": 300, "crops_per_tile": 2}
    task.train(Run.start(tmp_path / "start", toy(data, set_up="synthetic", **small)))
    second = {**small, "start": str(tmp_path / "start"), "seed": 2}
    mixed = toy(data, **second, start_share=0.25)
    task.train(Run.start(tmp_path / "own", toy(data, **second)))
    task.train(Run.start(tmp_path / "mixed", mixed))
    begun, own, found = (weights(tmp_path / name) for name in ("start", "own", "mixed"))
    assert not same(begun, own)
    for name, value in found.items():
        wanted = own[name] + 0.25 * (begun[name] - own[name]) if value.is_floating_point() else own[name]
        assert torch.allclose(value, wanted, atol=1e-6), name
    task.train(Run.start(tmp_path / "mixed", mixed, resume=True))
    assert same(weights(tmp_path / "mixed"), found)


def test_offsets_are_those_of_the_mixed_weights(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small = {"crop_points": 300, "crops_per_tile": 2}
    task.train(Run.start(tmp_path / "start", toy(data, set_up="synthetic", **small)))
    stages: list[set[str]] = []
    run = Run.start(
        tmp_path / "run", toy(data, **small, start=str(tmp_path / "start"), start_share=0.5, fitted_offsets=True)
    )
    fitted = task.fit_offsets

    def noted(*given: object) -> object:
        stages.append(set(run.last_checkpoint() or {}))
        return fitted(*given)

    monkeypatch.setattr(task, "fit_offsets", noted)
    task.train(run)
    (stage,) = stages
    assert task.MIXED in stage
    assert task.OFFSETS not in stage
    assert {task.MIXED, task.OFFSETS} <= set(run.last_checkpoint() or {})


def test_a_share_of_no_start_is_refused(data: Path) -> None:
    with pytest.raises(InputError, match="start_share needs a start"):
        toy(data, start_share=0.25)
