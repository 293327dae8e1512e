"""Exits, entries and bays placed, changed and deleted in Blender: truth, scene, redo, undo, panel."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest

import synthroads_addon
from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.roads import parts_and_copies
from synthroads_addon.blender.model.store import find_road, remember
from synthroads_addon.blender.model.truth import EditedRoad, read_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import Hatching, LineMarking, Turnout
from synthroads_addon.road.things.cabinet import Cabinet
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.ui.drawing.stations import changed_turnout, road_dots
from synthroads_addon.ui.panels import menus, turnouts
from tests.helpers.scenes.fake_layout import drawn

LENGTH = 700.0
SCENARIO: dict[str, Any] = {
    "seed": 7,
    "road": {
        "length": LENGTH,
        "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0},
        "lane_changes": {"share": 0.0},
        "furniture": {"construction_zone": 0.0, "overpass": 0.0},
    },
    "fidelity": "draft",
    "vegetation_detail": 0.0,
}


@pytest.fixture(autouse=True)
def road() -> Iterator[bpy.types.Object]:
    """Register the add-on and build a road without exits and bays; return its root."""
    synthroads_addon.register()
    scenario = Scenario.from_dict(SCENARIO)
    parameters = sample_road(scenario.road, scenario.seed)
    model = build_road(BuildRequest(parameters, 0.02, 0.0))
    remember(model.root, parameters, scenario, "")
    yield model.root
    synthroads_addon.unregister()


def truth() -> EditedRoad:
    """Return what the scene shows now."""
    bpy.context.view_layer.update()
    root = find_road(bpy.context.scene)
    assert root
    return read_road(root)


def paved_edge(station: float) -> float:
    """Return the largest distance to the right of the axis at which the scene's surface is a road there, m."""
    geometry = RoadGeometry(truth().known())
    mesh = scene_mesh()
    corners = mesh.vertices[mesh.triangles[mesh.class_id == class_id("road")]].reshape(-1, 3)
    places = geometry.alignment.project(corners[:, :2])
    near = np.abs(places[0] - station) < 8.0
    return float(-places[1][near].min())


def test_an_exit_is_placed_changed_dragged_and_deleted() -> None:
    scene = bpy.context.scene
    before = truth().known()
    geometry = RoadGeometry(before)
    x, y = geometry.alignment.place(np.array([200.0]), np.array([-30.0]))[0].tolist()
    scene.cursor.location = (x, y, 0.0)
    narrow = paved_edge(400.0)
    assert bpy.ops.synthroads.add_turnout(kind="exit") == {"FINISHED"}
    now = truth()
    placed = now.known().of_type(Turnout)["exit-right"]
    assert (placed.start_station, placed.kind) == (pytest.approx(200.0, abs=0.01), "exit")
    assert (now.by_hand, now.stale, now.lost) == ((), (), "")
    assert check(now.known()) == []
    wide = RoadGeometry(now.known()).sections["right"]
    assert paved_edge(400.0) == pytest.approx(float(wide.paved_edge(400.0)[0]), abs=0.05)
    assert paved_edge(400.0) > narrow + 1.0
    # What belongs to it.
    known = now.known()
    assert sorted(line.kind for line in known.of_type(LineMarking).values() if line.turnout) == [
        "gore_edge",
        "turnout_edge",
    ]
    assert len(known.of_type(Hatching)) == 1
    codes = {item.code for key, item in known.of_type(TrafficSign).items() if key not in before.objects}
    assert codes == {"333", "450-50", "450-51"}  # in the gore, and those before it that lie on the road
    # The panel lists it, the menu changes it, the dots stand at its ends.
    lines = "\n".join(drawn(turnouts.SYNTHROADS_PT_exits, bpy.context).lines)
    assert "Exit Right: 200 m, 365 m long" in lines
    assert "Change Exit Right" in "\n".join(drawn(menus.SYNTHROADS_MT_turnouts, bpy.context).lines)
    ends = [dot for dot in road_dots(RoadGeometry(known), {}) if dot.kind in ("turnout", "turnout_end")]
    assert [dot.station for dot in ends] == [placed.start_station, placed.end_station]
    # A second one has no room there; the scene stays.
    with pytest.raises(RuntimeError, match="less than 20 m from exit-right"):
        bpy.ops.synthroads.add_turnout(kind="emergency_bay", station=300.0, side="right")
    # Dragged: its end by 12 m, then itself by 30 m; sizes that aren't given stay.
    fields = changed_turnout(placed, "turnout_end", placed.end_station + 12.0)
    assert bpy.ops.synthroads.change_turnout(turnout="exit-right", **fields) == {"FINISHED"}
    assert bpy.ops.synthroads.change_turnout(turnout="exit-right", station=170.0) == {"FINISHED"}
    now = truth()
    moved = now.known().of_type(Turnout)["exit-right"]
    assert moved == placed.model_copy(
        update={"start_station": 170.0, "lane_length": pytest.approx(placed.lane_length + 12.0), "ramp": moved.ramp}
    )
    assert (now.by_hand, now.stale, check(now.known())) == ((), (), [])
    # Deleted with all of it.
    assert bpy.ops.synthroads.delete_turnout(turnout="exit-right") == {"FINISHED"}
    after = truth().known()
    assert (after.of_type(Turnout), after.of_type(Hatching)) == ({}, {})
    for kind in (LineMarking, TrafficSign, Guardrail):
        assert after.of_type(kind) == before.of_type(kind)
    assert paved_edge(400.0) == pytest.approx(narrow, abs=0.001)


def test_a_bay_of_stated_sizes_keeps_edits_of_other_things() -> None:
    root = find_road(bpy.context.scene)
    assert root
    name = next(key for key in truth().known().of_type(Cabinet))
    item = parts_and_copies(root, bpy.context.scene)[0][name]
    item.location.x += 0.4
    edited = truth().known().objects[name]
    sizes = {"by_rule": False, "lane_length": 55.0, "lane_width": 3.4, "taper_length": 25.0}
    assert bpy.ops.synthroads.add_turnout(kind="emergency_bay", station=300.0, side="left", **sizes) == {"FINISHED"}
    now = truth().known()
    bay = now.of_type(Turnout)["emergency-bay-left"]
    assert (bay.lane_length, bay.lane_width, bay.taper_in_length, bay.taper_out_length) == (55.0, 3.4, 25.0, 25.0)
    assert now.objects[name] == edited


def test_unknown_ids_and_a_scene_without_a_road_are_refused() -> None:
    with pytest.raises(RuntimeError, match="must be"):
        bpy.ops.synthroads.change_turnout(turnout="exit-left")
    with pytest.raises(RuntimeError, match="the road has none"):
        bpy.ops.synthroads.delete_turnout(turnout="exit-left")
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not bpy.ops.synthroads.add_turnout.poll()
