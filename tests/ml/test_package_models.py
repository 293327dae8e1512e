"""The models in the package: there is one for each task, small, and each sees something of a plain road."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest

from headless.cli import main
from ml.cards import model_names, read_card
from ml.centerline.task import load_predictor
from ml.data.frames import displace_frames, frames_along
from ml.shipped import open_shipped
from synthroads_addon.base.classes import class_scheme
from tests.helpers.clouds.road_data_sets import write_cloud
from tests.helpers.roads import analytic_roads

LARGEST_TOGETHER = 8e6
"""Bytes of all weights: they stand in the repository."""


def test_there_is_a_model_for_each_task_and_all_are_small() -> None:
    cards = [read_card(name) for name in model_names()]
    assert {card.task for card in cards} == {"centerline", "segmentation"}
    assert sum(card.weights.stat().st_size for card in cards) < LARGEST_TOGETHER


def test_a_cloud_is_labelled_without_a_training(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Road and ground, which form alone hardly tells apart on a plain road, and markings by their brightness."""
    points = analytic_roads.points()
    part = points.select(np.hypot(*(points.xyz[:, :2] - points.xyz[:, :2].mean(axis=0)).T) < 25.0)
    cloud, labelled = write_cloud(tmp_path / "scan.laz", part), tmp_path / "labelled.laz"
    assert main(["predict", str(cloud), "--output", str(labelled)]) == 0
    assert "segmentation-strips for" in capsys.readouterr().out, "nothing stands on this road"
    ids = {row.name: row.id for row in class_scheme("5").rows}
    found, true = np.asarray(laspy.read(labelled)["predicted_class"]), part.class_id
    paved = np.isin(true, (ids["road"], ids["road_marking"]))
    assert np.isin(found, (ids["road"], ids["road_marking"]))[paved].mean() > 0.8
    assert (found == ids["ground"])[~paved].mean() > 0.5


@pytest.mark.parametrize("name", model_names("centerline"))
def test_a_centreline_is_seen_without_a_training(name: str) -> None:
    road = analytic_roads.roads()[0]
    predictor = load_predictor(open_shipped(name))
    axis = road.known_truth.axis
    frames = displace_frames(frames_along(axis, 4.0), np.random.default_rng(1), 6.0, 1.0, 100.0).select(slice(2, 28))
    found = predictor.regress(road, frames)
    true, _ = axis.crossing(frames.position, frames.direction)
    assert np.abs(found.center - true).mean() < 0.6 * np.abs(true).mean(), "nearer than the path that it was given"
