"""Costs of the sensor's effects: which scans are compared, and what the table says of them."""

from __future__ import annotations

from studies.costs.effects import ALL, NONE, ScanCost, kinds, table, with_sensor_of
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.scenario.scenario import load_scenario


def test_a_scenario_gets_the_sensor_of_a_recipe_and_nothing_else() -> None:
    scenario = load_scenario("rq31-600m-even")
    drawn = scene_jobs(load_recipe("centerline-uav"))[0].scenario
    found = with_sensor_of(scenario, "centerline-uav")
    for name in ("noise", "motion", "receiver", "strip_errors", "relief", "mirror_clock"):
        assert getattr(found.scan, name) == getattr(drawn.scan, name)
    assert found.colour.intensity_from_layers == drawn.colour.intensity_from_layers
    assert found.road == scenario.road
    assert (found.scan.device, found.scan.platform) == (scenario.scan.device, scenario.scan.platform)


def test_scans_with_all_effects_none_and_without_one_each() -> None:
    rows = kinds(with_sensor_of(load_scenario("rq31-600m-even"), "centerline-uav"), leave_out_each=True)
    assert [row.name for row in rows[:2]] == [NONE, ALL]
    assert {"without speckle", "without relief", "without motion"} <= {row.name for row in rows}
    calm = rows[0].scenario.scan
    assert (calm.noise.speckle, calm.relief, calm.motion.position_sigma) == (0.0, 0.0, 0.0)
    assert len(kinds(rows[1].scenario, leave_out_each=False)) == 2


def test_ratios_are_of_the_least_times() -> None:
    scenario = load_scenario("rq31-600m-even")
    rows = [ScanCost(NONE, scenario, 1000, [2.5, 2.0]), ScanCost(ALL, scenario, 800, [2.2, 3.0])]
    assert "| all effects | 800 | 2.20 | 1.10 | 1.38 |" in table(rows)
