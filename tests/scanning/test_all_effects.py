"""A scan with every effect of the sensor at once: each acts, and neither workers nor their order change a byte."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.scanning.multipath import Mirrors, Multipath
from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.record import scan_blocks
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.strip_errors import Outage, StripErrors
from synthroads_addon.scanning.sway import Motion, with_motion
from synthroads_addon.scanning.weather.conditions import Rain
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, altered, mesh_of, plane, scan_of

HEIGHT = 12.0
STRIP = Standing.strips[0]
WALL = 12.0
"""Left of the scanner, m: a wall of steel, as high as this."""
RESOLUTION = 0.6
RECEIVER = Receiver(
    threshold_to_noise=5.0,
    overlap_begin=0.5,
    overlap_full=20.0,
    response="logarithmic",
    bits=12,
    soft_saturation=2.0,
    gain_sigma_db=1.0,
    lost_numbers=0.02,
    faint_range_sigma=0.02,
    incidence_range_noise=0.2,
    range_walk=0.003,
    range_tails=5.0,
    range_delay=0.4,
    echo_separation="waveform",
)
MOTION = Motion(position_sigma=0.1, attitude_sigma_deg=0.5, heading_sigma_deg=0.5, shortest_period=0.2)
NOISE = Noise(
    angle_sigma_mrad=0.2,
    position_sigma=0.01,
    attitude_sigma_deg=0.01,
    heading_sigma_deg=0.02,
    speckle=0.2,
    dropout=0.05,
)
STRIP_ERRORS = StripErrors(
    boresight_sigma_deg=0.01,
    lever_arm_sigma=0.01,
    drift_sigma=0.02,
    outage_sigma=100.0,
    gain_sigma_db=0.5,
    gain_step_db=0.8,
)
RAIN = Rain(rate_mm_h=25.0, echoes=True)


def corner() -> ScanPlan:
    """Return a scan of asphalt, a plate above it and a wall that mirrors, with all effects; its blocks are small."""
    far, step = 80.0, 1.1 * RESOLUTION
    ground = [(-far, -far, 0), (far, -far, 0), (far, WALL, 0), (-far, WALL, 0)]
    wall = [(-far, WALL, 0), (far, WALL, 0), (far, WALL, WALL), (-far, WALL, WALL)]
    plate = [(-far, -4.0, step), (far, -4.0, step), (far, 0.0, step), (-far, 0.0, step)]
    squares = [(first + a, first + b, first + c) for first in (0, 4, 8) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    mesh = mesh_of(ground + wall + plate, squares)
    material = np.array([0, 0, 1, 1, 0, 0], dtype=np.uint16)
    mesh = replace(mesh, material=material, materials=("asphalt", "galvanised_steel"))
    plan = scan_of(mesh, 7, Standing(HEIGHT), divergence=(20e-3, 20e-3), threshold=2e-5, saturation=3e-3)
    setting = replace(
        plan.setting,
        pulse_rate=500.0,
        lines_per_second=10.0,
        range_sigma=0.01,
        range_resolution=RESOLUTION,
        free_mirror=True,
        receiver=RECEIVER,
    )
    path = with_motion(plan.path, MOTION, plan.run.seed)
    return altered(
        plan,
        setting=setting,
        path=path,
        noise=NOISE,
        strip_errors=STRIP_ERRORS,
        outages=(Outage(STRIP.index, STRIP.start_time, STRIP.start_time + STRIP.duration),),
        multipath=Multipath(Mirrors(np.array([0.0, 0.5]), np.array([0.3, 0.002])), 1.0),
        effects=RAIN.effects(),
        attenuation=RAIN.attenuation(905.0),
        chosen_blocks=tuple((STRIP, number) for number in range(4)),
    )


def points_of(plan: ScanPlan) -> PointBlock:
    """Scan a plan's blocks by as many workers as it says; return their points."""
    return concatenate([result.points for result in scan_blocks(plan)])


def bytes_of(points: PointBlock) -> dict[str, bytes]:
    """Return the bytes of every array."""
    return {name: array.tobytes() for name, array in points.attributes().items()}


def with_setting(**changes) -> Callable[[ScanPlan], ScanPlan]:
    return lambda plan: altered(plan, setting=replace(plan.setting, **changes))


def with_receiver(**changes) -> Callable[[ScanPlan], ScanPlan]:
    return with_setting(receiver=RECEIVER.model_copy(update=changes))


def with_noise(name: str) -> Callable[[ScanPlan], ScanPlan]:
    return lambda plan: altered(plan, noise=NOISE.model_copy(update={name: 0.0}))


def with_strip_errors(name: str) -> Callable[[ScanPlan], ScanPlan]:
    return lambda plan: altered(plan, strip_errors=STRIP_ERRORS.model_copy(update={name: 0.0}))


LESS: dict[str, Callable[[ScanPlan], ScanPlan]] = {
    "noise of the range": with_setting(range_sigma=0.0),
    "mirror's clock": with_setting(free_mirror=False),
    **{f"noise.{name}": with_noise(name) for name in NOISE.model_fields_set},
    **{f"strips.{name}": with_strip_errors(name) for name in StripErrors.model_fields},
    **{f"receiver.{name}": with_receiver(**{name: None}) for name in RECEIVER.model_fields_set - {"response"}},
    "receiver.response": with_receiver(response="linear"),
    "multipath": lambda plan: altered(plan, multipath=None),
    "weather": lambda plan: altered(plan, effects=(), attenuation=0.0),
    "motion": lambda plan: altered(plan, path=Standing(HEIGHT)),
}


def test_every_effect_acts() -> None:
    plan = altered(corner(), chosen_blocks=((STRIP, 0),))
    every = bytes_of(points_of(plan))
    assert not [name for name, change in LESS.items() if bytes_of(points_of(change(plan))) == every]


@pytest.mark.parametrize("workers", [2, 3, 8])
def test_workers_change_no_byte(workers: int) -> None:
    plan = corner()
    alone = points_of(altered(plan, threads=1))
    assert np.count_nonzero(alone.class_id == UNLABELLED) > 20
    assert (alone.return_number > 1).sum() > 20
    assert bytes_of(points_of(altered(plan, threads=workers))) == bytes_of(alone)


def test_the_order_of_blocks_changes_no_byte() -> None:
    plan = corner()
    forward = [bytes_of(result.points) for result in scan_blocks(altered(plan, threads=1))]
    scan = BlockScan(plan)
    assert plan.run.chosen_blocks is not None
    backward = [bytes_of(scan.scan_block(*block).points) for block in reversed(plan.run.chosen_blocks)]
    assert backward[::-1] == forward


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.2, -0.1)])
def test_ranges_without_noise_are_true_to_less_than_a_millimetre(slope: tuple[float, float]) -> None:
    """All that moves, dims, mixes or loses echoes is on; points without errors lie on the plane."""
    plan = scan_of(plane(400.0, slope), 7, Standing(60.0), divergence=(1e-3, 1e-3), threshold=1e-6, saturation=1e-3)
    setting = replace(plan.setting, receiver=RECEIVER, free_mirror=True, field_of_view=1.2)
    path = with_motion(plan.path, MOTION, plan.run.seed)
    plan = altered(plan, setting=setting, path=path, noise=NOISE, strip_errors=STRIP_ERRORS)
    points = BlockScan(plan).scan_block(path.strips[0], 0).points
    x, y, z = (points.true_xyz - ORIGIN).T
    off = (z - slope[0] * x - slope[1] * y) / np.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2)
    assert len(points) > 20_000
    assert abs(off.mean()) < 1e-4
    assert np.abs(off).max() < 1e-3
    np.testing.assert_array_equal(points.range, points.true_range)


def test_a_strip_shows_more_than_a_hundred_thousand_mirror_angles() -> None:
    """As the points have them, in float32; with clocks that keep time with each other a line's angles come again."""
    plan = scan_of(plane(), 1, Standing(500.0))
    free = replace(plan.setting, free_mirror=True)
    strip = Strip(0, 0.0, 2.0)

    def angles(setting) -> int:
        one = altered(plan, setting=setting)
        count = one.pulse_count(strip)
        return len(np.unique(BlockScan(one).scan_pulses(strip, 0, count).points.scan_angle_deg))

    assert angles(plan.setting) <= plan.setting.pulses_per_line
    assert angles(free) > 100_000
