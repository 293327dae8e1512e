"""The tool Draw Road: what clicks, drags, the wheel and keys make of a sketch, and what is shown and built of it."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from synthroads_addon.blender.model.store import find_road, recall
from synthroads_addon.checking.checker import RULES
from synthroads_addon.fitting.tangents import LEAST_RADIUS
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.ui.drawing import overlay, tool
from synthroads_addon.ui.drawing.sketch import Sketch, shown_elements, state_text
from synthroads_addon.ui.drawing.tool import DrawingState
from synthroads_addon.ui.work.view import DRAWING_WIDTH, look_down
from tests.helpers.scenes.fake_layout import FakeLayout
from tests.helpers.scenes.panel_road import cheap, settings  # noqa: F401

LINE = [(0.0, 0.0), (900.0, 0.0), (1700.0, 600.0)]


def drawing(points: Any = LINE) -> DrawingState:
    """Return a drawing of points that were clicked."""
    state = DrawingState(Sketch(RoadScenario()))
    for point in points:
        state.move(np.array(point), False, None)
        state.press(np.array(point), False)
        state.release()
    state.refresh(None)
    return state


def radius(state: DrawingState, number: int = 1) -> float:
    """Return the radius at a point of the sketch."""
    axis = state.sketch.axis()
    assert axis
    return next(corner.radius for corner in axis.corners if corner.number == number)


def test_clicks_make_lines_clothoids_and_an_arc() -> None:
    state = drawing()
    assert state.sketch.points == LINE
    assert [element.kind for element in state.view.elements] == ["line", "clothoid", "arc", "clothoid", "line"]
    assert [text for _, text in state.view.labels] == ["R 900 m, A 300 m"]
    assert "Keeps the rules of the centreline" in state.view.text
    assert "from the tangents' points" in state.view.text


def test_the_axis_is_shown_with_the_point_under_the_mouse() -> None:
    state = drawing(LINE[:2])
    state.move(np.array(LINE[2]), False, None)
    assert len(state.view.elements) == 5
    assert len(state.view.tangents) == 3
    assert state.sketch.points == LINE[:2], "only a click takes it"


def test_ctrl_snaps_angle_and_length() -> None:
    state = drawing([(0.0, 0.0)])
    state.press(np.array([403.0, 8.0]), True)
    assert state.sketch.points[1] == (400.0, 0.0)
    state.press(np.array([700.0, 170.0]), True)
    leg = np.subtract(state.sketch.points[2], state.sketch.points[1])
    assert math.degrees(math.atan2(leg[1], leg[0])) == pytest.approx(30.0, abs=0.01)
    assert np.hypot(*leg) == pytest.approx(340.0, abs=0.01)


def test_backspace_takes_the_last_point_away() -> None:
    state = drawing()
    state.back()
    assert state.sketch.points == LINE[:2]
    for _ in range(5):
        state.back()
    assert state.sketch.points == []
    assert state.view.text == "Click the next point"


def test_a_handle_is_dragged_to_another_radius() -> None:
    state = drawing()
    handle = next(handle for handle in state.view.handles if handle.kind == "radius")
    vertex = np.array(LINE[1])
    state.view.hovered = handle
    state.press(np.array(handle.place), False)
    assert state.sketch.points == LINE, "no point is added where a handle is"
    state.move(vertex + 0.5 * (np.array(handle.place) - vertex), False, None)
    state.release()
    axis = state.sketch.axis()
    assert axis
    (corner,) = axis.corners
    assert corner.radius < 900.0
    assert corner.distance == pytest.approx(0.5 * np.hypot(*(np.array(handle.place) - vertex)), abs=0.2)
    assert RULES["radius-minimum"].title in state.view.text
    state.view.hovered = next(handle for handle in state.view.handles if handle.kind == "radius")
    state.press(np.array(LINE[1]), True)
    state.move(np.array(handle.place), True, None)
    assert radius(state) % 10.0 == 0.0, "Ctrl: steps of 10 m"


def test_a_point_is_dragged() -> None:
    state = drawing()
    state.view.hovered = next(handle for handle in state.view.handles if handle.number == 2)
    state.press(np.array(LINE[2]), False)
    state.move(np.array([1700.0, -300.0]), False, None)
    state.release()
    assert state.sketch.points[2] == (1700.0, -300.0)
    assert state.held is None


def test_the_wheel_changes_the_radius_under_the_mouse_alone() -> None:
    state = drawing()
    assert not state.wheel(1), "elsewhere the wheel zooms the view"
    state.view.hovered = next(handle for handle in state.view.handles if handle.kind == "radius")
    assert state.wheel(1)
    assert radius(state) == 990.0
    for _ in range(80):
        state.wheel(-1)
    assert radius(state) == LEAST_RADIUS


def test_a_point_that_cannot_be_rounded_is_refused_in_words() -> None:
    state = drawing()
    back = np.array([0.0, 1.0]) + LINE[1]
    state.move(np.array(LINE[1]) + [5.0, 0.0], False, None)
    assert state.view.is_refused
    assert "put it, or the next point, farther away" in state.view.text.replace("\n", " ")
    assert state.view.text.startswith("Point 3 turns by")
    state.press(np.array(LINE[1]) + [5.0, 0.0], False)
    assert state.sketch.points == LINE
    state.move(back + [900.0, 900.0], False, None)
    assert not state.view.is_refused


@pytest.mark.parametrize("seed", range(5))
def test_20_random_clicks_show_their_deviation_and_what_they_break(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state, tries = drawing([]), 0
    while len(state.sketch.points) < 20:
        point = rng.uniform(-1000.0, 1000.0, 2)
        state.press(point, False)
        tries += 1
    state.refresh(None)
    drawn = state.sketch.drawn()
    assert drawn
    assert tries < 60
    assert f"at most {drawn.deviation:.3f} m" in state.view.text
    for violation in drawn.violations:
        assert RULES[violation.rule].title in state_text(drawn)
    shown = np.concatenate([element.points for element in state.view.elements])
    off = min(np.hypot(*(shown - point).T).min() for point in state.sketch.points[1:-1])
    assert off <= drawn.deviation
    assert np.abs(shown[0] - state.sketch.points[0]).max() < 1e-6
    assert np.abs(shown[-1] - state.sketch.points[-1]).max() < 1e-4


def test_arcs_are_shown_round() -> None:
    state = drawing()
    axis = state.sketch.axis()
    assert axis
    arc = next(element for element in shown_elements(axis) if element.kind == "arc")
    assert np.hypot(*np.diff(arc.points, axis=0).T).max() <= 5.0
    assert set(overlay.COLORS) == {"line", "arc", "clothoid"}


def test_the_status_bar_names_the_keys() -> None:
    layout = FakeLayout()
    tool.draw_keys(type("Header", (), {"layout": layout}), bpy.context)
    text = "\n".join(layout.lines)
    for _, words in tool._KEYS:
        assert words in text
    icons = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys()
    assert {icon for icon, _ in tool._KEYS} <= set(icons)


def test_the_tool_stands_in_the_toolbar_and_begins_with_a_click() -> None:
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active

    tools = [
        item
        for item in VIEW3D_PT_tools_active._tools["OBJECT"]
        if getattr(item, "idname", "") == "synthroads.draw_road"
    ]
    groups = [part for item in VIEW3D_PT_tools_active._tools["OBJECT"] if isinstance(item, tuple) for part in item]
    assert len(tools) + len([item for item in groups if getattr(item, "idname", "") == "synthroads.draw_road"]) == 1
    assert tool.DrawRoadTool.bl_keymap[0][0] == tool.SYNTHROADS_OT_draw_road.bl_idname


def test_without_a_window_it_says_what_is_missing() -> None:
    with pytest.raises(RuntimeError, match="needs the mouse"):
        bpy.ops.synthroads.draw_road()


def test_what_was_drawn_is_what_is_built(cheap: Any) -> None:  # noqa: F811
    cheap.fidelity = "draft"
    state = drawing([(0.0, 0.0), (120.0, 0.0), (220.0, 60.0)])
    state.sketch.set_radius(1, 150.0)
    drawn = state.sketch.drawn()
    assert drawn
    bpy.ops.synthroads.road_from_curve(polygon=state.sketch.to_text())
    built = recall(find_road(bpy.context.scene))[0].alignment
    assert built == drawn.axis
    assert json.loads(state.sketch.to_text())[1] == [120.0, 0.0, 0.0, 150.0]


def test_a_road_is_drawn_from_above_and_2_km_are_in_sight() -> None:
    eye = SimpleNamespace(view_perspective="PERSP", view_rotation=None, view_location=None, view_distance=0.0)
    space = SimpleNamespace(region_3d=eye, lens=50.0, clip_start=0.01, clip_end=1000.0)
    look_down(space, Vector((1.0, 2.0, 3.0)), DRAWING_WIDTH)  # type: ignore[arg-type]
    assert eye.view_perspective == "ORTHO"
    assert tuple(eye.view_rotation) == (1.0, 0.0, 0.0, 0.0)
    assert tuple(eye.view_location) == (1.0, 2.0, 3.0)
    assert eye.view_distance * 72.0 / space.lens == pytest.approx(2000.0)
    assert space.clip_end >= 4.0 * DRAWING_WIDTH
