"""Times of a whole scan, projected from stretches of it, by a clock and a recorder that are made up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pytest

from synthroads_addon.base.progress import StageTimer
from synthroads_addon.jobs.choose.table import JobTimes, shipped_table
from synthroads_addon.jobs.choose.trial import Trial
from synthroads_addon.jobs.scan.files import CloudFiles
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.jobs.scan.test_plan import StandIns, planned

RATE, EACH, FIRST, OTHERS = 2e-6, 0.5, 30.0, 5.0
"""Seconds of a pulse, of every scan, of the first one besides, and of work of others that disturbs one."""


@dataclass
class MadeUpScans:
    """Scans that take as long as they are said to, by a clock of their own; every other pulse has a point."""

    each: float
    now: float = 100.0
    scans: int = 0
    block: float = 0.0
    disturbed: int | None = None
    octave: float = 0.0

    def record(self, plans: Iterable[ScanPlan], files: CloudFiles, timer: StageTimer, announce: bool) -> dict[str, Any]:
        for plan in plans:
            pulses = sum(map(plan.pulse_count, plan.path.strips))
            self.now += self.each + RATE * pulses + (0.0 if self.scans else FIRST) + self.block * plan.cut.count()
            self.now += OTHERS if self.scans == self.disturbed else 0.0
            self.now += self.octave * (plan.relief.octaves - 2) * pulses
            self.scans += 1
            files.counts.points += pulses // 2
        return {}


def site_of(plan: ScanPlan) -> Site:
    """Return the site of a scan of draft fidelity along a plan's path."""
    scenario = Scenario.from_dict({"fidelity": "draft"})
    return Site(scenario, ScenarioInputs.read(scenario), plan.path)


@pytest.mark.parametrize(("each", "disturbed"), [(0.0, None), (EACH, None), (EACH, 0), (EACH, 1), (0.0, 2), (EACH, 3)])
def test_a_scan_of_a_fixed_time_and_a_rate_is_predicted_exactly_though_others_disturb_one(
    each: float, disturbed: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    scans = MadeUpScans(each, disturbed=disturbed)
    monkeypatch.setattr("synthroads_addon.jobs.choose.trial.record_cloud", scans.record)
    plan = planned(StandIns(), seconds=75.0)
    trial = Trial(site_of(plan), plan, clock=lambda: scans.now)
    seconds, points = trial.time_scan(())
    assert trial.pulses > 1e6
    assert seconds == pytest.approx(each + RATE * trial.pulses, rel=1e-9)
    assert points == pytest.approx(trial.pulses / 2, rel=1e-4)


def test_what_every_block_takes_counts_as_often_as_there_are_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    scans = MadeUpScans(0.0, block=1.0)
    monkeypatch.setattr("synthroads_addon.jobs.choose.trial.record_cloud", scans.record)
    plan = planned(StandIns(), seconds=1500.0)
    trial = Trial(site_of(plan), plan, clock=lambda: scans.now)
    seconds, _ = trial.time_scan(())
    assert seconds == pytest.approx(RATE * trial.pulses + plan.cut.count(), rel=0.02)


@pytest.mark.parametrize("disturbed", [1, 2])
def test_what_a_finer_relief_takes_is_measured_though_others_disturb_one(
    disturbed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scans = MadeUpScans(EACH, scans=1, disturbed=disturbed, octave=3e-7)
    monkeypatch.setattr("synthroads_addon.jobs.choose.trial.record_cloud", scans.record)
    plan = planned(StandIns(), seconds=75.0)
    trial = Trial(site_of(plan), plan, clock=lambda: scans.now)
    seconds = trial.time_relief((), 6)
    assert seconds == pytest.approx(4 * 3e-7 * trial.pulses, rel=1e-6)
    times = JobTimes(shipped_table("uav"), area=1e4, pulses=10**6, points=10**6)
    by_table = times.relief_seconds(4) / times.relief_seconds(6)
    times.relief = 6, seconds
    assert times.relief_seconds(2) == 0.0
    assert times.relief_seconds(6) == pytest.approx(seconds)
    assert times.relief_seconds(4) == pytest.approx(seconds * by_table)


def test_two_timed_scans_tell_what_a_ray_costs_here() -> None:
    table = shipped_table("uav")
    times = JobTimes(table, area=1e4, pulses=10**6)
    times.calibrate(1, 3.0, 5)
    assert times.scan_seconds(61) == pytest.approx(3.0 * table.pulse_seconds(61) / table.pulse_seconds(1))
    times.calibrate(19, 5.0, 5)
    assert (times.scan_seconds(1), times.scan_seconds(19)) == (pytest.approx(3.0), pytest.approx(5.0))
    steps = table.pulse_seconds(61) - table.pulse_seconds(1), table.pulse_seconds(19) - table.pulse_seconds(1)
    assert times.scan_seconds(61) == pytest.approx(3.0 + 2.0 * steps[0] / steps[1])
