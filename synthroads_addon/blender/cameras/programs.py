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
"""Versions of Blender whose Cycles gives the same, node type by node type (tests/blender/materials/programs)."""
_OFF, _REC709 = "off", "Linear Rec.709"


class ProgramCalculator:
    """Works out layers of materials by their programs; any threads may use it side by side.

    Attributes:
        materials: indices of those that it works out.
        layers: names of the layers that come back.
        at_once: places that are worked out at once, as many as the processor keeps at hand.
        main_thread: it needs none.
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
        """Return the layers at N places, by name, (N, C) float32; 0 where a material says nothing of one.

        Args:
            material: (N,) of each place, ascending.
            values: (N, 4) of each input.
        """
        starts = np.flatnonzero(np.diff(material, prepend=-1)).tolist()
        spans = list(pairwise([*starts, len(material)]))
        ready = [self._programs[int(material[start])] for start in starts]
        widths = {name: width for one in ready for name, width in one.program.outputs}
        result = {name: np.zeros((len(material), width), np.float32) for name, width in widths.items()}
        for one, (start, end) in zip(ready, spans, strict=True):
            here = {what: values[what][start:end] for what in one.program.inputs}
            one.run(self._kernel, here, {name: result[name][start:end] for name, _ in one.program.outputs})
        return result


@dataclass
class CompiledMaterials:
    """Materials by their index, as far as they could be compiled.

    Attributes:
        kernel: what runs the programs, or why there are none.
        builders: what makes the programs of materials, for any of their layers.
        unknown: why a material has none: the node or setting that programs aren't made of.
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
        """Return what works out layers of those of some materials that were compiled; None if none was."""
        if isinstance(self.kernel, NoKernelError):
            return None
        programs = {index: self.builders[index].build(layers) for index in materials if index in self.builders}
        return ProgramCalculator(self.kernel, programs, layers) if programs else None

    def work(self, calculators: Sequence[LayerCalculator], materials: Collection[int]) -> MaterialWork:
        """Return calculators of some materials, and how these are worked out."""
        told = "programs"
        if isinstance(self.kernel, NoKernelError):
            told = _OFF if str(self.kernel) == _OFF else f"none: Cycles works them out, as {self.kernel}"
        unknown = {index: why for index, why in self.unknown.items() if index in materials}
        return MaterialWork(calculators, told, unknown)


@contextmanager
def material_work(
    items: Mapping[int, bpy.types.Material], layers: Sequence[str], kernels: Literal["auto", "off"]
) -> Iterator[MaterialWork]:
    """Context of what works out materials by their index: programs, and Cycles for the others.

    Args:
        items: materials that can be worked out, see `material_needs`.
        layers: those that are asked for.
        kernels: ``off`` to have Cycles work out all.
    """
    compiled, copies = CompiledMaterials.of(kernels), dict[int, ReadingCopy]()
    with ExitStack() as stack:
        for index, item in items.items():
            with ExitStack() as copy_stack:
                copy = copy_stack.enter_context(reading_copy(item, layers))
                if not compiled.compile(index, copy, layers):
                    copies[index] = copy
                    stack.push(copy_stack.pop_all())
        calculators: list[LayerCalculator] = []
        if (programs := compiled.calculator(sorted(items), layers)) is not None:
            calculators.append(programs)
        if copies:
            calculators.append(stack.enter_context(opened_calculator(copies, layers)))
        yield compiled.work(calculators, items)
