"""Messages of the panel: they name what the panel calls a field, with the panel that it stands in."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import InputError
from synthroads_addon.ui.fields.properties import PATHS
from synthroads_addon.ui.fields.sheets import panel_label
from synthroads_addon.ui.work.common import panel_message


@pytest.fixture
def add_on() -> Iterator[None]:
    """Register the add-on for one test."""
    synthroads_addon.register()
    yield
    synthroads_addon.unregister()


def test_a_field_is_named_by_its_label_and_panel() -> None:
    message = panel_message(InputError("road.lanes", 9, "must be 1 to 4"))
    assert message == "Lanes Each Way (Axis and Section) is 9: must be 1 to 4"


def test_ends_of_an_interval_and_fields_within_the_sentence_are_named_too() -> None:
    text = "must not be greater than road.furniture.gantry_spacing.maximum"
    message = panel_message(InputError("road.barriers.guardrail_height.minimum", 2.0, text))
    assert message.startswith("Guardrail Height, smallest value (Barriers) is 2.0: ")
    assert "road." not in message.replace("road.furniture.gantry_spacing.maximum", "road.") or "Furniture" in message


@pytest.mark.parametrize("path", sorted(PATHS))
def test_every_field_has_a_label_in_place_of_its_path(path: str) -> None:
    if "." in path:
        assert panel_label(path) != path
        assert "_" not in panel_label(path)


@pytest.mark.usefixtures("add_on")
def test_a_wrong_setting_is_refused_in_the_panels_words() -> None:
    settings = bpy.context.scene.synthroads
    settings.road.own_map_origin = True
    settings.road.map_origin = "1, 2"
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.synthroads.build()
    assert "road.map_origin" not in str(caught.value)
    assert "Map Origin" in str(caught.value)
