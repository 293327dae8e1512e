"""Predictors measured on roads: that the figures are those of the prediction, and cropping takes the easy way out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ml.data.frames import Frames
from ml.data.roads import LearningRoad, read_measured
from ml.scores import baselines
from ml.scores.baselines import SkeletonSettings
from ml.scores.evaluation import (
    CORRIDOR_COLUMNS,
    Case,
    Cropping,
    SliceCache,
    along_parabolas,
    evaluate,
    make_case,
    measure,
    skeleton_predictor,
    trivial_predictor,
    trivial_predictors,
)
from ml.scores.metrics import Spread
from ml.scores.pictures import PictureView, corridor_picture, lines_picture
from ml.scores.tables import COLUMNS, as_data, cell, report, table, write_tables
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from tests.helpers.clouds.centerline_roads import REAL, strip_road
from tests.helpers.roads import analytic_roads

Float = NDArray[np.float64]
MIDDLE, MIDDLE_10 = "middle of the extent", "middle of the extent, 10 m"


def told(offset: float, std: float = 0.1):
    """Return a predictor that looks the truth up and strays from it by an offset."""

    def predict(road: LearningRoad, frames: Frames) -> Float:
        y, _ = road.known_truth.axis.crossing(frames.position, frames.direction)
        return np.column_stack([y + offset, np.full(len(y), std)])

    return predict


@pytest.fixture(scope="module")
def road() -> LearningRoad:
    return strip_road()


def test_a_known_error_is_what_is_measured(road: LearningRoad) -> None:
    shown = make_case(road, 1, cropping=None, estimated=False)
    right, wrong = evaluate(told(0.0), shown), evaluate(told(0.15), shown)
    assert right["mae"] < 1e-9
    assert right["chamfer_full"] < 1e-6
    assert right["coverage_68"] == 1.0
    assert wrong["mae"] == pytest.approx(0.15, abs=1e-9)
    assert wrong["bias"] == pytest.approx(0.15, abs=1e-3)
    assert wrong["chamfer_common"] == pytest.approx(0.30, abs=0.01)
    # 0.15 m is 1.5 standard deviations.
    assert (wrong["coverage_68"], wrong["coverage_95"]) == (0.0, 1.0)


def test_frames_stray_from_the_axis_by_the_seed(road: LearningRoad) -> None:
    first, second, again = (make_case(road, seed, cropping=None, estimated=False).frames for seed in (1, 2, 1))
    assert np.array_equal(first.position, again.position)
    assert not np.allclose(first.position, second.position)
    y, _ = road.known_truth.axis.crossing(first.position, first.direction)
    assert 0.5 < np.nanmax(np.abs(y)) <= 6.2
    assert np.abs(first.direction - road.known_truth.axis.direction(first.station)).max() > 0.01


def test_the_estimated_path_does_not_know_the_axis(road: LearningRoad) -> None:
    """The truth may be anything: frames in use come from the points alone."""
    other = replace(road, truth=replace(road.known_truth, axis=road.known_truth.axis.translate((3.0, 4.0, 0.0))))
    frames = [make_case(one, 1, cropping=None, estimated=True).frames for one in (road, other)]
    assert np.array_equal(frames[0].position, frames[1].position)


def test_without_cropping_the_extent_gives_the_answer_away(road: LearningRoad) -> None:
    whole = evaluate(trivial_predictor(MIDDLE), make_case(road, 1, cropping=None, estimated=True))
    shown = make_case(road, 1, cropping=Cropping(), estimated=True)
    cut = evaluate(trivial_predictor(MIDDLE), shown)
    assert whole["mae"] < 0.2
    assert cut["mae"] > 0.4
    assert 0.6 < len(shown.road) / len(road) < 0.9


def test_cuts_of_single_slices_average_out_and_longer_ones_do_not(road: LearningRoad) -> None:
    errors = {
        length: np.mean(
            [
                evaluate(
                    trivial_predictor(MIDDLE_10),
                    make_case(road, seed, cropping=Cropping(length=length), estimated=False),
                )["mae"]
                for seed in (1, 2, 3)
            ]
        )
        for length in (1.0, 50.0)
    }
    assert errors[1.0] < 0.3 < errors[50.0]


def test_gaps_of_the_axis_are_left_out(road: LearningRoad) -> None:
    axis = road.known_truth.axis
    joined = axis.joined.copy()
    joined[80:120] = False
    gap = replace(road, truth=replace(road.known_truth, axis=MeasuredAxis(axis.points, joined)))
    whole, holed = (evaluate(told(0.0), make_case(one, 1, cropping=None, estimated=True)) for one in (road, gap))
    assert whole["slices"] - holed["slices"] == pytest.approx(40, abs=2)


def test_the_skeleton_takes_the_classes_where_there_are_any() -> None:
    lopsided = strip_road("lopsided", left=12.0, right=-5.0)
    shown = make_case(lopsided, 1, cropping=None, estimated=True)
    by_mask = {mask: evaluate(skeleton_predictor(SkeletonSettings(mask=mask)), shown) for mask in ("classes", "ground")}
    assert by_mask["classes"]["mae"] < 0.6
    assert by_mask["ground"]["mae"] > 2.0


def test_without_classes_the_skeleton_takes_the_ground() -> None:
    lopsided = strip_road("lopsided", left=12.0, right=-5.0)
    unknown = replace(lopsided, class_id=np.zeros_like(lopsided.class_id))
    shown = make_case(unknown, 1, cropping=None, estimated=True)
    classes, ground = (evaluate(skeleton_predictor(SkeletonSettings(mask=m)), shown) for m in ("classes", "ground"))
    assert classes == ground


def test_only_one_carriageways_points_belong_to_it(road: LearningRoad) -> None:
    assert road.belonging.all()
    room = np.column_stack(
        [np.full(len(road.known_truth.axis.points), np.inf), np.full(len(road.known_truth.axis.points), 2.0)]
    )
    half = replace(road, truth=replace(road.known_truth, room=room))
    _, offset = road.known_truth.axis.project(road.xyz)
    assert offset[half.belonging].min() == pytest.approx(-2.0, abs=0.05)
    shown = Case(half, make_case(road, 1, cropping=None, estimated=False).frames)
    assert evaluate(trivial_predictor(MIDDLE), shown)["bias"] == pytest.approx(2.5, abs=0.1)
    assert evaluate(skeleton_predictor(SkeletonSettings(0.5, 5.0, "ground")), shown)["bias"] == pytest.approx(
        2.5, abs=0.4
    )


def test_a_road_without_truth_is_refused(road: LearningRoad) -> None:
    with pytest.raises(InputError, match=r"strip.*known centreline"):
        make_case(replace(road, truth=None), 1, cropping=None, estimated=False)


def test_seeds_and_trained_versions_are_averaged(road: LearningRoad) -> None:
    predictors = {"two runs": [told(0.1), told(0.3)], "one for all": [told(0.2)]}
    result = measure(predictors, lambda seed: [make_case(road, seed, cropping=None, estimated=False)], [1, 2])
    spread = result["two runs"]["all"]["mae"]
    assert spread.mean == pytest.approx(0.2)
    assert spread.std == pytest.approx(0.1 * 2**0.5)
    assert spread.count == 2
    assert result["one for all"]["strip"]["mae"].std == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match="3 predictors for 2 seeds"):
        measure({"a": [told(0.0)] * 3}, lambda seed: [], [1, 2])


def measured() -> dict[str, dict[str, dict[str, Spread]]]:
    return {
        "model": {"all": {"mae": Spread(0.1234, 0.0056, 5), "found": Spread(0.995, 0.0, 5)}},
        "baseline": {"all": {"mae": Spread(0.9, np.nan, 1), "found": Spread(np.nan, np.nan, 5)}},
    }


def test_tables_say_mean_and_deviation(tmp_path: Path) -> None:
    text = table(measured()).splitlines()
    assert text[0] == "|  | MAE (m) | found (%) |"
    assert text[2] == "| model | 0.123 (0.006) | 99.5 |"
    assert text[3] == "| baseline | 0.900 | – |"
    assert cell(None, COLUMNS["mae"]) == "–"
    write_tables(tmp_path, "roads", measured())
    assert "## all" in (tmp_path / "roads.md").read_text()
    data = json.loads((tmp_path / "roads.json").read_text())
    assert data["baseline"]["all"]["mae"] == {"mean": 0.9, "std": None, "seeds": 1}
    assert data == as_data(measured())


def test_a_report_shows_every_road_and_the_corridor() -> None:
    figures = {"mae": Spread(0.1234, np.nan, 1), "coverage_68": Spread(0.69, np.nan, 1)}
    rows = {
        "model, seed 1": {"all": figures, "a": figures, "b": {"mae": Spread(0.2, np.nan, 1)}},
        "skeleton": {"all": {"mae": Spread(1.5, np.nan, 1)}},
    }
    corridor = {
        "lanes": {"slices": 9.0, "mae": 0.5, "right": 0.75, "interval_68": 0.7},
        "heading": {"slices": 9.0, "mae": 0.004, "interval_68": None},
    }
    text = report(rows, corridor)
    assert [line.split("  ")[0].strip() for line in text.splitlines()] == [
        *("2 roads:", "", "model, seed 1", "skeleton", ""),
        *("model, seed 1, by road:", "", "a", "b", ""),
        *("model, seed 1, the corridor:", "", "lanes", "heading (mrad)"),
    ]
    cells = {line.split("  ")[0]: line.split()[-2:] for line in text.splitlines() if line}
    assert cells["a"] == ["0.123", "69.0"]
    assert cells["b"] == ["0.200", "–"]
    assert cells["skeleton"] == ["1.500", "–"]
    assert cells["lanes"] == ["75.0", "70.0"]
    assert text.splitlines()[-1].split()[2:] == ["4.000", "–", "–"]


def test_pictures_are_drawn_with_and_without_uncertainty(road: LearningRoad) -> None:
    shown = make_case(road, 1, cropping=Cropping(), estimated=True)
    lines = {MIDDLE: trivial_predictor(MIDDLE)(road, shown.frames)[:, 0], "none": np.full(len(shown.frames), np.nan)}
    count = len(shown.frames)
    center = told(0.1)(road, shown.frames)
    corridor = np.column_stack([center, np.tile([3.5, -3.5, 2.0, 3.3, 0.0, 0.0], (count, 1)), np.full((count, 6), 0.1)])
    pictures = [
        lines_picture(shown, lines, PictureView(20.0, 50.0), "lines"),
        corridor_picture(shown, center[:, :1], PictureView(20.0, 50.0), "centre alone"),
        corridor_picture(shown, center, PictureView(20.0, 50.0), "with its deviation"),
        corridor_picture(shown, corridor, PictureView(20.0, 50.0), "corridor"),
    ]
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
    assert len({len(picture) for picture in pictures}) == 4
    assert pictures[0] == lines_picture(shown, lines, PictureView(20.0, 50.0), "lines"), "the same bytes again"


@pytest.mark.skipif(not REAL.is_dir(), reason="no real scans beside the repository")
def test_real_roads_give_their_axis_away_only_where_they_are_not_cropped() -> None:
    cloud = REAL / "als_rural2lane_t211-278.laz"
    road = read_measured(cloud, cloud.with_name(f"{cloud.stem}_axis.csv"), "carriageway")
    whole, cut = (make_case(road, 1, cropping=cropping, estimated=True) for cropping in (None, Cropping()))
    figures = evaluate(trivial_predictor(MIDDLE), whole)
    assert figures["mae"] < 0.1
    assert figures["slices"] == pytest.approx(730, abs=15)
    assert figures["found"] > 0.99
    assert evaluate(trivial_predictor(MIDDLE), cut)["mae"] > 0.4
    assert set(trivial_predictors()) >= {"centroid", MIDDLE}


def test_parabolas_average_cuts_out_and_follow_a_bend() -> None:
    road = strip_road("bend", radius=300.0)
    shown = make_case(road, 2, cropping=None, estimated=False)
    known = along_parabolas(
        lambda _, frames: road.known_truth.axis.crossing(frames.position, frames.direction)[0][:, None], 37.0
    )
    assert evaluate(known, shown)["distance_95"] < 0.01
    cut = make_case(road, 2, cropping=Cropping(), estimated=False)
    alone, together = (
        evaluate(predictor, cut)["mae"]
        for predictor in (trivial_predictor(MIDDLE), trivial_predictors()[f"{MIDDLE}, parabola of 37 m"][0])
    )
    assert together < 0.4 * alone
    gap = along_parabolas(lambda _, frames: np.where(frames.station < 100.0, np.nan, 0.0)[:, None], 37.0)
    found = gap(road, shown.frames)[:, 0]
    assert np.isnan(found[shown.frames.station < 100.0 - 18.5]).all()
    assert np.isfinite(found[shown.frames.station > 100.0]).all()


def test_intervals_count_where_they_are_given(road: LearningRoad) -> None:
    shown = make_case(road, 1, cropping=None, estimated=False)

    def predict(road: LearningRoad, frames: Frames) -> Float:
        found = np.zeros((len(frames), len(CORRIDOR_COLUMNS)))
        found[:, :2] = told(0.1)(road, frames)
        found[:, -2:] = [0.05, 0.2]
        return found

    figures = evaluate(predict, shown)
    assert (figures["coverage_68"], figures["coverage_95"]) == (0.0, 1.0)
    assert evaluate(told(0.1, std=1.0), shown)["coverage_68"] == 1.0


def test_roads_of_one_name_are_refused(road: LearningRoad) -> None:
    """Their figures would be taken for each other's."""
    shown = make_case(road, 1, cropping=None, estimated=False)
    with pytest.raises(InputError, match=f"road is '{road.name}': is the name of several roads"):
        measure({MIDDLE: [trivial_predictor(MIDDLE)]}, lambda seed: [shown, shown], [1])


def test_predictors_that_share_slices_say_the_same_as_alone() -> None:
    roads = [make_case(road, 1, cropping=None, estimated=False) for road in analytic_roads.roads()[:2]]
    shared = trivial_predictors(8.0)
    for shown in (*roads, replace(roads[0], frames=roads[0].frames.select(roads[0].frames.station < 50.0))):
        for name in baselines.RULES:
            alone = trivial_predictor(name, SliceCache(8.0))(shown.road, shown.frames)
            np.testing.assert_array_equal(shared[name][0](shown.road, shown.frames), alone)
