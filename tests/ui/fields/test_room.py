"""Texts in the sidebar: at any width none is cut off."""

from collections.abc import Iterator
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import calibration, cloud_view, edit, panels, presets, rules
from synthroads_addon.ui.work.long_operator import FileChooser
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import choose

WIDTHS = (200.0, 300.0, 450.0)
BROWSER_BUTTON = 120.0
"""Width of the text on the button of Blender's file browser that begins the work, pixels at a resolution scale of 1."""


@pytest.fixture(scope="module", autouse=True)
def broken_road(_empty_scene_for_module: None) -> Iterator[None]:
    """Build a road that breaks rules and check it, once."""
    synthroads_addon.register()
    values = {"road.length": 60.0, "road.half_width": 30.0, "seed": 3, "scan.own_weather": True}
    choose(bpy.context.scene.synthroads, **values)
    bpy.ops.synthroads.build()
    road = next(item for item in bpy.data.objects if item.get("synthroads_role") == "Road")
    set_modifier_input(road.modifiers[0], "Right Lane 1 Width", 2.6)
    bpy.context.view_layer.update()
    bpy.ops.synthroads.check_rules()
    bpy.context.scene.synthroads_calibration.real = "cloud.laz"
    bpy.ops.synthroads.add_calibration_class()
    yield
    synthroads_addon.unregister()


def widen(monkeypatch: pytest.MonkeyPatch, width: float) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)


@pytest.mark.keep_scene
@pytest.mark.parametrize("width", WIDTHS)
def test_no_label_is_cut_off(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    widen(monkeypatch, width)
    found = bpy.context.scene
    assert bpy.context.window_manager.synthroads_rules.violations
    others = (rules.SYNTHROADS_PT_rules, edit.SYNTHROADS_PT_edit, cloud_view.SYNTHROADS_PT_cloud_view)
    count, cut = 0, []
    for panel in (*panels.CLASSES, *others, calibration.SYNTHROADS_PT_calibration):
        texts = drawn(panel, bpy.context).texts(room.row_width())
        count += len(texts)
        cut += [(panel.__name__, text) for text, place, needed in texts if needed > place]
    assert cut == []
    assert count > 100, found


@pytest.mark.keep_scene
@pytest.mark.parametrize("width", [*WIDTHS, 292.0])
def test_no_word_is_broken(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    widen(monkeypatch, width)
    pieces, broken = room._pieces, []

    def watched(word: str, share: float, icons: int) -> list[str]:
        found = pieces(word, share, icons)
        broken.extend([word] if len(found) > 1 else [])
        return found

    monkeypatch.setattr(room, "_pieces", watched)
    for panel in panels.CLASSES:
        drawn(panel, bpy.context)
    assert broken == []


@pytest.mark.keep_scene
@pytest.mark.parametrize("width", WIDTHS)
def test_no_label_of_any_part_is_cut_off(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    widen(monkeypatch, width)
    for item in edit.editable_parts(bpy.context.scene).values():
        bpy.context.view_layer.objects.active = item
        layout = drawn(edit.SYNTHROADS_PT_edit, bpy.context)
        assert [text for text, place, needed in layout.texts(room.row_width()) if needed > place] == [], item.name


@pytest.mark.keep_scene
def test_every_broken_rule_is_told_in_full(monkeypatch: pytest.MonkeyPatch) -> None:
    state: Any = bpy.context.window_manager.synthroads_rules
    for width in WIDTHS:
        widen(monkeypatch, width)
        for number, row in enumerate(state.violations):
            state["index"] = number
            layout = drawn(rules.SYNTHROADS_PT_rules, bpy.context)
            texts = layout.texts(room.row_width())
            assert [text for text, place, needed in texts if needed > place] == []
            said = " ".join(text for text, _, _ in texts)
            assert row.text in said


def choosers(base: type = FileChooser) -> Iterator[type]:
    for found in base.__subclasses__():
        yield from choosers(found)
        if hasattr(found, "bl_label"):
            yield found


@pytest.mark.keep_scene
def test_the_file_browsers_button_has_room_for_what_it_does() -> None:
    labels = {found.bl_label for found in choosers()}  # type: ignore[attr-defined]
    assert len(labels) > 8
    assert [label for label in labels if room.text_width(label) > BROWSER_BUTTON] == []


@pytest.mark.keep_scene
def test_names_without_room_stand_above_their_menus(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {}
    for width in (200.0, 600.0):
        widen(monkeypatch, width)
        layouts = [drawn(panel, bpy.context) for panel in panels.CLASSES]
        found[width] = " ".join(text for layout in layouts for text, _, _ in layout.texts(room.row_width()))
    settings = bpy.context.scene.synthroads
    road = panels.open_parameters(bpy.context.scene)
    length = settings.road.length if road is None else road.alignment.length
    title = panels.with_length(presets.scenario_title(settings.preset), length)
    assert f"{title} Scenario" in found[200.0]
    assert "SynthRoads Road" in found[200.0]
    assert title in found[600.0]
    assert "SynthRoads Road" not in found[600.0]


def test_long_words_are_broken_and_none_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    widen(monkeypatch, 150.0)
    text = "carriageway-right-marking-edge-outer is wider than its lane"
    lines = room.text_lines(text)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert len(lines) > 2
    assert all(room.fits(line) for line in lines)


def test_values_that_have_no_room_beside_their_name_stand_below(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else Blender cuts 1500 m to 150."""
    monkeypatch.setattr(room, "sidebar_width", lambda: 280.0)
    assert room.has_room_beside("Radius")
    assert room.has_room_beside("Radius", ["2", "3"], 1)
    assert not room.has_room_beside("Radius", ["900 m", "1500 m"], 1)
    assert room.value_share("Radius", ["900 m", "1500 m"], 1) == 1.0
    assert not room.has_room_beside("Section", ["RQ 31, 2 × 2 carriageways"], 1)


def test_a_number_keeps_its_unit_where_lines_are_wrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: 200.0)
    for text in ("Guardrail-right-1, station 58 m", "on a road with a radius of 1,200 m, and 2.5 % at 3 mm"):
        lines = room.text_lines(text)
        assert " ".join(lines) == text
        assert not any(line.split()[0].strip(",") in ("m", "%", "mm") for line in lines), lines
