"""Any curve as the backbone that groups follow, and places along it."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.nodes.axis import axis_from_curve_group
from synthroads_addon.blender.nodes.points import points_along_axis_group
from synthroads_addon.blender.things.delineator import delineator_group
from synthroads_addon.blender.things.guardrail import guardrail_group

RADIUS, ANGLE, RISE = 300.0, 0.5, 0.02
LENGTH = RADIUS * ANGLE


def arc(count: int = 400) -> bpy.types.Object:
    """Return a curve object: an arc to the left that begins along +x and climbs evenly."""
    curve = bpy.data.curves.new("Arc", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("POLY")
    spline.points.add(count - 1)
    for point, turn in zip(spline.points, np.linspace(0.0, ANGLE, count), strict=True):
        point.co = (RADIUS * math.sin(turn), RADIUS * (1 - math.cos(turn)), RISE * RADIUS * turn, 1.0)
    return linked(bpy.data.objects.new("Arc", curve))


def linked(item: bpy.types.Object) -> bpy.types.Object:
    bpy.context.scene.collection.objects.link(item)
    return item


def empty() -> bpy.types.Object:
    return linked(bpy.data.objects.new("Item", bpy.data.meshes.new("Item")))


def give(item: bpy.types.Object, group: bpy.types.NodeTree, **inputs: Any) -> None:
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    for name, value in inputs.items():
        set_modifier_input(modifier, name.replace("_", " "), value)


def meshes_of(item: bpy.types.Object) -> list[bpy.types.Mesh]:
    """Return the meshes that an object is evaluated to; a curve's mesh is an instance of it."""
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    return [entry.object.data for entry in shown if entry.object.original == item and entry.object.type == "MESH"]


def values(mesh: bpy.types.Mesh, name: str) -> np.ndarray[Any, Any]:
    data = mesh.attributes[name].data
    return np.array([entry.vector if hasattr(entry, "vector") else entry.value for entry in data])


def corners(mesh: bpy.types.Mesh) -> np.ndarray[Any, Any]:
    return np.array([vertex.co for vertex in mesh.vertices])


def test_an_arc_becomes_its_backbone() -> None:
    item = arc()
    give(item, axis_from_curve_group(), Crossfall_Left=-0.04, First_Station=100.0)
    (mesh,) = meshes_of(item)
    station = values(mesh, "station") - 100.0
    assert station[[0, -1]] == pytest.approx([0.0, LENGTH], abs=1e-3)  # in plan, not along the grade
    turn = station / RADIUS
    ahead, left = np.sin(turn), 1.0 - np.cos(turn)
    assert corners(mesh) == pytest.approx(np.column_stack([RADIUS * ahead, RADIUS * left, RISE * station]), abs=1e-3)
    wanted = np.column_stack([-np.sin(turn), np.cos(turn), 0.0 * turn])
    assert values(mesh, "left") == pytest.approx(wanted, abs=1e-4)
    assert values(mesh, "curvature") * RADIUS == pytest.approx(np.ones(len(station)), abs=0.01)
    assert values(mesh, "crossfall_left") == pytest.approx(-0.04)
    assert values(mesh, "crossfall_right") == pytest.approx(0.025)


def test_a_guardrail_lies_along_a_curve_that_it_is_put_on_or_given() -> None:
    """Without a road it stands at the curve's height, and its end is the curve's."""
    curve, rail = arc(), empty()
    give(rail, guardrail_group(), Backbone=curve, Terminal_Length=0.0)
    beside = corners(*meshes_of(rail))
    give(curve, guardrail_group(), Terminal_Length=0.0)
    assert corners(*meshes_of(curve)) == pytest.approx(beside, abs=1e-4)
    x, y, z = beside.T
    turn = np.arctan2(x, RADIUS - y)
    assert np.abs(np.hypot(x, RADIUS - y) - RADIUS).max() < 0.2
    assert [turn.min(), turn.max()] == pytest.approx([0.0, ANGLE], abs=1e-3)
    above = z - RISE * RADIUS * turn
    for half in (turn < ANGLE / 2, turn > ANGLE / 2):
        assert above[half].max() == pytest.approx(0.75, abs=0.01)


def test_delineators_stand_along_a_curve() -> None:
    """Two groups one after the other: points along it, and a post of the usual height on each."""
    item = arc()
    give(item, points_along_axis_group(), Spacing=50.0, Offset=-5.0)
    (points,) = meshes_of(item)
    turn = np.arange(4) * 50.0 / RADIUS
    assert values(points, "heading") == pytest.approx(turn - math.pi / 2.0, abs=1e-3)
    give(item, delineator_group())
    (posts,) = meshes_of(item)
    places = corners(posts).reshape(4, -1, 3)
    assert np.hypot(*places.mean(axis=1)[:, :2].T - [[0.0], [RADIUS]]) == pytest.approx(RADIUS + 5.0, abs=0.1)
    assert places[0, :, 2].max() == pytest.approx(1.0, abs=0.02)
