"""Roads that an older version has saved: its names of inputs are known, so that edits are still carried back."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from synthroads_addon.blender.compat import modifier_input, set_modifier_input
from synthroads_addon.blender.model.build import RoadModel, build_road
from synthroads_addon.blender.model.older_files import rename_inputs
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.model.store import find_road, objects_of, recall
from synthroads_addon.blender.model.truth import open_road
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

BEFORE = {
    "Right Lane Line": "carriageway-right-line-1",
    "Right Outer Edge Line": "carriageway-right-line-0",
    "Right Inner Edge Line": "carriageway-right-line-2",
}
"""Names of lines, and the ids that stood in their place until October 2025."""
FIELDS = {"Dash Length": "Dash", "Gap Length": "Gap"}


def short_road() -> RoadParameters:
    scenario = load_scenario("rq31-600m-even")
    return sample_road(scenario.road.model_copy(update={"length": 40.0}), scenario.seed)


def name_as_before(model: RoadModel) -> None:
    """Give the inputs of the right side's lines the names that they had, under headings that stood by themselves."""
    interface = model.objects["Road"].modifiers[0].node_group.interface
    for entry in list(interface.items_tree):
        line = next((line for line in BEFORE if entry.name.startswith(line)), None)
        if line and entry.item_type == "PANEL":
            entry.name = f"Marking {BEFORE[line]}"
        elif line:
            field = entry.name.removeprefix(f"{line} ")
            entry.name = f"{BEFORE[line]} {FIELDS.get(field, field)}"


def test_inputs_named_by_ids_are_read_edited_and_named_in_words() -> None:
    parameters = short_road()
    model = build_road(BuildRequest(parameters, 0.02, 0.0, ("road",)))
    modifier = model.objects["Road"].modifiers[0]
    name_as_before(model)
    set_modifier_input(modifier, "carriageway-right-line-1 Dash", 4.5)

    edited = edited_parameters(parameters, model.objects)

    changed = {name for name, item in edited.objects.items() if item != parameters.objects[name]}
    assert changed == {"carriageway-right-line-1"}
    assert edited.objects["carriageway-right-line-1"].dash_length == 4.5  # type: ignore[union-attr]
    assert modifier_input(modifier, "Right Lane Line Dash Length") == 4.5
    headings = {entry.name: entry.parent.name for entry in modifier.node_group.interface.items_tree}
    assert headings["Right Lane Line"] == "Markings"
    assert headings["Right Lane Line Dash Length"] == "Right Lane Line"
    assert not [name for name in headings if "carriageway-" in name]


def test_a_road_of_this_version_stays_as_it_is() -> None:
    parameters = short_road()
    model = build_road(BuildRequest(parameters, 0.02, 0.0, ("road",)))
    interface = model.objects["Road"].modifiers[0].node_group.interface
    before = [entry.name for entry in interface.items_tree]
    rename_inputs(parameters, model.objects)
    assert [entry.name for entry in interface.items_tree] == before


OLDER = Path(__file__).parents[2] / "helpers" / "files" / "older_road.blend"
"""Saved by the last version without roots, in Blender 4.5: 40 m of road with two guardrails (`small_road`), in a
collection that was renamed afterwards."""


def test_a_file_without_roots_opens_with_its_road_edited_built_and_read_back() -> None:
    bpy.ops.wm.open_mainfile(filepath=str(OLDER))
    assert find_road(bpy.context.scene) is None
    opened = open_road()
    assert opened is not None
    root = find_road(bpy.context.scene)
    assert root is not None
    parameters, scenario = recall(root)
    assert parameters == opened.edited.parameters
    assert not opened.edited.by_hand
    assert not opened.edited.stale
    objects = objects_of(root)
    assert set(objects) == {"Backbone", "Road", "rail-left", "rail-right"}
    assert edited_parameters(parameters, objects) == parameters
    before = {role: np.array(item.matrix_world) for role, item in objects.items()}
    bpy.context.view_layer.update()
    assert all(np.array_equal(np.array(item.matrix_world), before[role]) for role, item in objects.items())
    set_modifier_input(objects["rail-left"].modifiers[0], "Offset", 12.5)
    edited = edited_parameters(parameters, objects)
    assert edited.objects["rail-left"].offset == 12.5  # type: ignore[union-attr]
    model = build_road(BuildRequest(edited, scenario.settings().tolerance, 0.0, ("road", "guardrails")))
    assert model.root == root
    assert "Renamed by the User" in bpy.data.collections
    assert edited_parameters(edited, objects_of(root)) == edited
