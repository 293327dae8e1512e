"""Materials at the returns by programs that a kernel runs, in any thread; Cycles works out those with unknown nodes."""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import bpy
import numpy as np

from ...base.arrays import Float32, Index
from ...scanning.kernels.library import NoKernelError
from ...scanning.kernels.materials import ReadyProgram, usable_materials
from ...scanning.kernels.program import MaterialProgram, ProgramBuilder
from ...scanning.scene.surface_values import SurfaceInput
from ..materials.programs import UnknownNodeError, compile_material
from .calculator import ReadingCopy, opened_calculator, reading_copy
from .nodes import LayerCalculator, MaterialWork

COMPARED = ((4, 5), (5, 2))
"""Versions of Blender in whose Cycles each node type gives the program's values (tests/blender/materials/programs)."""
_OFF, _REC709 = "off", "Linear Rec.709"


class ProgramCalculator:
    """Evaluates layers of materials by their programs; any threads may use it side by side.

    Attributes:
        materials: indices of the materials that it evaluates.
        layers: names of the layers that it returns.
        at_once: largest number of places that one call evaluates; chosen to fit into the processor's cache.
        main_thread: False: any thread may use it.
    """

    at_once = 1 << 15
    main_thread = False

    def __init__(self, kernel: ctypes.CDLL, programs: Mapping[int, MaterialProgram], layers: Sequence[str]) -> None:
        self._kernel = kernel
        self._programs = {index: ReadyProgram(program) for index, program in programs.items()}
        self.materials, self.layers = frozenset(programs), tuple(layers)

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return the inputs that the program of the material with this index reads."""
        return frozenset(self._programs[material].program.inputs)

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Return the layers at N places, by name, (N, C) float32; 0 where a material's program lacks the layer.

        Args:
            material: (N,) index of each place's material, ascending.
            values: (N, 4) values of each input at the places.
        """
        # First place of each material, and the spans of places of one material.
        starts = np.flatnonzero(np.diff(material, prepend=-1)).tolist()
        spans = list(pairwise([*starts, len(material)]))
        programs = [self._programs[int(material[start])] for start in starts]
        widths = {name: width for ready in programs for name, width in ready.program.outputs}
        result = {name: np.zeros((len(material), width), np.float32) for name, width in widths.items()}
        for ready, (start, end) in zip(programs, spans, strict=True):
            inputs = {surface_input: values[surface_input][start:end] for surface_input in ready.program.inputs}
            outputs = {name: result[name][start:end] for name, _ in ready.program.outputs}
            ready.run(self._kernel, inputs, outputs)
        return result


@dataclass
class CompiledMaterials:
    """Materials by their index, as far as they could be compiled.

    Attributes:
        kernel: compiled library that runs the programs, or the reason why no program can run.
        builders: builder of each compiled material's program, for any of its layers.
        unknown: for each material without a program: the node or setting that programs can't express.
    """

    kernel: ctypes.CDLL | NoKernelError
    builders: dict[int, ProgramBuilder] = field(default_factory=dict)
    unknown: dict[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, kernels: Literal["auto", "off"]) -> CompiledMaterials:
        """Return an empty collection; nothing is compiled where kernels are ``off`` or this machine has none."""
        if kernels == "off":
            return cls(NoKernelError(_OFF))
        if bpy.app.version[:2] not in COMPARED:
            return cls(NoKernelError(f"nobody has compared programs with Cycles of Blender {bpy.app.version_string}"))
        space = getattr(getattr(bpy.data, "colorspace", None), "working_space", _REC709)
        if space != _REC709:
            return cls(NoKernelError(f"programs have the colours of {_REC709}, and not of {space}"))
        return cls(usable_materials())

    def compile(self, index: int, copy: ReadingCopy, layers: Sequence[str]) -> bool:
        """Compile a material for layers; return whether that was possible. In Blender's main thread."""
        if isinstance(self.kernel, NoKernelError):
            return False
        try:
            self.builders[index] = compile_material(copy.item.node_tree, copy.readers, layers)
        except UnknownNodeError as error:
            self.unknown[index] = str(error)
            return False
        return True

    def calculator(self, materials: Sequence[int], layers: Sequence[str]) -> ProgramCalculator | None:
        """Return a calculator of those of the materials that were compiled; None if none was."""
        if isinstance(self.kernel, NoKernelError):
            return None
        programs = {index: self.builders[index].build(layers) for index in materials if index in self.builders}
        return ProgramCalculator(self.kernel, programs, layers) if programs else None

    def work(self, calculators: Sequence[LayerCalculator], materials: Collection[int]) -> MaterialWork:
        """Return the calculators with what the report says: kernels, and why Cycles evaluates which materials."""
        kernels = "programs"
        if isinstance(self.kernel, NoKernelError):
            kernels = _OFF if str(self.kernel) == _OFF else f"none: Cycles works them out, as {self.kernel}"
        unknown = {index: reason for index, reason in self.unknown.items() if index in materials}
        return MaterialWork(calculators, kernels, unknown)


@contextmanager
def material_work(
    items: Mapping[int, bpy.types.Material], layers: Sequence[str], kernels: Literal["auto", "off"]
) -> Iterator[MaterialWork]:
    """Context of the calculators of materials: programs, and Cycles for materials without a program.

    Args:
        items: materials that can be evaluated (see `material_needs`), by index.
        layers: names of the layers to evaluate.
        kernels: ``off`` to have Cycles evaluate all.
    """
    compiled, copies = CompiledMaterials.of(kernels), dict[int, ReadingCopy]()
    with ExitStack() as stack:
        for index, item in items.items():
            with ExitStack() as copy_stack:
                copy = copy_stack.enter_context(reading_copy(item, layers))
                # Only Cycles needs the copy from here on; the copy of a compiled material is removed at once.
                if not compiled.compile(index, copy, layers):
                    copies[index] = copy
                    stack.push(copy_stack.pop_all())
        calculators: list[LayerCalculator] = []
        if (programs := compiled.calculator(sorted(items), layers)) is not None:
            calculators.append(programs)
        if copies:
            calculators.append(stack.enter_context(opened_calculator(copies, layers)))
        yield compiled.work(calculators, items)
