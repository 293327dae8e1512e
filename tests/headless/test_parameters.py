"""`synthroads parameters`: one set, many sets, wrong input."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from headless import commands

ROOT = Path(__file__).parents[2]


def command(*arguments: str, hash_seed: str = "random") -> subprocess.CompletedProcess:
    line = [sys.executable, "-m", "headless.parameters", *arguments]
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False, env=environment)


def test_one_set_is_what_the_library_makes() -> None:
    from synthroads_addon.sampling.road import sample_road
    from synthroads_addon.scenario.scenario import RoadScenario

    done = command("--seed", "5", "--design-class", "EKA3", "--cross-section", "RQ25", "--length", "800")
    expected = sample_road(RoadScenario(design_class="EKA3", cross_section="RQ25", length=800.0), 5)
    assert done.returncode == 0
    assert done.stdout == expected.to_json()


def test_many_sets_are_lines_of_consecutive_seeds() -> None:
    done = command("--seed", "5", "--count", "3")
    sets = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each["metadata"]["seed"] for each in sets] == [5, 6, 7]
    assert sets[2] == json.loads(command("--seed", "7").stdout)


@pytest.mark.slow
def test_two_processes_write_the_same_bytes() -> None:
    arguments = ["--count", "20", "--length", "3000", "--cross-section", "RQ43.5"]
    first, second = (command(*arguments, hash_seed=seed).stdout for seed in ("1", "2"))
    assert len(first.splitlines()) == 20
    assert first == second


def test_wrong_input_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--cross-section", "RQ3"], ["--length", "-1"], ["--seed", "-1"], ["--set", "road.widht=3"]):
        assert commands.command("parameters", arguments) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_limits_that_conflict_are_all_named_in_one_line() -> None:
    changes = ["lanes=5", "lane_width=4.0", "median_width=2.0", "furniture.gantry_spacing=10"]
    arguments = ["--design-class", "EKA3", "--cross-section", "RQ25", "--length", "5"]
    done = command(*arguments, *(part for change in changes for part in ("--set", f"road.{change}")))
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert all(name in line for name in ("lanes is 5", "51 m wide", "median_width is 2 m", "gantry_spacing is 10 m"))
