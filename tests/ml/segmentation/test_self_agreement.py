"""A model's agreement with itself is Cohen's kappa of two views of a part of the cloud."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from ml.cards import model_names, read_card
from ml.choice import SQUARE, cloud_traits
from ml.prediction import predict
from ml.runs import Run
from ml.segmentation.scoring import EDGE
from ml.segmentation.self_agreement import ENOUGH_POINTS, SQUARES, _draw_squares, _kappa, sample_cloud, self_agreement
from ml.shipped import open_run
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.formats.registry import open_cloud
from tests.helpers.clouds.road_clouds import block_of, write


def test_kappa_is_agreement_beyond_chance() -> None:
    assert _kappa(np.diag([30, 50, 20])) == pytest.approx(1.0)
    assert _kappa(np.diag([100, 0])) == 0.0
    independent = np.outer([60, 40], [70, 30])
    assert _kappa(independent) == pytest.approx(0.0, abs=1e-12)
    # Cohen's own example of two raters: observed 0.70, by chance 0.41.
    assert _kappa(np.array([[88, 14, 18], [10, 40, 10], [2, 6, 12]])) == pytest.approx(0.4915, abs=1e-4)


def test_squares_are_drawn_until_there_are_enough_points() -> None:
    dense = Counter({(0, place): ENOUGH_POINTS for place in range(20)})
    assert len(_draw_squares(dense, stream(0, "self-agreement"))) == 1
    thin = Counter({(0, place): 100 for place in range(20)})
    assert len(_draw_squares(thin, stream(0, "self-agreement"))) == 6
    assert len(_draw_squares(Counter({(0, 0): 1}), stream(0, "self-agreement"))) == 1


@pytest.fixture
def unlike(tmp_path: Path) -> Path:
    """Return a cloud that is dense and uneven, along a road of 60 m with posts."""
    rng = np.random.default_rng(5)
    along, across = rng.uniform(0.0, 60.0, 80_000), rng.normal(0.0, 2.0, 80_000)
    ground = np.column_stack([along, across, rng.normal(0.0, 0.01, 80_000)])
    posts = np.column_stack(
        [np.repeat(np.arange(0.0, 60.0, 6.0), 300), np.full(3000, 4.0), np.tile(np.linspace(0.0, 1.2, 300), 10)]
    )
    xyz = np.concatenate([ground, posts]) + [1000.0, 2000.0, 50.0]
    return write(tmp_path / "unlike.laz", block_of(xyz, rng.uniform(0.1, 0.5, len(xyz)), np.zeros(len(xyz))))


def test_the_sample_holds_what_lies_in_its_squares(unlike: Path) -> None:
    sample = sample_cloud(unlike, cloud_traits(unlike).squares)
    squares = np.unique(np.floor((sample.coord[:, :2] + sample.origin[:2]) / EDGE), axis=0)
    assert 1 <= len(squares) <= SQUARES
    assert len(sample) > 80_000
    assert sample.strength is not None
    assert sample.color is None
    again = sample_cloud(unlike, cloud_traits(unlike).squares)
    assert (again.coord == sample.coord).all()


@pytest.fixture
def thin(unlike: Path) -> Path:
    """Return every hundredth point of that cloud: fewer per square metre than any model has learned from."""
    points = laspy.read(unlike)
    points.points = points.points[np.arange(0, len(points.points), 100)]
    points.write(str(unlike.with_name("thin.laz")))
    return unlike.with_name("thin.laz")


def test_the_traits_count_the_points_of_the_squares_that_are_drawn(unlike: Path) -> None:
    assert SQUARE == EDGE
    with open_cloud(unlike) as cloud:
        xyz = np.concatenate([block.xyz for block in cloud.blocks(1_000_000)])
    squares, numbers = np.unique(np.floor(xyz[:, :2] / EDGE).astype(int), axis=0, return_counts=True)
    assert cloud_traits(unlike).squares == dict(zip(map(tuple, squares.tolist()), numbers.tolist(), strict=True))


def test_models_that_label_by_several_views_are_compared_by_single_ones(thin: Path) -> None:
    """The mean of eight views changes less when the cloud is turned: it would win without being better."""
    run, sample = open_run(Path("segmentation-sweeps")), sample_cloud(thin, cloud_traits(thin).squares)
    agreements = [
        self_agreement(replace(run, configuration=run.configuration.model_copy(update={"votes": votes})), sample)
        for votes in (1, 4)
    ]
    assert agreements[0] == agreements[1]
    assert agreements[0] < 1.0


def test_each_model_that_is_tried_is_opened_once(thin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_and_count(run: Path) -> Run[Any]:
        opened.append(str(run))
        return open_run(run)

    monkeypatch.setattr("ml.prediction.open_run", open_and_count)
    predicted = predict(thin, tmp_path / "once.laz")
    assert predicted.choice is not None
    assert sorted(opened) == sorted(predicted.choice.agreements)


def test_a_model_sees_a_cloud_that_none_was_trained_on_twice(thin: Path, tmp_path: Path) -> None:
    predicted = predict(thin, tmp_path / "labelled.laz")
    assert predicted.choice is not None
    assert predicted.choice.doubtful
    # So thin a cloud doesn't tell that nothing stands in it: models of ground alone aren't tried.
    usable = {name for name in model_names("segmentation") if not read_card(name).domain.ground_only}
    assert set(predicted.choice.agreements) == usable
    name = predicted.choice.card.name
    expected = self_agreement(open_run(Path(name)), sample_cloud(thin, cloud_traits(thin).squares))
    assert predicted.choice.agreements[name] == pytest.approx(expected, abs=1e-6)
    assert "agree with themselves" in predicted.choice.why()
