"""Materials worked out at many places by a kernel: see materials.c, and `program` for what it is told to do."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache

import numpy as np

from ...base.arrays import Float32
from ..scene.surface_values import SurfaceInput
from .library import NoKernelError, load_kernel
from .program import SCRATCH, MaterialProgram, Picture

LANES = 64
"""Places that are worked out together."""

_POINTER = ctypes.c_void_p


class _Picture(ctypes.Structure):
    """An image; as `Picture` in materials.c."""

    _fields_ = (
        ("pixels", _POINTER),
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("interpolation", ctypes.c_int32),
        ("extension", ctypes.c_int32),
        ("bytes", ctypes.c_int32),
    )


class _Program(ctypes.Structure):
    """A program; as `Program` in materials.c."""

    _fields_ = (
        ("code", _POINTER),
        ("tables", _POINTER),
        ("pictures", _POINTER),
        ("uniform", ctypes.c_int32),
        ("whole", ctypes.c_int32),
        ("scratch", ctypes.c_int32),
    )


class _Places(ctypes.Structure):
    """Places; as `Places` in materials.c."""

    _fields_ = (
        ("inputs", _POINTER),
        ("outputs", _POINTER),
        ("widths", _POINTER),
        ("count", ctypes.c_int64),
    )


@cache
def usable_materials() -> ctypes.CDLL | NoKernelError:
    """Return the kernel, or why this machine has none; found out once."""
    try:
        kernel = load_kernel("materials")
    except NoKernelError as error:
        return error
    kernel.synthroads_materials.restype = None
    kernel.synthroads_materials.argtypes = [_POINTER, _POINTER, _POINTER, ctypes.c_int32]
    return kernel


class ReadyProgram:
    """A material's program as the kernel takes it; any threads may run it side by side.

    Args:
        program: of the material.

    Attributes:
        program: as given.
    """

    def __init__(self, program: MaterialProgram) -> None:
        self.program = program
        self._registers = np.zeros((program.registers + SCRATCH, LANES), np.float32)
        for number, value in program.constants:
            self._registers[number] = value
        self._pictures = (_Picture * max(1, len(program.pictures)))(*map(_picture_structure, program.pictures))
        self._widths = np.array([parts for _, parts in program.outputs], np.int32)
        self._native = _Program(
            program.code.ctypes.data,
            program.tables.ctypes.data,
            ctypes.addressof(self._pictures),
            program.uniform,
            len(program.code),
            program.registers,
        )

    def run(
        self,
        kernel: ctypes.CDLL,
        values: Mapping[SurfaceInput, Float32],
        outputs: Mapping[str, Float32],
        narrow: bool = False,
    ) -> None:
        """Write the material's layers at N places into arrays (N, C) by name; lets go of Python's lock meanwhile.

        Args:
            kernel: what runs it.
            values: (N, 4) float32 of each input that it reads.
            outputs: C-contiguous float32.
            narrow: keep to the instructions that every processor has: the same, more slowly.
        """
        program = self.program
        results = [outputs[name] for name, _ in program.outputs]
        count = len(results[0]) if results else 0
        inputs = [np.ascontiguousarray(values[surface_input], np.float32) for surface_input in program.inputs]
        if any(array.shape != (count, 4) for array in inputs):
            raise ValueError(f"values of {[array.shape for array in inputs]}: must be ({count}, 4)")
        for result, (name, parts) in zip(results, program.outputs, strict=True):
            if result.shape != (count, parts) or result.dtype != np.float32 or not result.flags.c_contiguous:
                raise ValueError(
                    f"{name} {result.dtype} {result.shape}: must be float32 ({count}, {parts}), side by side"
                )
        if not count:
            return
        registers = self._registers.copy()
        pointers = [
            (_POINTER * max(1, len(arrays)))(*(result.ctypes.data for result in arrays)) for arrays in (inputs, results)
        ]
        places = _Places(ctypes.addressof(pointers[0]), ctypes.addressof(pointers[1]), self._widths.ctypes.data, count)
        kernel.synthroads_materials(
            ctypes.byref(self._native), registers.ctypes.data, ctypes.byref(places), int(narrow)
        )


def run_program(
    kernel: ctypes.CDLL,
    program: MaterialProgram,
    values: Mapping[SurfaceInput, Float32],
    count: int,
    narrow: bool = False,
) -> dict[str, Float32]:
    """Return a material's layers at N places, by name, (N, C) float32, see `ReadyProgram.run`.

    Args:
        kernel: what runs it.
        program: of the material.
        values: (N, 4) float32 of each input that it reads.
        count: N.
        narrow: keep to the instructions that every processor has.
    """
    outputs = {name: np.empty((count, parts), np.float32) for name, parts in program.outputs}
    ReadyProgram(program).run(kernel, values, outputs, narrow)
    return outputs


def _picture_structure(picture: Picture) -> _Picture:
    """Return an image as the structure that the kernel reads."""
    pixels = picture.pixels
    height, width = pixels.shape[:2]
    bytes_ = int(pixels.dtype == np.uint8)
    return _Picture(pixels.ctypes.data, width, height, picture.interpolation, picture.extension, bytes_)
