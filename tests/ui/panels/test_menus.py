"""Blender's own menus: every action of the panel is found by its verb, in a menu, with a tooltip."""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.fields.properties import PATHS
from synthroads_addon.ui.panels import file_menus, menus, panels
from tests.helpers.scenes.fake_layout import FakeLayout, drawn
from tests.helpers.scenes.small_road import build_small

VERBS = (
    *("Build Road", "Random Road", "Scan", "Show Cloud", "Check Rules", "Export Twin", "Export Cloud"),
    *("'Exit'", "'Entry'", "'Emergency Bay'", "SYNTHROADS_MT_turnouts"),
    *("Draw Road", "Build Road from Curve", "Fit Road to Curve Again", "Unlink Road from Curve"),
    *("Repeat Along Road", "Delete from Road", "Set Class of Selected", "Add Sun, Sky, Cameras", "Save Scenario"),
)


@pytest.fixture(autouse=True)
def add_on() -> Iterator[None]:
    """Register the add-on for one test."""
    synthroads_addon.register()
    yield
    synthroads_addon.unregister()


def entries(draw: Any) -> list[str]:
    """Return what a menu draws, a line each."""
    layout = FakeLayout()
    draw(SimpleNamespace(layout=layout), bpy.context)
    return layout.lines


def test_blenders_menus_lead_to_ours() -> None:
    for name, own in (("VIEW3D_MT_add", "_draw_add"), ("VIEW3D_MT_object", "_draw_object")):
        functions = getattr(bpy.types, name)._dyn_ui_initialize()
        assert [function.__name__ for function in functions].count(own) == 1
    assert any("SYNTHROADS_MT_add" in line for line in entries(menus._draw_add))
    assert any("SYNTHROADS_MT_object" in line for line in entries(menus._draw_object))


def test_every_action_is_found_by_its_verb() -> None:
    text = "\n".join(entries(menus.SYNTHROADS_MT_add.draw) + entries(menus.SYNTHROADS_MT_object.draw))
    for verb in VERBS:
        assert verb in text, verb


def test_every_operator_stands_in_a_menu_or_needs_a_choice_of_the_panel() -> None:
    """Blender's search finds what stands in a menu."""
    menu_kinds = (menus.SYNTHROADS_MT_add, menus.SYNTHROADS_MT_object, menus.SYNTHROADS_MT_alignment)
    draws = tuple(kind.draw for kind in menu_kinds)
    files = (file_menus._draw_import, file_menus._draw_export)
    text = "\n".join(line for draw in (*draws, *files) for line in entries(draw))
    of_the_panel = {
        *(
            "choose_scenario",
            "choose_device",
            "add_file",
            "remove_file",
            "add_calibration_class",
            "show_violation",
            "mend_violation",
        ),
        *("move_thing", "move_axis_point"),
        *("change_turnout", "delete_turnout"),  # in a menu of their own, each with an entry for every turnout
        *("show_epoch", "next_change"),  # of the list of changes
        *("zoom_profile", "pick_in_profile"),  # by the mouse in the drawn profile
        *("remove_calibration_class", "show_doubt", "look_through", "add_asset_library"),
    }
    for name in dir(bpy.ops.synthroads):
        if name not in of_the_panel:
            assert f"synthroads.{name}" in text, name


def test_the_menu_of_the_right_mouse_button_is_for_roads() -> None:
    assert entries(menus._draw_context) == []
    build_small()
    bpy.context.view_layer.objects.active = bpy.data.objects["sign"]
    text = "\n".join(entries(menus._draw_context))
    assert "synthroads.repeat_thing" in text
    assert "synthroads.delete_thing" in text
    bpy.context.view_layer.objects.active = bpy.data.objects["Road"]
    assert "synthroads.repeat_thing" not in "\n".join(entries(menus._draw_context))


def test_a_curves_menus_lead_to_its_road() -> None:
    """The menu of the right mouse button, and Object > Convert."""
    assert any("synthroads.road_from_curve" in line for line in entries(menus._draw_convert))
    data = bpy.data.curves.new("Ride", "CURVE")
    curve = bpy.data.objects.new("Ride", data)
    bpy.context.scene.collection.objects.link(curve)
    assert entries(menus._draw_context) == []
    bpy.context.view_layer.objects.active = curve
    assert any("synthroads.road_from_curve" in line for line in entries(menus._draw_context))
    functions = bpy.types.VIEW3D_MT_object_convert._dyn_ui_initialize()
    assert [function.__name__ for function in functions].count("_draw_convert") == 1


def test_every_operator_has_a_tooltip_and_tells_its_values() -> None:
    without = []
    for name in dir(bpy.ops.synthroads):
        kind = getattr(bpy.ops.synthroads, name).get_rna_type()
        if len(kind.description) < 15:
            without.append(name)
        for prop in kind.properties:
            hidden = prop.is_hidden or prop.identifier == "rna_type" or prop.identifier.startswith("filter_")
            if not hidden and not prop.description:
                without.append(f"{name}.{prop.identifier}")
    assert without == []


def test_tooltips_of_numbers_tell_unit_limits_and_an_example() -> None:
    text = PATHS["road.length"].tooltip
    assert re.search(r"Allowed: .* m", text), text
    for kind in THINGS:
        group = getattr(bpy.context.scene.synthroads_things, kind)
        for prop in group.bl_rna.properties:
            if prop.identifier not in ("rna_type", "name"):
                assert prop.description, (kind, prop.identifier)
    pole = bpy.context.scene.synthroads_things.Pole.bl_rna.properties["height"].description
    assert pole == "Top above the surface. Allowed: 2 to 30 m, e.g. 12 m"


@pytest.mark.parametrize("width", [200.0, 300.0])
def test_an_empty_panel_begins_with_four_steps(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    main = next(cls for cls in panels.CLASSES if cls.bl_idname == "SYNTHROADS_PT_main")
    layout = drawn(main, bpy.context)
    text = " ".join(re.findall(r"label '([^']*)'", "\n".join(layout.lines)))
    for number in range(1, 5):
        assert f"{number}. " in text
    assert not [item for item in layout.texts(room.row_width()) if item[2] > item[1] + 0.5]
    build_small()
    assert "1. " not in "\n".join(drawn(main, bpy.context).lines)


def test_the_road_panel_says_how_long_the_road_is() -> None:
    """The settings' length is that of the next road."""
    build_small()
    bpy.context.scene.synthroads.road.length = 250.0
    road = next(cls for cls in panels.CLASSES if cls.bl_idname == "SYNTHROADS_PT_road")
    assert "label 'Length of the road: 60 m' <DRIVER_DISTANCE>" in drawn(road, bpy.context).lines


def test_the_headings_length_is_the_roads() -> None:
    """The scenario is one of 600 m."""
    main = next(cls for cls in panels.CLASSES if cls.bl_idname == "SYNTHROADS_PT_main")
    assert "600 m of motorway" in " ".join(drawn(main, bpy.context).lines)
    bpy.context.scene.synthroads.road.length = 250.0
    assert "250 m of motorway" in " ".join(drawn(main, bpy.context).lines)
    build_small()
    assert "60 m of motorway" in " ".join(drawn(main, bpy.context).lines)
    assert panels.with_length("A road of 5 km", 80.0) == "A road of 5 km"
