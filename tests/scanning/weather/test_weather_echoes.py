"""Echoes of rain, snow and fog against their published formulas, range by range."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate, stats

from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.weather.base import Weather
from synthroads_addon.scanning.weather.conditions import Fog, Rain, Snow
from synthroads_addon.scanning.weather.soft_target import soft_peak
from tests.helpers.scenes.scan_scenes import Standing, altered, middle_pulses, plane, scan_block, scan_of

RINGS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0])
DIVERGENCE = 4e-3
THRESHOLD = 2e-6


def in_weather(weather: Weather, threshold: float = THRESHOLD, path: Standing | None = None, **changes) -> ScanPlan:
    """Return a scan from above a plane, dimmed by nothing: the formulas are of the echoes."""
    plan = scan_of(
        plane(), path=path, threshold=threshold, divergence=(DIVERGENCE, DIVERGENCE), minimum_range=1.0, **changes
    )
    return altered(plan, effects=weather.effects())


def published(weather: Rain | Snow, low: float, high: float) -> float:
    """Return how many detected echoes a pulse has between two ranges, by Kilic's model with its distributions."""
    rate = weather.rate_mm_h
    assert rate is not None
    if isinstance(weather, Rain):
        intercept, slope, index = 8000.0, 4.1 * rate**-0.21, 1.328
    else:
        intercept, slope, index = 3800.0 * rate**-0.87, 2.55 * rate**-0.48, 1.3031
    reflected = ((index - 1) / (index + 1)) ** 2

    def density(reach: float) -> float:
        width = DIVERGENCE * reach
        least = max(0.05, 1e3 * width * np.sqrt(THRESHOLD * reach**2 / reflected))
        dark = reflected < THRESHOLD * reach**2
        return 0.0 if dark else float(np.pi / 4 * width**2 * intercept / slope * np.exp(-slope * least))

    return float(integrate.quad(density, low, high, limit=200)[0])


@pytest.mark.parametrize("weather", [Rain(rate_mm_h=20.0, echoes=True), Snow(rate_mm_h=3.0, echoes=True)])
def test_drops_and_flakes_are_met_as_often_as_published_in_every_ring(weather: Rain | Snow) -> None:
    plan = altered(in_weather(weather), setting=replace(in_weather(weather).setting, range_resolution=0.0))
    result = scan_block(plan, plan.path.strips[0], 0)
    air = result.points.class_id == UNLABELLED
    found = np.histogram(result.points.range[air], RINGS)[0]
    expected = np.array([published(weather, *ring) for ring in pairwise(RINGS)]) * result.pulses
    assert stats.chi2.sf(np.sum((found - expected) ** 2 / expected), len(expected)) > 0.001
    many = expected > 4000
    assert many.sum() >= 2
    np.testing.assert_allclose(found[many], expected[many], rtol=0.05)
    assert found.sum() == pytest.approx(expected.sum(), rel=0.05)


def test_what_is_met_hides_the_drops_behind_it() -> None:
    """From 3 m above a plane pulses have as many echoes as there are drops above it, at every slant."""
    weather = Rain(rate_mm_h=2.0, echoes=True)
    plan = in_weather(weather, path=Standing(3.0), field_of_view=2.6, range_resolution=0.0)
    result = scan_block(plan, plan.path.strips[0], 0)
    points = result.points
    air = points.class_id == UNLABELLED
    reach = 3.0 / np.cos(np.deg2rad(points.scan_angle_deg.astype(np.float64)))
    assert (points.range[air] < reach[air]).all()
    ground = reach[~air]
    expected = np.mean([published(weather, 1.0, near) for near in np.quantile(ground, (np.arange(40) + 0.5) / 40)])
    assert air.sum() > 1000
    assert air.sum() == pytest.approx(expected * result.pulses, rel=0.05)


def test_fog_s_echo_is_the_peak_of_the_published_integral() -> None:
    fog = Fog(visibility=80.0, echoes=True)
    plan = in_weather(fog, receiver=Receiver(overlap_begin=1.0, overlap_full=3.0))
    extinction, width = fog.extinction(905.0), plan.setting.range_resolution
    plan = altered(plan, attenuation=2 * extinction)

    def power(reach: float) -> float:
        def back(behind: float) -> float:
            place = reach + width - behind
            share = min(max((place - 1.0) / 2.0, 0.0), 1.0)
            if place < 1.0:
                return 0.0
            return float(np.sin(np.pi * behind / 2 / width) ** 2 * share * np.exp(-2 * extinction * place) / place**2)

        return float(np.pi * 0.046 / (np.log(20) / extinction) * integrate.quad(back, 0, 2 * width, limit=200)[0])

    reach = np.linspace(1.0, 6.0, 501)
    expected = np.array([power(place) for place in reach])
    distance, peak = soft_peak(plan.setting, extinction)
    assert distance == pytest.approx(reach[expected.argmax()], abs=0.02)
    assert peak == pytest.approx(expected.max(), rel=0.01)
    points = middle_pulses(altered(plan, setting=replace(plan.setting, threshold=0.5 * peak)), 100).points
    fogged = points.class_id == UNLABELLED
    assert fogged.sum() == 100
    np.testing.assert_allclose(points.range[fogged], distance, atol=1e-6)
    np.testing.assert_allclose(points.intensity[fogged], peak, rtol=1e-3)


def test_faint_fog_is_detected_by_chance() -> None:
    fog = Fog(visibility=80.0, echoes=True)
    plan = altered(in_weather(fog), attenuation=2 * fog.extinction(905.0))
    _, peak = soft_peak(plan.setting, fog.extinction(905.0))
    receiver = Receiver(threshold_to_noise=5.0)
    plan = altered(plan, setting=replace(plan.setting, threshold=peak / 0.9, receiver=receiver))
    result = scan_block(plan, plan.path.strips[0], 0)
    found = np.count_nonzero(result.points.class_id == UNLABELLED)
    chance = stats.norm.cdf(5.0 * (0.9 - 1.0))
    assert stats.binomtest(found, result.pulses, chance).pvalue > 0.001


def test_no_echo_unless_wanted_and_the_scheme_s_class_for_noise() -> None:
    assert Rain().effects() == Snow().effects() == Fog().effects() == ()
    plan = altered(in_weather(Rain(rate_mm_h=50.0, echoes=True)), air_class=42)
    assert set(scan_block(plan, plan.path.strips[0], 0).points.class_id) == {1, 42}


def test_a_visibility_has_the_rate_of_the_same_extinction() -> None:
    for model in (Rain, Snow):
        weather = model(visibility=900.0)
        assert model(rate_mm_h=weather.rate(905.0)).extinction(905.0) == pytest.approx(weather.extinction(905.0))
