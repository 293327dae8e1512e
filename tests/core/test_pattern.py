"""The rotating mirror's pulses against closed form, and settings that contradict each other."""

import numpy as np
import pytest

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.parameters.geometry import RoadGeometry
from synthroads_addon.core.parameters.sampler import sample_road
from synthroads_addon.core.scanning.devices import device_names, load_device, scanner_setting
from synthroads_addon.core.scanning.path import FlightPath
from synthroads_addon.core.scanning.pattern import pulse_count, rotating_mirror
from synthroads_addon.core.scenario import Scenario, apply_change, load_scenario


def setting(*changes: str):
    return scanner_setting(load_scenario("rq31-600m", list(changes)).scan)


def path(*changes: str) -> FlightPath:
    scenario = load_scenario("rq31-600m", list(changes))
    return FlightPath(RoadGeometry(sample_road(scenario.road, 1)), scenario.scan.platform)


def test_demo_setting() -> None:
    s = setting()
    assert np.rad2deg(s.angle_step) == pytest.approx(360 * 100 / 200_000)
    assert s.pulses_per_line == 1000
    assert s.range_resolution == pytest.approx(0.5996, abs=1e-3)
    assert s.threshold * 113.0**2 == pytest.approx(0.2)


def test_every_preset_mode_is_consistent() -> None:
    for name in device_names():
        device = load_device(name)
        for mode in device.modes:
            s = setting(
                f"scan.device={name}",
                f"scan.pulse_rate_khz={mode.pulse_rate_khz}",
                f"scan.field_of_view_deg={mode.field_of_view_deg}",
                f"scan.lines_per_second={device.lines_per_second[1]}",
            )
            assert s.pulses_per_line * s.angle_step <= s.field_of_view * (1 + 1e-9)
            # The pulses of a line are fired before the next line begins.
            assert s.pulses_per_line / s.pulse_rate <= 1 / s.lines_per_second * (1 + 1e-9)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ("scan.pulse_rate_khz=150", "scan.pulse_rate_khz"),
        ("scan.field_of_view_deg=200", "scan.field_of_view_deg"),
        ("scan.lines_per_second=101", "scan.lines_per_second"),
        ("scan.device=riegl-minivux", "scan.device"),
    ],
)
def test_impossible_settings_are_refused(change: str, field: str) -> None:
    with pytest.raises(InputError, match=field.replace(".", r"\.")):
        setting(change)


def test_too_fine_an_angle_is_refused() -> None:
    with pytest.raises(InputError, match=r"angle step of 0\.012"):
        setting("scan.pulse_rate_khz=300", "scan.field_of_view_deg=120", "scan.lines_per_second=10")


def test_pulses_against_closed_form() -> None:
    s, p = setting(), path()
    strip = p.strips[0]
    assert pulse_count(s, strip) == 7_500_000
    pulses = rotating_mirror(s, p, strip, 123_000, 2000)
    assert pulses.time[0] == pytest.approx(1.23)
    np.testing.assert_allclose(np.diff(pulses.time[:1000]), 1 / 200_000, rtol=1e-6)
    assert pulses.time[1000] == pytest.approx(1.24)
    np.testing.assert_allclose(np.rad2deg(pulses.scan_angle[:1000]), -89.91 + 0.18 * np.arange(1000), atol=1e-9)
    np.testing.assert_allclose(pulses.direction[:, 2], -np.cos(pulses.scan_angle), atol=1e-12)
    for a, b in (("direction", "in_plane"), ("direction", "across"), ("in_plane", "across")):
        np.testing.assert_allclose((getattr(pulses, a) * getattr(pulses, b)).sum(axis=1), 0, atol=1e-12)
    for name in ("direction", "in_plane", "across"):
        np.testing.assert_allclose(np.linalg.norm(getattr(pulses, name), axis=1), 1, atol=1e-12)


def test_blocks_join_without_seam() -> None:
    s, p = setting(), path()
    whole = rotating_mirror(s, p, p.strips[1], 5000, 3000)
    parts = [rotating_mirror(s, p, p.strips[1], 5000 + k, 1000) for k in (0, 1000, 2000)]
    np.testing.assert_array_equal(whole.direction, np.concatenate([x.direction for x in parts]))
    np.testing.assert_array_equal(whole.origin, np.concatenate([x.origin for x in parts]))


def test_path_keeps_height_offset_speed_and_sides() -> None:
    p = path()
    geometry = p.geometry
    for strip in p.strips:
        time = strip.start_time + np.linspace(0, strip.duration, 200)
        position, heading = p.pose(strip, time)
        station, offset = geometry.alignment.project(position[:, :2])
        np.testing.assert_allclose(offset, strip.lateral_offset, atol=1e-6)
        np.testing.assert_allclose(position[:, 2] - geometry.profile.elevation(station), 60.0, atol=1e-6)
        sign = 1 if strip.forward else -1
        np.testing.assert_allclose(np.diff(station), sign * 8.0 * np.diff(time), atol=1e-5)
        track = np.diff(position[:, :2], axis=0)
        facing = np.stack([np.cos(heading), np.sin(heading)], axis=1)[:-1]
        assert np.all((track * facing).sum(axis=1) > 0.99 * np.linalg.norm(track, axis=1))


def test_positive_scan_angle_looks_to_the_right() -> None:
    s, p = setting(), path("road.radius.maximum=900")
    pulses = rotating_mirror(s, p, p.strips[0], 0, 1000)
    _station, offset = p.geometry.alignment.project((pulses.origin + pulses.direction)[:, :2])
    right = pulses.scan_angle > 0.01
    assert np.all(offset[right] < p.strips[0].lateral_offset)


def test_changes_are_applied_and_unknown_keys_named() -> None:
    data = apply_change({"a": {"b": 1}}, "a.c=[1,2]")
    assert data == {"a": {"b": 1, "c": [1, 2]}}
    with pytest.raises(InputError, match="did you mean 'platform'"):
        load_scenario("rq31-600m", ["scan.platfrom.height=3"])
    assert Scenario.from_dict(load_scenario("rq31-600m").to_dict()) == load_scenario("rq31-600m")
