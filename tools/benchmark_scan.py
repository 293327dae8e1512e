"""Measure casting and radiometry against the bare caster on the same rays, in one run.

    python tools/benchmark_scan.py

Times are of one thread's processor; blocks spread over a strip are scanned a few times each and the median taken, as
other work on the machine disturbs single runs. The ratio is the time within the caster over all the time.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.blender.files import empty_file  # noqa: E402
from synthroads_addon.blender.model import build_road  # noqa: E402
from synthroads_addon.blender.scene import scanned_scene  # noqa: E402
from synthroads_addon.core.parameters.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.core.parameters.sampler import sample_road  # noqa: E402
from synthroads_addon.core.scanning.caster import Caster  # noqa: E402
from synthroads_addon.core.scanning.scan import Scan, scan_block  # noqa: E402
from synthroads_addon.core.scenario import load_scenario  # noqa: E402
from synthroads_addon.scan_files import make_scan, road_path  # noqa: E402

BLOCKS = 8
"""Blocks of a strip that are scanned."""


class TimedCaster:
    """A caster that counts its rays and its time."""

    main_thread_only = False

    def __init__(self, caster: Caster) -> None:
        self.caster, self.name = caster, caster.name
        self.rays, self.seconds = 0, 0.0

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float
    ) -> NDArray[np.int32]:
        """Cast, and look at the clock."""
        begin = time.thread_time()
        faces = self.caster.cast(origins, directions, maximum_range)
        self.seconds += time.thread_time() - begin
        self.rays += len(origins)
        return faces


def main() -> None:
    """Print a table for several numbers of rays per pulse."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="rq31-600m")
    parser.add_argument("--set", action="append", default=[], dest="changes")
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    scenario = load_scenario(arguments.scenario, arguments.changes)
    settings = scenario.settings()
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    empty_file()
    build_road(parameters, settings.tolerance, settings.vegetation_detail)
    scene = scanned_scene(geometry=geometry)
    print("| rays per pulse | rays/s | bare caster, same rays/s | ratio |\n|---|---|---|---|")
    for rays in (1, 7, 19, 61):
        changed = load_scenario(arguments.scenario, [f"scan.rays_per_pulse={rays}", *arguments.changes])
        scan = make_scan(changed, scene, road_path(changed, geometry))
        ours, share = measured(scan, arguments.repeat)
        print(f"| {rays} | {ours / 1e6:.2f} M | {ours / share / 1e6:.2f} M | {100 * share:.0f} % |")


def measured(scan: Scan, repeat: int) -> tuple[float, float]:
    """Return rays per second of one thread with everything, and the share of the time within the caster."""
    part = scan.target._parts[0]
    timed = TimedCaster(part.caster)
    object.__setattr__(part, "caster", timed)
    strip = scan.path.strips[0]
    blocks = np.linspace(0, scan.pulses(strip) // scan.cut.size - 1, BLOCKS).astype(int)
    rays, whole, casting = 0, 0.0, 0.0
    for block in blocks:
        runs = []
        for _ in range(repeat):
            timed.rays, timed.seconds = 0, 0.0
            begin = time.thread_time()
            scan_block(scan, strip, int(block))
            runs.append((time.thread_time() - begin, timed.seconds))
        seconds = sorted(runs)[repeat // 2]
        rays, whole, casting = rays + timed.rays, whole + seconds[0], casting + seconds[1]
    return rays / whole, casting / whole


if __name__ == "__main__":
    main()
