"""The builder, and the node groups as a user meets them in Blender's editor."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from inspect import signature
from itertools import chain
from pathlib import Path
from pkgutil import walk_packages

import bpy
import numpy as np
import pytest

from synthroads_addon.blender import nodes, things
from synthroads_addon.blender.compat import modifier_input, set_modifier_input
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.nodes import builder
from synthroads_addon.blender.nodes import operations as op
from synthroads_addon.blender.nodes.builder import Tree, Value, node_group
from synthroads_addon.blender.nodes.strip import strip_group
from synthroads_addon.blender.things.guardrail import guardrail_group
from synthroads_addon.blender.things.road.carriageway import height_group
from synthroads_addon.blender.things.road.layout import MarkingLayout, SideLayout
from synthroads_addon.blender.things.road.markings import carriageway_marking_group
from synthroads_addon.blender.things.road.road import road_group
from synthroads_addon.blender.things.vehicle.vehicle import vehicle_group
from synthroads_addon.road.things.vehicles import CHASSIS
from tests.helpers.scenes.described_group import describe
from tests.helpers.scenes.kept_groups import KeptGroups

LAYOUT = (
    SideLayout("Left", 3, (MarkingLayout("Outer Edge Line", "outer_edge", 0), MarkingLayout("Lane Line", "lane", 1))),
    SideLayout(
        "Right",
        2,
        (
            MarkingLayout("Inner Edge Line", "inner_edge", 2),
            MarkingLayout("Gore Edge Line", "gore_edge"),
            MarkingLayout("Free Line", "free", varies=True),
        ),
        varying=("Hard Shoulder", "Lane 1"),
        turnouts=("Exit",),
        detailed=("Lane 2",),
    ),
)

SNAPSHOTS = Path(__file__).parent / "snapshots"
WRITE = "SYNTHROADS_WRITE_SNAPSHOTS"


def all_groups() -> list[bpy.types.NodeTree]:
    """Return every group of the road model, sub-groups included: each module's `..._group` function makes one."""
    road_group(LAYOUT)
    packages = [walk_packages(package.__path__, f"{package.__name__}.") for package in (nodes, things)]
    for module in chain.from_iterable(packages):
        loaded = import_module(module.name)
        for name, make in vars(loaded).items():
            own = getattr(make, "__module__", "") == loaded.__name__
            if name.endswith("_group") and own and not signature(make, follow_wrapped=False).parameters:
                make()
    for model in CHASSIS:
        vehicle_group(model)
    return [group for group in bpy.data.node_groups if group.name.startswith("SR ")]


def evaluated(group: bpy.types.NodeTree, **inputs: object) -> bpy.types.Mesh:
    """Return what a group makes as the modifier of an empty mesh; materials are named as in their table."""
    item = bpy.data.objects.new("Item", bpy.data.meshes.new("Item"))
    bpy.context.scene.collection.objects.link(item)
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    for name, value in inputs.items():
        named = isinstance(value, str) and name.endswith("Material")
        set_modifier_input(modifier, name, material(str(value)) if named else value)
    return item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def results(tree: Tree, values: dict[str, Value]) -> None:
    """Let the group return one point that carries the values as attributes."""
    mesh = tree.node("GeometryNodeMeshLine", count=1).value
    for name, value in values.items():
        mesh = op.store(mesh, name, value)
    tree.output("Mesh", mesh)


def stored(mesh: bpy.types.Mesh, name: str) -> object:
    attribute = mesh.attributes[name].data[0]
    return tuple(attribute.vector) if hasattr(attribute, "vector") else attribute.value


class TestBuilder:
    def test_sockets_calculate(self) -> None:
        def build(tree: Tree) -> None:
            """Arithmetic."""
            x = tree.number("X", 7.0, (-100.0, 100.0), description="x")
            n = tree.integer("N", 7, (-100, 100), description="n")
            v = op.vector(tree, x, 1.0, 2.0)
            results(tree, {
                "a": (x + 1.0) * 2.0 - x / 2.0,
                "b": 10.0 - x,
                "c": 21.0 / x,
                "d": -x % 4.0,
                "e": n // 2 + n % 4,
                "f": (n + 1) * 2 - 1,
                "g": n / 2,
                "h": 2.0 * v + (1.0, 0.0, 0.0),
                "i": op.dot(v, v),
                "j": (x > 6.9) & ~(x >= 7.1) & n.equals(7),
                "k": op.switch(x < 0.0, x, 0.0),
                "l": v - v * (1.0, 1.0, 0.5),
                "m": op.component(v, "Y"),
            })  # fmt: skip

        mesh = evaluated(node_group("Arithmetic", build))
        wanted = {
            "a": 12.5,
            "b": 3.0,
            "c": 3.0,
            "d": 1.0,
            "e": 6,
            "f": 15,
            "g": 3.5,
            "h": (15, 2, 4),
            "i": 54.0,
        }
        wanted |= {"j": True, "k": 7.0, "l": (0, 0, 1), "m": 1.0}
        assert {name: pytest.approx(stored(mesh, name)) for name in wanted} == wanted
        assert mesh.attributes["e"].data_type == mesh.attributes["f"].data_type == "INT"
        mesh = evaluated(node_group("Arithmetic", build), X=-8.0)
        assert stored(mesh, "k") == 0.0
        assert stored(mesh, "j") is False

    def test_joined_geometry_keeps_its_order(self) -> None:
        def build(tree: Tree) -> None:
            """Joined points."""
            points = [tree.node("GeometryNodeMeshLine", count=1, start_location=(i, 0.0, 0.0)).value for i in range(4)]
            tree.output("Mesh", op.join(*points))

        mesh = evaluated(node_group("Joined", build))
        assert [vertex.co.x for vertex in mesh.vertices] == [0.0, 1.0, 2.0, 3.0]

    def test_a_grid_has_columns_from_left_to_right_and_looks_up(self) -> None:
        def build(tree: Tree) -> None:
            """A grid."""
            mesh, column, row = op.grid(tree, 4, 3)
            tree.output("Mesh", op.set_position(mesh, op.vector(tree, column, row)))

        mesh = evaluated(node_group("Grid", build))
        places = np.array([vertex.co for vertex in mesh.vertices])
        assert sorted(map(tuple, places[:, :2].tolist())) == [(x, y) for x in range(4) for y in range(3)]
        assert all(face.normal.z > 0.99 for face in mesh.polygons)

    def test_a_group_of_the_same_version_is_used_again(self, monkeypatch: pytest.MonkeyPatch) -> None:
        first = strip_group()
        assert strip_group() == first
        monkeypatch.setattr(builder, "_sources_digest", lambda: b"changed")
        second = strip_group()
        assert second != first
        assert second.name == "SR Strip"
        assert first.name == "SR Strip (older)"

    def test_groups_of_other_lanes_are_groups_of_their_own(self) -> None:
        assert road_group(LAYOUT) == road_group(LAYOUT)
        assert road_group(LAYOUT) != road_group(LAYOUT[1:])

    def test_an_unknown_input_is_refused(self) -> None:
        def build(tree: Tree) -> None:
            """A mistake."""
            tree.node("GeometryNodeMeshLine", cuont=1)

        with pytest.raises(KeyError, match="cuont"):
            node_group("Mistake", build)

    def test_modifier_inputs_are_set_and_read(self) -> None:
        item = bpy.data.objects.new("Item", bpy.data.meshes.new("Item"))
        modifier = item.modifiers.new("Nodes", "NODES")
        modifier.node_group = guardrail_group()
        for name, value in {"Height": 0.8, "Left Beam": False, "Instance": 7, "Road": item}.items():
            set_modifier_input(modifier, name, value)
            assert modifier_input(modifier, name) == (pytest.approx(value) if name == "Height" else value)
        with pytest.raises(KeyError, match="Hieght"):
            set_modifier_input(modifier, "Hieght", 1.0)


class TestKeptGroups:
    def test_what_is_taken_is_what_would_be_made(self, kept_groups: KeptGroups) -> None:
        def road() -> dict[str, str]:
            bpy.ops.wm.read_factory_settings(use_empty=True)
            strip_group()  # one of the road's that is there already
            road_group(LAYOUT)
            groups = bpy.data.node_groups
            return {f"{group.name} {group[builder.KEY]} {group.users}": describe(group) for group in groups}

        kept_groups.on = False
        made = road()
        kept_groups.on = True
        road()
        make, kept_groups._make = kept_groups._make, None
        try:
            taken = road()
        finally:
            kept_groups._make = make
        assert taken == made
        assert not bpy.data.libraries


class TestEveryGroup:
    """They are made once and only read: to make them takes far longer than to look at them."""

    pytestmark = pytest.mark.keep_scene

    @pytest.fixture(scope="class")
    def groups(self) -> list[bpy.types.NodeTree]:
        """Return every group of the road model."""
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        groups = all_groups()
        assert len(groups) > 50
        return groups

    def test_inputs_are_described_and_limited(self, groups: list[bpy.types.NodeTree]) -> None:
        for group in groups:
            assert group.description, group.name
            sockets = [item for item in group.interface.items_tree if item.item_type == "SOCKET"]
            names = [item.name for item in sockets]
            for item in sockets:
                where = f"{group.name}: {item.name}"
                assert item.in_out == "OUTPUT" or item.description, where
                if item.in_out == "INPUT" and item.socket_type in ("NodeSocketFloat", "NodeSocketInt"):
                    assert item.min_value <= item.default_value <= item.max_value, where
                    assert item.min_value > -1e9 or item.name.endswith("Instance"), where
                if item.in_out == "INPUT" and item.name.endswith(("Width", "Height", "Length", "Spacing", "Offset")):
                    assert item.subtype in ("DISTANCE", "FACTOR"), where
            assert len(set(names)) == len(names), group.name

    def test_nodes_stand_in_named_frames_and_do_not_overlap(self, groups: list[bpy.types.NodeTree]) -> None:
        for group in groups:
            nodes = [node for node in group.nodes if node.type not in ("FRAME", "GROUP_OUTPUT")]
            framed = [node for node in nodes if node.parent is not None and node.parent.label]
            assert len(framed) > 0.8 * len(nodes), group.name
            places = [tuple(node.location_absolute) for node in nodes]
            assert len(set(places)) == len(places), group.name
            for link in group.links:
                if link.from_node.parent == link.to_node.parent and link.to_node.parent is not None:
                    assert link.from_node.location_absolute.x < link.to_node.location_absolute.x, group.name

    def test_groups_are_valid(self, groups: list[bpy.types.NodeTree]) -> None:
        for group in groups:
            assert all(link.is_valid for link in group.links), group.name
            makes = next(item for item in group.interface.items_tree if item.in_out == "OUTPUT").socket_type
            assert group.is_modifier == (makes == "NodeSocketGeometry"), group.name
            assert group.color_tag != "NONE", group.name


class TestGroups:
    @pytest.mark.parametrize("make", [strip_group, height_group, carriageway_marking_group])
    def test_a_group_is_as_its_snapshot(self, make: Callable[[], bpy.types.NodeTree]) -> None:
        group = make()
        snapshot = SNAPSHOTS / f"{group.name}.txt"
        if WRITE in os.environ:
            snapshot.write_text(describe(group), encoding="utf-8")
        assert describe(group) == snapshot.read_text(encoding="utf-8"), f"if this is meant, run with {WRITE}=1"

    def test_the_road_has_an_input_for_each_lane_and_marking(self) -> None:
        names = {item.name for item in road_group(LAYOUT).interface.items_tree}
        assert {f"Left Lane {n} Width" for n in (1, 2, 3)} | {f"Right Lane {n} Width" for n in (1, 2)} <= names
        assert "Right Lane 3 Width" not in names
        assert {
            "Left Outer Edge Line Width",
            "Left Lane Line Gap Length",
            "Right Inner Edge Line Film Thickness",
            "Right Free Line Distance",
            "Right Exit Start Station",
            "Median Instance",
            "Left Verge Slope",
        } <= names

    def test_a_strip_can_be_used_by_hand(self) -> None:
        line = bpy.data.meshes.new("Line")
        line.from_pydata([(0, 0, 1), (10, 0, 2), (20, 0, 2)], [(0, 1), (1, 2)], [])
        line.attributes.new("left", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", [0.0, 1.0, 0.0] * 3)
        item = bpy.data.objects.new("Line", line)
        bpy.context.scene.collection.objects.link(item)
        modifier = item.modifiers.new("Strip", "NODES")
        modifier.node_group = strip_group()
        values = {
            "Left Offset": 3.0,
            "Right Offset": -1.0,
            "Left Height": 0.5,
            "Right Height": 0.0,
            "Class": 9,
        }
        for name, value in values.items():
            set_modifier_input(modifier, name, value)
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        places = sorted(tuple(round(x, 5) for x in vertex.co) for vertex in mesh.vertices)
        assert places == [(0, -1, 1), (0, 3, 1.5), (10, -1, 2), (10, 3, 2.5), (20, -1, 2), (20, 3, 2.5)]
        assert all(face.normal.z > 0.0 for face in mesh.polygons)
        assert [value.value for value in mesh.attributes["class_id"].data] == [9, 9]
        set_modifier_input(modifier, "Left Offset", -1.0)
        assert not item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.polygons
