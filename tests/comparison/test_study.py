"""The study of one effect at a time: which variants there are, what the network learns, and the table."""

from __future__ import annotations

import numpy as np
import pytest

from studies.realism.effects import (
    EVERYTHING,
    MARKING,
    NOTHING,
    Outcome,
    network_score,
    points_of,
    scenario_of,
    table,
    variants,
)
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.selection.classes import RealClass
from synthroads_addon.comparison.clouds import ComparedCloud
from synthroads_addon.scenario.scenario import load_scenario


def cloud(contrast_db: float, seed: int) -> ComparedCloud:
    """Return pavement with a band of markings that are brighter by a contrast."""
    rng = np.random.default_rng(seed)
    place = np.column_stack([rng.uniform(0, 30, (6000, 2)), rng.normal(0, 0.01, 6000)])
    paint = place[:, 1] < 6.0
    level = rng.normal(0, 1.0, 6000) + contrast_db * paint
    none = np.zeros(6000)

    def part(rows: np.ndarray) -> RealClass:
        values = (place[rows], 10.0 ** (level[rows] / 10.0), 0, none[rows], none[rows], none[rows].astype(np.uint8))
        return RealClass("", *values)

    return ComparedCloud("made up", {"road": part(~paint), MARKING: part(paint)})


def test_only_effects_that_a_scenario_has_are_left_out() -> None:
    scenario = load_scenario("airborne-1000m-even", ["scan.noise.speckle=0.2", "scan.motion.position_sigma=0.1"])
    found = dict(variants(scenario))
    assert found[NOTHING] == scenario
    assert {"speckle", "motion"} <= found.keys()
    assert not {"multipath", "dropout", "weather-echoes", "strip-errors"} & found.keys()
    assert found["speckle"].scan.noise.speckle == 0.0
    assert list(found)[-1] == EVERYTHING
    assert found[EVERYTHING].scan.noise.speckle == found[EVERYTHING].scan.motion.position_sigma == 0.0


def test_the_network_tells_markings_by_their_contrast() -> None:
    learned, clear, faint = (points_of(cloud(contrast, seed)) for contrast, seed in ((5.0, 1), (5.0, 2), (0.0, 3)))
    assert network_score(learned, [clear]) > 0.97
    assert network_score(learned, [faint]) == pytest.approx(0.5, abs=0.05)


def test_scenes_of_recipes_and_their_changes() -> None:
    assert scenario_of("sweeps", "sweeps-02", ["road.length=90"]).road.length == 90.0
    assert scenario_of("sweeps", None, []).outputs == ("cloud",)
    with pytest.raises(InputError, match=r"must be a scene of sweeps, e\.g\. sweeps-01"):
        scenario_of("sweeps", "sweeps-99", [])


def test_a_row_for_each_effect() -> None:
    rows = [
        Outcome(NOTHING, {"all": 0.9, "pattern": 0.7}, 0.85, 1234, 5.0),
        Outcome("speckle", {"all": 1.0, "pattern": 0.7}, None, 5, 4.0),
    ]
    assert table(rows).splitlines()[2:] == [
        "| none: all effects | 0.90 | 0.70 | 0.850 | 1,234 | 5.00 |",
        "| speckle | 1.00 | 0.70 | - | 5 | 4.00 |",
    ]
