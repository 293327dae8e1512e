"""`synthroads parameters`: one set, many sets, wrong input."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def command(*arguments: str) -> subprocess.CompletedProcess:
    line = [sys.executable, "-m", "headless.parameters", *arguments]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)


def test_one_set_is_what_the_library_makes() -> None:
    from synthroads_addon.core.parameters.sampler import sample_road
    from synthroads_addon.core.scenario import RoadScenario

    done = command("--seed", "5", "--design-class", "EKA3", "--cross-section", "RQ25", "--length", "800")
    expected = sample_road(RoadScenario(design_class="EKA3", cross_section="RQ25", length=800.0), 5)
    assert done.returncode == 0
    assert done.stdout == expected.to_json()


def test_many_sets_are_lines_of_consecutive_seeds() -> None:
    done = command("--seed", "5", "--count", "3")
    assert [json.loads(line)["metadata"]["seed"] for line in done.stdout.splitlines()] == [5, 6, 7]


def test_wrong_input_is_one_line() -> None:
    for arguments in (["--cross-section", "RQ3"], ["--length", "-1"], ["--seed", "-1"], ["--set", "road.widht=3"]):
        done = command(*arguments)
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1
