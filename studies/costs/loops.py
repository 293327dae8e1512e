"""Time what is done for the pulses of a scenario by compiled loops and by NumPy, in turn, on one thread.

    python studies/costs/loops.py mobile-mapping-300m-even --set road.length=100 --set scan.rays_per_pulse=7
    python studies/costs/loops.py rq31-600m-even --set road.length=60 --set scan.traffic_speed_factor=0 --faces

Casting is in both, in packets. Of each block the shortest of some runs counts, in processor time. With ``--faces`` it
says how many pulses have all their rays on one face, and what could be saved of these rays, where nothing moves.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.beam import conical_directions
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scenario.scenario import load_scenario

BLOCKS, RUNS, PULSES = 4, 5, 40_000
_SPREAD, _PROBES = 10, 3
"""Blocks spread over the path for `faces`; rays of the outer ring that are cast with the axis to guess by."""


def plan_of(scenario: str, changes: list[str]) -> ScanPlan:
    """Return the plan of a scenario's scan, for which its model is built."""
    job = load_scenario(scenario, ['outputs=["cloud"]', *changes])
    scene = RoadScene.of(job, RoadGeometry(sample_road(job.road, job.seed)))
    scene.build()
    return RoadScene(job, scene.road, scene.inputs, scene.model, scene.read()).plan()


def times(plan: ScanPlan) -> tuple[float, float]:
    """Return the seconds that the first blocks' pulses take by compiled loops, and by NumPy."""
    by_numpy = replace(plan)
    vars(by_numpy)["pulse_kernel"] = NoKernelError("measured")
    result = [0.0, 0.0]
    for strip, number in list(plan.blocks())[:BLOCKS]:
        first, count = plan.cut.pulse_span(strip, number)
        count, scan = min(count, PULSES), BlockScan(plan)
        poses = scan.emitter.poses_between(
            strip, *(plan.cut.time(strip, pulse) for pulse in (first, first + count - 1))
        )
        pulses = scan.emitter.emit(strip, poses, None, first, count)
        times_by_plan: tuple[list[float], list[float]] = ([], [])
        for _ in range(RUNS):
            for timed_plan, run_times in zip((plan, by_numpy), times_by_plan, strict=True):
                begin = time.thread_time()
                BlockScan(timed_plan).tracer.traced_echoes(strip, pulses, poses.motions, 0)
                run_times.append(time.thread_time() - begin)
        result = [total + min(run_times) for total, run_times in zip(result, times_by_plan, strict=True)]
    return result[0], result[1]


def shortest(work: Callable[..., object], *arguments: object) -> float:
    """Return the least processor time, s, that some runs of a function with what it is given take in this thread."""
    run_times = []
    for _ in range(RUNS):
        begin = time.thread_time()
        work(*arguments)
        run_times.append(time.thread_time() - begin)
    return min(run_times)


def faces(plan: ScanPlan) -> dict[str, float]:
    """Return shares of pulses whose rays all meet one face, and seconds of casting, of pulses that diverge.

    Returns:
        ``one face``: of the pulses whose axis meets anything; ``believed``: those whose axis and three rays of the
        outer ring meet one face; ``wrong``: of these, those another ray of which meets another face; seconds of casting
        all rays (``cast``), those four (``four``) and the axis (``axis``), of all that is done for pulses
        (``pulses``), and of blocks as a whole (``blocks``).
    """
    blocks, scan, pattern = list(plan.blocks()), BlockScan(plan), plan.emission.pattern
    block_indices = np.unique(np.linspace(0, len(blocks) - 1, _SPREAD).astype(int)[1:-1])
    outer_rays = sum(plan.emission.rings[:-1]) + 1 + np.arange(_PROBES) * plan.emission.rings[-1] // _PROBES
    probes = [0, *outer_rays.tolist()]
    counts = dict.fromkeys(("hits", "one face", "believed", "wrong"), 0)
    seconds = dict.fromkeys(("cast", "four", "axis", "pulses", "blocks"), 0.0)
    for strip, number in (blocks[i] for i in block_indices):
        first, count = plan.cut.pulse_span(strip, number)
        count = min(count, PULSES)
        poses = scan.emitter.poses_between(
            strip, *(plan.cut.time(strip, pulse) for pulse in (first, first + count - 1))
        )
        pulses = scan.emitter.emit(strip, poses, None, first, count)
        if plan.emission.outline is not None:
            is_near = ~plan.emission.outline.passed_by(pulses.origin, pulses.direction, plan.setting.maximum_range)
            pulses = pulses.select(np.flatnonzero(is_near))
        assert pulses.in_plane is not None
        assert pulses.across is not None
        frame = (pulses.in_plane, pulses.across, pattern, plan.setting.divergence)
        rows = np.ascontiguousarray(conical_directions(pulses.direction, *frame).transpose(2, 1, 0), np.float32)
        begins = np.ascontiguousarray(np.broadcast_to(pulses.origin.T[:, None], rows.shape), np.float32)
        faces_of_rays = {}
        for name, ray_indices in (("cast", [*range(len(pattern))]), ("four", probes), ("axis", [0])):
            origins, directions = (np.ascontiguousarray(part[:, ray_indices].reshape(-1, 3)) for part in (begins, rows))
            rays = (origins, directions, plan.setting.maximum_range)
            seconds[name] += shortest(plan.target.caster.cast, *rays)
            faces_of_rays[name] = plan.target.caster.cast(*rays).reshape(len(rows), -1)
        hits = faces_of_rays["axis"][:, 0] >= 0
        meets_one_face, is_believed = (
            (faces_of_rays[name] == faces_of_rays["axis"]).all(axis=1) & hits for name in ("cast", "four")
        )
        for name, mask in (
            ("hits", hits),
            ("one face", meets_one_face),
            ("believed", is_believed),
            ("wrong", is_believed & ~meets_one_face),
        ):
            counts[name] += int(mask.sum())
        seconds["pulses"] += shortest(scan.tracer.traced_echoes, strip, pulses, poses.motions, 0)
        seconds["blocks"] += shortest(scan.scan_pulses, strip, first, count, number)
    share = {name: counts[name] / max(1, counts["hits"]) for name in ("one face", "believed")}
    return {**share, "wrong": counts["wrong"] / max(1, counts["believed"]), **seconds}


def main() -> int:
    """Print the times of the command line's scenario."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenario", help="a shipped one's name, or a file")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="as for synthroads generate")
    parser.add_argument("--faces", action="store_true", help="say how many pulses meet one face alone")
    arguments = parser.parse_args()
    plan = plan_of(arguments.scenario, arguments.set)
    print(plan.summary()["kernels"])
    if arguments.faces:
        print(", ".join(f"{name} {value:.4f}" for name, value in faces(plan).items()))
        return 0
    compiled, numpys = times(plan)
    print(f"compiled {compiled:.3f} s, NumPy {numpys:.3f} s, ratio {compiled / numpys:.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
