"""The axis as a trained model tells it, laid beside the path of a reconstruction."""

from __future__ import annotations

import json
from pathlib import Path as FilePath
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ml.centerline import learned_axis
from ml.centerline.learned_axis import axis_beside
from ml.tasks import Prediction
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.reconstruction.path import CloudPath

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
PATH = CloudPath(np.column_stack([np.arange(101.0), np.zeros(101)]), np.zeros(101))
"""100 m to the east."""


def line(first: float, last: float, offset: float, std: list[float | None] | None = None) -> dict[str, Any]:
    """Return a predicted centreline with a point every 2 m, beside the path."""
    x = np.arange(first, last + 1.0, 2.0)
    points = np.column_stack([x, np.full(len(x), offset), np.zeros(len(x))]) + ORIGIN
    properties = {"feature": "centerline"} | ({} if std is None else {"std": std})
    return {"properties": properties, "geometry": {"coordinates": points.tolist()}}


def test_a_line_lies_beside_the_path_with_its_deviation_and_nowhere_else() -> None:
    told = {"features": [line(10.0, 30.0, 1.25, [0.2] * 10 + [None]), line(60.0, 80.0, -0.5)]}
    offset, std = axis_beside(told, ORIGIN, PATH)
    there = [10 <= at <= 30 or 60 <= at <= 80 for at in range(101)]
    assert np.isfinite(offset).tolist() == np.isfinite(std).tolist() == there
    assert offset[10:31] == pytest.approx(1.25, abs=1e-6)
    assert offset[60:81] == pytest.approx(-0.5, abs=1e-6)
    assert std[10:29] == pytest.approx(0.2)
    assert std[30] == std[70] == pytest.approx(0.1)  # where the model tells none


@pytest.mark.parametrize("document", [None, {}, {"features": [{"properties": {"feature": "corridor"}}]}])
def test_where_no_line_is_told_there_is_none(document: object) -> None:
    offset, std = axis_beside(document, ORIGIN, PATH)
    assert np.isnan(offset).all()
    assert np.isnan(std).all()


def _run_of(task: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    trained = SimpleNamespace(configuration=SimpleNamespace(task=task))
    monkeypatch.setattr(learned_axis, "open_run", lambda folder: trained)
    return trained


def test_the_model_is_used_along_the_path_and_leaves_no_files(
    tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained = _run_of("centerline", monkeypatch)
    asked: list[Prediction] = []

    def predict(run: Any, prediction: Prediction) -> None:
        assert run is trained
        assert prediction.path is not None
        course = np.loadtxt(prediction.path, delimiter=",", skiprows=1)
        assert course == pytest.approx(PATH.points[::5] + ORIGIN[:2])
        asked.append(prediction)
        prediction.output.write_text(json.dumps({"features": [line(0.0, 100.0, 0.75)]}), encoding="utf-8")

    monkeypatch.setattr(learned_axis, "task", lambda name: SimpleNamespace(predict=predict))
    predictor = learned_axis.learned_axis(tmp_path / "run", tmp_path / "cloud.laz")
    cloud: Any = SimpleNamespace(origin=ORIGIN)
    offset, _ = predictor(cloud, PATH)
    assert offset == pytest.approx(0.75)
    assert asked[0].cloud == tmp_path / "cloud.laz"
    assert list(tmp_path.iterdir()) == []


def test_only_a_finished_run_of_a_centreline_model_will_do(tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MissingFileError):
        learned_axis.learned_axis(tmp_path / "none", tmp_path / "cloud.laz")
    _run_of("segmentation", monkeypatch)
    with pytest.raises(InputError, match="name a centreline model"):
        learned_axis.learned_axis(tmp_path, tmp_path / "cloud.laz")
