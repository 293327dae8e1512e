"""The shipped airborne survey has the errors of a real sensor, each of which can be left out; the even one has few."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon import scan_to_arrays
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.scenario.without import scenario_without

REAL, EVEN = "airborne-1000m", "airborne-1000m-even"
SMALL = ("road.length=60", "road.half_width=25")
EFFECTS = ("noise", "range-noise", "speckle", "detection", "response", "mixed-points", "motion", "mirror-clock")
EFFECTS += ("strip-errors", "relief", "surface-variation")


def asphalt_spread_db(scenario: Scenario) -> float:
    """Return the interquartile range of the intensities of the road's points, dB."""
    arrays = scan_to_arrays(scenario).arrays
    road = next(row.id for row in class_scheme("19").rows if row.name == "road")
    intensity = arrays["intensity"][(arrays["class_id"] == road) & (arrays["intensity"] > 0.0)]
    low, high = np.percentile(10.0 * np.log10(intensity), [25.0, 75.0])
    return float(high - low)


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_effect_of_the_airborne_survey_can_be_left_out(effect: str) -> None:
    scenario = load_scenario(REAL)
    assert scenario_without(scenario, [effect]) != scenario


def test_the_even_survey_has_no_speckle_sway_or_errors_of_strips() -> None:
    even = load_scenario(EVEN)
    for effect in ("speckle", "motion", "strip-errors"):
        assert scenario_without(even, [effect]) == even


def test_asphalt_of_the_airborne_survey_varies_in_brightness_like_real_asphalt() -> None:
    """Four real airborne scans of German roads have 1.0 to 1.8 dB between the quartiles of their asphalt."""
    assert 1.0 < asphalt_spread_db(load_scenario(REAL, SMALL)) < 1.8
    assert asphalt_spread_db(load_scenario(EVEN, SMALL)) < 0.8
