"""The panel Alignment: its tables are the road's, edits show at once, are undone, and are the road's truth."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import synthroads_addon
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.roads import ROAD
from synthroads_addon.blender.model.store import STATED, find_road, objects_of
from synthroads_addon.blender.model.truth import EditedRoad, read_road
from synthroads_addon.blender.things.model_builder import group_inputs
from synthroads_addon.checking.marks import row_marks
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.tables.elements import element_rows
from synthroads_addon.ui.alignment import panel, tables
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.work import follow
from synthroads_addon.ui.work.build import edited_work
from synthroads_addon.ui.work.job import PanelJob
from tests.helpers.scenes.fake_layout import FakeLayout, drawn


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a small road of an arc, a clothoid and an arc."""
    path = tmp_path_factory.mktemp("road") / "road.blend"
    synthroads_addon.register()
    settings = bpy.context.scene.synthroads
    settings.road.length, settings.road.half_width, settings.seed, settings.fidelity = 150.0, 20.0, 3, "draft"
    bpy.ops.synthroads.build()
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    synthroads_addon.unregister()
    return path


@pytest.fixture
def group(file: Path) -> Iterator[Any]:
    """Register the add-on and open the small road for one test; return the tables' properties."""
    synthroads_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(file))
    tables.sync(bpy.context.scene)
    yield bpy.context.scene.synthroads_alignment
    synthroads_addon.unregister()


def read() -> EditedRoad:
    root = find_road(bpy.context.scene)
    assert root
    bpy.context.view_layer.update()
    return read_road(root)


def rows() -> list[tuple[str, float, float]]:
    return [(row.kind, row.length, row.radius) for row in element_rows(read().parameters.alignment.horizontal)]


def test_the_rows_are_the_roads(group: Any) -> None:
    axis = read().parameters.alignment
    assert [len(group.elements), len(group.vertical)] == [len(axis.horizontal), len(axis.vertical)]
    for row, there in zip(group.elements, element_rows(axis.horizontal), strict=True):
        assert (row.kind, row.length, row.radius) == (
            there.kind,
            float(np.float32(there.length)),
            float(np.float32(there.radius)),
        )
    for row, point in zip(group.vertical, axis.vertical, strict=True):
        assert row.elevation == float(np.float32(point.elevation))
    assert STATED not in find_road(bpy.context.scene)  # to look changes nothing


def test_a_value_changes_the_road_at_once_and_is_read_back_exactly(group: Any) -> None:
    before = rows()
    group.elements[0].length = 44.125
    group.elements[2].radius = 1000.5
    group.vertical[0].elevation = 0.5
    assert tables.tables.refused == ""
    edited = read()
    after = rows()
    assert after[0] == (before[0][0], 44.125, before[0][2])
    assert after[2][2] == 1000.5
    assert edited.parameters.alignment.vertical[0].elevation == 0.5
    assert edited.lost == ""
    assert edited.by_hand == ()
    assert edited.stale  # Build as Edited is offered
    # The scene shows it: the backbone's vertices lie on the stated axis.
    backbone = objects_of(find_road(bpy.context.scene))["Backbone"].data  # type: ignore[arg-type]
    geometry = RoadGeometry(edited.parameters)
    places = np.empty(3 * len(backbone.vertices), np.float32)
    backbone.vertices.foreach_get("co", places)
    station, offset = geometry.alignment.project(places.reshape(-1, 3)[:, :2].astype(np.float64))
    assert np.abs(offset).max() < 1e-3
    assert np.abs(places.reshape(-1, 3)[:, 2] - geometry.profile.elevation(station)).max() < 1e-3
    assert station.max() == pytest.approx(geometry.length, abs=1e-3)


def test_the_surface_is_seen_along_the_stated_axis(group: Any) -> None:
    group.elements[2].radius = 400.0
    root = find_road(bpy.context.scene)
    assert root
    geometry = RoadGeometry(read().parameters)
    pavement = objects_of(root)["Road"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    places = np.empty(3 * len(pavement.vertices), np.float32)
    pavement.vertices.foreach_get("co", places)
    station, offset = geometry.alignment.project(places.reshape(-1, 3)[:, :2].astype(np.float64))
    assert [station.min(), station.max()] == pytest.approx([0.0, geometry.length], abs=1e-2)
    assert offset.min() < -5.0  # both carriageways are there
    assert offset.max() > 5.0


def test_lines_reach_as_far_as_the_road_after_several_edits(group: Any) -> None:
    """Their stations are inputs of the surface, which is shown along the stated axis: they are carried once only."""
    for length in (40.0, 30.0, 25.0):
        group.elements[0].length = length
    bpy.ops.synthroads.delete_element(number=0)
    parameters = read().parameters
    ends = [(line.start_station, line.end_station) for line in parameters.of_type(LineMarking).values()]
    assert ends
    assert ends == [pytest.approx((0.0, parameters.alignment.length), abs=1e-5)] * len(ends)


def test_a_line_edited_along_the_stated_axis_ends_there(group: Any) -> None:
    group.elements[0].length += 20.0
    root = find_road(bpy.context.scene)
    assert root
    pavement = objects_of(root)["Road"]
    name = next(name for name in _input_names(pavement) if name.endswith("End Station"))
    set_modifier_input(pavement.modifiers[0], name, 100.0)
    assert bpy.ops.synthroads.build_edited() == {"FINISHED"}
    length = read().parameters.alignment.length
    ends = sorted({line.end_station for line in read().parameters.of_type(LineMarking).values()})
    assert ends == pytest.approx([100.0, length], abs=1e-4)


def _input_names(item: bpy.types.Object) -> list[str]:
    tree = item.modifiers[0].node_group
    return [socket.name for socket in group_inputs(tree)]


def test_the_built_road_is_the_stated_one(group: Any) -> None:
    group.elements[0].length = 60.0
    group.crossfall[0].percent = -5.5
    group.strip = "Lane 1"
    group.widths[0].width = 3.5
    stated = read().parameters
    assert bpy.ops.synthroads.build_edited() == {"FINISHED"}
    built = read()
    assert built.parameters == stated
    assert built.stale == ()
    assert STATED not in find_road(bpy.context.scene)
    carriageway = built.parameters.carriageway("right")
    assert carriageway
    assert carriageway.crossfall[0].crossfall_percent == -5.5
    assert carriageway.lanes[0].width == 3.5


def test_the_window_takes_no_building_for_a_move(group: Any) -> None:
    """Between two steps of the build, which has another axis than the road had, the window looks what was moved."""
    group.elements[0].length = 60.0
    stated = read().parameters
    root = find_road(bpy.context.scene)
    assert root
    job = PanelJob("Build", edited_work(str(root[ROAD]), read_road(root)))
    job.start()
    looks = 0
    while job.tick(0.0):
        bpy.context.view_layer.update()
        follow._follow_later()
        looks += 1
    assert job.error is None
    assert looks > 5
    bpy.context.view_layer.update()
    follow._follow_later()
    assert not follow._moved
    assert read().parameters == stated


def test_rows_are_inserted_split_and_deleted(group: Any) -> None:
    before = rows()
    assert bpy.ops.synthroads.split_element(number=1) == {"FINISHED"}
    assert len(group.elements) == len(before) + 1
    assert rows()[1][1] + rows()[2][1] == pytest.approx(before[1][1], abs=1e-5)
    assert bpy.ops.synthroads.insert_element(kind="line", number=0) == {"FINISHED"}
    assert (group.elements[1].kind, group.active_elements) == ("line", 1)
    assert bpy.ops.synthroads.delete_element() == {"FINISHED"}  # the active one
    assert [row[0] for row in rows()] == ["arc", "clothoid", "clothoid", "arc"]
    for table in ("vertical", "crossfall", "widths"):
        count = len(getattr(group, table))
        assert bpy.ops.synthroads.insert_point(table=table, number=0) == {"FINISHED"}
        assert len(getattr(group, table)) == count + 1
        assert bpy.ops.synthroads.delete_point(table=table, number=1) == {"FINISHED"}
        assert len(getattr(group, table)) == count


def test_a_broken_rule_is_marked_in_its_row_with_its_words_and_mended(group: Any) -> None:
    bpy.ops.synthroads.insert_element(kind="arc", number=0)
    marks = row_marks(read().parameters)
    assert {number: [v.rule for v in broken] for number, broken in tables.tables.marks.elements.items()} == {
        number: [v.rule for v in broken] for number, broken in marks.elements.items()
    }
    group.active_elements = 1
    text = "\n".join(drawn(panel.SYNTHROADS_PT_alignment, bpy.context).lines)
    assert "Curvature doesn't jump" in text
    assert "a transition" in text
    assert "synthroads.mend_rule" in text
    assert bpy.ops.synthroads.mend_rule(table="elements", number=1) == {"FINISHED"}
    assert [row[0] for row in rows()][:3] == ["arc", "clothoid", "arc"]


def test_what_is_not_allowed_stays_and_says_why(group: Any) -> None:
    before = rows()
    group.elements[0].length = 0.0
    assert tables.tables.refused == "Length of Element 1 is 0.0: must be from 0.01 to 1,000,000 m"
    assert rows() == before
    text = " ".join(drawn(panel.SYNTHROADS_PT_alignment, bpy.context).lines)
    assert "Length of Element 1" in text
    with pytest.raises(RuntimeError, match="Row is 9: must be 0 to 2, or -1 for the active row"):
        bpy.ops.synthroads.delete_element(number=9)
    group.elements[0].length = before[0][1] + 1.0
    assert tables.tables.refused == ""


def test_a_moved_backbone_is_built_before_its_table_is_edited(group: Any) -> None:
    backbone = objects_of(find_road(bpy.context.scene))["Backbone"]  # type: ignore[arg-type]
    for vertex in backbone.data.vertices:
        vertex.co.z += 0.5
    backbone.data.update()
    group.elements[0].length = 50.0
    assert tables.tables.refused == "Alignment: the backbone was moved by hand: press Build as Edited first"


def test_things_are_placed_once_the_stated_axis_is_built(group: Any) -> None:
    group.elements[0].length = 60.0
    with pytest.raises(RuntimeError, match="its axis was changed in Alignment: press Build as Edited first"):
        bpy.ops.synthroads.add_thing(kind="TrafficSign", station=50.0, side="right")
    bpy.ops.synthroads.build_edited()
    assert bpy.ops.synthroads.add_thing(kind="TrafficSign", station=50.0, side="right") == {"FINISHED"}


def test_an_edit_is_undone_with_its_rows(group: Any) -> None:
    bpy.ops.ed.undo_push(message="before")
    before = rows()
    bpy.ops.synthroads.split_element(number=0)
    bpy.ops.ed.undo_push(message="split")
    bpy.ops.ed.undo()
    assert rows() == before
    tables.sync(bpy.context.scene)
    assert len(bpy.context.scene.synthroads_alignment.elements) == len(before)


def test_the_axis_begins_where_it_is_stated(group: Any) -> None:
    before = read().parameters.alignment
    assert group.start_x == pytest.approx(before.start_x, abs=1e-4)
    group.start_x, group.start_y, group.start_heading = 12.5, -7.25, 90.0
    assert tables.tables.refused == ""
    after = read().parameters.alignment
    assert (after.start_x, after.start_y, after.start_heading_deg) == (12.5, -7.25, 90.0)
    assert (after.horizontal, after.vertical) == (before.horizontal, before.vertical)
    bpy.context.view_layer.update()
    backbone = objects_of(find_road(bpy.context.scene))["Backbone"]
    assert np.allclose(backbone.data.vertices[0].co[:2], (12.5, -7.25), atol=1e-4)
    # What stands at one place follows with the next build, which the panel offers.
    assert "Build as Edited" in "\n".join(drawn(panel.SYNTHROADS_PT_alignment, bpy.context).lines)
    bpy.ops.synthroads.build_edited()
    assert read().parameters.alignment == after
    assert "Build as Edited" not in "\n".join(drawn(panel.SYNTHROADS_PT_alignment, bpy.context).lines)


def test_an_edit_is_redone_after_it_was_undone(group: Any) -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.context.scene.synthroads_alignment.elements[0].length = 44.125
    bpy.ops.ed.undo_push(message="length")
    changed = rows()
    bpy.ops.ed.undo()
    assert rows() != changed
    bpy.ops.ed.redo()
    assert rows() == changed


@pytest.mark.parametrize("width", [200.0, 300.0])
def test_columns_have_headings_with_units(group: Any, width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a crossfall's row has a number alone, the heading says what it counts; where it is narrow, the row does."""
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    lines = "\n".join(drawn(panel.SYNTHROADS_PT_alignment, bpy.context).lines)
    assert "label 'Station'" in lines
    assert "label '%'" in lines or re.search(r"label '-?\d+(\.\d+)? %'", lines)


@pytest.mark.parametrize("width", [200.0, 300.0])
def test_no_word_is_cut(group: Any, width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    bpy.ops.synthroads.insert_element(kind="arc", number=0)
    group.active_elements = 1
    layout = drawn(panel.SYNTHROADS_PT_alignment, bpy.context)
    cut = [text for text, place, needed in layout.texts(width - 60.0) if needed > place]
    assert cut == []


@pytest.mark.parametrize("width", [200.0, 300.0])
def test_a_lists_row_shows_its_values_whole(group: Any, width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender cuts a number that is wider than its field: as many are shown as have room."""
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    bpy.ops.synthroads.insert_element(kind="arc", number=0)
    for table in tables.TABLES:
        kind = getattr(panel, f"SYNTHROADS_UL_{table}")
        for item in getattr(group, table):
            layout = FakeLayout()
            kind.draw_item(None, bpy.context, layout, group, item, 0, group, "")
            shown = layout.texts(room.row_width())
            assert [text for text, place, needed in shown if needed > place] == []
            assert layout.used  # a value at least
            assert 1 <= len(layout.used) <= (1 if width == 200.0 else 2)
    assert [_element_row(group, number).alert for number in (0, 1)] == [False, True]
    named = [any("Arc" in line for line in _element_row(group, 1).lines)]
    assert named == [width == 300.0]  # the kind's name is there at a usual width


@pytest.mark.parametrize(("width", "icon"), [(200.0, "SPHERECURVE"), (400.0, "ERROR")])
def test_a_rows_icon_is_its_kind_where_there_is_no_name_and_else_a_warning(
    group: Any, width: float, icon: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    bpy.ops.synthroads.insert_element(kind="arc", number=0)
    assert f"<{icon}>" in "".join(_element_row(group, 1).lines)
    assert "<ERROR>" not in "".join(_element_row(group, 0).lines)


def test_a_length_is_shown_with_its_millimetres(group: Any) -> None:
    """Blender counts the digits before the point as well: with 2 of them, 21.31 m would be shown as 21 m."""
    shown = bpy.utils.units.to_string("METRIC", "LENGTH", 21.311, precision=_digits(group.elements[0], "length"))
    assert shown == "21.311 m"
    shown = bpy.utils.units.to_string("METRIC", "LENGTH", 21.311, precision=2)
    assert shown == "21 m"


def _digits(item: Any, name: str) -> int:
    return int(item.bl_rna.properties[name].precision)


def _element_row(group: Any, number: int) -> FakeLayout:
    layout = FakeLayout()
    kind: Any = panel.SYNTHROADS_UL_elements
    kind.draw_item(None, bpy.context, layout, group, group.elements[number], 0, group, "")
    return layout.parts()[0]


def test_every_edit_stands_in_the_menu() -> None:
    """Blender's search finds what stands in a menu."""
    synthroads_addon.register()
    try:
        text = "\n".join(drawn(panel.SYNTHROADS_MT_alignment, bpy.context).lines)
        for words in ("Insert Straight", "Insert Clothoid", "Insert Arc", "Delete Element", "Split Element"):
            assert f"'{words}'" in text
        for words in ("Insert Vertical Point", "Delete Crossfall Point", "Insert Width", "Show Profile"):
            assert f"'{words}'" in text
    finally:
        synthroads_addon.unregister()
