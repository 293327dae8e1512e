"""Road from Curve: on the curve, with its deviation and broken rules told, following it while that is wanted."""

from __future__ import annotations

import json
import re
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.model.roads import origin_of, world_matrix
from synthroads_addon.blender.model.store import find_road, recall, roads
from synthroads_addon.blender.model.truth import read_road
from synthroads_addon.blender.scene.curve_points import curve_points
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import alignment_of, profile_of
from synthroads_addon.ui.drawing import along_curve, links
from synthroads_addon.ui.fields import room
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import cheap, choose, settings, users_own  # noqa: F401


@pytest.fixture(autouse=True)
def draft(cheap: Any) -> None:  # noqa: F811
    """Build without what takes long."""
    choose(cheap, fidelity="draft")


CORNERS = ((-150.0, 0.0, 2.0), (0.0, 0.0, 2.0), (140.0, 60.0, 8.0))


def bezier(points: Any = CORNERS, name: str = "Ride") -> bpy.types.Object:
    """Add a smooth Bezier curve through points, the active object; return it."""
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(len(points) - 1)
    for point, place in zip(spline.bezier_points, points, strict=True):
        point.co = place
        point.handle_left_type = point.handle_right_type = "AUTO"
    return added(data, name)


def poly(points: Any, name: str = "Tangents") -> bpy.types.Object:
    """Add a polyline, the active object; return it."""
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("POLY")
    spline.points.add(len(points) - 1)
    for point, place in zip(spline.points, points, strict=True):
        point.co = (*place, 1.0)
    return added(data, name)


def added(data: Any, name: str) -> bpy.types.Object:
    item = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    return item


def off_curve(curve: bpy.types.Object, root: bpy.types.Object) -> tuple[float, float]:
    """Return how far a curve's points are at most from the road's axis as it stands in the scene, and in height, m."""
    axis = recall(root)[0].alignment
    into = np.linalg.inv(world_matrix(root))
    points = curve_points(curve) @ into[:3, :3].T + into[:3, 3]
    station, offset = alignment_of(axis).project(points[:, :2])
    return float(np.abs(offset).max()), float(np.abs(profile_of(axis).elevation(station) - points[:, 2]).max())


def test_the_road_lies_on_the_curve_and_tells_how_far_off_it_is(cheap: Any) -> None:  # noqa: F811
    curve = bezier()
    curve.location = (1000.0, -500.0, 1.0)
    curve.rotation_euler = (0.0, 0.0, 0.7)
    bpy.context.view_layer.update()
    assert bpy.ops.synthroads.road_from_curve() == {"FINISHED"}
    (root,) = roads(bpy.context.scene)
    across, up = off_curve(curve, root)
    deviation, rules = links.drawn_texts(root)
    assert across < 0.2
    assert f"at most {across:.2f}" in deviation
    assert up < 0.2
    broken = {violation.rule for violation in check(recall(root)[0])}
    assert "radius-minimum" in broken
    assert rules.startswith(f"it breaks {len(broken)} rules: Smallest radius (")
    assert read_road(root).known() == recall(root)[0], "nothing counts as edited"
    surface = next(item for item in bpy.data.objects if item.get("synthroads_role") == "Road")
    corners = np.array(
        [
            surface.matrix_world @ vertex.co
            for vertex in surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh().vertices
        ]
    )
    distances = [np.hypot(*(corners[:, :2] - point[:2]).T).min() for point in curve_points(curve)[::5]]
    assert max(distances) < 16.0, "the pavement is where the curve is"


def test_a_second_road_lies_on_its_curve_with_a_seed_of_its_own(cheap: Any) -> None:  # noqa: F811
    first_curve = bezier()
    bpy.ops.synthroads.road_from_curve()
    (first,) = roads(bpy.context.scene)
    second_curve = bezier([(x, y + 300.0, z) for x, y, z in CORNERS], "Other")
    bpy.ops.synthroads.road_from_curve(beside=True)
    second = next(root for root in roads(bpy.context.scene) if root != first)
    assert off_curve(second_curve, second)[0] < 0.2
    assert off_curve(first_curve, first)[0] < 0.2
    assert recall(first)[1].seed != recall(second)[1].seed == cheap.seed
    assert np.array_equal(origin_of(first), origin_of(second))


def test_it_follows_its_curve_until_it_is_unlinked(cheap: Any) -> None:  # noqa: F811
    curve = bezier()
    bpy.ops.synthroads.road_from_curve()
    (root,) = roads(bpy.context.scene)
    assert links.linked_curve(root, bpy.context.scene) == curve
    assert not links.is_outdated(root, bpy.context.scene)
    curve.data.splines[0].bezier_points[2].co = (140.0, -90.0, 2.0)
    curve.location.y = 25.0
    bpy.context.view_layer.update()
    assert links.is_outdated(root, bpy.context.scene)
    assert along_curve.followers(bpy.context.scene) == [], "it is to be asked for"
    bpy.context.scene.synthroads_drawing.follows = True
    assert along_curve.followers(bpy.context.scene) == [root]
    cheap.seed = 99
    along_curve.follow(root)
    assert off_curve(curve, root)[0] < 0.2
    assert recall(root)[1].seed == 3, "with the seed that it was built with"
    assert along_curve.followers(bpy.context.scene) == []
    bpy.ops.synthroads.unlink_curve()
    curve.location.y = 50.0
    bpy.context.view_layer.update()
    assert links.linked_curve(root, bpy.context.scene) is None
    assert not links.is_outdated(root, bpy.context.scene)
    assert not bpy.ops.synthroads.fit_again.poll()


def test_another_road_in_its_place_ends_the_link(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    bezier()
    bpy.ops.synthroads.road_from_curve()
    (root,) = roads(bpy.context.scene)
    bpy.ops.synthroads.build()
    assert find_road(bpy.context.scene) == root
    assert links.linked_curve(root, bpy.context.scene) is None
    assert links.drawn_texts(root) == ("", "")


def test_an_edited_road_keeps_its_link(cheap: Any) -> None:  # noqa: F811
    curve = bezier()
    bpy.ops.synthroads.road_from_curve()
    bpy.ops.synthroads.build_edited()
    (root,) = roads(bpy.context.scene)
    assert links.linked_curve(root, bpy.context.scene) == curve


def test_a_deleted_curve_is_no_link(cheap: Any) -> None:  # noqa: F811
    curve = bezier()
    bpy.ops.synthroads.road_from_curve()
    (root,) = roads(bpy.context.scene)
    bpy.context.scene.collection.objects.unlink(curve)
    assert links.linked_curve(root, bpy.context.scene) is None
    bpy.data.objects.remove(curve)
    assert links.linked_curve(root, bpy.context.scene) is None


def test_a_tangent_polygon_is_rounded_exactly_with_its_points_radii(cheap: Any) -> None:  # noqa: F811
    curve = poly([(0.0, 0.0, 0.0), (200.0, 0.0, 0.0), (400.0, 120.0, 0.0)])
    curve.data.splines[0].points[1].radius = 250.0
    bpy.context.scene.synthroads_drawing.tangents = True
    bpy.ops.synthroads.road_from_curve()
    axis = recall(find_road(bpy.context.scene))[0].alignment
    assert [element.kind for element in axis.horizontal] == ["line", "clothoid", "arc", "clothoid", "line"]
    assert axis.horizontal[2].curvature_start == pytest.approx(1.0 / 250.0, abs=1e-12)
    curve.data.splines[0].points[1].radius = 1.0
    assert links.curve_line(curve, links.CurveSettings(tangents=True)).radii == (0.0, 0.0, 0.0)


def test_points_of_the_tool_become_a_polygon_that_stays_linked(cheap: Any) -> None:  # noqa: F811
    rows = [[0.0, 0.0, 0.0, 0.0], [150.0, 0.0, 0.0, 300.0], [300.0, 60.0, 0.0, 0.0]]
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="must be JSON rows"):
        bpy.ops.synthroads.road_from_curve(polygon="[[1, 2]]")
    assert len(bpy.data.objects) == before
    bpy.ops.synthroads.road_from_curve(polygon=json.dumps(rows))
    (root,) = roads(bpy.context.scene)
    curve = links.linked_curve(root, bpy.context.scene)
    assert curve is not None
    assert [round(point.radius, 3) for point in curve.data.splines[0].points] == [1.0, 300.0, 1.0]
    assert curve.hide_render
    curve.data.splines[0].points[2].co.y = 0.0
    bpy.context.view_layer.update()
    bpy.ops.synthroads.fit_again()
    assert [element.kind for element in recall(root)[0].alignment.horizontal] == ["line"]


@pytest.mark.parametrize("kind", ["closed", "two", "short", "mesh", "none"])
def test_what_is_no_line_is_refused_with_the_remedy(kind: str, cheap: Any, users_own: Any) -> None:  # noqa: F811
    curve = bezier()
    message = {
        "closed": "Toggle Cyclic",
        "two": "has 2 splines",
        "short": "shorter than 1 m",
        "mesh": "select a curve first",
        "none": "select a curve first",
    }[kind]
    if kind == "closed":
        curve.data.splines[0].use_cyclic_u = True
    elif kind == "two":
        curve.data.splines.new("POLY")
    elif kind == "short":
        curve.scale = (0.001, 0.001, 0.001)
        bpy.context.view_layer.update()
    else:
        bpy.context.view_layer.objects.active = users_own if kind == "mesh" else None
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.synthroads.road_from_curve()
    assert roads(bpy.context.scene) == []


def test_a_curve_that_no_road_follows_is_refused_with_a_picture(cheap: Any) -> None:  # noqa: F811
    poly([(begin + along, 0.0, 0.0) for begin in (0.0, 400.0, 200.0) for along in np.arange(0.0, 200.0, 5.0)])
    with pytest.raises(RuntimeError, match=r"no road follows its points within 2 m.*Show Missed Axis"):
        bpy.ops.synthroads.road_from_curve()
    assert find_road(bpy.context.scene) is None
    assert "SynthRoads Axis Fit" in bpy.data.images


def test_heights_can_come_from_the_seed(cheap: Any) -> None:  # noqa: F811
    bezier([(x, y, 0.0) for x, y, _ in CORNERS])
    bpy.ops.synthroads.road_from_curve()
    heights = {point.elevation for point in recall(find_road(bpy.context.scene))[0].alignment.vertical}
    assert max(abs(height) for height in heights) < 1e-3, "a flat curve gives a level road"
    bpy.context.scene.synthroads_drawing.heights = "SEED"
    bpy.context.view_layer.objects.active = bpy.data.objects["Ride"]
    bpy.ops.synthroads.road_from_curve()
    heights = {point.elevation for point in recall(find_road(bpy.context.scene))[0].alignment.vertical}
    assert max(heights) - min(heights) > 0.1


@pytest.mark.parametrize("kind", ["NURBS", "CURVES"])
def test_other_kinds_of_curves_are_read(kind: str) -> None:
    if kind == "NURBS":
        data = bpy.data.curves.new("Nurbs", "CURVE")
        data.dimensions = "3D"
        spline = data.splines.new("NURBS")
        spline.points.add(3)
        for point, x in zip(spline.points, (0.0, 50.0, 100.0, 150.0), strict=True):
            point.co = (x, 0.0, 3.0, 1.0)
        spline.use_endpoint_u = True
        points = curve_points(added(data, "Nurbs"))
    else:
        data = bpy.data.hair_curves.new("Hair")
        data.add_curves([4])
        data.attributes["position"].data.foreach_set("vector", [0, 0, 3, 50, 0, 3, 100, 0, 3, 150, 0, 3])
        points = curve_points(added(data, "Hair"))
    assert points[0].tolist() == pytest.approx([0.0, 0.0, 3.0])
    assert points[-1].tolist() == pytest.approx([150.0, 0.0, 3.0], abs=1e-3)


@pytest.mark.parametrize("width", [200.0, 300.0])
def test_the_panel_shows_the_link_and_no_word_is_cut(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    panel = along_curve.SYNTHROADS_PT_drawing
    empty = "\n".join(drawn(panel, bpy.context).lines)
    assert "synthroads.draw_road" in empty
    assert "synthroads.fit_again" not in empty
    bezier()
    bpy.ops.synthroads.road_from_curve()
    layout = drawn(panel, bpy.context)
    text = " ".join(re.findall(r"label '([^']*)'", "\n".join(layout.lines)))
    for words in ("from the curve", "It breaks", "Linked to Ride"):
        assert words in text
    assert "synthroads.fit_again" in "\n".join(layout.lines)
    assert [item for item in layout.texts(room.row_width()) if item[2] > item[1] + 0.5] == []
