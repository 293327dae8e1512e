"""One class of a measured line, one reader, one stated gap: the same axis means the same wherever it is used."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from ml.scores.distances import lateral_errors
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.cloud.selection.classes import RealCloud
from synthroads_addon.cloud.selection.pavement import RoadClasses, road_classes
from synthroads_addon.road.axes.measured_axis import GAP, MeasuredAxis, usual_gap


def arc(spacing: float, length: float = 280.0, radius: float = 300.0) -> np.ndarray:
    turned = np.arange(0.0, length + 1e-9, spacing) / radius
    return np.column_stack([radius * np.sin(turned), radius * (1.0 - np.cos(turned)), np.full(len(turned), 5.0)])


def written(path: Path, points: np.ndarray) -> Path:
    """Write an axis as its file's ending says; return the file."""
    if path.suffix == ".geojson":
        path.write_text(json.dumps({"type": "LineString", "coordinates": (points + [5e5, 5e6, 0.0]).tolist()}))
    else:
        rows = (f"{x + 5e5:.4f},{y + 5e6:.4f},{z:.4f}" for x, y, z in points)
        path.write_text("x,y,z\n" + "\n".join(rows) + "\n")
    return path


def nearest_by_brute_force(points: np.ndarray, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (N,) of points from a polyline, and running lengths of their feet, segment by segment."""
    best, where = np.full(len(points), np.inf), np.zeros(len(points))
    run = 0.0
    for begin, end in pairwise(line):
        length = float(np.hypot(*(end - begin)))
        share = np.clip((points - begin) @ (end - begin) / length**2, 0.0, 1.0)
        away = np.hypot(*(points - begin - share[:, None] * (end - begin)).T)
        where = np.where(away < best, run + share * length, where)
        best, run = np.minimum(best, away), run + length
    return best, where


LINES: dict[str, Callable[[], np.ndarray]] = {
    "a point every metre": lambda: arc(1.0)[:, :2],
    "a point every 20 m": lambda: arc(20.0, radius=60.0)[:, :2],
    "right angles": lambda: np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 3.0], [80.0, 3.0], [80.0, -60.0], [79.0, -60.0]]),
    "long and short steps": lambda: np.array([[0.0, 0.0], [200.0, 1.0], [200.1, 1.0], [200.2, 1.3], [390.0, 40.0]]),
    "a loop": lambda: np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [50.0, 60.0], [50.0, -60.0]]),
    "two points": lambda: np.array([[0.0, 0.0], [30.0, 40.0]]),
    "random steps": lambda: np.cumsum(np.random.default_rng(5).normal(0.0, 7.0, (300, 2)), axis=0),
}


@pytest.mark.parametrize("name", LINES)
def test_stations_and_offsets_are_those_of_the_nearest_place(name: str) -> None:
    line = LINES[name]()
    low, high = line.min(axis=0) - 60.0, line.max(axis=0) + 60.0
    points = np.random.default_rng(1).uniform(low, high, (3000, 2))
    station, offset = MeasuredAxis(line).project(points)
    within = (station > 0.0) & (station < MeasuredAxis(line).length)
    away, where = nearest_by_brute_force(points, line)
    assert np.abs(np.abs(offset) - away)[within].max() < 1e-6
    clear = within & (np.abs(station - where) < 1e-6)
    assert clear.sum() > 0.99 * within.sum()  # two places can be as near


@pytest.mark.parametrize("ending", [".csv", ".geojson"])
@pytest.mark.parametrize("spacing", [0.25, 1.0, 2.0, 5.0, 10.0, 20.0])
def test_an_axis_is_joined_whatever_its_spacing_and_file(tmp_path: Path, spacing: float, ending: str) -> None:
    points = arc(spacing)
    with collected_remarks() as remarks:
        axis = MeasuredAxis.read(written(tmp_path / f"axis{ending}", points))
    assert (axis.joined.all(), len(axis.joined), remarks) == (True, len(points) - 1, [])


@pytest.mark.parametrize(("spacing", "missing"), [(1.0, 6.0), (1.0, 56.0), (2.0, 12.0), (10.0, 60.0)])
def test_gaps_of_evenly_spaced_points_are_found_and_told(tmp_path: Path, spacing: float, missing: float) -> None:
    points = arc(spacing)
    along = np.arange(len(points)) * spacing
    kept = points[(along <= 100.0) | (along >= 100.0 + missing)]
    with collected_remarks() as remarks:
        axis = MeasuredAxis.read(written(tmp_path / "axis.csv", kept))
    assert np.count_nonzero(~axis.joined) == 1
    gap = max(GAP, GAP * spacing)
    (remark,) = remarks
    chord = float(np.hypot(*(axis.points[1:] - axis.points[:-1])[~axis.joined][0, :2]))
    assert chord == pytest.approx(missing, abs=0.1)
    assert remark == (
        f"axis.csv: 1 step of more than {gap:.3g} m between its points, {chord:.1f} m at most, count as gaps"
    )


def test_a_drawn_line_with_vertices_where_it_turns_has_no_gaps(tmp_path: Path) -> None:
    steps = np.array([5.0, 80.0, 7.0, 12.0, 200.0, 3.0, 150.0])
    drawn = np.column_stack([np.r_[0.0, np.cumsum(steps)], np.zeros(8), np.zeros(8)])
    assert usual_gap(steps) == np.inf
    for ending in (".csv", ".geojson"):
        assert MeasuredAxis.read(written(tmp_path / f"axis{ending}", drawn)).joined.all()


def strip_along(points: np.ndarray) -> RealCloud:
    """Return a cloud of pavement 5 m to either side of a line, its intensity 100."""
    rng = np.random.default_rng(2)
    axis = MeasuredAxis(points)
    station, offset = rng.uniform(0.0, axis.length, 20_000), rng.uniform(-5.0, 5.0, 20_000)
    at, turned = axis.position(station), axis.direction(station)
    plan = at + offset[:, None] * np.column_stack([-np.sin(turned), np.cos(turned)])
    none, xyz = np.full(20_000, np.nan), np.column_stack([plan + [5e5, 5e6], np.zeros(20_000)])
    keep = np.isfinite(plan).all(axis=1)
    ones = np.ones(20_000)
    return RealCloud(
        xyz[keep], 100.0 * ones[keep], ones[keep].astype(int), None, none[keep], none[keep], ones[keep].astype(np.uint8)
    )


@pytest.mark.parametrize("ending", [".csv", ".geojson"])
@pytest.mark.parametrize("spacing", [1.0, 10.0, 20.0])
def test_calibration_finds_the_pavement_beside_an_axis_of_any_spacing(
    tmp_path: Path, spacing: float, ending: str
) -> None:
    cloud = strip_along(arc(1.0))
    file = written(tmp_path / f"axis{ending}", arc(spacing))
    found = road_classes(cloud, RoadClasses(file, ((-3.0, 3.0),), ()))["paved"]
    assert len(found.intensity) == pytest.approx(0.6 * len(cloud.xyz), rel=0.03)


def test_nothing_lies_beside_gaps_and_ends(tmp_path: Path) -> None:
    line = np.array([[0.0, 0, 0], [4, 0, 0], [8, 0, 0], [8, 4, 0], [8, 40, 0], [8, 44, 0]])
    axis = MeasuredAxis.read(written(tmp_path / "axis.csv", line))
    points = np.array([[2.0, 1.0], [9.0, 2.0], [8.2, -0.2], [5.0, 20.0], [7.0, 42.0], [-3.0, 0.0], [2.0, 90.0]])
    station, offset = axis.beside(points + [5e5, 5e6], 40.0)
    assert station[[0, 1]] == pytest.approx([2.0, 10.0], abs=1e-3)
    assert offset[[0, 1, 4]] == pytest.approx([1.0, -1.0, 1.0], abs=1e-3)
    assert np.isfinite(offset[2])
    assert np.isnan(offset[[3, 5, 6]]).all()
    assert np.isnan(axis.beside([[5e5 + 2.0, 5e6 + 30.0]], 40.0)[0]).all()


def test_scores_and_truth_measure_the_same_offset_at_vertices_20_m_apart() -> None:
    line = arc(20.0, radius=60.0)[:, :2]
    axis = MeasuredAxis(line)
    points = np.random.default_rng(3).uniform(line.min(axis=0) - 15.0, line.max(axis=0) + 15.0, (2000, 2))
    station, offset = axis.project(points)
    inside = axis.inside(station)
    scored = lateral_errors(points, line, np.arange(len(line)) * 4.0)
    assert scored[inside] == pytest.approx(offset[inside], abs=1e-9)
