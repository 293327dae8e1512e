"""The trade-off measures each row in a process of its own and writes table, JSON and plot."""

import json
import subprocess
import sys
from pathlib import Path

from synthroads_addon.core.scenario import load_scenario
from synthroads_addon.core.schema import canonical_json
from synthroads_addon.core.tradeoff import KNOBS, ROW_TITLES, rows

ROOT = Path(__file__).parents[2]


def small_scenario(folder: Path) -> Path:
    changes = ["road.length=120", "road.half_width=30", "scan.platform.lateral_offsets=[5]", "vegetation_detail=0.2"]
    path = folder / "small.json"
    path.write_text(canonical_json(load_scenario("rq31-600m", changes).to_dict()))
    return path


def test_a_knob_is_measured(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "headless.tradeoff", "--scenario", str(small_scenario(tmp_path)), "--knobs", "caster"]
    done = subprocess.run(
        [*line, "--output", str(tmp_path / "out")], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["tradeoff.json", "tradeoff.md", "tradeoff.png"]
    slow, fast = json.loads((tmp_path / "out" / "tradeoff.json").read_text())["rows"]
    assert (slow["value"], fast["value"]) == ("bvhtree", "embree")
    assert fast["rays_per_second"] > slow["rays_per_second"]
    for row in (slow, fast):
        assert set(row["errors"]) == set(ROW_TITLES)
        assert 0 < row["errors"]["height_mm"] < 5
        assert row["errors"]["position_mm"] > 0
    # Both casters see the same scene.
    assert abs(slow["errors"]["position_mm"] - fast["errors"]["position_mm"]) < 0.05 * fast["errors"]["position_mm"]


def test_unknown_knob_is_refused(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "headless.tradeoff", "--knobs", "speed", "--output", str(tmp_path / "out")]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2
    assert "--knobs is 'speed'" in done.stderr


def test_every_row_is_named() -> None:
    assert len(list(rows(KNOBS))) == sum(len(values) for values in KNOBS.values())
