"""Long work: memory and open files stay flat over many scenes of a data set, and over many scans in one Blender."""

from __future__ import annotations

import ctypes
import gc
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from synthroads_addon.dataset.recipe import Recipe
from synthroads_addon.jobs.dataset.processes import Outcome, local_processes
from synthroads_addon.jobs.dataset.run import DatasetRun
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.process_memory import memory_mb

pytestmark = [
    pytest.mark.slow,
    pytest.mark.any_blender,
    pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="open files are counted in /proc"),
]

SCENES = int(os.environ.get("ENDURANCE_SCENES") or 200)
SCANS = 100
GROWTH = 8.0
"""MB that the last quarter of some work may take above its second."""
TINY = {
    "fidelity": "draft",
    "vegetation_detail": 0,
    "outputs": ["parameters", "cloud", "centerline"],
    "road.length": 20,
    "road.half_width": 20,
    "scan.lines_per_second": 20,
    "scan.platform.speed": 40,
    "scan.platform.lateral_offsets": [0],
    "colour.source": "material",
}


def resident_mb() -> float:
    """Return what this process holds, MB, without what the C library keeps of what is free: that varies by 100 MB."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return memory_mb()


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def check_flat(memory: list[float], files: list[int]) -> None:
    """See that the last quarter takes no more than the second: the first one loads what is used."""
    quarter = len(memory) // 4
    second, last = memory[quarter : 2 * quarter], memory[-quarter:]
    print(f"{len(memory)}: memory {max(second):.1f} MB, then {max(last):.1f} MB; files {files[quarter]}, {files[-1]}")
    assert max(last) < max(second) + GROWTH
    assert max(files[-quarter:]) <= max(files[quarter : 2 * quarter])


def test_scenes_of_a_data_set(tmp_path: Path) -> None:
    memory: list[float] = []
    files: list[int] = []

    def watched(folders: list[str]) -> Iterator[Outcome]:
        for outcome in local_processes(2)(folders):
            memory.append(resident_mb())
            files.append(open_files())
            yield outcome

    groups = [{"name": "a", "scenes": SCENES}]
    recipe = Recipe.from_dict({"title": "t", "seed": 3, "layouts": ["pointcept"], "set": TINY, "groups": groups})
    manifest = DatasetRun(recipe, tmp_path / "set").run(watched)
    assert manifest.complete
    check_flat(memory, files)
    logs = [json.loads((tmp_path / "set" / "logs" / f"{scene.name}.json").read_text()) for scene in manifest.scenes]
    peaks = [max(stage["peak_memory_mb"] for stage in log["stages"].values()) for log in logs]
    quarter = len(peaks) // 4
    assert max(peaks[-quarter:]) < 1.2 * max(peaks[:quarter])


def scans_in_one_blender(folder: Path) -> tuple[list[float], list[int]]:
    """Scan a road to a cloud and previews again and again; return memory (MB) and open files after each scan.

    Each tenth time images give the colours. The scene is the same afterwards.
    """
    from synthroads_addon.blender.model.build import build_road
    from synthroads_addon.blender.things.model_builder import BuildRequest
    from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
    from synthroads_addon.sampling.road import sample_road
    from synthroads_addon.scenario.road import RoadScenario
    from tests.helpers.scenes.scene_hash import digest

    thin = {"lines_per_second": 20.0, "platform": {"height": 30.0, "speed": 30.0}}
    plain = {"fidelity": "draft", "scan": thin, "outputs": ["cloud", "previews"]}
    scenarios = [Scenario.from_dict({**plain, "colour": {"source": kind}}) for kind in ("images", *["material"] * 9)]
    build_road(BuildRequest(sample_road(RoadScenario(length=40.0, half_width=20.0), 4), 0.05, 0.1))
    before = digest()
    memory, files = [], []
    for number in range(SCANS):
        scan_scene(SceneScan(scenarios[number % 10], folder, overwrite=True))
        memory.append(resident_mb())
        files.append(open_files())
    assert digest() == before
    return memory, files


def test_scans_in_one_blender(tmp_path: Path) -> None:
    """In a process of its own: where others have taken gigabytes before, what is free is taken anew in pieces."""
    pytest.importorskip("bpy", reason="needs Blender")
    log = tmp_path / "log.json"
    code = f"import json, pathlib; from {__name__} import scans_in_one_blender as scans\n"
    code += f"pathlib.Path({str(log)!r}).write_text(json.dumps(scans(pathlib.Path({str(tmp_path / 'out')!r}))))"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[2])
    check_flat(*json.loads(log.read_text()))
