"""Epochs in Blender: the next one is drawn and built, stepped through, taken back; edits are listed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

import synthroads_addon
from synthroads_addon.blender.model.store import find_road, objects_of, recall_parameters, remember
from synthroads_addon.road.changes.change import read_changes
from synthroads_addon.road.changes.edits import apply_changes
from synthroads_addon.ui.panels import epochs
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.small_road import SCENARIO, build_small, small_parameters


@pytest.fixture(autouse=True)
def road() -> Iterator[bpy.types.Object]:
    """Register the add-on and build a short road with two posts, a sign and rails; return its root."""
    synthroads_addon.register()
    model = build_small(small_parameters())
    remember(model.root, small_parameters(), SCENARIO, "")
    limits = bpy.context.scene.synthroads.road.changes
    limits.things_per_km.minimum = limits.things_per_km.maximum = 20.0
    limits.years = 3.0
    yield model.root
    synthroads_addon.unregister()


def test_the_next_epoch_is_built_stepped_through_and_taken_back(tmp_path: Path) -> None:
    before = recall_parameters(find_road(bpy.context.scene)).to_json()
    assert bpy.ops.synthroads.next_epoch() == {"FINISHED"}
    root = find_road(bpy.context.scene)
    changes = epochs.kept_changes(root)
    assert changes is not None
    assert changes.changes
    after = recall_parameters(root)
    assert apply_changes(small_parameters(), changes).to_json() == after.to_json()
    place = tuple(bpy.context.scene.cursor.location)
    assert bpy.ops.synthroads.next_change() == {"FINISHED"}
    assert tuple(bpy.context.scene.cursor.location) != place
    assert json.loads(root[epochs.EPOCHS])["chosen"] == 0
    text = str(drawn(epochs.SYNTHROADS_PT_epochs))
    assert epochs.change_text(changes.changes[0]) in text
    assert bpy.ops.synthroads.save_changes(filepath=str(tmp_path / "list.json")) == {"FINISHED"}
    assert read_changes(tmp_path / "list.json") == changes
    assert bpy.ops.synthroads.show_epoch(shown="before") == {"FINISHED"}
    assert recall_parameters(find_road(bpy.context.scene)).to_json() == before


def test_edits_are_listed_as_changes() -> None:
    root = find_road(bpy.context.scene)
    objects_of(root)["sign"].location.x += 1.0
    bpy.context.view_layer.update()
    assert bpy.ops.synthroads.list_edits() == {"FINISHED"}
    changes = epochs.kept_changes(root)
    assert changes is not None
    assert [(change.kind, change.things) for change in changes.changes] == [("moved", ("sign",))]
    assert changes.changes[0].size == pytest.approx(1.0, abs=0.05)
