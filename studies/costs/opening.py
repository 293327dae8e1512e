"""Measure what it takes to open a scene of 2 million triangles, up to the first pulse: time and memory, stage by stage.

    python studies/costs/opening.py

Prints the table of docs/casters.md. Seconds are by the clock and, in brackets, of all cores' processor time. Memory is
what the process holds at the end of a stage, and its peak, beyond what Blender held before.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.base.progress import peak_memory_mb
from synthroads_addon.blender.casters.embree import EmbreeCaster
from synthroads_addon.blender.scene.evaluated import scanned_scene
from synthroads_addon.blender.scene.foreign import open_scene
from synthroads_addon.jobs.measure.waves import write_waves
from synthroads_addon.scanning.scene.caster import FacePlanes


def held_mb() -> float:
    """Return the resident memory of this process, MB (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def measure(path: Path, triangles: int) -> None:
    """Open a scene in this process; print a Markdown table of seconds and memory per triangle, a row per stage."""
    memory_before, last_stamps = held_mb(), (time.perf_counter(), time.process_time())
    begin = last_stamps
    print(f"\nBlender {bpy.app.version_string}\n")
    print("| stage | seconds | memory (B/triangle) | peak (B/triangle) |\n|---|---|---|---|")

    def stage(name: str, work: Callable[[], Any]) -> Any:
        """Run a stage, print its row and return its result."""
        nonlocal last_stamps
        result = work()
        row(name, last_stamps)
        last_stamps = (time.perf_counter(), time.process_time())
        return result

    def row(name: str, first_stamps: tuple[float, float]) -> None:
        """Print a row: what was taken since some stamps."""
        seconds, processor = time.perf_counter() - first_stamps[0], time.process_time() - first_stamps[1]
        memory = [1e6 * (value - memory_before) / triangles for value in (held_mb(), peak_memory_mb() or np.nan)]
        print(f"| {name} | {seconds:.2f} ({processor:.2f}) | {memory[0]:.0f} | {memory[1]:.0f} |", flush=True)

    stage("Blender's importer", lambda: open_scene(path, "z"))
    scene = stage("triangles and labels as arrays", scanned_scene)
    objects_to_keep = [stage("Embree: its copy of the mesh, and the tree", lambda: EmbreeCaster(scene.static))]
    objects_to_keep.append(stage("planes of the faces", lambda: FacePlanes(scene.static)))
    row("in all", begin)


def main() -> None:
    """Write the scene in a separate process, so that its memory is freed, and measure its opening here."""
    if len(sys.argv) > 1:
        print(write_waves(Path(sys.argv[1])), flush=True)
        os._exit(0)  # Blender's own way out can crash
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "waves.obj"
        command = [sys.executable, __file__, str(path)]
        process = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        measure(path, int(process.stdout.split()[-1]))
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
