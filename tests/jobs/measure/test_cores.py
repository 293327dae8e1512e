"""studies/costs/cores.py: a kept scene is scanned without Blender, in packets, to the same bytes each time."""

from __future__ import annotations

import gzip
import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from studies.costs.cores import SETTINGS
from synthroads_addon.materials.table import materials
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import plane

ROOT = Path(__file__).resolve().parents[3]
TOOL = ROOT / "studies" / "costs" / "cores.py"
WITHOUT_BLENDER = f"""
import runpy, sys
sys.modules["bpy"] = None
sys.argv[0] = {str(TOOL)!r}
runpy.run_path(sys.argv[0], run_name="__main__")
"""

pytestmark = pytest.mark.any_blender


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return the file of a kept scene: a level plane, above which 20 m of a road's path are flown."""
    scenario = load_scenario("rq31-600m-even", ["road.length=20", "scan.platform.speed=40", *SETTINGS])
    scene = ScannedScene(plane(200.0))
    rows = {name: materials()[name] for name in scene.static.materials}
    path = tmp_path / "scene.pickle"
    with gzip.open(path, "wb") as file:
        pickle.dump((scenario.to_dict(), sample_road(scenario.road, scenario.seed).to_dict(), scene, rows), file)
    return path


def test_no_blender_is_needed_and_rays_are_cast_in_packets(kept: Path) -> None:
    command = [sys.executable, "-c", WITHOUT_BLENDER, "scan", str(kept)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert answer.returncode == 0, answer.stderr
    found = json.loads(answer.stdout)
    assert found["kernels"].startswith("packets of ")
    assert found["points"] > 0
    assert found["seconds"] > 0.0


def test_of_each_number_of_cores_the_fastest_scan_counts(kept: Path) -> None:
    command = [sys.executable, str(TOOL), "scan", str(kept), "--cores", "1", "--turns", "2"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert answer.returncode == 0, answer.stderr
    runs = json.loads(answer.stderr.splitlines()[-1])
    assert len(runs) == 2
    (row,) = answer.stdout.splitlines()[2:]
    assert row.startswith(f"| 1 | {min(run['seconds'] for run in runs):.1f} |")
    assert " | 1.00 | " in row
    assert row.endswith(" | yes |")
