"""Kinks between elements: rounded on request within a distance, told, and refused where they can't be."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.written_lines import Walk, linear, opendrive, xodr_road

LINE = "<line/>"


def kinked(path: Path, angle: float, curvature: float = 0.0, length: float = 100.0) -> tuple[Path, Walk, Walk]:
    """Return a file of two elements that meet at an angle (rad), and a walk along either."""
    first = Walk([(length, linear(length, curvature, curvature))], 0.0, 0.0, 0.3)
    x, y, heading = first.poses[-1]
    second = Walk([(length, linear(length, 0.0, 0.0))], x, y, heading + angle)
    shape = f'<arc curvature="{curvature!r}"/>' if curvature else LINE
    rows = [(0.0, length, first.poses[0], shape), (length, length, second.poses[0], LINE)]
    return opendrive(path, [xodr_road(rows)]), first, second


@pytest.mark.parametrize(("angle", "curvature"), [(0.02, 0.0), (-0.12, 0.0), (0.06, 1 / 400), (-0.05, 1 / 250)])
def test_a_kink_is_rounded_within_the_distance_and_told(tmp_path: Path, angle: float, curvature: float) -> None:
    path, first, second = kinked(tmp_path / "kink.xodr", angle, curvature)
    with collected_remarks() as remarks:
        axis, scenario, report = road_axis(path, RoadScenario(), round_kinks=0.05)
    (row,) = report["rounded"]
    assert row["station"] == pytest.approx(100.0)
    assert row["angle"] == pytest.approx(angle, abs=1e-6)
    alignment = alignment_of(axis)
    corner = np.array([first.poses[-1][:2]]) - scenario.map_origin[:2]
    off = abs(float(alignment.project(corner)[1][0]))
    assert off == pytest.approx(row["deviation"], abs=1e-5)
    assert 0.2 * 0.05 < off <= 0.05
    ends = np.array([first.poses[0][:2], second.poses[-1][:2]]) - scenario.map_origin[:2]
    assert np.hypot(*(alignment.position(np.array([0.0, alignment.length])) - ends).T).max() < 1e-6
    headings = alignment.heading(np.array([0.0, alignment.length]))
    assert math.remainder(headings[1] - second.poses[-1][2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-7)
    assert max(abs(e.curvature_end) for e in axis.horizontal) <= 0.1
    assert any("is rounded over" in text for text in remarks)


def test_kinks_are_refused_without_it_and_where_no_rounding_keeps_the_distance(tmp_path: Path) -> None:
    path, *_ = kinked(tmp_path / "kink.xodr", 0.1)
    with pytest.raises(InputError, match="--round-kinks"):
        road_axis(path, RoadScenario())
    with pytest.raises(InputError, match="form a kink"):
        road_axis(path, RoadScenario(), round_kinks=0.001)  # it would have a radius of 0.6 m


def test_the_command_rounds_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, *_ = kinked(tmp_path / "kink.xodr", 0.05)
    out = tmp_path / "road"
    assert main(["road", str(path), "--output", str(out), "--round-kinks", "0.02"]) == 0
    assert json.loads((out / "road.json").read_text())["rounded"][0]["deviation"] <= 0.02
    assert main(["road", str(path), "--output", str(out), "--overwrite"]) != 0
    assert "kink" in capsys.readouterr().err
