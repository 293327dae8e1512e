"""Predictions along a road: overlapping sequences, gaps, rotated clouds, strips, files."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ml.centerline.find_road import centerline_geojson, corridor_json, find_road
from ml.centerline.predictor import CenterlinePredictor, Regression, UseOptions, smooth_line, target_errors
from ml.data import strips
from ml.data.corridor import CORRIDOR
from ml.data.frames import Frames, displace_frames, frames_along, read_path
from ml.data.roads import LearningRoad
from ml.networks.centerline.models import TARGETS
from ml.scores.calibration import IntervalCalibration
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from tests.helpers.clouds.centerline_batches import SETTINGS, small
from tests.helpers.clouds.road_data_sets import write_cloud
from tests.helpers.roads import analytic_roads

# Slices that hold all their points: which ones are left out may not differ between what is compared.
WHOLE = SETTINGS.model_copy(update={"points_per_slice": 2000})


def predictor(name: str = "transformer", **use: object) -> CenterlinePredictor:
    return CenterlinePredictor(small(name).eval(), WHOLE, UseOptions(**use))


@cache
def road() -> LearningRoad:
    return analytic_roads.roads()[0]


def frames(first: float = 20.0, last: float = 100.0) -> Frames:
    assert road().truth is not None
    every = frames_along(road().truth.axis)
    some = every.select((every.station >= first) & (every.station <= last))
    return displace_frames(some, np.random.default_rng(4), 6.0, 1.0, 100.0)


def test_columns_are_those_that_evaluations_want():
    from ml.scores.evaluation import CORRIDOR_COLUMNS

    found = predictor()(road(), frames())
    assert found.shape == (len(frames()), len(CORRIDOR_COLUMNS))
    assert np.isfinite(found).all()
    assert (found[:, 1] > 0).all()


def test_every_frame_is_predicted_from_overlapping_sequences():
    places = frames(20.0, 43.0)
    alone = predictor(step=10).regress(road(), places)
    overlapping = predictor(step=3).regress(road(), places)
    assert np.isfinite(alone.value).all()
    assert np.isfinite(overlapping.value).all()
    assert not np.allclose(alone.center[10:14], overlapping.center[10:14], atol=1e-9)
    # The first slices lie in the first sequence only.
    np.testing.assert_allclose(alone.center[:3], overlapping.center[:3], atol=1e-5)


def test_frames_in_several_sequences_have_the_mean_by_inverse_variances(monkeypatch: pytest.MonkeyPatch):
    places = frames(20.0, 43.0).select(slice(0, 3))
    ready = predictor(step=3)
    said = {0: [(1.0, 0.1)], 1: [(2.0, 0.1), (5.0, 0.2)], 2: [(4.0, 0.3)]}

    def told(road: object, some: Frames) -> object:
        for turn in range(2):
            number = np.array([frame for frame, values in said.items() if len(values) > turn])
            value, std = np.array([said[frame][turn] for frame in number]).T
            shape = (len(number), len(TARGETS))
            yield (
                number,
                np.zeros(len(number)),
                np.ones(len(number), bool),
                *(np.broadcast_to(one[:, None], shape).copy() for one in (value, std)),
            )

    monkeypatch.setattr(ready, "_predict_sequences", told)
    monkeypatch.setattr("ml.centerline.predictor.smooth_line", lambda frames, y, std, reach: y)
    found = ready.regress(road(), places)
    # 1 / 0.1^2 = 100 and 1 / 0.2^2 = 25: (100 x 2 + 25 x 5) / 125; the mean of the inverse variances is 62.5.
    np.testing.assert_allclose(found.center, [1.0, 2.6, 4.0])
    np.testing.assert_allclose(found.raw_std[:, 0], [0.1, 62.5**-0.5, 0.3])


def test_few_frames_and_none():
    few = frames().select(slice(0, 4))
    assert np.isfinite(predictor().regress(road(), few).value).all()
    assert predictor()(road(), few.select(slice(0, 0))).shape == (0, 4 + 2 * len(CORRIDOR))


def test_nothing_is_predicted_where_there_are_no_points():
    station = road().reference.project(road().xyz)[0]
    holed = road().select((station < 50.0) | (station > 80.0))
    found = predictor().regress(holed, frames())
    at = frames().station
    assert np.isnan(found.value[(at > 53.5) & (at < 76.5)]).all()
    assert np.isnan(found.std[(at > 53.5) & (at < 76.5)]).all()
    assert np.isfinite(found.value[(at < 49.0) | (at > 81.0)]).all()


def test_rotating_and_shifting_a_cloud_carries_over():
    """Cloud and frames in other coordinates: the same y in the frames, and so the same line in the cloud."""
    angle, by = 0.7, np.array([120.0, -40.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    xyz = road().xyz.copy()
    xyz[:, :2] = road().xyz[:, :2] @ turn.T + by
    line = road().reference.points.copy()
    line[:, :2] = line[:, :2] @ turn.T + by
    turned = replace(road(), xyz=xyz, reference=MeasuredAxis(line))
    places = frames()
    elsewhere = Frames(places.position @ turn.T + by, places.direction + angle, places.station)
    for name in ("single", "sequence", "transformer"):
        here, there = predictor(name)(road(), places), predictor(name)(turned, elsewhere)
        # Points at a slice's border fall on either side of it: 0.1 mm of rounding moves some.
        difference = np.abs(here - there)
        assert np.median(difference) < 1e-4, name
        assert difference[:, 0].max() < 0.05, name


def test_calibration_scales_deviations_and_widths():
    table = {"center": IntervalCalibration(factor=3.0, widths=(4.0, 5.0))}
    model = small("single").eval()
    plain = CenterlinePredictor(model, WHOLE, UseOptions()).regress(road(), frames())
    ready = CenterlinePredictor(model, WHOLE, UseOptions(), table)
    found = ready.regress(road(), frames())
    np.testing.assert_allclose(found.std[:, 0], 3.0 * plain.std[:, 0])
    np.testing.assert_allclose(found.std[:, 1:], plain.std[:, 1:])
    np.testing.assert_allclose(found.widths[:, 0], plain.std[:, :1] * [4.0, 5.0])


def test_errors_of_the_truth_itself_are_none():
    known = road().truth
    assert known is not None
    places = frames()
    there = known.at(places)
    value = np.column_stack([there.center, there.corridor])
    found = Regression(places, value, *(np.ones_like(value) for _ in range(2)), np.ones((*value.shape, 2)))
    np.testing.assert_allclose(target_errors(found, known), 0.0, atol=1e-12)
    found.value[:, TARGETS.index("height")] += 0.25
    np.testing.assert_allclose(target_errors(found, known)[:, TARGETS.index("height")], 0.25)


def test_heights_are_elevations():
    """Whatever each slice counts its heights from: the cloud lifted is the prediction lifted."""
    lifted = replace(road(), xyz=road().xyz + np.array([0.0, 0.0, 50.0], dtype=np.float32))
    here, there = predictor().regress(road(), frames()), predictor().regress(lifted, frames())
    column = TARGETS.index("height")
    np.testing.assert_allclose(there.value[:, column] - here.value[:, column], 50.0, atol=1e-3)
    np.testing.assert_allclose(there.center, here.center, atol=1e-3)


@cache
def _path_file(folder: Path) -> Path:
    """Write 100 m of the road's axis, moved by 2 m, as a path in map coordinates."""
    line = road().reference
    points = line.points[line.station <= 100.0] + road().origin + np.array([0.0, 2.0, 0.0])
    text = "x,y,z\n" + "".join(f"{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in points)
    (folder / "path.csv").write_text(text)
    return folder / "path.csv"


def test_strips_make_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A road cut into strips is the same road, but for where the overlapping sequences begin."""
    cloud = write_cloud(tmp_path / "cloud.laz", analytic_roads.points(density=2.0))
    path = _path_file(tmp_path)
    ready = predictor(step=1)
    whole = find_road(ready, cloud, read_path(path))
    monkeypatch.setattr(strips, "LENGTH", 30.0)
    parts = find_road(ready, cloud, read_path(path))
    assert len(whole.frames) == len(parts.frames) > 90
    np.testing.assert_allclose(parts.value, whole.value, atol=2e-3)
    np.testing.assert_allclose(parts.std, whole.std, rtol=0.02)


def test_road_is_found_without_a_path(tmp_path: Path):
    cloud = write_cloud(tmp_path / "cloud.laz", analytic_roads.points())
    found = find_road(predictor(), cloud)
    assert found.epsg == 25832
    known = road().truth
    assert known is not None
    station, offset = known.axis.project(found.frames.position - road().origin[:2])
    inner = (station > 10.0) & (station < 150.0)
    assert inner.sum() > 130
    assert np.abs(offset[inner]).max() < 3.0
    height = found.value[:, TARGETS.index("height")]
    assert np.abs(height - np.median(road().xyz[:, 2]) - road().origin[2]).max() < 10.0


def test_clouds_without_ground_are_refused(tmp_path: Path):
    points = analytic_roads.points()
    leaves = replace(points, class_id=np.full(len(points), 3, dtype=np.uint8))
    with pytest.raises(InputError, match="at least one of the classes ground"):
        find_road(predictor(), write_cloud(tmp_path / "leaves.laz", leaves))
    with pytest.raises(MissingFileError):
        find_road(predictor(), tmp_path / "none.laz")


def _found(gap: bool = True) -> Regression:
    count = 6
    station = np.arange(count, dtype=np.float64)
    value = np.zeros((count, len(TARGETS)))
    value[:, 0], value[:, 1], value[:, 2], value[:, TARGETS.index("height")] = 1.0, 4.0, -3.0, 200.0
    if gap:
        value[2] = np.nan
    std = np.full_like(value, 0.1)
    places = Frames(np.column_stack([500_000.0 + station, 0.0 * station]), 0.0 * station, station)
    return Regression(places, value, std, std, std[:, :, None] * np.array([1.0, 2.0]), 25832)


def test_geojson_has_lines_in_map_coordinates():
    data = json.loads(json.dumps(centerline_geojson(_found(), "cloud", 1.0), allow_nan=False))
    assert data["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::25832"
    names = [feature["properties"]["feature"] for feature in data["features"]]
    assert names == ["centerline"] * 2 + ["left_edge"] * 2 + ["right_edge"] * 2
    first, second = data["features"][:2]
    assert first["geometry"]["coordinates"] == [[500000.0, 1.0, 200.0], [500001.0, 1.0, 200.0]]
    assert second["properties"]["stations"] == [3.0, 4.0, 5.0]
    assert second["properties"]["std"] == [0.1] * 3
    assert second["properties"]["interval_95"] == [0.2] * 3
    assert len(centerline_geojson(_found(gap=False), "cloud", 1.0)["features"]) == 3


def test_geojson_is_read_back_as_an_axis(tmp_path: Path):
    data = centerline_geojson(_found(gap=False), "cloud", 1.0)
    data["features"] = data["features"][:1]
    (tmp_path / "line.geojson").write_text(json.dumps(data))
    np.testing.assert_allclose(MeasuredAxis.read(tmp_path / "line.geojson").points[:, 1], 1.0)


def test_corridor_is_json_with_all_columns():
    data = json.loads(json.dumps(corridor_json(_found(), {}), allow_nan=False))
    slices = data["slices"]
    for name in TARGETS:
        assert {name, f"{name}_std", f"{name}_68", f"{name}_95"} <= set(slices)
    assert slices["center"][2] is None
    assert slices["x"][0] == 500000.0
    assert data["units"]["lanes"] == "1"
    assert len({len(column) for column in slices.values()}) == 1


def test_lines_of_interleaved_sequences_are_joined():
    """Frames on a circle of 280 m that stray and turn, and every fourth of them off to one side."""
    station = np.concatenate([np.arange(60.0), 90.0 + np.arange(30.0)])
    angle = station / 280.0
    rng = np.random.default_rng(3)
    turn, away = rng.uniform(-0.03, 0.03, len(station)), np.sin(station / 9.0)
    out = np.column_stack([np.sin(angle), -np.cos(angle)])
    places = Frames((280.0 - away)[:, None] * out, angle + turn, station)
    known = MeasuredAxis(
        280.0 * np.column_stack([np.sin(np.linspace(-0.1, 0.6, 2000)), -np.cos(np.linspace(-0.1, 0.6, 2000))])
    )
    true, _ = known.crossing(places.position, places.direction)
    std = np.full(len(station), 0.1)
    np.testing.assert_allclose(smooth_line(places, true, std, 1), true, atol=1e-12)
    np.testing.assert_allclose(smooth_line(places, true, std, 4), true, atol=0.006)
    jagged = true + 0.2 * (station % 4 == 0) - 0.05
    inner = np.r_[4:56, 64:86]
    assert np.abs(smooth_line(places, jagged, std, 4) - true)[inner].max() < 0.01
    # Who isn't sure counts for little.
    std[station % 4 == 0] = 1.0
    assert np.abs(smooth_line(places, jagged, std, 4) - true + 0.05)[inner].max() < 0.01
    jagged[20] = np.nan
    again = smooth_line(places, jagged, std, 4)
    assert np.isnan(again[20])
    assert np.isfinite(np.delete(again, 20)).all()
    # Nothing crosses the gap.
    other = jagged.copy()
    other[60:] += 5.0
    np.testing.assert_array_equal(smooth_line(places, other, std, 4)[:60], again[:60])
