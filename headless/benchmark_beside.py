"""One scan of a scene in a process of its own, by whichever version of SynthRoads lies on Python's path.

    PYTHONPATH=FOLDER python headless/benchmark_beside.py SCENE.obj CHANGE ...

prints what it took as a line of JSON. It takes nothing from its own version, so that `synthroads benchmark --beside`
measures both in the same way.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

_STAGES = ("scan", "files")
"""Stages of a scan from its first pulse to the end of its file."""


def measure(scene: Path, changes: list[str]) -> dict[str, Any]:
    """Scan an .obj file with z up in this new process; return processor times (s), counts and memory (MB).

    Returns:
        ``scan``: processor seconds from the first pulse to the file's end; ``whole``: those of the whole process, from
        its first line on; ``pulses``, ``points``; ``memory_mb``: peak.
    """
    from synthroads_addon.base.progress import peak_memory_mb
    from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
    from synthroads_addon.scenario.scenario import Scenario, load_scenario

    begin_times: dict[str, float] = {}
    durations: dict[str, float] = {}

    def note(stage: str, share: float) -> None:
        """Note when a stage begins, and how long it took."""
        name = str(stage)
        if share == 0.0:
            begin_times.setdefault(name, time.process_time())
        elif share == 1.0:
            durations[name] = time.process_time() - begin_times[name]

    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        scenario_file = Path(folder) / "scenario.json"
        scenario_file.write_text(json.dumps(Scenario().to_dict()), encoding="utf-8")
        job = SceneScan(load_scenario(str(scenario_file), changes), Path(folder) / "out", scene, up="z")
        counts = scan_scene(job, note)["counts"]
    return {
        "scan": sum(durations.get(stage, 0.0) for stage in _STAGES),
        "whole": time.process_time(),
        "pulses": counts["pulses"],
        "points": counts["points"],
        "memory_mb": peak_memory_mb(),
    }


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]), sys.argv[2:])), flush=True)
    os._exit(0)  # Blender's own way out can crash
