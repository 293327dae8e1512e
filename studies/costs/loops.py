"""Time what is done for the pulses of a scenario by compiled loops and by NumPy, in turn, on one thread.

    python studies/costs/loops.py mobile-mapping-300m --set road.length=100 --set scan.rays_per_pulse=7

Casting is in both, in packets. Of each block the shortest of some runs counts, in processor time.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scenario.scenario import load_scenario

BLOCKS, RUNS, PULSES = 4, 5, 40_000


def plan_of(scenario: str, changes: list[str]) -> ScanPlan:
    """Return the plan of a scenario's scan, for which its model is built."""
    job = load_scenario(scenario, ['outputs=["cloud"]', *changes])
    shown = RoadScene.of(job, RoadGeometry(sample_road(job.road, job.seed)))
    shown.build()
    return RoadScene(job, shown.road, shown.inputs, shown.model, shown.read()).plan()


def times(plan: ScanPlan) -> tuple[float, float]:
    """Return the seconds that the first blocks' pulses take by compiled loops, and by NumPy."""
    by_numpy = replace(plan)
    vars(by_numpy)["pulse_kernel"] = NoKernelError("measured")
    result = [0.0, 0.0]
    for strip, number in list(plan.blocks())[:BLOCKS]:
        first, count = plan.cut.pulse_span(strip, number)
        count, scan = min(count, PULSES), BlockScan(plan)
        poses = scan.poses_between(strip, *(plan.cut.time(strip, pulse) for pulse in (first, first + count - 1)))
        pulses = scan.emit(strip, poses, None, first, count)
        spent: tuple[list[float], list[float]] = ([], [])
        for _ in range(RUNS):
            for one, taken in zip((plan, by_numpy), spent, strict=True):
                begin = time.thread_time()
                BlockScan(one).traced_echoes(strip, pulses, poses.motions, 0)
                taken.append(time.thread_time() - begin)
        result = [total + min(taken) for total, taken in zip(result, spent, strict=True)]
    return result[0], result[1]


def main() -> int:
    """Print the times of the command line's scenario."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenario", help="a shipped one's name, or a file")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="as for synthroads generate")
    arguments = parser.parse_args()
    plan = plan_of(arguments.scenario, arguments.set)
    compiled, numpys = times(plan)
    print(plan.summary()["kernels"])
    print(f"compiled {compiled:.3f} s, NumPy {numpys:.3f} s, ratio {compiled / numpys:.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
