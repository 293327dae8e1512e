"""Figures of scan lines: on made-up lines whose errors and distances are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies.realism.lines import LineFigures, line_figures, main
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.calibration_cloud import write_las

STEP, APART = 0.36, 0.3


def lines(off: float = 0.003, along: float = 0.015, uneven: float = 0.06, turn_deg: float = 30.0) -> np.ndarray:
    """Return points of parallel lines, at distances that differ, that begin anywhere."""
    rng = np.random.default_rng(1)
    across = np.cumsum(rng.normal(APART, uneven, 200))
    count = 60
    x = STEP * (np.arange(count) + rng.uniform(0.0, 1.0, (len(across), 1))) + rng.normal(0.0, along, (200, count))
    y = across[:, None] + rng.normal(0.0, off, x.shape)
    turn = np.deg2rad(turn_deg)
    return np.column_stack([x.ravel(), y.ravel()]) @ np.array(
        [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    )


@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 91.0])
def test_errors_of_known_lines_are_found(turn_deg: float) -> None:
    found = line_figures(lines(turn_deg=turn_deg), "made up")
    assert found.lines > 150
    assert found.off_mm == pytest.approx(3.0, rel=0.1)
    assert found.along_mm == pytest.approx(15.0, rel=0.1)
    assert found.step == pytest.approx(STEP, rel=0.01)
    assert found.gap == pytest.approx(APART, rel=0.05)
    assert found.gap_variation == pytest.approx(0.06 / APART, rel=0.2)
    assert found.turned_deg < 0.05


def test_lines_that_points_leave_are_told() -> None:
    straight, bent = (line_figures(lines(off=off), "made up") for off in (0.001, 0.008))
    assert straight.off_mm < 1.2
    assert 6.0 < bent.off_mm < 9.0


def test_points_without_lines_are_refused() -> None:
    with pytest.raises(InputError, match="two scan lines of 12 points"):
        line_figures(np.random.default_rng(1).uniform(0.0, 25.0, (10_000, 2)), "made up")


def test_the_table_has_a_row_for_each_cloud(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    place = np.column_stack([lines(), np.zeros(200 * 60)])
    cloud = write_las(tmp_path / "made-up.las", place, np.full(len(place), 100.0), np.ones(len(place), np.uint16))
    listed = tmp_path / "list.yaml"
    listed.write_text(f'type: CloudList\nclouds:\n  - {{cloud: {cloud.name}, class_field: label, road: "1"}}\n')
    monkeypatch.setattr("sys.argv", ["lines.py", str(listed)])
    assert main() == 0
    head, _, row = capsys.readouterr().out.strip().splitlines()
    assert row.startswith("| made-up |")
    assert head.count("|") == row.count("|") == len(LineFigures.__dataclass_fields__) + 2
