"""How far a file's line is from the axis taken from it: measured along it, and drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from headless.cli import main
from synthroads_addon.base.arrays import Float
from synthroads_addon.road_files.axis import line_deviation
from synthroads_addon.road_files.line import exact_axis
from synthroads_addon.road_files.read import choose_line, read_lines
from tests.helpers.roads.written_lines import opendrive
from tests.road_files.test_kinks import kinked
from tests.road_files.test_landxml import written
from tests.road_files.test_opendrive import main_road

CUBIC = '<elevationProfile><elevation s="0" a="4" b="0.01" c="1e-4" d="-4e-7"/></elevationProfile>'


def deviation(path: Path, round_kinks: float | None = None) -> tuple[float, Float, Float, Float | None]:
    """Return how far a file's longest line is from its axis."""
    line = choose_line(read_lines(path), None, path.name)
    return line_deviation(line, exact_axis(line, round_kinks))


def test_lines_arcs_and_clothoids_are_not_off(tmp_path: Path) -> None:
    road, _ = main_road(rest=CUBIC)
    length, station, across, above = deviation(opendrive(tmp_path / "a.xodr", [road]))
    assert length == pytest.approx(400.0)
    assert station[-1] == pytest.approx(400.0)
    assert np.abs(across).max() < 1e-6
    assert above is not None
    assert 1e-5 < np.abs(above).max() < 1e-3  # parabolas for a cubic


def test_a_transition_of_another_kind_is_off_by_what_the_report_says(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    written(path, "bloss")
    _, _, across, _ = deviation(path)
    assert 1e-6 < np.abs(across).max() < 1e-3


def test_a_rounded_kink_is_seen_where_it_is(tmp_path: Path) -> None:
    path, *_ = kinked(tmp_path / "kink.xodr", 0.05)
    _, station, across, above = deviation(path, round_kinks=0.03)
    assert above is None
    assert station[np.abs(across).argmax()] == pytest.approx(100.0, abs=1.0)
    assert 0.01 < np.abs(across).max() <= 0.03


@pytest.mark.parametrize("name", ["a.xodr", "a.csv"])
def test_the_command_draws_it(tmp_path: Path, name: str) -> None:
    road, walk = main_road(500_000.0, 5_700_000.0, CUBIC)
    path = opendrive(tmp_path / "a.xodr", [road])
    if name.endswith("csv"):
        path = tmp_path / name
        rows = np.column_stack([walk.points(2.0)[1], np.zeros(200)])
        np.savetxt(path, rows, delimiter=",", header="x,y,z", comments="")
    out = tmp_path / "out"
    assert main(["road", str(path), "--output", str(out), "--only-axis"]) == 0
    with Image.open(out / "deviation.png") as picture:
        assert picture.width > 1000
        assert len(set(picture.convert("RGB").getdata())) > 4
