"""Scans from the panel without a road: what is visible, with its classes, along a curve, from a camera, or over all."""

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import classes
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.ui.panels.scene_scan import unclassified
from synthroads_addon.ui.work import scan as scan_module
from tests.helpers.scenes.panel_road import choose, settings, small_pictures
from tests.helpers.scenes.scene_hash import changes, lines
from tests.helpers.scenes.transparent_materials import CASES, Nodes, add_card

__all__ = ["settings", "small_pictures"]

pytestmark = pytest.mark.usefixtures("small_pictures")
IDS = {row.name: row.id for row in classes()}
CHEAP = {
    "scan.own_lines_per_second": True,
    "scan.lines_per_second": 20.0,
    "scan.platform.speed": 10.0,
    "scan.platform.own_height": True,
    "scan.platform.height": 12.0,
    "colour.source": "material",
}


@pytest.fixture
def yard(settings: Any, tmp_path: Path) -> Any:
    """A plane with a box on it, each with a class by another way; return the panel's settings."""
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    ground = bpy.context.object
    collection = bpy.data.collections.new("ground")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(ground)
    bpy.ops.mesh.primitive_cube_add(size=4.0, location=(6.0, 3.0, 2.0))
    bpy.context.object.name = "Box"
    settings.show_scenario(load_scenario("rq31-600m-even"))
    choose(settings, **CHEAP)
    settings.output = str(tmp_path / "out")
    return settings


def guide(item: bpy.types.Object | None) -> None:
    bpy.context.scene.synthroads_scene_scan.guide = item


def curve(*points: tuple[float, float, float]) -> bpy.types.Object:
    data = bpy.data.curves.new("Way", "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("POLY")
    spline.points.add(len(points) - 1)
    for point, place in zip(spline.points, points, strict=True):
        point.co = (*place, 1.0)
    item = bpy.data.objects.new("Way", data)
    bpy.context.scene.collection.objects.link(item)
    return item


def camera(*places: tuple[float, float, float]) -> bpy.types.Object:
    item = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    bpy.context.scene.collection.objects.link(item)
    for number, place in enumerate(places):
        item.location = place
        if len(places) > 1:
            item.keyframe_insert("location", frame=1 + 20 * number)
    bpy.context.scene.frame_end = 21
    bpy.context.view_layer.update()
    return item


def scanned(settings: Any) -> Any:
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    folder = Path(settings.output)
    with open_cloud(folder / "cloud.laz") as cloud:
        blocks = list(cloud.blocks())
    points = np.concatenate([block.xyz for block in blocks])
    return (
        points,
        np.concatenate([block.class_id for block in blocks]),
        json.loads((folder / "report.json").read_text()),
    )


def test_what_is_visible_is_scanned_with_its_classes(yard: Any) -> None:
    assert [item.name for item in unclassified(bpy.context)] == ["Box"]
    bpy.context.scene.synthroads_scene_scan.point_class = "barrier"
    chosen = bpy.context.scene.synthroads_scene_scan.point_class
    assert bpy.ops.synthroads.set_class() == {"FINISHED"}
    assert unclassified(bpy.context) == []
    points, class_id, report = scanned(yard)
    box = points[:, 2] > 0.1
    assert box.sum() > 20
    assert set(class_id[box & (points[:, 2] > 1.0)].tolist()) == {IDS[chosen]}
    assert set(class_id[points[:, 2] < 0.01].tolist()) <= {IDS["ground"], IDS[chosen]}
    assert report["counts"]["points"] == len(points)
    assert "no class" not in " ".join(report["warnings"])


def test_along_a_curve(yard: Any) -> None:
    """Strips of a scanner 12 m above a curve along y at x = -15 lie there, and not over the middle."""
    bpy.data.objects["Box"].hide_render = True
    yard.scan.platform.lateral_offsets = "0"
    yard.scan.own_field_of_view_deg, yard.scan.field_of_view_deg = True, 20.0
    guide(curve((-15.0, -18.0, 0.0), (-15.0, 18.0, 0.0)))
    points, _, _ = scanned(yard)
    assert np.abs(points[:, 0] + 15.0).max() < 12.0 * np.tan(np.deg2rad(10.5))
    assert np.ptp(points[:, 1]) > 30.0


def test_from_a_still_camera_a_tripod_stands_there(yard: Any) -> None:
    yard.scan.platform.kind = "tripod"
    yard.scan.platform.turn_seconds = 1.0
    guide(camera((-5.0, 0.0, 1.5)))
    request = scan_module.requested_visible_scan(bpy.context)
    assert request.route.kind == "places"
    points, _, _ = scanned(yard)
    assert points[:, 0].min() > -20.1
    yard.scan.platform.kind = "uav"
    with pytest.raises(RuntimeError, match=r"Eye.*animate it, or choose a tripod"):
        bpy.ops.synthroads.scan()


def test_through_the_frames_of_a_moving_camera(yard: Any) -> None:
    bpy.context.scene.frame_set(7)
    guide(camera((-10.0, -15.0, 12.0), (-10.0, 15.0, 12.0)))
    request = scan_module.requested_visible_scan(bpy.context)
    assert request.route.kind == "flight"
    assert bpy.context.scene.frame_current == 7
    places = np.array(request.route.points)
    assert places[0] == pytest.approx((-10.0, -15.0, 12.0), abs=1e-5)
    assert places[-1] == pytest.approx((-10.0, 15.0, 12.0), abs=1e-5)
    path = request.route.path(request.scenario.scan.platform, scene_mesh())
    place = next(part for part in path.pose(path.strips[0], np.zeros(1)) if part.shape == (1, 3))
    assert place[0, 2] == pytest.approx(12.0, abs=1e-3)


def test_an_empty_scene_is_a_message(settings: Any, tmp_path: Path) -> None:
    settings.show_scenario(load_scenario("rq31-600m-even"))
    choose(settings, **CHEAP)
    settings.output = str(tmp_path / "out")
    with pytest.raises(RuntimeError, match="nothing visible has faces"):
        bpy.ops.synthroads.scan()
    assert not (tmp_path / "out").exists()


def test_a_scene_in_other_units_is_a_message(yard: Any) -> None:
    bpy.context.scene.unit_settings.scale_length = 0.01
    with pytest.raises(RuntimeError, match=r"Unit Scale is 0.01: must be 1 .*by 0.01"):
        bpy.ops.synthroads.scan()
    assert not Path(yard.output).exists()
    bpy.context.scene.unit_settings.system = "NONE"
    assert bpy.ops.synthroads.scan() == {"FINISHED"}


FAR = 20_000.0
"""How far east (m) of the origin a scene is moved, for coordinates that are held in steps of 2 mm."""


@pytest.mark.parametrize(
    ("visible", "boxes", "source"), [("render", 2, "material"), ("viewport", 1, "material"), ("render", 2, "images")]
)
def test_the_panel_scans_and_says_what_the_command_does(yard: Any, visible: str, boxes: int, source: str) -> None:
    """A box that the viewport hides, hair, and a card that is clear: seen, named and passed as by `synthroads scan`.

    Remarks of either Blender are in the report: on coordinates far from the origin, and faces whose vertices are of
    two classes.
    """
    choose(yard, **CHEAP | {"colour.source": source})
    twin = bpy.data.objects.new("Twin", bpy.data.objects["Box"].data)
    twin.location = (-8.0, 3.0, 2.0)
    bpy.context.scene.collection.objects.link(twin)
    settings = bpy.data.objects["Box"].modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.render_type, settings.count = "HAIR", "PATH", 3
    nodes = Nodes()
    CASES["noise"].build(nodes)
    add_card(nodes.item, size=2.0, height=9.0)
    layer = bpy.data.objects["Box"].data.attributes.new("class_id", "INT", "POINT")
    layer.data.foreach_set("value", [4] * 4 + [5] * 4)
    for item in bpy.data.objects:
        item.location.x += FAR
    bpy.context.view_layer.update()
    twin.hide_viewport = True
    bpy.context.scene.synthroads_scene_scan.visible = visible
    bpy.context.view_layer.update()
    before = lines()
    points, _, report = scanned(yard)
    assert changes(before) == []
    high = points[(points[:, 2] > 0.5) & (points[:, 2] < 8.0)]
    assert len(set((high[:, 0] > FAR).tolist())) == boxes
    text = " ".join(report["warnings"])
    assert "Box: hair can't be scanned" in text
    assert "the transparency of the material 'Clear' can't be worked out (Noise Texture" in text
    mixed = [text for text in report["remarks"] if "faces have vertices of several class_id" in text]
    assert [text.partition(" faces")[0] for text in mixed] == ["Box: 4", "Twin: 4"][:boxes]
    assert len([text for text in report["remarks"] if "are held in steps of 2 mm" in text]) == 1
