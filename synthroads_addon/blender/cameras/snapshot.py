"""Materials as they were at one moment, kept in a file, and evaluated later without a trace in the open file.

A scan in the panel goes on while the user works. Between two turns of the scan the open file must contain nothing of
it, as each step of undo and each save would keep that; and a user's changes to materials must not change the scan.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

import bpy

from ...base.arrays import Float32, Index
from ...base.errors import InputError
from ...scanning.colour.colour import MATERIAL_LAYERS
from ...scanning.scene.surface_values import SurfaceInput
from ..materials.calculable import material_needs
from .calculator import ReadingCopy, opened_calculator, reading_copy
from .nodes import LayerCalculator, MaterialWork
from .programs import CompiledMaterials
from .surfaces import numbered_materials

_INPUT, _IMAGE = "synthroads_input", "synthroads_image"
"""Custom properties of nodes in the file: the input that a node reads; session number of the image that it shows."""


class MaterialSnapshot:
    """Copies of materials that read images of returns' values, in a file.

    Attributes:
        obstacles: for materials that can't be evaluated, by index: names of the nodes that prevent it.
        compiled: programs of the materials that can be evaluated without Blender.
    """

    def __init__(
        self, names: Sequence[str], varying: Collection[int], folder: Path, kernels: Literal["auto", "off"] = "auto"
    ) -> None:
        """Write the file; in Blender's main thread.

        Args:
            names: names of the scene mesh's materials.
            varying: indices of the materials to evaluate.
            folder: folder of the file; it must exist as long as materials are evaluated.
            kernels: ``off`` to have Cycles evaluate all.
        """
        self._path = folder / "materials.blend"
        items = {index: item for index, item in numbered_materials(names) if index in varying}
        needs = {index: material_needs(item) for index, item in items.items()}
        self.obstacles = {index: need.obstacles for index, need in needs.items() if need.obstacles}
        self._names: dict[int, str] = {}
        self._inputs: dict[int, frozenset[SurfaceInput]] = {}
        self.compiled = CompiledMaterials.of(kernels)
        with ExitStack() as stack:
            copies: dict[int, ReadingCopy] = {}
            for index, item in items.items():
                if index in self.obstacles:
                    continue
                # Only Cycles needs the copy from here on; the copy of a compiled material is removed at once.
                with ExitStack() as copy_stack:
                    copy = copy_stack.enter_context(reading_copy(item, tuple(MATERIAL_LAYERS)))
                    if not self.compiled.compile(index, copy, tuple(MATERIAL_LAYERS)):
                        copies[index] = copy
                        stack.push(copy_stack.pop_all())
            for index, copy in copies.items():
                self._names[index] = copy.item.name
                self._inputs[index] = frozenset(surface_input for surface_input, _ in copy.readers)
                _mark_nodes(copy)
            if copies:
                bpy.data.libraries.write(str(self._path), {copy.item for copy in copies.values()})

    def work(self, materials: Collection[int], layers: Sequence[str]) -> MaterialWork:
        """Return calculators of layers of materials, given by their indices; materials with obstacles have none."""
        programs = self.compiled.calculator(sorted(materials), layers)
        rendered = sorted(index for index in materials if index in self._names)
        calculators: list[LayerCalculator] = [] if programs is None else [programs]
        if rendered:
            calculators.append(SnapshotCalculator(self, rendered, layers))
        return self.compiled.work(calculators, materials)

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return the inputs that the material with this index reads."""
        return self._inputs[material]

    @contextmanager
    def loaded(self, materials: Sequence[int]) -> Iterator[dict[int, ReadingCopy]]:
        """Context of copies of materials, by index, loaded from the file until the exit; in Blender's main thread."""
        # Appended, not linked: linked materials can't show images of the open file.
        with bpy.data.libraries.load(str(self._path), link=False) as (_, target):
            target.materials = [self._names[index] for index in materials]
        items = list(target.materials)
        trees = [tree for item in items for tree in _groups_below(item.node_tree)]
        try:
            yield {index: _loaded_copy(item) for index, item in zip(materials, items, strict=True)}
        finally:
            libraries = [library for library in bpy.data.libraries if library.filepath == str(self._path)]
            bpy.data.batch_remove([*items, *trees, *libraries])


class SnapshotCalculator:
    """Evaluates layers of a snapshot's materials; each call makes and removes all that it needs in Blender.

    Attributes:
        materials: indices of the materials that it evaluates.
        layers: names of the layers that it returns.
        at_once: largest number of places that one call evaluates: Blender's window stands still meanwhile; chosen.
        main_thread: True: only Blender's main thread may use it.
    """

    at_once = 1 << 16
    main_thread = True

    def __init__(self, snapshot: MaterialSnapshot, materials: Sequence[int], layers: Sequence[str]) -> None:
        self._snapshot, self._materials, self.layers = snapshot, materials, tuple(layers)
        self.materials = frozenset(materials)

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return the inputs that the material with this index reads."""
        return self._snapshot.inputs_of(material)

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Return the layers (N, C) of N places, see `Calculator.calculate`; in Blender's main thread."""
        with self._snapshot.loaded(self._materials) as copies, opened_calculator(copies, self.layers) as calculator:
            return calculator.calculate(material, values)


def _mark_nodes(copy: ReadingCopy) -> None:
    """Note on a copy's nodes which input they read or which image they show; unlink the images, to save none."""
    for surface_input, node in copy.readers:
        node[_INPUT] = list(surface_input)
    for node in _nodes_below(copy.item.node_tree):
        if node.type == "TEX_IMAGE" and node.image is not None:
            node[_IMAGE], node.image = node.image.session_uid, None


def _loaded_copy(item: bpy.types.Material) -> ReadingCopy:
    """Return a material from the snapshot's file as a copy whose nodes show the open file's images again.

    Raises:
        InputError: the user has removed one of the images.
    """
    images = {image.session_uid: image for image in bpy.data.images}
    readers: list[tuple[SurfaceInput, bpy.types.Node]] = []
    for node in _nodes_below(item.node_tree):
        if _INPUT in node:
            readers.append((SurfaceInput(*node[_INPUT]), node))
        elif _IMAGE in node:
            if node[_IMAGE] not in images:
                raise InputError(
                    "Scene",
                    None,
                    f"an image of its material {item.name!r} was removed during the scan: start the scan again",
                )
            node.image = images[node[_IMAGE]]
    return ReadingCopy(item, readers)


def _nodes_below(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the nodes of a tree and of the groups in it."""
    for part_tree in (tree, *_groups_below(tree)):
        yield from part_tree.nodes


def _groups_below(tree: bpy.types.NodeTree) -> Iterator[bpy.types.NodeTree]:
    """Yield the groups in a tree, at any depth; each group is used by one node only."""
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            yield node.node_tree
            yield from _groups_below(node.node_tree)
