"""Nodes of materials, each by itself and fed with values: what programs give beside what Cycles gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from synthroads_addon.blender.cameras.calculator import opened_calculator, reading_copy
from synthroads_addon.blender.materials.programs import UnknownNodeError, compile_material
from synthroads_addon.scanning.colour.colour import MATERIAL_LAYERS
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.materials import run_program, usable_materials
from synthroads_addon.scanning.scene.surface_values import SurfaceInput

PLACES = 2000
"""Places that each case is worked out at."""
LAYERS = ("base_color", "roughness")
Fed = tuple[str, int | None]
"""An attribute that feeds an input, and which of its components; None for all."""


@dataclass(frozen=True)
class Case:
    """A node.

    Attributes:
        kind: its type, without ``ShaderNode``.
        output: identifier of the output that is looked at.
        fed: what feeds inputs, by identifier.
        constants: values of others.
        properties: of the node.
        values: name of the values that attributes have, see `VALUES`.
        set_up: what is done to the node beside this.
    """

    kind: str
    output: str
    fed: Mapping[str, Fed] = field(default_factory=dict)
    constants: Mapping[str, Any] = field(default_factory=dict)
    properties: Mapping[str, Any] = field(default_factory=dict)
    values: str = "small"
    set_up: Callable[[Any], None] = lambda node: None


def _random(seed: int, size: float) -> np.ndarray:
    result = np.zeros((PLACES, 4), np.float32)
    result[:, :3] = np.random.default_rng(seed).uniform(-size, size, (PLACES, 3))
    return result


def _extreme(seed: int) -> np.ndarray:
    """Return small and very large numbers, whole ones, halves and zeros."""
    random, result = np.random.default_rng(seed), _random(seed, 3.0)
    result[:400] *= 100.0
    result[400:600, :3] *= 10.0 ** random.uniform(2.0, 6.0, (200, 3))
    result[600:800, :3] = random.integers(-3, 4, (200, 3))
    result[800:950, :3] = random.integers(-6, 7, (150, 3)) / 2.0
    result[950:1050] = 0.0
    return result


def _small(seed: int, size: float) -> np.ndarray:
    result = _random(seed, size)
    result[:150] = np.round(result[:150])
    return result


def _far(seed: int) -> np.ndarray:
    result = _random(seed, 40.0)
    result[:200] *= 40.0
    result[200:300] = np.round(result[200:300])
    result[300:400] *= 400.0
    return result


def _near_and_far() -> np.ndarray:
    """Return texture coordinates: quarters, others, and some far away."""
    result = _random(5, 3.0)
    result[:200] = np.round(result[:200] * 4.0) / 4.0
    result[200:300] *= 300.0
    return result


_SMALL = {"a": _small(5, 3.0), "b": _small(6, 1.0), "c": _small(7, 0.8)}
VALUES: dict[str, dict[str, np.ndarray]] = {
    "extreme": {"a": _extreme(1), "b": _extreme(2), "c": _extreme(3)},
    "small": _SMALL,
    "positive": {name: np.abs(values) for name, values in _SMALL.items()},
    "far_and_near": {"a": _near_and_far()},
    "far": {"a": _far(8), "b": np.abs(_SMALL["b"]), "c": np.abs(_SMALL["c"])},
}
"""Values (N, 4) of the attributes ``a``, ``b`` and ``c``."""


def _built(case: Case) -> bpy.types.Material:
    """Return a material that shows the output."""
    item = bpy.data.materials.new("Case")
    if item.node_tree is None:
        item.use_nodes = True
    tree = item.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(f"ShaderNode{case.kind}")
    for name, value in case.properties.items():
        setattr(node, name, value)
    case.set_up(node)
    entries = {entry.identifier: entry for entry in node.inputs}
    for identifier, value in case.constants.items():
        entries[identifier].default_value = value
    for identifier, (name, part) in case.fed.items():
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = name
        source = attribute.outputs["Vector"]
        if part is not None:
            split = tree.nodes.new("ShaderNodeSeparateXYZ")
            tree.links.new(source, split.inputs[0])
            source = split.outputs[part]
        tree.links.new(source, entries[identifier])
    show(tree, next(output for output in node.outputs if output.identifier == case.output))
    return item


def show(tree: bpy.types.NodeTree, output: bpy.types.NodeSocket) -> None:
    """Have a material's layer be what an output gives: a number the roughness, else the base colour."""
    number = output.type == "VALUE"
    end = tree.nodes.new("ShaderNodeOutputAOV")
    end.aov_name = "roughness" if number else "base_color"
    tree.links.new(output, end.inputs["Value" if number else "Color"])


def deviations(cases: Mapping[str, Case], varying: bool = True) -> dict[str, float | str]:
    """Return by how much each case differs from Cycles, relative to its values above 1, or the node that isn't known.

    Args:
        cases: the nodes.
        varying: see `material_deviations`.
    """
    items = [_built(case) for case in cases.values()]
    fed = [VALUES[case.values] for case in cases.values()]
    values = [{SurfaceInput("attribute", name): one[name] for name in one} for one in fed]
    found = material_deviations(items, values, varying=varying)
    return dict(zip(cases, found, strict=True))


def material_deviations(
    items: Sequence[bpy.types.Material],
    fed: Sequence[Mapping[SurfaceInput, np.ndarray]],
    layers: Sequence[str] = LAYERS,
    varying: bool = True,
) -> list[float | str]:
    """Return the same of materials, which are removed, with values (N, 4) of what each of them reads.

    Args:
        items: the materials.
        fed: values of each.
        layers: those that are compared.
        varying: whether Cycles must give different values at different places, else nothing would be compared.
    """
    kernel = usable_materials()
    assert not isinstance(kernel, NoKernelError), f"{kernel}: python tools/build_kernels.py"
    result: list[float | str] = []
    with ExitStack() as stack:
        copies = {number: stack.enter_context(reading_copy(item, layers)) for number, item in enumerate(items)}
        asked = {what for copy in copies.values() for what, _ in copy.readers}
        count = len(next(iter(fed[0].values())))
        empty = np.zeros((count, 4), np.float32)
        values = {what: np.concatenate([own.get(what, empty) for own in fed]) for what in sorted(asked)}
        with opened_calculator(copies, layers) as calculator:
            truth = calculator.calculate(np.repeat(np.arange(len(items)), count), values)
        for number, copy in copies.items():
            expected = {name: array[number * count : (number + 1) * count] for name, array in truth.items()}
            try:
                program = compile_material(copy.item.node_tree, copy.readers, layers).build(layers)
            except UnknownNodeError as error:
                result.append(str(error))
                continue
            own = {what: np.ascontiguousarray(fed[number][what]) for what in program.inputs}
            made = run_program(kernel, program, own, count)
            for name, other in run_program(kernel, program, own, count, narrow=True).items():
                np.testing.assert_array_equal(made[name], other)
            spread = max(float(np.nanmax(expected[name]) - np.nanmin(expected[name])) for name in made)
            assert spread > 0.0 or not varying, copy.item.name
            result.append(max(_deviation(array, expected[name]) for name, array in made.items()))
    for item in items:
        bpy.data.materials.remove(item)
    return result


def _deviation(made: np.ndarray, truth: np.ndarray) -> float:
    assert made.shape[1] == MATERIAL_LAYERS["base_color"] or made.shape[1] == 1
    with np.errstate(all="ignore"):
        same = (made == truth) | (np.isnan(made) & np.isnan(truth))
        scale = np.maximum(1.0, np.abs(truth).max(axis=1, keepdims=True))
        apart = np.where(same, 0.0, np.abs(made - truth) / scale)
    return float(np.nan_to_num(apart, nan=np.inf).max())
