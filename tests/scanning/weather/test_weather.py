"""The attenuation of the air against published tables, and its units."""

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.surroundings import Environment
from synthroads_addon.sampling.surroundings import WEATHER
from synthroads_addon.scanning.weather.base import Weather
from synthroads_addon.scanning.weather.conditions import Rain, Snow
from synthroads_addon.scanning.weather.extinction import (
    kim_exponent,
    kruse_exponent,
    snow_extinction,
    visibility_extinction,
)
from synthroads_addon.scanning.weather.registry import WEATHERS, weather_of
from synthroads_addon.scenario.scan import ScanScenario
from synthroads_addon.scenario.scenario import load_scenario

CONDITIONS = list(WEATHERS)
OF_ROADS = get_args(Environment.model_fields["weather"].annotation)

KIM = [
    # km, extinction at 905 and at 1550 nm (1/km), light that comes back over 100 m at 905 nm
    (23.0, 0.089, 0.044, 0.982),
    (10.0, 0.205, 0.102, 0.960),
    (4.0, 0.600, 0.354, 0.887),
    (1.0, 3.05, 2.33, 0.543),
    (0.5, 7.82, 7.82, 0.209),
    (0.2, 19.6, 19.6, 0.020),
    (0.05, 78.2, 78.2, 0.0),
]


@pytest.mark.parametrize(("kilometres", "at_905", "at_1550", "back"), KIM)
def test_visibility_table(kilometres, at_905, at_1550, back) -> None:
    visibility = 1000.0 * kilometres
    for wavelength, expected in ((905.0, at_905), (1550.0, at_1550)):
        got = visibility_extinction(visibility, wavelength, kim_exponent(visibility))
        assert 1000.0 * got == pytest.approx(expected, rel=6e-3)
    clear = WEATHERS["clear"](visibility=visibility)
    assert math.exp(-clear.attenuation(905.0) * 100.0) == pytest.approx(back, abs=6e-4)


@pytest.mark.parametrize(("rate", "decibels", "back"), [(5.0, 3.2, 0.864), (25.0, 9.3, 0.652), (50.0, 14.8, 0.506)])
def test_rain_table(rate, decibels, back) -> None:
    assert 1e4 * math.log10(math.exp(Rain(rate_mm_h=rate).extinction(905.0))) == pytest.approx(decibels, abs=0.05)
    rain = Rain(rate_mm_h=rate)
    for wavelength in (905.0, 1550.0):
        assert math.exp(-rain.attenuation(wavelength) * 100.0) == pytest.approx(back, abs=6e-4)


def test_snow_in_decibels_per_kilometre() -> None:
    wet, dry = (1e4 * math.log10(math.exp(snow_extinction(2.0, 1550.0, wet=wet))) for wet in (True, False))
    assert wet == pytest.approx((0.0001023 * 1550 + 3.785) * 2**0.72, rel=1e-3)
    assert dry == pytest.approx((5.42e-5 * 1550 + 5.496) * 2**1.38, rel=1e-3)
    assert Snow(rate_mm_h=2.0).extinction(1550.0) == snow_extinction(2.0, 1550.0)


def test_visibility_is_where_a_fiftieth_of_the_contrast_is_left() -> None:
    for condition in CONDITIONS:
        weather = WEATHERS[condition](visibility=1234.0)
        assert math.exp(-weather.extinction(550.0) * 1234.0) == pytest.approx(0.02)
        assert weather.attenuation(905.0) == 2.0 * weather.extinction(905.0)


def test_large_drops_dim_every_wavelength_alike_and_small_particles_do_not() -> None:
    ratio = {
        condition: WEATHERS[condition]().extinction(905.0) / WEATHERS[condition]().extinction(1550.0)
        for condition in CONDITIONS
    }
    assert [ratio[name] for name in ("fog", "rain", "snow")] == [1.0, 1.0, 1.0]
    assert all(ratio[name] > 1.4 for name in ("clear", "haze", "dust"))


def test_haze_and_dust_follow_kruse() -> None:
    assert kruse_exponent(1000.0) == pytest.approx(0.585)
    assert kruse_exponent(20_000.0) == kim_exponent(20_000.0) == 1.3
    assert kruse_exponent(60_000.0) == kim_exponent(60_000.0) == 1.6
    for condition in ("haze", "dust"):
        got = WEATHERS[condition](visibility=1000.0).extinction(1550.0)
        assert got == pytest.approx(math.log(50) / 1000 * (1550 / 550) ** -0.585)


@pytest.mark.parametrize("visibility", [500.0, 1000.0, 6000.0])
def test_kims_exponent_has_no_jumps_in_fog_and_haze(visibility) -> None:
    assert kim_exponent(visibility - 1e-6) == pytest.approx(kim_exponent(visibility), abs=1e-6)


def test_usual_visibilities_are_those_of_sampled_roads() -> None:
    assert {name: visibility for name, (visibility, _) in WEATHER.items()} == {
        name: WEATHERS[name].usual["visibility"] for name in OF_ROADS if name != "clear"
    }
    assert WEATHERS["clear"].usual["visibility"] == Environment.model_fields["visibility"].default


@pytest.mark.parametrize("condition", OF_ROADS)
def test_weather_of_a_road(condition) -> None:
    usual = WEATHERS[condition](visibility=WEATHERS[condition].usual["visibility"])
    assert weather_of(Environment(weather=condition)) == usual
    assert weather_of(Environment(weather=condition, visibility=321.0)).visibility == 321.0
    written = Environment.from_dict(Environment(weather=condition).to_dict())
    assert weather_of(written) == weather_of(Environment(weather=condition))


@given(st.sampled_from(CONDITIONS), st.floats(20, 200_000), st.floats(500, 2500))
def test_worse_visibility_never_dims_less(condition, visibility, wavelength) -> None:
    """Lasers from green on: at 50 km Kim's exponent jumps, which brightens ultraviolet by more than the air dims it."""
    here = WEATHERS[condition](visibility=visibility).attenuation(wavelength)
    assert math.isfinite(here)
    assert here > 0.0
    worse = WEATHERS[condition](visibility=max(20.0, visibility * 0.9)).attenuation(wavelength)
    assert worse >= here


def weather_in(**data: object) -> Weather | None:
    """Return the weather of a scan that says this of it."""
    return ScanScenario.from_dict({"weather": data}).weather


def test_a_scan_takes_the_weather_that_its_condition_names() -> None:
    assert [type(weather_in(condition=name)) for name in CONDITIONS] == list(WEATHERS.values())
    assert weather_in() == weather_in(condition=None) == WEATHERS["clear"]()
    assert weather_in(visibility=300) == WEATHERS["clear"](visibility=300)
    for name in CONDITIONS:
        given = {"condition": name, "visibility": 300.0}
        assert list(weather_in(**given).to_dict().items())[:2] == list(given.items())


REFUSED = {
    "unknown": ({"condition": "fgo"}, "condition is 'fgo'", "must be one of clear, haze, fog, rain, snow, dust"),
    "of others": ({"condition": "fog", "rate_mm_h": 5}, "weather", "can't be given for fog, only for rain, snow"),
    "of others, unnamed": ({"rate_mm_h": 5}, "weather", "can't be given for clear, only for rain, snow"),
    "both": ({"condition": "rain", "rate_mm_h": 5, "visibility": 500}, "weather", "can't both be given"),
    "too much": ({"condition": "snow", "rate_mm_h": 500}, "weather.rate_mm_h is 500", "less than or equal to 200"),
    "misspelt": ({"condition": "fog", "visibilty": 30}, "weather", "did you mean 'visibility'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_says_where_and_what_is_allowed(case: str) -> None:
    data, field, allowed = REFUSED[case]
    with pytest.raises(InputError) as caught:
        weather_in(**data)
    assert field in str(caught.value)
    assert allowed in str(caught.value)


@pytest.mark.parametrize("changes", [["condition=rain", "rate_mm_h=5"], ["condition=fog"], ["visibility=300"]])
def test_changes_reach_the_fields_of_a_weather(changes: list[str]) -> None:
    weather = load_scenario("rq31-600m-even", [f"scan.weather.{change}" for change in changes]).scan.weather
    wanted = {"condition": "clear"} | dict(change.split("=") for change in changes)
    if wanted["condition"] != "clear":
        wanted["echoes"] = "False"
    assert {name: str(value).removesuffix(".0") for name, value in weather.to_dict().items()} == wanted
