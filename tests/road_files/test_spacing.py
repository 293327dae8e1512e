"""Points of a line before the fit: stops, doubled ones, those that go back, and bends between points too far apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.fitting.fit import AxisRefusedError
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road_files.spacing import cleaned, moved_aside, tell_spacing, widest_sagitta
from synthroads_addon.scenario.road import RoadScenario

STRAIGHT = np.column_stack([np.arange(0.0, 400.0, 10.0), np.zeros(40), np.full(40, 5.0)])


def circle(radius: float, step: float, length: float = 400.0) -> np.ndarray:
    angle = np.arange(0.0, length / radius, step / radius)
    return np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), np.zeros(len(angle))])


def with_remarks(points: np.ndarray) -> tuple[np.ndarray, str]:
    with collected_remarks() as remarks:
        found = cleaned("a.csv", points)
    return found, " | ".join(remarks)


def test_a_sound_line_stays_as_it_is() -> None:
    for line in (STRAIGHT, circle(30.0, 10.0), circle(2000.0, 0.2)):
        found, text = with_remarks(line)
        assert np.array_equal(found, line)
        assert text == ""


def test_doubled_points_are_left_out_and_told() -> None:
    found, text = with_remarks(np.repeat(STRAIGHT, [1] * 20 + [3] + [1] * 19, axis=0))
    assert np.array_equal(found, STRAIGHT)
    assert "2 points that are where the one before is are left out, the first is point 22 (200.00, 0.00)" in text


def test_a_stop_is_one_point() -> None:
    """Of more points than all the rest of the line has."""
    rng = np.random.default_rng(3)
    still = STRAIGHT[20] + 0.05 * np.column_stack([rng.normal(size=(50, 2)), np.zeros(50)])
    found, text = with_remarks(np.concatenate([STRAIGHT[:20], still, STRAIGHT[21:]]))
    assert len(found) == 40
    assert np.abs(found - STRAIGHT).max() < 0.1
    assert "stands still" in text
    assert "50 at point 21" in text


def test_short_steps_that_lead_on_are_no_stop() -> None:
    """Between two gaps that are half of the way."""
    line = np.column_stack([np.r_[np.arange(0.0, 200.0, 5.0), 500.0, 900.0], np.zeros(42), np.zeros(42)])
    found, text = with_remarks(line)
    assert np.array_equal(found, line)
    assert text == ""


def test_points_that_go_back_are_left_out_and_told() -> None:
    order = [*range(15), 16, 15, *range(17, 40)]
    found, text = with_remarks(STRAIGHT[order])
    assert np.array_equal(found, STRAIGHT[[*range(15), *range(16, 40)]])
    assert "goes back: 1 points are left out, from point 17 (150.00, 0.00)" in text
    jump = np.concatenate([STRAIGHT[:21], STRAIGHT[16:]])
    found, text = with_remarks(jump)
    assert np.array_equal(found, STRAIGHT)
    assert "5 points are left out, from point 22 (160.00, 0.00)" in text


def test_a_line_that_turns_back_for_good_is_told_of_and_refused_by_the_fit(tmp_path: Path) -> None:
    there_and_back = np.concatenate([STRAIGHT, STRAIGHT[:20]])
    found, text = with_remarks(there_and_back)
    assert np.array_equal(found, there_and_back)
    assert "a.csv turns back at point 40 (390.00, 0.00), for more than 100 m" in text
    rows = there_and_back + (294_000.0, 5_628_000.0, 0.0)
    (tmp_path / "a.csv").write_text("\n".join(",".join(map(str, row)) for row in rows.tolist()))
    with pytest.raises(AxisRefusedError, match="no road follows its points"):
        axis_from_file(tmp_path / "a.csv", RoadScenario(), 1)


@pytest.mark.parametrize(
    ("step", "apart", "message"),
    [
        (21000.0, 0.0, r"point 1 \(0\.00, 0\.00\): the next one is 21\.0 km away, but must lie within 20 km"),
        (1500.0, 1.0, r"the next one is 1\.5 km away, but must lie within 1 km"),
        (19_900.0, 0.0, r"length, m is 1014900: must be at most 1e\+06 m"),
    ],
)
def test_points_too_far_apart_for_one_road_are_refused(step: float, apart: float, message: str) -> None:
    """They would be fitted for minutes, gap by gap."""
    line = np.column_stack([step * np.arange(52), np.zeros(52), np.zeros(52)])
    with pytest.raises(InputError, match=message):
        cleaned("a.csv", line, apart)


@pytest.mark.parametrize(("radius", "step"), [(800.0, 111.0), (300.0, 30.0), (60.0, 10.0)])
def test_the_sagitta_is_that_of_the_arc(radius: float, step: float) -> None:
    found, length, bend, _ = widest_sagitta(circle(radius, step, 6.0 * step))
    chord = 2.0 * radius * np.sin(step / radius / 2.0)
    assert length == pytest.approx(chord)
    assert bend == pytest.approx(radius, rel=1e-9)
    assert found == pytest.approx(radius * (1.0 - np.cos(step / radius / 2.0)), rel=0.02)


def test_points_too_far_apart_are_told_with_place_and_figure() -> None:
    for step, told in ((111.0, True), (10.0, False)):
        with collected_remarks() as remarks:
            tell_spacing("a.csv", [STRAIGHT, circle(800.0, step)])
        assert bool(remarks) is told
        if told:
            assert "points are 111 m apart at" in remarks[0]
            assert (
                "in a bend of 800 m radius: between them the road may lie up to 1.92 m beside the chord" in remarks[0]
            )


def test_csv_is_cleaned_and_told_of_too(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    points = circle(800.0, 111.0, 900.0) + (294_000.0, 5_628_000.0, 180.0)
    rows = [*points[:4], points[3], *points[4:]]
    path.write_text("x,y,z\n" + "\n".join(",".join(f"{value:.3f}" for value in row) for row in rows))
    with collected_remarks() as remarks:
        _, _, report = axis_from_file(path, RoadScenario(), 1)
    text = " | ".join(remarks)
    assert "1 points that are where the one before is" in text
    assert "beside the chord" in text
    assert report["sagitta"] == pytest.approx(1.92, abs=0.01)


def test_a_line_beside_a_path_runs_at_its_distance() -> None:
    for offset in (7.0, -7.0):
        found = moved_aside("a", circle(100.0, 1.0), offset, 1.85)
        radius = np.hypot(found[:, 0], found[:, 1] - 100.0)
        assert np.abs(radius[6:-6] - (100.0 - offset)).max() < 1e-3
        assert np.abs(radius - (100.0 - offset)).max() < 0.01
        assert np.abs(found[:, 2] + 1.85).max() < 1e-12
    with pytest.raises(InputError, match="bends too sharply at point"):
        moved_aside("a", circle(20.0, 1.0, 60.0), 25.0, 0.0)
