"""Many changes of a node tree at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import bpy
import pytest

from synthroads_addon.blender.nodes.changes import Change, make_changes

COUNT = 300


def changes_of_chain(kind: str = "GeometryNodeTree") -> tuple[bpy.types.NodeTree, list[Change]]:
    """Return a tree of nodes that add, and changes that link them in a row and have each add 2."""
    tree = bpy.data.node_groups.new("Chain", kind)
    nodes = [tree.nodes.new("ShaderNodeMath") for _ in range(COUNT)]
    changes: list[Change] = [partial(tree.links.new, one.outputs[0], other.inputs[0]) for one, other in pairwise(nodes)]
    changes += [partial(setattr, node.inputs[1], "default_value", 2.0) for node in nodes]
    return tree, changes


def make_one_by_one(changes: list[Change]) -> None:
    for change in changes:
        change()


@pytest.mark.parametrize("kind", ["GeometryNodeTree", "ShaderNodeTree"])
def test_all_are_made_and_nothing_else_is_left(kind: str) -> None:
    tree, changes = changes_of_chain(kind)
    make_changes(changes)
    assert [node.inputs[0].is_linked for node in tree.nodes] == [False] + [True] * (COUNT - 1)
    assert all(link.is_valid for link in tree.links)
    assert {node.inputs[1].default_value for node in tree.nodes} == {2.0}
    assert [group.name for group in bpy.data.node_groups] == [tree.name]
    assert not any("SynthRoadsUpdated" in name for name in dir(bpy.types))
    make_changes([])


@pytest.mark.parametrize("number", [0, COUNT, -1])
def test_what_a_change_raises_is_raised(number: int) -> None:
    tree, changes = changes_of_chain()
    changes[number] = partial(setattr, tree.nodes[0].inputs[1], "default_value", "two")
    with pytest.raises(TypeError, match="default_value"):
        make_changes(changes)
    assert [group.name for group in bpy.data.node_groups] == [tree.name]


def seconds(make: Callable[[list[Change]], None]) -> float:
    _, changes = changes_of_chain()
    begin = time.perf_counter()
    make(changes)
    return time.perf_counter() - begin


def test_it_takes_a_fraction_of_the_time() -> None:
    assert min(seconds(make_changes) for _ in range(3)) < 0.2 * seconds(make_one_by_one)
