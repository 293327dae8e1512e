"""Scan patterns, measured in the directions and times of their shots, against closed form and the presets' numbers."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from synthroads_addon.base.rotations import rotation_matrix
from synthroads_addon.scanning.devices.device import Device, PulseMode, ScannerSetting, device_names, load_device
from synthroads_addon.scanning.devices.shots import _cycle_table, shot_count, shot_run, shots
from synthroads_addon.scanning.patterns.base import PulseRays
from tests.helpers.scenes.scanners import custom, mode, preset, wedges

MODES = [(name, m) for name in device_names() for m in load_device(name).modes]
LINES = [(name, m) for name, m in MODES if "mirror" in load_device(name).pattern.type or name == "generic-grid"]
HEADS = [(name, m) for name, m in MODES if load_device(name).pattern.type == "rotating_head"]


def label(value: Any) -> str:
    """Name a case by device and pulse rate."""
    return value if isinstance(value, str) else f"{value.pulse_rate_khz:g}kHz"


def off_nadir(direction: np.ndarray) -> np.ndarray:
    """Return angles (P,) from the nadir, positive to the right, of directions across the forward direction."""
    return np.arctan2(-direction[1], -direction[2])


def of_head(shot: PulseRays, device: Device, head: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and directions of one head, in that head's own frame."""
    mine = shot.beam // device.pattern.beams == head
    h = device.heads[head]
    turn = rotation_matrix(*np.deg2rad([h.yaw_deg, h.pitch_deg, h.roll_deg]))
    return shot.time[mine], turn.T @ shot.direction[:, mine]


def expected_step_deg(device: Device, m: PulseMode, lines: float) -> float:
    """Return the angle step as each pattern defines it, from the preset's numbers alone."""
    rate, pattern = m.pulse_rate_khz * 1e3, device.pattern
    if pattern.type == "rotating_mirror":
        return pattern.turn_per_line_deg * lines / rate
    return m.field_of_view_deg * lines / rate


def line_starts(angle: np.ndarray, expected_step: float) -> np.ndarray:
    """Return the numbers of the first pulses of lines: the beam has jumped back, or rests at a turning point."""
    step = np.diff(angle) / expected_step
    return np.concatenate([[0], np.flatnonzero((step < -1.5) | (np.abs(step) < 0.5)) + 1])


@pytest.mark.parametrize("share", [1.0, 0.617], ids=["fastest", "slower"])
@pytest.mark.parametrize(("name", "m"), LINES, ids=label)
def test_line_scanners_against_their_data_sheets(name: str, m: PulseMode, share: float) -> None:
    d = load_device(name)
    lines = d.lines_per_second[1] * share
    s = preset(name, pulse_rate_khz=m.pulse_rate_khz, lines_per_second=lines)
    shot = shots(s, 0, shot_count(s, 4.0 / lines))
    for head in range(len(d.heads)):
        time, direction = of_head(shot, d, head)
        # The rows of a grid lean forward, so that only their sine across is that of the angle in their plane.
        angle = np.arcsin(-direction[1]) if d.pattern.type == "grid" else off_nadir(direction)
        step = math.radians(expected_step_deg(d, m, lines))
        starts = line_starts(angle, step)
        assert len(starts) == 4
        first = slice(0, starts[1])
        np.testing.assert_allclose(np.abs(np.diff(angle[first])), step, rtol=1e-6)
        np.testing.assert_allclose(np.diff(time[first]), 1e-3 / m.pulse_rate_khz, rtol=1e-6)
        np.testing.assert_allclose(np.diff(time[starts]), 1 / lines, rtol=1e-9)
        # As many steps as fit: what is left of the field of view is less than one.
        covered, view = np.ptp(angle[first]) + step, math.radians(m.field_of_view_deg)
        assert view - step < covered <= view * (1 + 1e-9)
        centre = math.degrees((angle[first].max() + angle[first].min()) / 2)
        assert centre == pytest.approx(d.pattern.centre_from_nadir_deg, abs=1e-6)


@pytest.mark.parametrize(("name", "m"), HEADS, ids=label)
def test_rotating_heads_against_their_data_sheets(name: str, m: PulseMode) -> None:
    d = load_device(name)
    beams = d.pattern.elevations_deg
    for turns in d.lines_per_second:
        s = preset(name, lines_per_second=turns)
        shot = shots(s, 0, shot_count(s, 2.0 / turns))
        assert shot_count(s, 2.0 / turns) / (2.0 / turns) == pytest.approx(m.pulse_rate_khz * 1e3, rel=1e-3)
        for channel, elevation in enumerate(beams):
            mine = shot.beam == channel
            x, y, z = shot.direction[:, mine]
            np.testing.assert_allclose(np.rad2deg(np.arcsin(z)), elevation, atol=1e-10)
            azimuth, time = np.arctan2(-y, x), shot.time[mine]
            np.testing.assert_allclose(shot.scan_angle[mine], azimuth, atol=1e-12)
            # The head itself begins half a turn to the left, in whole steps.
            aside = d.pattern.azimuths_deg[channel] if d.pattern.azimuths_deg else 0.0
            head = turns * (time[0] - len(azimuth) // 2 * (len(beams) / (m.pulse_rate_khz * 1e3)) / 2)
            assert math.remainder(azimuth[0] - math.radians(aside) - math.tau * head, math.tau) == pytest.approx(
                0.0, abs=1e-9
            )
            step = np.diff(np.unwrap(azimuth))
            sequence = len(beams) / (m.pulse_rate_khz * 1e3)
            n = len(azimuth) // 2  # of the first turn
            np.testing.assert_allclose(step[: n - 1], 2 * np.pi * turns * sequence, rtol=1e-6)
            np.testing.assert_allclose(np.diff(time[:n]), sequence, rtol=1e-6)
            assert time[n] - time[0] == pytest.approx(1 / turns)
            assert math.radians(360) - step[0] < step[0] * n <= math.radians(360) * (1 + 1e-9)


def test_beams_fire_at_their_times_while_the_head_turns() -> None:
    s = preset("velodyne-vlp-16", lines_per_second=20.0)
    shot = shots(s, 0, 48)
    np.testing.assert_array_equal(shot.beam, np.tile(np.arange(16), 3))
    np.testing.assert_allclose(shot.time[:16] - shot.time[0], np.arange(16) * 2.304e-6, atol=1e-15)
    azimuth = np.arctan2(-shot.direction[1], shot.direction[0])
    np.testing.assert_allclose(azimuth - azimuth[0], 2 * np.pi * 20 * shot.time, atol=1e-9)
    np.testing.assert_allclose(shot.scan_angle, azimuth, atol=1e-12)
    # One laser of each block at a time.
    pairs = shots(preset("velodyne-hdl-64e"), 0, 64)
    np.testing.assert_array_equal(pairs.beam.reshape(-1, 2), np.stack([np.arange(32), np.arange(32, 64)], axis=1))
    np.testing.assert_array_equal(pairs.time[::2], pairs.time[1::2])
    # Without times: one after the other, at the pulse rate.
    even = custom({"type": "rotating_head", "elevations_deg": [1.0, -5.0, 3.0]})
    np.testing.assert_allclose(np.diff(shots(even, 0, 30).time), 1e-5, rtol=1e-9)


def test_the_data_sheet_of_the_minivux() -> None:
    s = preset("riegl-minivux-3uav", pulse_rate_khz=200)
    shot = shots(s, 123_000, 2000)
    assert shot.time[0] == pytest.approx(1.23)
    assert shot.time[1000] == pytest.approx(1.24)
    np.testing.assert_allclose(np.rad2deg(shot.scan_angle[:1000]), -89.91 + 0.18 * np.arange(1000), atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(off_nadir(shot.direction)), np.rad2deg(shot.scan_angle), atol=1e-9)
    assert shot_count(s, 75.0) == 7_500_000


def test_only_whole_lines_are_counted() -> None:
    s = preset("riegl-minivux-3uav", pulse_rate_khz=200)
    assert shot_count(s, 0.0999999) == 9 * 1000
    assert shot_count(s, 0.1) == 10 * 1000
    assert shot_count(s, 0.0) == 1000
    assert shot_count(preset("riegl-vq-450", lines_per_second=200), 0.1) == 2 * 20 * 2750
    assert shot_count(preset("livox-mid-70"), 0.1) == 10_000
    assert shot_count(preset("livox-mid-70"), 0.0) == 1


MIRROR = {"modes": [mode(10.37, 50.0)], "lines_per_second": [7.0, 7.0], "finest_angle_deg": 1e-4}


@pytest.mark.parametrize("motion", ["triangular", "sinusoidal"])
@pytest.mark.parametrize("centre", [0.0, 30.0])
def test_oscillating_mirror_follows_its_motion(motion: str, centre: float) -> None:
    """One continuous motion of time, though neither line nor period is a whole number of pulses."""
    pattern = {"type": "oscillating_mirror", "motion": motion, "centre_from_nadir_deg": centre}
    s = custom(pattern, **MIRROR)
    count = int(10_370 / 7)
    shot = shots(s, 0, 6 * count)
    # Pulses lie symmetrically in a line, so that the first one isn't at the turning point.
    phase = (shot.time + (1 / 7 - (count - 1) / 10_370) / 2) * 7
    motions = {"triangular": 25.0 - 50.0 * np.abs(phase % 2 - 1), "sinusoidal": 25.0 * np.sin(np.pi * (phase - 0.5))}
    swing = motions[motion]
    np.testing.assert_allclose(np.rad2deg(shot.scan_angle), centre + swing, atol=1e-8)
    np.testing.assert_allclose(off_nadir(shot.direction), shot.scan_angle, atol=1e-12)
    # It turns back at the edges of the field of view, once per line.
    turning = np.flatnonzero(np.diff(np.sign(np.diff(shot.scan_angle)))) // count
    assert set(turning) == {0, 1, 2, 3, 4}
    half = np.rad2deg(np.abs(shot.scan_angle - math.radians(centre))).max()
    assert 25.0 - 50.0 * 7 / 10_370 < half <= 25.0
    steps = np.abs(np.diff(shot.scan_angle[:count]))
    assert steps.max() == pytest.approx(s.angle_step, rel=1e-5)


def test_grid_on_the_ground() -> None:
    s = custom(
        {"type": "grid", "rows": 5, "along_field_deg": 20.0}, modes=[mode(100, 30.0)], lines_per_second=[1000, 1000]
    )
    shot = shots(s, 0, shot_count(s, 0.01))
    assert shot.time.size == 10 * 100
    across = np.rad2deg(np.arcsin(-shot.direction[1])).reshape(10, 100)
    np.testing.assert_allclose(across, np.tile(-14.85 + 0.3 * np.arange(100), (10, 1)), atol=1e-10)
    along = np.rad2deg(np.arctan2(shot.direction[0], -shot.direction[2])).reshape(10, 100)
    rows = np.tile([-8.0, -4.0, 0.0, 4.0, 8.0], 2)
    np.testing.assert_allclose(along, np.repeat(rows[:, None], 100, axis=1), atol=1e-10)


EVERY = [*device_names(), "finest", "tilted heads"]


def any_setting(name: str) -> ScannerSetting:
    """Return a preset's setting, or one of those that no preset has."""
    if name == "finest":
        return finest()
    if name == "tilted heads":
        heads = [{"roll_deg": 10.0, "pitch_deg": 20.0, "yaw_deg": 30.0}, {"pitch_deg": -20.0}, {"roll_deg": 90.0}]
        return custom({"type": "rotating_head", "elevations_deg": [3.0, -7.0]}, heads=heads)
    return preset(name)


def finest() -> ScannerSetting:
    """Return a full circle in steps of 0.001 deg: more pulses per line than are kept in a table."""
    return custom(
        {"type": "rotating_mirror"},
        {"angle_step_deg": 0.001},
        modes=[mode(1000.0, 360.0)],
        lines_per_second=[1.0, 10.0],
    )


@pytest.mark.parametrize("name", EVERY)
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_slices_equal_the_whole(name: str, data: st.DataObject) -> None:
    s = any_setting(name)
    begin = data.draw(st.integers(0, 2_000_000), label="begin")
    size = data.draw(st.integers(2, 3000), label="size")
    cut = data.draw(st.integers(1, size - 1), label="cut")
    framed = data.draw(st.booleans(), label="with_frame")
    whole = shots(s, begin, size, framed)
    parts = [shots(s, begin, cut, framed), shots(s, begin + cut, size - cut, framed)]
    for field in ("time", "scan_angle", "direction", "in_plane", "across", "beam"):
        value = getattr(whole, field)
        if value is None:
            assert not framed
            continue
        joined = np.concatenate([getattr(part, field) for part in parts], axis=-1)
        np.testing.assert_array_equal(value, joined)
    assert (whole.in_plane is None) is (not framed)
    run, rows = shot_run(s, begin, size, framed), np.arange(cut, size, 2)
    for field in ("scan_angle", "direction", "in_plane", "across", "beam"):
        value, some = getattr(whole, field), run.column(field, rows)
        assert (value is None) is (some is None)
        if some is not None:
            np.testing.assert_array_equal(some, value[..., rows])


@pytest.mark.parametrize("name", [name for name in EVERY if len(any_setting(name).device.heads) == 1])
def test_cycles_repeat(name: str) -> None:
    """Shots looked up in a table of one cycle are those of the pulses' own numbers."""
    s = any_setting(name)
    first = 3 * shot_count(s, 700 / s.lines_per_second) + 17
    shot, alone = shots(s, first, 500), s.device.pattern.rays(s.timing, np.arange(first, first + 500), False)
    np.testing.assert_allclose(shot.time, alone.time, rtol=1e-15)
    np.testing.assert_allclose(shot.scan_angle, alone.scan_angle, atol=1e-12)
    np.testing.assert_allclose(shot.direction, alone.direction, atol=1e-12)


def test_long_cycles_are_not_kept() -> None:
    _cycle_table.cache_clear()
    shots(finest(), 0, 10)
    assert _cycle_table.cache_info().currsize == 0
    shots(preset("generic-polygon"), 0, 10)
    assert _cycle_table.cache_info().currsize == 1


@pytest.mark.parametrize("name", EVERY)
def test_axes_are_orthonormal_and_times_increase(name: str) -> None:
    s = any_setting(name)
    shot = shots(s, 0, min(300_000, shot_count(s, 3 / s.lines_per_second)), True)
    frame = np.stack([shot.direction, shot.in_plane, shot.across])
    products = np.einsum("aip,bip->abp", frame, frame)
    np.testing.assert_allclose(products, np.repeat(np.eye(3)[:, :, None], shot.time.size, axis=2), atol=1e-12)
    assert shot.time[0] == 0
    steps = np.diff(shot.time)
    together = name in ("ouster-os1-64", "velodyne-hdl-64e", "velodyne-vlp-32c")
    assert (steps >= 0).all() if together else (steps > 0).all()
    assert set(shot.beam) == set(range(s.device.channels))


@pytest.mark.parametrize("name", ["riegl-minivux-3uav", "riegl-vz-600i", "generic-grid", "velodyne-vlp-16"])
def test_in_plane_is_where_the_beam_goes(name: str) -> None:
    s = preset(name)
    beams = s.device.pattern.beams
    shot = shots(s, 100 * beams, 3 * beams, True)
    for channel in range(0, beams, 5):
        d = shot.direction[:, shot.beam == channel]
        travel = d[:, 2] - d[:, 0]
        towards = shot.in_plane[:, shot.beam == channel][:, 1]
        assert travel @ towards == pytest.approx(np.linalg.norm(travel), rel=1e-9)


def test_axes_at_the_nadir_point_right_and_forward() -> None:
    s = custom({"type": "polygon_mirror"}, modes=[mode(100, 60.0)], lines_per_second=[10, 99.9900009999])
    shot = shots(s, 500, 1, True)
    np.testing.assert_allclose(shot.direction[:, 0], [0, 0, -1], atol=1e-3)
    np.testing.assert_allclose(shot.in_plane[:, 0], [0, -1, 0], atol=1e-3)
    np.testing.assert_allclose(shot.across[:, 0], [1, 0, 0], atol=1e-3)
    # A wedge that hardly deflects.
    shot = shots(wedges((0.01, 1.5, 1)), 0, 1000, True)
    np.testing.assert_allclose(shot.in_plane, np.tile([[0], [-1], [0]], 1000), atol=1e-3)
    np.testing.assert_allclose(shot.across, np.tile([[1], [0], [0]], 1000), atol=1e-3)


@pytest.mark.parametrize("name", device_names())
def test_positive_scan_angles_look_to_the_right(name: str) -> None:
    s = preset(name)
    shot = shots(s, 0, min(200_000, shot_count(s, 2 / s.lines_per_second)))
    d = s.device
    for head in range(len(d.heads)):
        mine = shot.beam // d.pattern.beams == head
        _, direction = of_head(shot, d, head)
        side = np.sin(shot.scan_angle[mine])
        clear = np.abs(side) > 1e-6
        np.testing.assert_array_equal(np.sign(-direction[1, clear]), np.sign(side[clear]))


def test_two_heads_cross_their_lines() -> None:
    s = preset("riegl-vq-450")
    shot = shots(s, 0, 4 * s.pulses_per_line)
    np.testing.assert_array_equal(shot.beam, np.tile([0, 1], 2 * s.pulses_per_line))
    for head, forward in enumerate(([1, 1, 0], [1, -1, 0])):
        d = shot.direction[:, head::2]
        np.testing.assert_allclose(np.array(forward) @ d, 0, atol=1e-12)
    # They fire in turn, each at the pulse rate.
    np.testing.assert_allclose(np.diff(shot.time[: s.pulses_per_line]), 1 / 1.1e6, rtol=1e-6)


def test_point_spacing_on_flat_ground() -> None:
    """60 m above ground at 8 m/s, 200 kHz and 100 lines/s: 0.08 m along, 0.1885 m across at the nadir."""
    height, speed = 60.0, 8.0
    s = preset("riegl-minivux-3uav", pulse_rate_khz=200, lines_per_second=100)
    shot = shots(s, 0, shot_count(s, 1.0))
    ground = speed * shot.time - height * shot.direction[0] / shot.direction[2]
    sideways = -height * shot.direction[1] / shot.direction[2]
    below = np.abs(shot.scan_angle) < math.radians(1.0)
    lines = np.flatnonzero(np.diff(shot.time) > 0.75 * 0.01 / 2)
    assert len(lines) == 99
    spacing = np.abs(np.diff(sideways[: lines[0]]))[below[: lines[0] - 1]]
    np.testing.assert_allclose(spacing, 60 * math.radians(0.18), rtol=0.01)
    middle = ground[500::1000]
    np.testing.assert_allclose(np.diff(middle), 0.08, rtol=0.01)


def test_the_finest_angle_step_is_exact() -> None:
    s = finest()
    assert s.pulses_per_line == 360_000
    step = Fraction(360, 360_000)
    first = 360_000 * 40_000 + 123_456  # the 14-billionth pulse
    shot = shots(s, first, 1000, True)
    angle = [float((123_456 + i - Fraction(360_000 - 1, 2)) * step) for i in range(1000)]
    np.testing.assert_allclose(np.rad2deg(off_nadir(shot.direction)), angle, atol=1e-10)
    np.testing.assert_allclose(np.diff(np.rad2deg(off_nadir(shot.direction))), 0.001, rtol=1e-9)
    exact = [Fraction(first + i, 1_000_000) for i in range(1000)]
    lines = Fraction(s.lines_per_second)
    assert abs(lines - Fraction(1000, 360)) < Fraction(1, 10**12)
    assert max(abs(Fraction(t) - e) for t, e in zip(shot.time.tolist(), exact, strict=True)) < Fraction(1, 10**10)


@pytest.mark.parametrize("step", [0.001, 0.01, 0.02])
def test_a_step_that_divides_the_field_of_view_loses_no_pulse(step: float) -> None:
    """In floating point 30 deg hold 29,999.999999999993 steps of 0.001 deg."""
    s = custom(
        {"type": "rotating_mirror"},
        {"angle_step_deg": step},
        modes=[mode(100.0, 30.0)],
        lines_per_second=[0.01, 9000.0],
        finest_angle_deg=0.0005,
    )
    assert s.pulses_per_line == round(30.0 / step)


@pytest.mark.parametrize("pulse", [0, 10**6, 10**9 + 7, 10**11 + 3])
def test_no_drift_after_billions_of_pulses(pulse: int) -> None:
    """Times and angles of late pulses against exact fractions."""
    s = custom({"type": "polygon_mirror"}, {"lines_per_second": 37.3}, modes=[mode(123.457, 60.0)])
    per_line = math.floor(Fraction(123_457) / Fraction(37.3))
    line, within = divmod(pulse, per_line)
    shot = shots(s, pulse, 1)
    exact = line / Fraction(37.3) + Fraction(within, 123_457)
    assert shot.time[0] == pytest.approx(float(exact), rel=4e-16, abs=1e-18)
    angle = (within - Fraction(per_line - 1, 2)) * 60 * Fraction(37.3) / 123_457
    assert math.degrees(shot.scan_angle[0]) == pytest.approx(float(angle), abs=1e-11)


@pytest.mark.parametrize("name", ["riegl-vq-780i", "velodyne-hdl-64e", "riegl-minivux-3uav"])
def test_a_mirror_by_a_clock_of_its_own(name: str) -> None:
    """Lines begin anywhere within half a step, angles follow the times at the mirror's rate, and stay in the view."""
    locked, free = preset(name), preset(name, mirror_clock="free")
    heads, lines = len(free.device.heads), 200
    line = free.pulses_per_line * heads
    apart = np.empty((lines, 2))
    for number in range(lines):
        usual, shot = (shots(setting, number * line, line) for setting in (locked, free))
        delay, turn = shot.time - usual.time, shot.scan_angle - usual.scan_angle
        turn -= math.tau * np.round(turn / math.tau)  # angles of a head that looks all around
        # The first head's pulses of a line are all late by the same time, and turned by the same angle.
        assert np.ptp(delay[::heads]) < 1e-9
        assert np.ptp(turn[::heads]) < 1e-6
        apart[number] = delay[0], turn[0]
        assert (np.diff(shot.time) >= 0.0).all()
    beams = free.device.pattern.beams
    share = apart[:, 0] * free.pulse_rate / beams
    assert share.min() >= 0.0
    assert share.max() < 1.0
    counts = np.bincount((share * 10).astype(int), minlength=10)
    assert stats.chisquare(counts).pvalue > 0.001
    assert abs(np.corrcoef(share[1:], share[:-1])[0, 1]) < 0.25
    np.testing.assert_allclose(np.abs(apart[:, 1]), np.abs(share - 0.5) * free.angle_step, atol=1e-9)
    assert np.abs(shot.scan_angle).max() <= np.abs(usual.scan_angle).max() + free.angle_step


def test_a_free_mirror_gives_any_slice_the_same() -> None:
    free = preset("riegl-vq-780i", mirror_clock="free")
    whole, part = shots(free, 0, 30_000, True), shots(free, 12_345, 100, True)
    for name in ("time", "scan_angle", "direction", "in_plane", "across"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[..., 12_345:12_445])
    assert len(np.unique(whole.scan_angle)) > 5 * len(np.unique(shots(preset("riegl-vq-780i"), 0, 30_000).scan_angle))


@pytest.mark.parametrize("device", ["velodyne-vlp-16", "riegl-vq-450"])
def test_a_whole_turn_by_a_clock_of_its_own_keeps_its_scan_angles_within_half_a_turn(device: str) -> None:
    angles = shots(preset(device, mirror_clock="free"), 0, 300_000).scan_angle
    assert np.abs(angles).max() <= np.pi
    assert np.abs(angles).max() > np.deg2rad(179.5)
