"""Wedge prisms against closed form and against rays that are traced face by face."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from synthroads_addon.scanning.devices.device import device_names, load_device
from synthroads_addon.scanning.devices.shots import shots
from tests.helpers.scenes.scanners import custom, mode, preset, wedges

WEDGES = [name for name in device_names() if load_device(name).pattern.type == "wedge_prism"]


def spectrum(across: np.ndarray, rate: float) -> np.ndarray:
    """Return the frequencies (1/s) of the two strongest turns of forward + i right, the strongest first."""
    window = np.hanning(len(across))
    power = np.abs(np.fft.fft(across * window))
    frequency = np.fft.fftfreq(len(across), 1 / rate)
    best = frequency[np.argmax(power)]
    power[np.abs(frequency - best) < 20 * rate / len(across)] = 0
    return np.array([best, frequency[np.argmax(power)]])


@pytest.mark.parametrize("name", WEDGES)
def test_wedge_prisms_against_their_data_sheets(name: str) -> None:
    d, s = load_device(name), preset(name)
    (m,) = d.modes
    rate = m.pulse_rate_khz * 1e3
    shot = shots(s, 0, 400_000)
    np.testing.assert_allclose(shot.time, np.arange(400_000) / rate, rtol=1e-12)
    x, y, z = shot.direction
    view = 2 * np.rad2deg(np.arctan2(np.hypot(x, y), -z)).max()
    assert view == pytest.approx(m.field_of_view_deg, abs=0.01)
    found = spectrum(x - 1j * y, rate)
    turns = np.array([wedge.turns for wedge in d.pattern.wedges]) / d.pattern.wedges[0].turns
    expected = turns * d.lines_per_second[1]
    if len(expected) == 1:
        assert found[0] == pytest.approx(expected[0], abs=0.3)
    else:
        np.testing.assert_allclose(np.sort(found), np.sort(expected), atol=0.3)


def cone(apex_deg: float, index: float) -> float:
    """Return the deflection (rad) of light that falls upright on a wedge: asin(n sin a) - a."""
    apex = math.radians(apex_deg)
    return math.asin(index * math.sin(apex)) - apex


@pytest.mark.parametrize(("apex", "index"), [(5.0, 1.5), (33.0, 1.509), (12.0, 3.4), (0.01, 1.5)])
def test_one_wedge_draws_a_cone(apex: float, index: float) -> None:
    s = wedges((apex, index, 1), rate_khz=100, lines=43.0)
    shot = shots(s, 0, 10_000, True)
    x, y, z = shot.direction
    half = np.arctan2(np.hypot(x, y), -z)
    np.testing.assert_allclose(half, cone(apex, index), atol=1e-12)
    phase = 2 * np.pi * 43.0 * np.arange(10_000) / 100e3
    np.testing.assert_allclose(x, np.sin(half) * np.cos(phase), atol=1e-11)
    np.testing.assert_allclose(-y, np.sin(half) * np.sin(phase), atol=1e-11)


def test_a_tilted_cone_meets_flat_ground_in_an_ellipse() -> None:
    tilt, height = math.radians(20.0), 60.0
    half = cone(30.0, 1.5)
    pattern = {"type": "wedge_prism", "wedges": [{"angle_deg": 30.0, "refractive_index": 1.5, "turns": 1}]}
    s = custom(pattern, modes=[mode(100, math.degrees(2 * half))], heads=[{"pitch_deg": 20.0}])
    x, y, z = shots(s, 0, 5000).direction
    x, y = -height * x / z, -height * y / z
    near, far = height * math.tan(tilt - half), height * math.tan(tilt + half)
    semi_axis = height * math.sin(half) / math.sqrt(math.cos(tilt) ** 2 - math.sin(half) ** 2)
    conic = ((x - (far + near) / 2) / ((far - near) / 2)) ** 2 + (y / semi_axis) ** 2
    np.testing.assert_allclose(conic, 1.0, atol=1e-9)


def snell(ray: np.ndarray, normal: np.ndarray, before: float, after: float) -> np.ndarray:
    """Refract one unit ray at a face, by angles: in the plane of incidence, sin(out) = before / after sin(in)."""
    cosine = ray @ normal
    across = ray - cosine * normal
    sine = before / after * np.linalg.norm(across)
    direction = across / np.linalg.norm(across) if np.linalg.norm(across) > 0 else across
    return math.sqrt(1 - sine**2) * normal + sine * direction


def traced(prism: list[tuple[float, float]], phases: list[float]) -> np.ndarray:
    """Trace a ray face by face; axes: forward, right, down."""
    ray = np.array([0.0, 0.0, 1.0])
    for (apex_deg, index), phase in zip(prism, phases, strict=True):
        apex = math.radians(apex_deg)
        ray = snell(ray, np.array([0.0, 0.0, 1.0]), 1.0, index)
        lean = -math.sin(apex)
        ray = snell(ray, np.array([lean * math.cos(phase), lean * math.sin(phase), math.cos(apex)]), index, 1.0)
    return ray


@pytest.mark.parametrize("turns", [(5, -3), (7, 2), (1, 1), (-4, 9)])
def test_two_wedges_draw_a_rosette(turns: tuple[int, int]) -> None:
    prism = [(18.0, 1.51), (14.0, 1.6)]
    lines = 40.0
    s = wedges((*prism[0], turns[0]), (*prism[1], turns[1]), rate_khz=1000.0, lines=lines)
    period = 1e6 / lines * abs(turns[0])  # pulses in which both wedges turn a whole number of times
    assert period == int(period)
    shot = shots(s, 0, 2 * int(period))
    x, y, z = shot.direction
    rate = 2 * np.pi * lines / 1e6
    for i in np.linspace(0, len(x) - 1, 200).astype(int):
        phases = [rate * i, rate * i * turns[1] / turns[0]]
        expected = traced(prism, phases)
        np.testing.assert_allclose([x[i], -y[i], -z[i]], expected, atol=1e-10)
    np.testing.assert_allclose(shot.direction[:, : int(period)], shot.direction[:, int(period) :], atol=1e-10)
    radius = np.arctan2(np.hypot(x, y), -z)
    petals = abs(turns[0] - turns[1])
    first = radius[: int(period)]
    if petals == 0:
        assert np.ptp(first) < 1e-12
        return
    bent = cone(*prism[0])
    outer, inner = (
        math.asin(1.6 * math.sin(math.radians(14.0) + math.asin(math.sin(sign * bent) / 1.6))) - math.radians(14.0)
        for sign in (1, -1)
    )
    assert first.max() == pytest.approx(outer, abs=1e-6)
    assert first.min() == pytest.approx(abs(inner), abs=1e-6)
    peaks = (first > np.roll(first, 1)) & (first >= np.roll(first, -1))
    assert np.count_nonzero(peaks) == petals


def test_a_wedge_turns_the_cross_section_by_the_shortest_way() -> None:
    shot = shots(preset("livox-mid-70"), 0, 2000, True)
    axis, right = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])
    for i in range(0, 2000, 97):
        d = shot.direction[:, i]
        turn_axis = np.cross(axis, d)
        sine = np.linalg.norm(turn_axis)
        k = turn_axis / sine
        # Rodrigues' formula.
        expected = right * (axis @ d) + np.cross(k, right) * sine + k * (k @ right) * (1 - axis @ d)
        np.testing.assert_allclose(shot.in_plane[:, i], expected, atol=1e-12)


@pytest.mark.parametrize("pulse", [0, 10**6, 10**9 + 7, 10**11 + 3])
def test_no_drift_after_billions_of_pulses(pulse: int) -> None:
    """Directions of late pulses against exact fractions of turns."""
    s = wedges((20.0, 1.5, 5), (20.0, 1.5, -3), rate_khz=100.0, lines=37.3)
    turned = [pulse * Fraction(37.3) * ratio / 100_000 % 1 for ratio in (1, Fraction(-3, 5))]
    expected = traced([(20.0, 1.5)] * 2, [2 * math.pi * float(turn) for turn in turned])
    x, y, z = shots(s, pulse, 1).direction[:, 0]
    # 1e-9 rad: 0.1 um at 100 m, a billion pulses (three hours) into the scan.
    np.testing.assert_allclose([x, -y, -z], expected, atol=1e-11 + 1e-18 * pulse)
