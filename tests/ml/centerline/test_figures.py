"""Parts of the documentation's tables: the baseline's best settings, and predictors with a memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ml.centerline.predictor import CenterlinePredictor, UseOptions
from ml.data.frames import Frames, frames_along
from ml.data.roads import LearningRoad
from ml.networks.centerline.models import TARGETS
from ml.scores.evaluation import evaluate, make_case, skeleton_predictor
from ml.scores.metrics import Spread
from studies.learning.centerline import grid_search, remembering, road_table
from tests.helpers.clouds.centerline_batches import SETTINGS, small
from tests.helpers.clouds.centerline_roads import strip_road
from tests.helpers.roads.analytic_roads import roads


def test_the_grid_search_takes_the_best_that_finds_enough() -> None:
    road = strip_road("short", length=80.0)
    search = grid_search([make_case(road, 1, cropping=None, estimated=True)], ["ground"])
    assert len(search.rows) == 48
    one, row = search.rows[7]
    assert evaluate(skeleton_predictor(one), make_case(road, 1, cropping=None, estimated=True)) == row
    figures = dict(search.rows)
    enough = [row["mae"] for row in figures.values() if row["found"] >= 0.8]
    assert figures[search.best]["mae"] == min(enough)
    assert figures[search.best]["found"] >= 0.8


def test_what_was_found_is_remembered_by_points_and_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    sequences = CenterlinePredictor._predict_sequences

    def counted(self: CenterlinePredictor, road: LearningRoad, frames: Frames) -> Any:
        seen.append(len(frames))
        return sequences(self, road, frames)

    monkeypatch.setattr(CenterlinePredictor, "_predict_sequences", counted)
    known = roads()[0]
    places = frames_along(known.known_truth.axis).select(slice(20, 43))
    plain = CenterlinePredictor(small("single").eval(), SETTINGS, UseOptions(step=10))
    wanted = plain.regress(known, places)
    kept = remembering(plain)
    for _ in range(2):
        found = kept.regress(known, places)
        np.testing.assert_array_equal(found.value, wanted.value)
        np.testing.assert_array_equal(found.std, wanted.std)
    again, _ = kept.calibrate([(known, places)])
    factors = np.array([again.calibration[name].factor for name in TARGETS])
    np.testing.assert_allclose(again.regress(known, places).std, wanted.raw_std * factors)
    assert len(seen) == 2
    fewer = np.arange(len(known)) % 2 == 0
    other = kept.regress(known.select(fewer), places)
    assert not np.array_equal(other.value, wanted.value)
    kept.regress(known, places.select(np.arange(len(places)) > 3))
    assert len(seen) == 4


def test_roads_stand_side_by_side() -> None:
    figures = {"model": {"a": {"mae": Spread(0.1234, 0.0056, 5)}}}
    lines = road_table(figures, {"a": "A"}).splitlines()
    assert lines[0] == "|  | A: MAE (m) | A: Chamfer (m) |"
    assert lines[2] == "| model | 0.123 (0.006) | – |"
