"""Options of the commands: what they say of themselves, and what they mean."""

from __future__ import annotations

from headless import dataset
from synthroads_addon.core.dataset.recipe import load_recipe, scene_jobs


def test_changes_of_a_data_set_are_of_the_type_of_their_field() -> None:
    changed = dataset._changed(load_recipe("small-gantries"), ["cloud.classes=5", "title=7", "road.length=200"])
    scenarios = [job.scenario for job in scene_jobs(changed)]
    assert {(one.cloud.classes, one.title, one.road.length) for one in scenarios} == {("5", "7", 200.0)}
