"""Epochs in Blender: drawn, shown before and after, stepped through, listed from edits, saved."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.store import find_road, objects_of, remember
from synthroads_addon.blender.model.truth import read_road
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.changes.change import ChangeList
from synthroads_addon.road.changes.edits import apply_changes
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.ui.panels import epochs
from tests.helpers.scenes.fake_layout import drawn

SCENARIO: dict[str, Any] = {
    "seed": 5,
    "road": {"length": 150.0, "grass_density": 0.0},
    "fidelity": "draft",
    "vegetation_detail": 0.0,
}


@pytest.fixture
def before() -> Iterator[RoadParameters]:
    """Register the add-on and build a road; return its set."""
    synthroads_addon.register()
    scenario = Scenario.from_dict(SCENARIO)
    parameters = sample_road(scenario.road, scenario.seed)
    remember(build_road(BuildRequest(parameters, 0.02, 0.0)).root, parameters, scenario, "")
    yield parameters
    synthroads_addon.unregister()


def shown() -> RoadParameters:
    """Return the set of the road that the scene shows now."""
    bpy.context.view_layer.update()
    return read_road(find_road(bpy.context.scene), bpy.context.scene).known()


def lines() -> str:
    """Return what the panel draws."""
    return "\n".join(drawn(epochs.SYNTHROADS_PT_epochs, bpy.context).lines)


def test_the_next_epoch_is_drawn_and_both_are_shown(before: RoadParameters, tmp_path: Path) -> None:
    assert not bpy.ops.synthroads.next_change.poll()
    assert bpy.ops.synthroads.next_epoch() == {"FINISHED"}
    changes = epochs.kept_changes(find_road(bpy.context.scene))
    assert changes is not None
    assert len(changes.changes) > 3
    after = apply_changes(before, changes)
    assert shown().to_json() == after.to_json()
    assert epochs.change_text(changes.changes[0]) in lines()
    parts = objects_of(find_road(bpy.context.scene))
    assert tuple(parts["Road"].color) != tuple(parts["Terrain"].color), "what changed is coloured"

    assert bpy.ops.synthroads.show_epoch(shown="before") == {"FINISHED"}
    assert shown().to_json() == before.to_json()
    assert "button 'Before' synthroads.show_epoch pressed" in lines()
    assert bpy.ops.synthroads.show_epoch(shown="after") == {"FINISHED"}
    assert shown().to_json() == after.to_json()

    path = tmp_path / "list.json"
    assert bpy.ops.synthroads.save_changes(filepath=str(path)) == {"FINISHED"}
    assert ChangeList.from_dict(json.loads(path.read_text(encoding="utf-8")), "list") == changes

    assert bpy.ops.synthroads.next_epoch() == {"FINISHED"}
    kept = epochs.kept_epochs(find_road(bpy.context.scene))
    assert kept is not None
    assert kept["epoch"] == 2
    assert RoadParameters.from_dict(json.loads(kept["before"]), "before").to_json() == after.to_json()


def test_changes_are_stepped_through_with_the_cursor(before: RoadParameters) -> None:
    bpy.ops.synthroads.next_epoch()
    changes = epochs.kept_changes(find_road(bpy.context.scene))
    assert changes is not None
    places = []
    for _ in changes.changes:
        assert bpy.ops.synthroads.next_change() == {"FINISHED"}
        places.append(tuple(bpy.context.scene.cursor.location))
    kept = epochs.kept_epochs(find_road(bpy.context.scene))
    assert kept is not None
    assert kept["chosen"] == len(changes.changes) - 1
    assert len(set(places)) > 1
    bpy.ops.synthroads.next_change(step=-1)
    assert tuple(bpy.context.scene.cursor.location) == pytest.approx(places[-2])


def test_edits_become_a_list_of_changes(before: RoadParameters) -> None:
    root = find_road(bpy.context.scene)
    bpy.ops.synthroads.list_edits()
    changes = epochs.kept_changes(root)
    assert changes is not None
    assert not changes.changes, "nothing was edited"
    pole = next(
        name for name, item in before.objects.items() if item.type in ("Cabinet", "TrafficSign", "Pole", "Shaft")
    )
    item = next(part for part in bpy.context.scene.objects if part.name.startswith(pole))
    item.location.x += 0.7
    bpy.context.view_layer.update()
    bpy.ops.synthroads.list_edits()
    changes = epochs.kept_changes(find_road(bpy.context.scene))
    assert changes is not None
    assert [change.kind for change in changes.changes] == ["moved"]
    assert changes.changes[0].things == (pole,)


def moved_post() -> str:
    """Move the first post that stands by itself by 0.7 m; return its id."""
    root = find_road(bpy.context.scene)
    kinds = ("Cabinet", "TrafficSign", "Pole", "Shaft")
    changes = epochs.kept_changes(root)
    changed = {thing for change in changes.changes for thing in change.things} if changes else set()
    name = next(name for name, item in shown().objects.items() if item.type in kinds and name not in changed)
    item = objects_of(root)[name]
    item.location.x += 0.7
    bpy.context.view_layer.update()
    return name


def test_an_edit_is_added_to_the_changes_that_were_drawn(before: RoadParameters) -> None:
    bpy.ops.synthroads.next_epoch()
    drawn_list = epochs.kept_changes(find_road(bpy.context.scene))
    assert drawn_list is not None
    post = moved_post()
    assert bpy.ops.synthroads.list_edits() == {"FINISHED"}
    changes = epochs.kept_changes(find_road(bpy.context.scene))
    assert changes is not None
    assert changes.years == drawn_list.years
    assert len(changes.changes) == len(drawn_list.changes) + 1
    by_things = {(change.kind, change.things) for change in changes.changes}
    assert {(change.kind, change.things) for change in drawn_list.changes} < by_things
    assert ("moved", (post,)) in by_things
    assert apply_changes(before, changes).to_json() == shown().to_json()
    colours = {name: tuple(part.color) for name, part in objects_of(find_road(bpy.context.scene)).items()}
    assert colours[post] == pytest.approx(epochs._COLOURS["moved"])
    assert bpy.ops.synthroads.show_epoch(shown="before") == {"FINISHED"}
    assert shown().to_json() == before.to_json()


def test_another_road_built_in_its_place_has_no_epochs(before: RoadParameters) -> None:
    bpy.ops.synthroads.next_epoch()
    assert epochs.kept_epochs(find_road(bpy.context.scene)) is not None
    bpy.context.scene.synthroads.seed = 6
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    assert epochs.kept_epochs(find_road(bpy.context.scene)) is None
    assert "Before" not in lines()
