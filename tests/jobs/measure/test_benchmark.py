"""The benchmark on a small scene, and its tables."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from headless.benchmark_table import LIMITS, TABLE, add_scaling, beside_lines, join_runs, judge_lines, markdown
from headless.cli import main
from headless.marked_documents import BEGIN, END

pytestmark = pytest.mark.any_blender


def a_result(quick: bool, **lines: float) -> dict[str, Any]:
    stages = {"model": {"seconds": 7.0, "peak_memory_mb": 900.0}}
    floor = {"name": "writing", "unit": "million points/s", "ours": 3.0, "floor": 6.0}
    runs = [
        {
            "cores": cores,
            "stages": stages,
            "lines": lines,
            "floors": [floor],
            "scans": {"waves_1": {"pulses_per_second": 2.0 * cores, "processor_rate": 2.0 / cores, "busy": 0.9}},
            "beside": [],
        }
        for cores in (1, 2)
    ]
    return {"machine": "A processor, 2 cores", "quick": quick, "runs": runs}


def test_limits_are_judged_on_two_cores() -> None:
    result = a_result(False, model=1e3, casting=61.0, writing=80.0)
    assert {name: kept for name, _, kept in judge_lines(result)} == {"model": False, "casting": True, "writing": True}
    table = markdown(result)
    assert "| 1,000.0 | 1,000.0 | at most " in table
    assert "**missed**" in table
    assert "| writing LAZ; lazrs alone | 80 | 80 | at least 80 % | kept |" in table
    assert "| demo job, memory | – | – | at most 3000 MB | – |" in table
    assert "| writing | 2 | million points/s | 3.00 | 6.00 | 50 |" in table
    assert "| waves, 1 ray per pulse | 2 | 4.00 | 2.00 | 2.00 | 90 |" in table
    assert "missed" not in markdown(a_result(True, model=1e3))
    one = result | {"runs": result["runs"][:1]}
    assert not list(judge_lines(one))


def test_speed_is_held_against_what_runs_beside() -> None:
    """A limit in seconds or rates would be one of another machine: but for what a scan takes besides its pulses."""
    assert {name for name, limit in LIMITS.items() if limit.unit not in ("%", "times")} == {
        *("points", "memory_mb", "waves_memory", "waves_fixed")
    }


def test_two_cores_are_held_against_one_by_the_scan_that_gains_least() -> None:
    runs = a_result(False)["runs"]
    runs[1] |= {"lines": {}}
    for run, rate in zip(runs, (3.0, 4.5), strict=True):
        run["scans"] = run["scans"] | {"road_7": {"pulses_per_second": rate}}
    add_scaling(runs)
    assert runs[1]["lines"] == {"scaling": 1.5}
    add_scaling(runs[:1])
    assert "scaling" not in runs[0]["lines"]


def test_another_version_is_held_against_rates_and_memory() -> None:
    ours = {"scan": 2.0, "whole": 3.0, "pulses": 10e6, "points": 9e6, "memory_mb": 500.0}
    other = ours | {"scan": 5.0, "whole": 4.0, "memory_mb": 400.0}
    rows = [{"name": name, "ours": ours, "other": other} for name in ("road_7", "start")]
    assert beside_lines(rows) == {"road_7_beside": 2.5, "start_beside": 0.75, "memory_beside": 1.25}
    assert beside_lines([]) == {}
    result = a_result(False)
    result["runs"][1]["beside"] = rows
    table = markdown(result)
    unit = "million pulses per processor second"
    assert f"| road, 7 rays per pulse | 2 | {unit} | 5.00 | 2.00 | 500 | 400 |" in table
    assert "| first scan of a new process | 2 | processor seconds | 3.00 | 4.00 | 500 | 400 |" in table


def test_parts_that_were_measured_apart_are_joined() -> None:
    kept, now = a_result(False, model=2.0, casting=50.0)["runs"], a_result(False, casting=70.0)["runs"][1:]
    now[0]["stages"] = {}
    now[0]["scans"] = {"road_1": now[0]["scans"]["waves_1"]}
    now[0]["floors"] = [{"name": name, "unit": "", "ours": 1.0, "floor": 4.0} for name in ("writing", "scan")]
    one, two = join_runs(kept, now)
    assert one == kept[0]
    assert two["lines"] == {"model": 2.0, "casting": 70.0}
    assert two["stages"] == kept[1]["stages"]
    assert two["scans"].keys() == {"waves_1", "road_1"}
    assert [(row["name"], row["floor"]) for row in two["floors"]] == [("writing", 4.0), ("scan", 4.0)]
    assert "| road, 1 ray per pulse | 2 |" in markdown(a_result(False) | {"runs": [one, two]})
    assert join_runs([], now) == join_runs(now, now)


@pytest.mark.slow
def test_a_quick_run_measures_every_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"{BEGIN.format(TABLE)}\n{END}", encoding="utf-8")
    out, root = tmp_path / "out", Path(__file__).resolve().parents[3]
    words = ["--quick", "--cores", "1", "--beside", str(root), "--output", str(out), "--document", str(page)]
    assert main(["benchmark", *words]) == 0
    shown = capfd.readouterr().out
    result = json.loads((out / "benchmark.json").read_text(encoding="utf-8"))
    (run,) = result["runs"]
    assert run["cores"] == 1
    assert set(run["lines"]) == set(LIMITS) - {"scaling"}
    # Of a small scene hardly any memory is its own, and what it takes besides its pulses is lost in chance.
    small = {"waves_memory", "waves_fixed"}
    assert {name for name, value in run["lines"].items() if value <= 0.0} <= small
    assert [stage for stage in run["stages"] if run["stages"][stage]["seconds"] <= 0.0] in ([], ["images"])
    assert {row["name"].partition(",")[0].partition(";")[0] for row in run["floors"]} == {
        *("casting and radiometry", "writing LAZ", "scan", "rendering", "waves", "road")
    }
    # Whatever is faster than its floor would be measured wrongly; a busy machine blurs small scenes.
    assert all(row["ours"] < 3.0 * row["floor"] for row in run["floors"])
    assert run["scans"].keys() == {f"waves_{rays}" for rays in (1, 19)} | {f"road_{rays}" for rays in (1, 7, 19)}
    assert [row["name"] for row in run["beside"]] == [*run["scans"], "start"]
    for row in run["beside"]:  # the same program, so the same scan
        assert row["ours"]["points"] == row["other"]["points"] > 1000
        assert 0.0 < row["ours"]["scan"] < row["ours"]["whole"]
    table = (out / "benchmark.md").read_text(encoding="utf-8")
    assert table.strip() in page.read_text(encoding="utf-8")
    assert "casting and radiometry, 61 rays per pulse" in shown


def test_bad_input_is_refused_before_anything_is_measured(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("headless.benchmark._measure_all", lambda _: pytest.fail("measured"))
    assert main(["benchmark", "--cores", "0"]) == 2
    assert "--cores is 0: must be 1 to" in capfd.readouterr().err
    assert main(["benchmark", "--cores", "1", "--set", 'outputs=["parameters"]']) == 2
    assert "outputs is ['parameters']: must have the cloud" in capfd.readouterr().err
    assert main(["benchmark", "--cores", "1", "--beside", "nowhere"]) == 2
    assert "--beside is 'nowhere': must be a folder that holds the package synthroads_addon" in capfd.readouterr().err
    assert main(["benchmark", "--cores", "1", "--parts", "start"]) == 2
    assert "start is measured beside another version: --beside names it" in capfd.readouterr().err
    assert main(["benchmark", "--cores", "1", "--resume"]) == 2
    assert "--resume: needs --output" in capfd.readouterr().err
    assert main(["benchmark", "--document", "/nowhere/x.md", "--cores", "1"]) == 2
    assert "--document is '/nowhere/x.md': cannot be read" in capfd.readouterr().err


def test_an_occupied_folder_is_refused_before_anything_is_measured(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "benchmark.md").write_text("mine")
    monkeypatch.setattr("headless.benchmark._measure_all", lambda _: pytest.fail("measured"))
    assert main(["benchmark", "--cores", "1", "--output", str(tmp_path)]) == 2
    assert "already holds benchmark.md" in capfd.readouterr().err
    assert (tmp_path / "benchmark.md").read_text() == "mine"


def test_a_result_of_another_machine_is_not_joined(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("headless.benchmark._measure_all", lambda _: pytest.fail("measured"))
    (tmp_path / "benchmark.json").write_text(json.dumps(a_result(False)))
    words = ["benchmark", "--cores", "1", "--output", str(tmp_path), "--resume"]
    assert main(words) == 2
    assert "machine is 'A processor, 2 cores': must be '" in capfd.readouterr().err
    assert main([*words, "--overwrite"]) == 2
    assert "--resume: can't be given with --overwrite" in capfd.readouterr().err
