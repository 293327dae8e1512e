"""Paths of vehicles as axes: what they say of themselves, and the axis beside and below them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_points import PathPlace
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road.geometry import alignment_of, profile_of
from synthroads_addon.road_files.read import format_of
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.written_maps import bend, beside, sbet
from tests.road_files.test_opendrive import main_road

UTM = RoadScenario(epsg=32632)


def drive(noise: float = 0.0) -> np.ndarray:
    """Return places (N, 3) every 0.25 m, 5.375 m right of a bend and 1.85 m above it, with a stop of 20 s."""
    station = np.arange(0.0, 600.0, 0.25)
    points = np.column_stack([beside(bend(), station.tolist(), -5.375), 100.0 + 0.01 * station + 1.85])
    still = np.repeat(points[800:801], 2000, axis=0)
    rng = np.random.default_rng(5)
    still[:, :2] += 0.002 * rng.normal(size=(2000, 2))
    points = np.concatenate([points[:800], still, points[800:]])
    points[:, :2] += noise * rng.normal(size=(len(points), 2))
    return points


def distances(axis: object, scenario: RoadScenario) -> tuple[float, float]:
    """Return how far the true axis is off the one that was found at most, in plan and in height, m."""
    station = np.arange(20.0, 580.0, 5.0)
    points = beside(bend(), station.tolist())
    there, offset = alignment_of(axis).project(points - np.array(scenario.map_origin[:2]))  # type: ignore[arg-type]
    height = profile_of(axis).elevation(there) + scenario.map_origin[2]  # type: ignore[arg-type]
    return float(np.abs(offset).max()), float(np.abs(height - (100.0 + 0.01 * station)).max())


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_axis_lies_beside_and_below_the_path(tmp_path: Path, noise: float) -> None:
    path = sbet(tmp_path / "drive.sbet", drive(noise))
    assert format_of(path) == "SBET"
    with collected_remarks() as remarks:
        axis, scenario, report = axis_from_file(path, UTM, 1, None, PathPlace(5.375, None, 1.85))
    plan, height = distances(axis, scenario)
    assert plan < 0.06
    assert height < 0.02
    text = " | ".join(remarks)
    assert "heights count from the ellipsoid" in text
    assert "stands still" in text
    assert "is used as the axis itself" not in text
    assert report["name"] == "drive"


def test_without_a_place_the_path_is_the_axis_and_that_is_said(tmp_path: Path) -> None:
    path = sbet(tmp_path / "drive.sbet", drive())
    with collected_remarks() as remarks:
        axis, scenario, _ = axis_from_file(path, UTM, 1)
    text = " | ".join(remarks)
    assert "drive.sbet is the path of a vehicle, and is used as the axis itself: --offset-from-path" in text
    assert "heights are those of the path: --height-above-road" in text
    assert distances(axis, scenario) == pytest.approx((5.375, 1.85), abs=0.06)


def test_a_lane_says_where_the_axis_lies(tmp_path: Path) -> None:
    """RQ 31: half a median of 4 m, an edge strip of 0.75 m, lanes of 3.75 m: 8.375 m to the outer lane's middle."""
    path = sbet(tmp_path / "drive.sbet", drive())
    _, scenario, _ = axis_from_file(path, UTM, 1)
    found = {}
    for lane in (0, 1):
        axis, limits, _ = axis_from_file(path, UTM, 1, None, PathPlace(None, lane, 1.85))
        line = alignment_of(axis)
        middle = drive()[1000, :2] - np.array(limits.map_origin[:2])
        found[lane] = -float(line.project(middle[None])[1][0])
    assert found[0] == pytest.approx(2.0 + 0.75 + 3.75 + 1.875, abs=0.03)
    assert found[1] == pytest.approx(2.0 + 0.75 + 1.875, abs=0.03)
    with pytest.raises(InputError, match="--path-lane is 2: the road has 2 lanes each way: 0, the outermost, to 1"):
        axis_from_file(path, UTM, 1, None, PathPlace(None, 2))
    with pytest.raises(InputError, match="can't be given together with --offset-from-path"):
        axis_from_file(path, UTM, 1, None, PathPlace(1.0, 0))
    assert scenario.epsg == 32632


def test_csv_with_times_is_a_path_as_well(tmp_path: Path) -> None:
    points = drive()[:800:4]
    rows = "\n".join(f"{n * 0.1:.2f},{x:.4f},{y:.4f},{z:.4f}" for n, (x, y, z) in enumerate(points.tolist()))
    for head, said in (("time,x,y,z", True), ("number,x,y,z", False)):
        path = tmp_path / "a.csv"
        path.write_text(f"# crs: EPSG:32632\n{head}\n{rows}\n")
        with collected_remarks() as remarks:
            axis_from_file(path, UTM, 1)
        assert ("is the path of a vehicle" in " ".join(remarks)) is said
    path.write_text(f"# crs: EPSG:32632\ntime,x,y,z\n{rows}\n")
    out = str(tmp_path / "out")
    command = ["road", str(path), "--output", out, "--set", "road.epsg=32632", "--height-above-road", "1.85"]
    assert main([*command, "--offset-from-path", "5.375"]) == 0


def test_a_place_beside_is_for_points_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.helpers.roads.written_lines import opendrive

    path = opendrive(tmp_path / "a.xodr", [main_road()[0]])
    assert main(["road", str(path), "--output", str(tmp_path / "out"), "--offset-from-path", "3"]) == 2
    assert "error: --offset-from-path is 'a.xodr': is for lines of points and paths" in capsys.readouterr().err
    for value in ("nan", "101", "-1e9"):
        assert main(["road", str(path), "--output", str(tmp_path / "out"), f"--offset-from-path={value}"]) == 2
    assert "a length of at most 100 m" in capsys.readouterr().err
