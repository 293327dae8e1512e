"""Scans with rays in packets: but for ties the points of single rays, whatever is scanned and however."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.packets import Packets, usable_packets
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.platforms.stretches import spread_stretches
from synthroads_addon.scanning.record import record_as_measured
from synthroads_addon.scanning.scan import BlockResult, join_results
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import altered

pytestmark = [pytest.mark.any_blender, pytest.mark.slow]

COMMON = ('outputs=["cloud"]', "scan.noise.range_sigma=0")
SCENES: dict[str, tuple[str, tuple[str, ...], float]] = {
    "leaves": (
        "rq31-600m-even",
        ("road.length=60", "road.half_width=35", "road.trees_per_hectare=250", "scan.footprints=full"),
        0.25,
    ),
    "spared": ("rq31-600m-even", ("road.length=60", "road.half_width=35", "scan.footprints=where_needed"), 0.3),
    "vehicles, mirrors, rain": (
        "mobile-mapping-300m-even",
        (
            "road.length=120",
            "road.vehicles.per_km.minimum=60",
            "road.vehicles.per_km.maximum=60",
            "scan.multipath=3",
            "scan.weather.condition=rain",
            "scan.weather.rate_mm_h=20",
            "scan.weather.echoes=true",
        ),
        0.04,
    ),
    "cylindrical beam": (
        "tripod-200m-even",
        ("road.length=100", "scan.beam=cylindrical", "scan.rays_per_pulse=7"),
        0.4,
    ),
    "one ray": ("airborne-1000m-even", ("road.length=150", "road.half_width=60", "scan.rays_per_pulse=1"), 0.3),
}
"""Scenarios, what changes in them, and the duration of each of the stretches that are scanned, s."""


def measured(plan: ScanPlan) -> BlockResult:
    return join_results(record_as_measured(plan))


def plans(name: str) -> dict[str, ScanPlan]:
    """Return the plans of one scene with packets and without."""
    scenario, changes, seconds = SCENES[name]
    job = load_scenario(scenario, [*COMMON, *changes])
    shown = RoadScene.of(job, RoadGeometry(sample_road(job.road, job.seed)))
    shown.build()
    scene, result = shown.read(), {}
    for kernels in ("auto", "off"):
        changed = job.model_copy(update={"scan": job.scan.model_copy(update={"kernels": kernels})})
        plan = RoadScene(changed, shown.road, shown.inputs, shown.model, scene).plan()
        result[kernels] = altered(plan, path=spread_stretches(plan.path, 4, seconds))
    return result


@pytest.mark.parametrize("name", SCENES)
def test_points_are_those_of_single_rays_but_for_ties(name: str) -> None:
    assert isinstance(usable_packets(), Packets), "python tools/build_kernels.py"
    made = plans(name)
    assert made["auto"].summary()["kernels"].startswith("packets of ")
    assert made["off"].summary()["kernels"].startswith("off")
    packed, single = (measured(made[kernels]).points for kernels in ("auto", "off"))
    assert len(single) > 50_000
    keys = [np.stack([one.gps_time, one.return_number.astype(float)], axis=1) for one in (packed, single)]
    rows = [np.ascontiguousarray(key).view(np.dtype((np.void, 16))).ravel() for key in keys]
    _, mine, theirs = np.intersect1d(*rows, return_indices=True)
    unmatched = len(packed) + len(single) - 2 * len(mine)
    differ = (packed.xyz[mine] != single.xyz[theirs]).any(axis=1)
    differ |= packed.intensity[mine] != single.intensity[theirs]
    differ |= packed.class_id[mine] != single.class_id[theirs]
    assert unmatched + differ.sum() <= 1e-4 * len(single)
    apart = np.linalg.norm(packed.xyz[mine] - single.xyz[theirs], axis=1)
    footprint = made["off"].setting.beam_angle * single.range[theirs]
    assert (apart <= np.maximum(footprint, 1e-3)).all()
    again = measured(altered(made["auto"], threads=3)).points
    for field in ("xyz", "intensity", "gps_time", "class_id"):
        np.testing.assert_array_equal(getattr(again, field), getattr(packed, field))


def assert_same(found: BlockResult, expected: BlockResult) -> None:
    """Check that two scans have the same points, byte for byte, and counts."""
    assert len(found.points) > 50_000
    for field, values in found.points.attributes().items():
        theirs = expected.points.attributes()[field]
        assert values.dtype == theirs.dtype, field
        assert values.tobytes() == theirs.tobytes(), field
    assert (found.pulses, found.rays) == (expected.pulses, expected.rays)
    assert found.below_threshold == expected.below_threshold
    np.testing.assert_array_equal(found.footprints, expected.footprints)


def by_numpy(plan: ScanPlan, monkeypatch: pytest.MonkeyPatch) -> BlockResult:
    """Return the points of a plan with rays in packets, and all else done by NumPy."""
    with monkeypatch.context() as patch:  # of the class: a scan makes plans of its own out of this one
        for name in ("noise_kernel", "pose_kernel", "point_loops"):
            patch.setattr(ScanPlan, name, None)
        patch.setattr(ScanPlan, "pulse_kernel", NoKernelError("compared with"))
        assert "; pulses by NumPy: compared with; " in replace(plan).summary()["kernels"]
        return measured(plan)


@pytest.mark.parametrize("noise", [{}, {"position_sigma": 0.02, "attitude_sigma_deg": 0.01, "angle_sigma_mrad": 0.1}])
def test_compiled_loops_make_the_points_that_numpy_makes(
    noise: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plans("leaves")["auto"]
    plan = altered(plan, noise=plan.reception.noise.model_copy(update=noise))
    assert plan.summary()["kernels"].endswith("; pulses compiled; noise compiled; poses compiled; points compiled")
    assert None not in (plan.pose_kernel, plan.noise_kernel, plan.point_loops)
    assert_same(measured(plan), by_numpy(plan, monkeypatch))


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("spared", ", by NumPy: which footprints are spared"),
        ("vehicles, mirrors, rain", ", by NumPy: echoes of the air, what surfaces mirror"),
        ("cylindrical beam", ""),
        ("one ray", ""),
    ],
)
def test_whatever_is_scanned_numpy_makes_the_same_points(name: str, left: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plans(name)["auto"]
    assert plan.summary()["kernels"].endswith(
        f"; pulses compiled{left}; noise compiled; poses compiled; points compiled"
    )
    assert bool(plan.target.moving) == (name != "spared")
    expected = by_numpy(plan, monkeypatch)
    for threads in (1, 2):
        assert_same(measured(altered(plan, threads=threads)), expected)
