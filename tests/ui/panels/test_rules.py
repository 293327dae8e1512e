"""The list of broken rules: what the library finds in the road as it is edited, and the jump to the place."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

import synthroads_addon
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.model.store import find_road, objects_of, recall_parameters
from synthroads_addon.blender.things.model_builder import ROLE
from synthroads_addon.checking.checker import RULES, check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import Carriageway
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.fields.wording import title_case
from synthroads_addon.ui.panels import rules
from synthroads_addon.ui.translations.catalogue import catalogue_of
from tests.helpers.scenes.fake_layout import FakeLayout, drawn


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a small road."""
    path = tmp_path_factory.mktemp("road") / "road.blend"
    synthroads_addon.register()
    settings = bpy.context.scene.synthroads
    settings.road.length, settings.road.half_width, settings.seed = 150.0, 20.0, 3
    bpy.ops.synthroads.build()
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    synthroads_addon.unregister()
    return path


@pytest.fixture
def found(file: Path) -> Iterator[Any]:
    """Register the add-on and open the small road for one test; return the list."""
    synthroads_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(file))
    yield bpy.context.window_manager.synthroads_rules
    synthroads_addon.unregister()


def narrow_lane(width: float = 2.6) -> None:
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", width)
    bpy.data.objects["Road"].update_tag()
    bpy.context.view_layer.update()


def road() -> Any:
    collection = find_road(bpy.context.scene)
    assert collection
    return edited_parameters(recall_parameters(collection), objects_of(collection))


def view() -> Any:
    return next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D").spaces.active


def test_a_sampled_road_breaks_no_rule(found: Any) -> None:
    assert rules.checked.parameters is None
    assert bpy.ops.synthroads.check_rules() == {"FINISHED"}
    assert len(found.violations) == 0
    assert rules.checked.parameters == road()
    assert not bpy.ops.synthroads.show_violation.poll()


def test_the_list_is_the_librarys_for_the_edited_road(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    expected = check(road())
    assert "lane-width" in {violation.rule for violation in expected}
    rows = [(row.rule, row.object, row.text, row.name) for row in found.violations]
    assert rows == [(v.rule, v.object, v.text, RULES[v.rule].title) for v in expected]
    assert [row.station for row in found.violations] == [np.float32(v.station) for v in expected]
    row = next(row for row in found.violations if row.rule == "lane-width")
    assert (row.value, row.limit, row.comparison) == ("2.6 m", "3.5 m", "2.6 m (limit 3.5 m)")
    assert found.index == -1


def test_checking_again_replaces_the_list(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    count = len(found.violations)
    bpy.ops.synthroads.check_rules()
    assert len(found.violations) == count > 0
    bpy.ops.synthroads.build()
    bpy.ops.synthroads.check_rules()
    assert len(found.violations) == 0


@pytest.mark.parametrize("by", ["click", "operator"])
def test_a_click_looks_along_the_road_at_the_place(found: Any, by: str) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    index = next(i for i, row in enumerate(found.violations) if row.rule == "lane-width")
    cursor, perspective = tuple(bpy.context.scene.cursor.location), view().region_3d
    perspective.view_perspective = "ORTHO"
    if by == "click":
        found.index = index
    else:
        bpy.ops.synthroads.show_violation(index=index)
    geometry, row = RoadGeometry(road()), found.violations[index]
    station, offset = row.station, row.offset
    place = geometry.point(station, offset)[0]
    assert np.allclose(perspective.view_location, place, atol=1e-3)
    assert perspective.view_perspective == "PERSP"
    assert perspective.view_distance == pytest.approx(math.hypot(34.0, 20.0), abs=1e-3)
    _, heading, _ = geometry.alignment.frame(station)
    ahead = perspective.view_rotation @ Vector((0.0, 0.0, -1.0))
    assert math.atan2(ahead.y, ahead.x) == pytest.approx(float(heading), abs=1e-3)
    assert ahead.z < -0.3
    assert np.allclose(rules.checked.marker.corners[0], place, atol=1e-3)
    assert tuple(bpy.context.scene.cursor.location) == cursor  # it is the user's


def test_a_carriageways_place_lies_on_it(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    parameters = road()
    geometry = RoadGeometry(parameters)
    for row in found.violations:
        item = parameters.objects.get(row.object)
        if isinstance(item, Carriageway):
            assert geometry.strips[int(geometry.strip_index(row.station, row.offset)[0])].side == item.side


def test_the_place_of_any_object_is_beside_the_road(found: Any) -> None:
    parameters = road()
    geometry = RoadGeometry(parameters)
    for key in [*parameters.objects, "no such object"]:
        for station in (-5.0, 20.0, 1e6):
            violation = rules.Violation("object-range", key, station, 0.0, 0.0, "m", "")
            assert abs(rules.violation_offset(geometry, violation)) < 200.0


def test_the_list_says_when_the_road_has_changed(found: Any) -> None:
    scene = bpy.context.scene
    bpy.ops.synthroads.check_rules()
    assert not rules.checked.is_outdated(scene)
    narrow_lane()
    assert rules.checked.is_outdated(scene)
    bpy.ops.synthroads.check_rules()
    assert not rules.checked.is_outdated(scene)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.update()
    assert not rules.checked.asked  # the user's own objects are none of the road's
    for item in [item for item in bpy.data.objects if ROLE in item]:
        bpy.data.objects.remove(item)
    rules._note_changes(scene)
    assert rules.checked.is_outdated(scene)
    assert not bpy.ops.synthroads.check_rules.poll()


def test_nothing_is_added_to_the_file(found: Any) -> None:
    narrow_lane()
    before = {name: len(getattr(bpy.data, name)) for name in ("objects", "meshes", "collections", "materials")}
    bpy.ops.synthroads.check_rules()
    found.index = 0
    assert {name: len(getattr(bpy.data, name)) for name in before} == before
    bpy.ops.synthroads.clear_rules()
    assert (len(found.violations), rules.checked.marker.corners) == (0, [])


def test_another_file_has_its_own_rules(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    found.index = 0
    bpy.ops.wm.read_homefile(use_empty=True)
    assert len(bpy.context.window_manager.synthroads_rules.violations) == 0
    assert rules.checked.parameters is None
    assert rules.checked.marker.corners == []


def test_a_damaged_road_is_a_message(found: Any) -> None:
    find_road(bpy.context.scene)["synthroads_parameters"] = "{"
    with pytest.raises(RuntimeError, match="Road: its parameter set in the file is damaged") as caught:
        bpy.ops.synthroads.check_rules()
    assert "Traceback" not in str(caught.value)


def test_a_line_that_is_not_there_is_a_message(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    with pytest.raises(RuntimeError, match="index is 9999: must be 0 to"):
        bpy.ops.synthroads.show_violation(index=9999)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (3.5, "3.5"), (0.15, "0.15"), (0.0012, "0.0012"), (-12.345, "-12.35"), (600.0, "600")]
    + [(1234.56, "1,234.6"), (1.7976931348623157e308, "1.8e+308"), (100.0, "100"), (10.0, "10")],
)
def test_numbers_fit_a_narrow_column(value: float, text: str) -> None:
    assert rules._digits(value) == text


def test_the_panel_shows_the_list_and_the_chosen_line_in_full(found: Any) -> None:
    def lines() -> str:
        return "\n".join(drawn(rules.SYNTHROADS_PT_rules, bpy.context).lines)

    assert "list" not in lines()
    bpy.ops.synthroads.check_rules()
    assert "No rule is broken" in lines()
    narrow_lane()
    assert "The road has changed since" in lines()
    bpy.ops.synthroads.check_rules()
    assert "1 rule is broken" in lines()
    assert "list SYNTHROADS_UL_violations of 1" in lines()
    assert "label 'Found' | label '2.6 m'" not in lines()
    found.index = 0
    assert "label 'Found' | label '2.6 m'" in lines()
    assert "label 'Limit' | label '3.5 m'" in lines()
    assert "changed since" not in lines()


@pytest.mark.parametrize("width", [200.0, 300.0])
@pytest.mark.parametrize("locale", ["", "de_DE"])
def test_a_row_says_rule_object_value_and_limit(
    found: Any, width: float, locale: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if locale:
        catalogue = catalogue_of(locale)
        assert catalogue
        monkeypatch.setattr(rules, "said", lambda text: catalogue.translate(text) or text)
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    for row in found.violations:
        lines = rules.row_lines(row)
        assert all(room.fits(line, rules._LIST_SHARE) for line in lines)
        text = " ".join(lines)
        for part in (title_case(row.object), f" {row.station:,.0f} m", row.value, row.limit):
            assert part in text
        assert (row.name in text) or locale


def test_a_row_draws_its_lines_below_each_other(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    layout = FakeLayout()
    rules.SYNTHROADS_UL_violations.draw_item(None, None, layout, found, found.violations[0], 0, found, "index")
    assert layout.lines == [f"  label {line!r}" for line in rules.row_lines(found.violations[0])]


def test_a_broken_rule_is_mended_from_the_list(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    index = next(i for i, row in enumerate(found.violations) if row.rule == "lane-width")
    found.index = index
    assert "button 'Set Width to 3.50 m' synthroads.mend_violation" in "\n".join(
        drawn(rules.SYNTHROADS_PT_rules, bpy.context).lines
    )
    assert bpy.ops.synthroads.mend_violation(index=index) == {"FINISHED"}
    assert "lane-width" not in {row.rule for row in found.violations}
    assert check(road()) == [] == list(found.violations)


def test_what_no_single_change_mends_has_no_button(found: Any) -> None:
    narrow_lane()
    bpy.ops.synthroads.check_rules()
    found.violations[0].rule = "object-range"
    found.index = 0
    assert "mend_violation" not in "\n".join(drawn(rules.SYNTHROADS_PT_rules, bpy.context).lines)
    with pytest.raises(RuntimeError, match="no single change keeps this rule"):
        bpy.ops.synthroads.mend_violation(index=0)
    with pytest.raises(RuntimeError, match="index is 9999: must be 0 to"):
        bpy.ops.synthroads.mend_violation(index=9999)
