"""Sun, sky, haze and cameras by one button: they are kept in the file, replaced by the next, and never scanned."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view

import synthroads_addon
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import ROLE
from synthroads_addon.blender.views.daylight import views_of
from synthroads_addon.blender.views.lamps import LAMP
from synthroads_addon.scanning.colour.light import sun_direction
from synthroads_addon.ui.panels import panels, rules, views
from tests.helpers.scenes.fake_layout import FakeLayout, drawn
from tests.helpers.scenes.panel_road import choose


@pytest.fixture(autouse=True)
def panel() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings of a small road in haze."""
    synthroads_addon.register()
    settings = bpy.context.scene.synthroads
    quick = {"fidelity": "draft", "own_vegetation_detail": True, "vegetation_detail": 0.1}
    choose(settings, **{"road.length": 60.0, "seed": 3, "road.half_width": 30.0, **quick})
    yield settings
    synthroads_addon.unregister()


def build(visibility: float) -> Any:
    bpy.ops.synthroads.build()
    root = next(item for item in bpy.data.objects if "synthroads_road" in item and item.type == "EMPTY")
    text = root["synthroads_parameters"]
    start = text.index('"visibility"')
    end = text.index("\n", start) if "\n" in text[start:] else len(text)
    old = text[start:end].rstrip(",}")
    root["synthroads_parameters"] = text.replace(old, f'"visibility": {visibility}')
    parameters = rules.edited_parameters(bpy.context.scene)
    assert parameters
    assert parameters.environment.visibility == visibility
    return parameters


def test_the_button_lights_the_road_and_looks_along_it(panel: Any, tmp_path: Path) -> None:
    parameters = build(800.0)
    before = scene_mesh()
    own = bpy.data.objects.new("Mine", bpy.data.lights.new("Mine", "SUN"))
    bpy.context.scene.collection.objects.link(own)
    assert bpy.ops.synthroads.add_views() == {"FINISHED"}
    found = views_of(bpy.context.scene)
    assert sorted(found) == ["aerial", "driver", "haze", "sun"]
    assert bpy.context.scene.camera == found["driver"]
    bpy.context.view_layer.update()
    towards = np.array(found["sun"].matrix_world)[:3, 2]
    assert towards == pytest.approx(sun_direction(parameters.environment), abs=1e-6)
    density = found["haze"].data.materials[0].node_tree.nodes["Volume Absorption"].inputs["Density"].default_value
    assert density == pytest.approx(-math.log(0.02) / 800.0)
    road = next(item for item in bpy.data.objects if item.get(ROLE) == "Road")
    for name in ("driver", "aerial"):
        corners = [road.matrix_world @ vertex.co for vertex in road.evaluated_get(graph()).data.vertices]
        seen = np.array([world_to_camera_view(bpy.context.scene, found[name], corner) for corner in corners])
        inside = (seen[:, 2] > 0.0) & (np.abs(seen[:, :2] - 0.5) < 0.5).all(axis=1)
        assert inside.mean() > 0.2, name
    after = scene_mesh()
    assert (before.vertices == after.vertices).all()
    layout = FakeLayout()
    panels.draw_scan(layout, bpy.context)
    assert "scanned too" not in "\n".join(layout.lines), "what scans leave out isn't counted"
    panel.seed = 5
    bpy.ops.synthroads.look_through(camera="aerial")
    bpy.ops.synthroads.add_views()
    assert sorted(views_of(bpy.context.scene)) == ["aerial", "driver", "haze", "sun"]
    assert bpy.context.scene.camera == views_of(bpy.context.scene)["aerial"]
    assert own.name in bpy.context.scene.objects
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert sorted(views_of(bpy.context.scene)) == ["aerial", "driver", "haze", "sun"]
    assert bpy.context.scene.world["synthroads_view"] == "sky"
    assert "Driver" in "\n".join(drawn(views.SYNTHROADS_PT_views, bpy.context).lines)


def graph() -> Any:
    return bpy.context.evaluated_depsgraph_get()


def test_clear_air_has_no_haze_and_the_users_world_stays() -> None:
    mine = bpy.data.worlds.new("Mine")
    bpy.context.scene.world = mine
    build(23_000.0)
    bpy.ops.synthroads.add_views()
    assert sorted(views_of(bpy.context.scene)) == ["aerial", "driver", "sun"]
    assert mine.use_fake_user
    assert bpy.context.scene.world != mine


def test_night_falls_over_a_road_with_its_edits(panel: Any) -> None:
    """The sun of the panel is the road's by the button alone: nothing is built again, and what was placed stays."""
    bpy.ops.synthroads.build()
    bpy.ops.synthroads.add_thing(kind="Gantry", station=30.0)
    before = rules.edited_parameters(bpy.context.scene)
    low, high = "road.environment.sun_elevation_deg_minimum", "road.environment.sun_elevation_deg_maximum"
    choose(panel, **{low: -20.0, high: -20.0})
    assert bpy.ops.synthroads.add_views() == {"FINISHED"}
    after = rules.edited_parameters(bpy.context.scene)
    assert before
    assert after
    assert after.environment.sun_elevation_deg == -20.0
    assert after.environment.sun_azimuth_deg == before.environment.sun_azimuth_deg
    assert after.objects == before.objects
    assert "gantry-1" in after.objects


def test_a_loaded_roads_sun_stays_until_the_panels_is_changed(panel: Any) -> None:
    bpy.ops.synthroads.build()
    before = rules.edited_parameters(bpy.context.scene)
    assert bpy.ops.synthroads.add_views() == {"FINISHED"}
    assert rules.edited_parameters(bpy.context.scene) == before


def test_one_button_lights_the_road_by_night(panel: Any) -> None:
    bpy.ops.synthroads.build()
    scene = bpy.context.scene
    scene.cycles.samples = 4096
    scene.camera = bpy.data.objects.new("Blender's", bpy.data.cameras.new("Blender's"))
    assert bpy.ops.synthroads.add_night() == {"FINISHED"}
    parameters = rules.edited_parameters(scene)
    assert parameters
    assert parameters.environment.sun_elevation_deg == views.NIGHT_SUN
    assert scene.render.engine == "CYCLES"
    assert scene.cycles.samples == views.NIGHT_SAMPLES
    assert scene.cycles.max_bounces == 4
    assert scene.cycles.adaptive_threshold == pytest.approx(0.03)
    assert scene.render.resolution_percentage == 100
    assert any(LAMP in item for item in scene.objects), "the driver's headlights"
    assert "Light by Night" in "\n".join(drawn(views.SYNTHROADS_PT_views, bpy.context).lines)
    assert scene.camera == views_of(scene)["driver"], "else the picture would show what Blender's own camera sees"
    scene.cycles.samples, scene.cycles.max_bounces, scene.render.resolution_percentage = 16, 6, 50
    bpy.ops.synthroads.add_night()
    assert (scene.cycles.samples, scene.cycles.max_bounces) == (16, 6), "the user's own numbers stay"
    assert scene.render.resolution_percentage == 50
    bpy.ops.synthroads.add_night(resolution_percentage=25)
    assert scene.render.resolution_percentage == 25
