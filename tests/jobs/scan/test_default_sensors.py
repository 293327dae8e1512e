"""The shipped scans have the errors of real sensors, each of which can be left out; the even ones have few."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon import scan_to_arrays
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.scenario.without import scenario_without

REAL, EVEN = "airborne-1000m", "airborne-1000m-even"
SMALL = ("road.length=60", "road.half_width=25")
COMMON = ("noise", "range-noise", "speckle", "detection", "response", "mixed-points", "mirror-clock", "relief")
COMMON += ("surface-variation",)
EFFECTS = {
    REAL: (*COMMON, "motion", "strip-errors"),
    "rq31-600m": (*COMMON, "motion", "strip-errors", "dropout"),
    "mobile-mapping-300m": (*COMMON, "motion", "strip-errors"),
    "tripod-200m": COMMON,
}
"""Shipped scenario -> effects that it has."""
RANDOM = ("speckle", "dropout", "motion", "strip-errors")
"""Effects that no device brings by itself: an even scenario has none of them."""


def asphalt_spread_db(scenario: Scenario) -> float:
    """Return the interquartile range of the intensities of the road's points, dB."""
    arrays = scan_to_arrays(scenario).arrays
    road = next(row.id for row in class_scheme("19").rows if row.name == "road")
    intensity = arrays["intensity"][(arrays["class_id"] == road) & (arrays["intensity"] > 0.0)]
    low, high = np.percentile(10.0 * np.log10(intensity), [25.0, 75.0])
    return float(high - low)


def noise_of_neighbours_db(scenario: Scenario) -> float:
    """Return the median difference between the intensities of two successive points of the road, dB."""
    arrays = scan_to_arrays(scenario).arrays
    road = next(row.id for row in class_scheme("19").rows if row.name == "road")
    intensity = arrays["intensity"][(arrays["class_id"] == road) & (arrays["intensity"] > 0.0)]
    return float(np.median(np.abs(np.diff(10.0 * np.log10(intensity)))))


@pytest.mark.parametrize(("name", "effect"), [(name, effect) for name, rows in EFFECTS.items() for effect in rows])
def test_each_effect_of_a_shipped_scan_can_be_left_out(name: str, effect: str) -> None:
    scenario = load_scenario(name)
    assert scenario_without(scenario, [effect]) != scenario


@pytest.mark.parametrize("name", EFFECTS)
def test_an_even_scan_has_none_of_the_random_effects(name: str) -> None:
    real, even = load_scenario(name), load_scenario(f"{name}-even")
    for effect in RANDOM:
        assert scenario_without(even, [effect]) == even
        assert (scenario_without(real, [effect]) != real) is (effect in EFFECTS[name])


@pytest.mark.parametrize("name", [name for name in EFFECTS if name != REAL])
def test_a_real_sensor_s_asphalt_varies_more_than_an_even_one_s(name: str) -> None:
    """Speckle of a fifth, with the surfaces' own variation, adds at least half a decibel between the quartiles."""
    changes = (*SMALL, "fidelity=draft", 'road.vehicles.per_km={"minimum": 0, "maximum": 0}', "scan.rays_per_pulse=1")
    real, even = (noise_of_neighbours_db(load_scenario(each, changes)) for each in (name, f"{name}-even"))
    assert real > even + 0.5


def test_asphalt_of_the_airborne_survey_varies_in_brightness_like_real_asphalt() -> None:
    """Four real airborne scans of German roads have 1.0 to 1.8 dB between the quartiles of their asphalt."""
    assert 1.0 < asphalt_spread_db(load_scenario(REAL, SMALL)) < 1.8
    assert asphalt_spread_db(load_scenario(EVEN, SMALL)) < 0.8
