"""Dots that are dragged along the road, and the label: numbers exact, stations in the truth, undone by one step."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model.roads import parts_and_copies
from synthroads_addon.blender.model.store import find_road, recall
from synthroads_addon.blender.model.truth import read_road
from synthroads_addon.jobs.drawn_axis import rounded_axis
from synthroads_addon.road.crossfall import crossfall_points
from synthroads_addon.road.geometry import RoadGeometry, alignment_of
from synthroads_addon.road.objects import LineObject
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.things.thing import Thing
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.ui.drawing import dots, overlay
from synthroads_addon.ui.drawing.stations import (
    Dot,
    allowed_stations,
    moved_axis,
    road_dots,
    station_at,
    with_axis,
)
from tests.helpers.scenes.panel_road import settings  # noqa: F401
from tests.helpers.scenes.small_road import build_small, small_parameters

POINTS = np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 10.0], [900.0, 200.0, 4.0]])


def road() -> RoadParameters:
    """Return a road along a tangent polygon, with a vertical point and its usual furniture."""
    limits = RoadScenario(length=900.0, half_width=30.0)
    axis = rounded_axis(POINTS, [500.0], limits).axis
    return sample_road(limits, 4, axis=axis)


def dot_of(parameters: RoadParameters, kind: str, number: int = 1) -> Dot:
    """Return a dot of the axis."""
    return next(dot for dot in road_dots(RoadGeometry(parameters), {}) if (dot.kind, dot.number) == (kind, number))


def test_there_is_a_dot_at_each_end_vertical_point_and_station() -> None:
    parameters = road()
    things = {name: item for name, item in parameters.objects.items() if isinstance(item, Thing)}
    found = road_dots(RoadGeometry(parameters), things)
    axis = parameters.alignment
    assert sum(dot.kind == "element" for dot in found) == len(axis.horizontal) - 1
    assert sum(dot.kind == "vertical" for dot in found) == len(axis.vertical) - 2 == 1
    lines = sum(isinstance(item, LineObject) for item in things.values())
    assert sum(dot.kind in ("start", "end") for dot in found) == 2 * lines > 0
    assert sum(dot.kind == "thing" for dot in found) == len(things) - lines > 0
    alignment = alignment_of(axis)
    for dot in found:
        station, offset = alignment.project(np.array([dot.place[:2]]))
        assert station[0] == pytest.approx(dot.station, abs=1e-3)
        assert offset[0] == pytest.approx(dot.offset, abs=1e-3)


def test_a_dot_follows_the_mouse_along_the_road_and_stays_between_its_neighbours() -> None:
    geometry = RoadGeometry(road())
    dot = dot_of(geometry.parameters, "element", 1)
    place = alignment_of(geometry.parameters.alignment).place(np.array([dot.station + 3.456]), np.array([7.0]))[0]
    assert station_at(geometry, dot, (place[0], place[1])) == pytest.approx(dot.station + 3.456, abs=0.005)
    low, high = allowed_stations(geometry.parameters.alignment, dot)
    assert station_at(geometry, dot, (-500.0, 0.0)) == pytest.approx(low, abs=0.005)
    assert station_at(geometry, dot, (900.0, 200.0)) == pytest.approx(high, abs=0.005)


def test_an_elements_end_moves_and_the_length_stays() -> None:
    axis = road().alignment
    lengths = [element.length for element in axis.horizontal]
    moved = moved_axis(axis, "element", 1, lengths[0] + 5.0)
    assert [element.length for element in moved.horizontal] == pytest.approx(
        [lengths[0] + 5.0, lengths[1] - 5.0, *lengths[2:]]
    )
    assert moved.length == pytest.approx(axis.length, abs=1e-8)
    assert [e.curvature_start for e in moved.horizontal] == [e.curvature_start for e in axis.horizontal]


def test_a_vertical_point_moves_alone() -> None:
    axis = road().alignment
    moved = moved_axis(axis, "vertical", 1, axis.vertical[1].station + 20.0)
    assert moved.vertical[1].station == axis.vertical[1].station + 20.0
    assert moved.vertical[1].elevation == axis.vertical[1].elevation
    assert moved.horizontal == axis.horizontal


@pytest.mark.parametrize(
    ("kind", "number", "station", "message"),
    [
        ("element", 0, 5.0, "from 1 to 4"),
        ("element", 9, 5.0, "from 1 to 4"),
        ("element", 1, 900.0, "between its neighbours"),
        ("vertical", 1, 0.2, "between its neighbours"),
        ("vertical", 2, 5.0, "from 1 to 1"),
    ],
)
def test_no_place_or_no_room_is_refused(kind: Any, number: int, station: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        moved_axis(road().alignment, kind, number, station)


def test_roundings_that_would_overlap_are_refused() -> None:
    axis = road().alignment
    points = (
        VerticalPoint(station=0.0, elevation=0.0),
        VerticalPoint(station=400.0, elevation=8.0, radius=9000.0),
        VerticalPoint(station=900.0, elevation=0.0),
    )
    steep = axis.model_copy(update={"vertical": points})
    with pytest.raises(InputError, match=r"tangents|grades|more distance"):
        moved_axis(steep, "vertical", 1, 20.0)


def test_crossfall_by_the_rule_follows_the_curves_and_others_stay() -> None:
    parameters = road()
    axis = moved_axis(parameters.alignment, "element", 1, parameters.alignment.horizontal[0].length + 5.0)
    moved = with_axis(parameters, axis)
    right = moved.carriageway("right")
    assert right
    assert right.crossfall == crossfall_points("EKA1A", "right", 6.0, axis.horizontal)
    assert right.crossfall != parameters.carriageway("right").crossfall  # type: ignore[union-attr]
    own = parameters.carriageway(
        "left"
    ).model_copy(  # type: ignore[union-attr]
        update={"crossfall": parameters.carriageway("left").crossfall[:1]}  # type: ignore[union-attr]
    )
    name = next(key for key, item in parameters.objects.items() if item == parameters.carriageway("left"))
    by_hand = parameters.model_copy(update={"objects": parameters.objects | {name: own}})
    assert with_axis(by_hand, axis).carriageway("left") == own


def test_dots_of_things_are_where_the_things_are_now() -> None:
    build_small()
    root = find_road(bpy.context.scene)
    assert root
    item = parts_and_copies(root, bpy.context.scene)[0]["sign"]
    bpy.ops.synthroads.move_thing(thing="sign", kind="thing", station=33.25)
    bpy.context.view_layer.update()
    found = dots.present_dots(root, bpy.context.scene)
    assert found
    (dot,) = [dot for dot in found[1] if dot.name == "sign"]
    assert dot.station == pytest.approx(33.25, abs=1e-3)
    assert read_road(root).known().objects["sign"].station == pytest.approx(33.25, abs=1e-3)  # type: ignore[attr-defined]
    assert np.abs(np.array(item.location)[:2] - dot.place[:2]).max() < 1e-3
    assert {dot.name for dot in found[1]} >= {"rail-left", "rail-right", "sign"}
    assert "post-1" not in {dot.name for dot in found[1]}, "posts have no object of their own"


def test_a_line_things_ends_move_one_by_one() -> None:
    build_small()
    bpy.ops.synthroads.move_thing(thing="rail-left", kind="end", station=40.0)
    bpy.ops.synthroads.move_thing(thing="rail-left", kind="start", station=12.5)
    rail = read_road(find_road(bpy.context.scene)).known().objects["rail-left"]  # type: ignore[arg-type]
    assert (rail.start_station, rail.end_station) == (12.5, 40.0)  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError, match="must be a part of the shown road"):
        bpy.ops.synthroads.move_thing(thing="nothing", kind="thing", station=1.0)


def test_the_axis_is_moved_and_the_road_built_again_in_its_place() -> None:
    parameters = small_parameters()
    curvature = parameters.alignment.horizontal[0].curvature_start
    elements = tuple(HorizontalElement.between(length, curvature, curvature) for length in (25.0, 35.0))
    name = next(iter(parameters.of_type(AlignmentObject)))
    axis = parameters.alignment.model_copy(update={"horizontal": elements})
    build_small(parameters.model_copy(update={"objects": parameters.objects | {name: axis}}))
    root = find_road(bpy.context.scene)
    assert root
    kind = "element"
    (dot,) = road_dots(RoadGeometry(recall(root)[0]), {})
    bpy.ops.synthroads.move_axis_point(kind=kind, number=dot.number, station=dot.station + 2.0)
    assert find_road(bpy.context.scene) == root
    now = next(d for d in road_dots(RoadGeometry(recall(root)[0]), {}) if (d.kind, d.number) == (kind, dot.number))
    assert now.station == pytest.approx(dot.station + 2.0, abs=1e-6)
    assert set(recall(root)[0].objects) >= {"sign", "rail-left"}
    with pytest.raises(RuntimeError, match=r"between its neighbours|Number"):
        bpy.ops.synthroads.move_axis_point(kind=kind, number=dot.number, station=5000.0)


def test_the_label_tells_station_and_offset_of_what_is_moved() -> None:
    build_small()
    root = find_road(bpy.context.scene)
    assert root
    parts, scene = parts_and_copies(root, bpy.context.scene)[0], bpy.context.scene
    assert dots.label_of(parts["sign"], scene) == "station 40.00 m, offset -16.50 m"
    assert dots.label_of(parts["Road"], scene) == ""
    assert dots.label_of(None, scene) == ""
    place = RoadGeometry(recall(root)[0]).alignment.place(np.array([23.4]), np.array([-4.2]))[0]
    parts["sign"].location[:2] = place.tolist()
    bpy.context.view_layer.update()
    assert dots.label_of(parts["sign"], scene) == "station 23.40 m, offset -4.20 m"
    root.location, root.rotation_euler = (100.0, 50.0, 3.0), (0.0, 0.0, 0.5)
    bpy.context.view_layer.update()
    assert dots.label_of(parts["sign"], scene) == "station 23.40 m, offset -4.20 m", "the whole road was moved"


def test_the_group_of_gizmos_is_for_roads_in_object_mode() -> None:
    group = dots.SYNTHROADS_GGT_dots
    assert bpy.types.GizmoGroup.bl_rna_get_subclass_py(group.bl_idname) is group
    assert not group.poll(bpy.context)
    build_small()
    root = find_road(bpy.context.scene)
    assert root
    bpy.context.view_layer.objects.active = parts_and_copies(root, bpy.context.scene)[0]["sign"]
    assert group.poll(bpy.context)
    bpy.context.scene.synthroads_drawing.dots = False
    assert not group.poll(bpy.context)
    assert set(dots._COLORS) == set(dots._SIZE)


def test_labels_at_one_place_are_drawn_above_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[tuple[float, float], str]] = []
    monkeypatch.setattr(overlay, "label_size", lambda text, scale: (8.0 * len(text), 20.0))
    monkeypatch.setattr(overlay, "draw_label", lambda place, text, scale: drawn.append((place, text)))
    overlay.draw_labels([((10.0, 10.0), "station 180.94 m"), ((12.0, 14.0), "exit-right"), ((300.0, 14.0), "far")], 1.0)
    assert [text for _, text in drawn] == ["station 180.94 m", "exit-right", "far"]
    assert [place for place, _ in drawn] == [(10.0, 10.0), (12.0, 30.0), (300.0, 14.0)]
    assert dots.draw_labels is overlay.draw_labels
