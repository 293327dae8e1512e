"""Scenes scanned with footprints where needed give the returns of full ones, class by class, and lose no object."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id, classes
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.platforms.stretches import spread_stretches
from synthroads_addon.scanning.record import record_as_measured
from synthroads_addon.scanning.scan import BlockResult, BlockScan, join_results
from synthroads_addon.scanning.scene.bare_ground import CLASSES, BareGround
from synthroads_addon.scanning.sparing import Sparing
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import altered

pytestmark = [pytest.mark.any_blender, pytest.mark.slow]

NEAR, ALIKE = 1e-3, 0.01
"""Ranges that are this near (m) and intensities that are this much alike (relative) count as the same."""
FEW = 20
"""Returns of an object that must not be lost."""
COMMON = (
    "scan.footprints=where_needed",
    'outputs=["cloud"]',
    "fidelity=standard",
    "scan.noise.range_sigma=0",
    "road.environment.bad_weather=0",
)
SCENES: dict[str, tuple[str, tuple[str, ...], float]] = {
    "uav": ("rq31-600m-even", ("road.length=80", "road.half_width=40"), 0.05),
    "mobile": ("mobile-mapping-300m-even", ("road.length=120",), 0.04),
    "airborne": ("airborne-1000m-even", ("road.length=150", "road.half_width=60"), 0.03),
    "tripod": ("tripod-200m-even", ("road.length=100",), 0.2),
    "dense plants": (
        "rq31-600m-even",
        (
            "road.length=60",
            "road.half_width=35",
            "road.trees_per_hectare=250",
            "road.shrubs_per_hectare=300",
            "road.vegetation.grass_height.maximum=0.8",
        ),
        0.05,
    ),
}
"""Scenarios, what changes in them, and the duration of each of the stretches that are scanned, s."""
STRETCHES = 4


@dataclass(frozen=True)
class Compared:
    """A scene's stretches, scanned with footprints in full and where needed."""

    plan: ScanPlan
    full: BlockResult
    spared: BlockResult


@cache
def compared(name: str, caster: str = "auto") -> Compared:
    """Scan the stretches of a scene both ways."""
    scenario, changes, seconds = SCENES[name]
    job = load_scenario(scenario, [*COMMON, *changes, f"scan.caster={caster}"])
    shown = RoadScene.of(job, RoadGeometry(sample_road(job.road, job.seed)))
    shown.build()
    plan = shown.plan()
    plan = altered(plan, path=spread_stretches(plan.path, STRETCHES, seconds))
    return Compared(plan, measured(altered(plan, ground=None)), measured(plan))


def measured(plan: ScanPlan) -> BlockResult:
    return join_results(record_as_measured(plan))


def same_returns(full: PointBlock, spared: PointBlock) -> np.ndarray:
    """Return a mask (N,) of the returns of full footprints that the spared ones give as well."""
    keys = [np.stack([one.gps_time, one.return_number.astype(float)], axis=1).tobytes() for one in (full, spared)]
    size = 2 * 8
    rows = [np.frombuffer(key, np.dtype((np.void, size))) for key in keys]
    _, mine, theirs = np.intersect1d(*rows, return_indices=True)
    near = np.abs(full.range[mine] - spared.range[theirs]) <= NEAR
    alike = np.abs(spared.intensity[theirs] / full.intensity[mine] - 1.0) <= ALIKE
    labelled = full.class_id[mine] == spared.class_id[theirs]
    result = np.zeros(len(full), bool)
    result[mine] = near & alike & labelled
    return result


def share_by_class(full: PointBlock, spared: PointBlock) -> dict[str, float]:
    """Return the share of each class's returns that are the same."""
    same, names = same_returns(full, spared), {one.id: one.name for one in classes()}
    return {names.get(label, str(label)): float(same[full.class_id == label].mean()) for label in set(full.class_id)}


def lost_objects(full: PointBlock, spared: PointBlock) -> set[int]:
    """Return the instances of `FEW` returns or more that aren't there with spared footprints."""
    numbers, counts = np.unique(full.instance_id, return_counts=True)
    return set(numbers[counts >= FEW].tolist()) - set(np.unique(spared.instance_id).tolist())


@pytest.mark.parametrize("name", SCENES)
def test_returns_of_every_class_are_those_of_full_footprints(name: str) -> None:
    scene = compared(name)
    shares = share_by_class(scene.full.points, scene.spared.points)
    assert len(shares) > 3
    assert min(shares.values()) >= 0.995, shares
    assert abs(len(scene.spared.points) / len(scene.full.points) - 1.0) < 1e-3
    assert not lost_objects(scene.full.points, scene.spared.points)


@pytest.mark.parametrize("name", SCENES)
def test_most_footprints_on_ground_and_pavement_alone_are_spared(name: str) -> None:
    plan = compared(name).plan
    strip = plan.path.strips[1]  # not where the scene ends
    first, count = plan.cut.pulse_span(strip, 0)
    scan, times = BlockScan(plan), [plan.cut.time(strip, number) for number in (first, first + count - 1)]
    poses = scan.emitter.poses_between(strip, times[0], times[1])
    pulses = scan.emitter.emit(strip, poses, None, first, count)
    faces = scan.tracer.trace_rays(pulses, poses.motions).first.face
    labels = np.where(faces >= 0, np.take(plan.target.class_id, faces, mode="clip"), 255)
    bare = np.isin(labels, [class_id(name) for name in CLASSES]).all(axis=0)
    met = plan.target.cast(pulses.origin, pulses.direction, plan.setting.maximum_range, pulses.time, poses.motions)
    spared = np.zeros(count, bool)
    spared[Sparing(plan).find(pulses, met, poses.motions).pulse] = True
    assert bare.sum() > 500
    assert spared[bare].mean() >= 0.85
    assert spared[~bare].mean() < 1e-3  # where blades of grass end a millimetre above the ground


def test_other_casters_spare_the_same() -> None:
    fast, slow = compared("uav"), compared("uav", "bvhtree")
    assert fast.plan.target.caster.name != slow.plan.target.caster.name
    shares = share_by_class(fast.spared.points, slow.spared.points)
    assert min(shares.values()) >= 0.999, shares


@pytest.mark.parametrize("blind", ["edges", "things"])
def test_without_what_it_looks_for_returns_are_lost(blind: str) -> None:
    scene = compared("uav")
    assert scene.plan.emission.ground is not None
    wrong = without(scene.plan.emission.ground, blind)
    shares = share_by_class(scene.full.points, measured(altered(scene.plan, ground=wrong)).points)
    assert min(shares.values()) < 0.99, shares


def without(ground: BareGround, blind: str) -> BareGround:
    """Return a scene's ground as if nothing bordered on its planes, or nothing stood on it."""
    wrong = object.__new__(BareGround)
    wrong.__dict__.update(ground.__dict__)
    check: Callable = ground.check_footprints

    def check_footprints(*beams):
        whole, alone = check(*beams)
        if blind == "edges":
            return np.ones_like(whole), alone
        return whole, whole

    wrong.check_footprints = check_footprints
    return wrong
