"""Forecasts of scans: near what they take, and a refusal of what is more than anyone can have meant."""

from __future__ import annotations

from dataclasses import replace

import pytest

from synthroads_addon.base import machine
from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning import forecast as module
from synthroads_addon.scanning.blocks import Blocks
from synthroads_addon.scanning.forecast import MOST_PULSES, check_scan_size, forecast_scan
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import Standing


def blocks(seconds: float, rays: int = 7) -> Blocks:
    path = Standing()
    path.strips = (Strip(0, 0.0, seconds),)
    return Blocks(scanner_setting(load_scenario("rq31-600m-even").scan), path, rays)


def test_a_scan_of_the_demo_s_size_is_told_within_a_factor_of_two() -> None:
    """On one core it took 34 s and 1.2 GB; see docs/benchmark.md."""
    cut = blocks(180.0)
    told = forecast_scan(cut, 1_500_000, threads=1)
    assert told.pulses == cut.pulse_count(cut.path.strips[0]) == pytest.approx(18e6, rel=0.5)
    assert 17 < told.seconds < 68
    assert 0.6e9 < told.memory < 2.4e9
    assert f"{told.pulses:,} pulses" in told.text()
    assert forecast_scan(cut, 1_500_000, threads=2).seconds == pytest.approx(told.seconds / 2.0)


@pytest.mark.parametrize(("rays", "microseconds"), [(1, 0.2), (7, 0.9), (19, 2.0), (61, 5.6)])
def test_rays_take_what_casting_them_was_measured_to_take(rays: int, microseconds: float) -> None:
    """The time of a pulse without its rays is the same for all numbers of rays; the times are those of the page."""
    told = forecast_scan(blocks(180.0, rays), 1000, threads=1)
    seven = forecast_scan(blocks(180.0, 7), 1000, threads=1)
    assert 1e6 * (told.seconds - seven.seconds) / told.pulses == pytest.approx(microseconds - 0.9, abs=1.0)


def test_rendered_colours_take_longer() -> None:
    """By docs/tradeoff.md images take 34 s longer than materials' nodes for the 10 million pulses of a motorway."""
    cut = blocks(100.0)
    longer = forecast_scan(cut, 1000, threads=1, rendered=True).seconds - forecast_scan(cut, 1000, threads=1).seconds
    assert 1e6 * longer / forecast_scan(cut, 1000).pulses == pytest.approx(3.4, rel=0.5)


def test_a_busy_machine_takes_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twelve others on two cores: one thread gets 2/13 of a core, two threads get 2/7 each by the same turns."""
    monkeypatch.setattr(machine, "available_cores", lambda: 2)
    idle = forecast_scan(blocks(100.0), 1000, threads=2)
    for share, cores in ((1.0, 2.0), (0.97, 2.0), (2 / 13, 4 / 14)):
        assert machine.free_cores(2, share) == pytest.approx(cores)
        monkeypatch.setattr(module, "share_of_core", lambda share=share: share)
        assert idle.beside_others().seconds == pytest.approx(idle.seconds * 2.0 / cores)


def test_the_share_of_a_core_is_measured() -> None:
    assert 0.01 <= machine.share_of_core(0.02) <= 1.0


def test_what_nobody_can_have_meant_is_refused_and_a_field_lets_it_be_done() -> None:
    """As of a scene in millimetres, which is a thousand times as long as it should be."""
    large = forecast_scan(blocks(1e6), 1000)
    assert large.pulses > MOST_PULSES
    with pytest.raises(InputError, match=r"scan.most_pulses is 5000000000: .* pulses, .* (days|hours) .*--allow-large"):
        check_scan_size(large)
    check_scan_size(large, large.pulses)
    with pytest.raises(InputError, match="most_pulses"):
        check_scan_size(large, large.pulses - 1)
    small = forecast_scan(blocks(10.0), 1000)
    check_scan_size(small)
    with pytest.raises(InputError, match="most_pulses is 5: "):
        check_scan_size(small, 5)


def test_a_scene_that_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "physical_memory", lambda: 8_000_000_000)
    scan = forecast_scan(blocks(1.0), 100_000_000)
    with pytest.raises(InputError, match="triangles take about 35 GB of memory, this machine has 8 GB"):
        check_scan_size(scan)
    check_scan_size(scan, MOST_PULSES)
    check_scan_size(replace(scan, scene_memory=1e9))
    monkeypatch.setattr(module, "physical_memory", lambda: None)
    check_scan_size(scan)
