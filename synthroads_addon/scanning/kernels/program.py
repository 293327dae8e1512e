"""Programs for the kernel of materials: operations on numbers at many places, put together and given registers.

A value is a number in a list of operations, each of which has others for operands; equal ones are one. What is the same
at all places is worked out once. See materials.c.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float32
from ..scene.surface_values import SurfaceInput

WORDS = 16
"""Numbers per instruction."""
SCRATCH = 8
"""Registers that operations use themselves."""


class Op(IntEnum):
    """Operations, in the order that materials.c has them in."""

    LOAD = 0
    STORE = 1
    ADD = 2
    SUBTRACT = 3
    MULTIPLY = 4
    DIVIDE = 5
    SAFE_DIVIDE = 6
    MINIMUM = 7
    MAXIMUM = 8
    LESS = 9
    LESS_EQUAL = 10
    EQUAL = 11
    SELECT = 12
    ABSOLUTE = 13
    NEGATE = 14
    FLOOR = 15
    CEIL = 16
    TRUNCATE = 17
    SQRT = 18
    SIGN = 19
    EXPONENT = 20
    LOGARITHM = 21
    POWER = 22
    SINE = 23
    COSINE = 24
    TANGENT = 25
    ARCSINE = 26
    ARCCOSINE = 27
    ARCTANGENT = 28
    ARCTAN2 = 29
    SINH = 30
    COSH = 31
    TANH = 32
    REMAINDER = 33
    HASH = 34
    OCTAVE = 35
    FRACTAL = 36
    VORONOI = 37
    IMAGE = 38
    RAMP = 39
    TO_HSV = 40
    FROM_HSV = 41
    TO_HSL = 42
    FROM_HSL = 43
    TO_LINEAR = 44
    CHECKER = 45
    BRICK = 46
    MULTIPLY_ADD = 47


class Picture(NamedTuple):
    """An image that a program looks values up in.

    Attributes:
        pixels: (height, width, 4), the lowest row first: float32, or uint8 of which 255 is 1; C-contiguous.
        interpolation: 0 for the closest pixel, 1 linear, 2 cubic.
        extension: beyond its edges: 0 it is repeated, 1 its edges go on, 2 there is nothing, 3 it is mirrored.
    """

    pixels: Float32 | NDArray[np.uint8]
    interpolation: int
    extension: int


@dataclass(frozen=True)
class MaterialProgram:
    """Instructions that work out layers of a material at places.

    Attributes:
        code: (K, `WORDS`) int32: operation, where its results go, registers of its operands, settings.
        uniform: instructions at the front that are run once.
        registers: number of them, without those of `SCRATCH`.
        constants: (register, number) of those that are given.
        inputs: what is read of the places, in order.
        outputs: layers that are written, by name, with their numbers of components.
        tables: float32, for ramps.
        pictures: images.
    """

    code: NDArray[np.int32]
    uniform: int
    registers: int
    constants: tuple[tuple[int, float], ...]
    inputs: tuple[SurfaceInput, ...]
    outputs: tuple[tuple[str, int], ...]
    tables: Float32
    pictures: tuple[Picture, ...]


class _Step(NamedTuple):
    """An operation: its operands are values, its settings numbers; its results are values from its own on."""

    op: Op
    operands: tuple[int, ...]
    settings: tuple[int, ...]
    results: int
    uniform: bool


@dataclass
class ProgramBuilder:
    """Puts a program together; values are numbers that its methods return."""

    inputs: list[SurfaceInput] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    _steps: dict[int, _Step] = field(default_factory=dict)
    _constants: dict[int, float] = field(default_factory=dict)
    _known: dict[object, int] = field(default_factory=dict)
    _tables: list[Float32] = field(default_factory=list)
    _outputs: dict[str, list[int]] = field(default_factory=dict)
    _owners: dict[int, int] = field(default_factory=dict)
    _size: int = 0

    def constant(self, number: float) -> int:
        """Return the value that stands for a number, as float32 has it."""
        bits = struct.pack("<f", np.float32(number))
        if bits not in self._known:
            self._known[bits] = self._reserve(1)
            self._constants[self._known[bits]] = struct.unpack("<f", bits)[0]
        return self._known[bits]

    def number_of(self, value: int) -> float | None:
        """Return the number that a value stands for; None if it is the result of an operation."""
        return self._constants.get(value)

    def load(self, surface_input: SurfaceInput, part: int) -> int:
        """Return the value of a component of an input that is read at each place.

        Args:
            surface_input: the input.
            part: number of its component.
        """
        if surface_input not in self.inputs:
            self.inputs.append(surface_input)
        return self._add(Op.LOAD, (), (self.inputs.index(surface_input), part), 1, uniform=False)

    def add(self, op: Op, *operands: int, settings: Sequence[int] = (), results: int = 1) -> int:
        """Return the first of the results of an operation; the others are the values that follow.

        Args:
            op: the operation.
            operands: values that it reads.
            settings: whole numbers that it has besides.
            results: how many values it gives.
        """
        uniform = all(self._is_uniform(value) for value in operands)
        return self._add(op, operands, tuple(settings), results, uniform)

    def table(self, numbers: Sequence[float] | Float32) -> int:
        """Add numbers to the program's tables; return the index at which they begin there."""
        start = sum(len(table) for table in self._tables)
        self._tables.append(np.asarray(numbers, np.float32))
        return start

    def picture(self, picture: Picture) -> int:
        """Return the number of an image, which is added to the program if it isn't there yet."""
        for number, known_picture in enumerate(self.pictures):
            if known_picture.pixels is picture.pixels and known_picture[1:] == picture[1:]:
                return number
        self.pictures.append(picture)
        return len(self.pictures) - 1

    def output(self, layer: str, values: Sequence[int]) -> None:
        """Set the values of a layer, one for each of its components."""
        self._outputs[layer] = list(values)

    def build(self, layers: Sequence[str]) -> MaterialProgram:
        """Return the program for some of the outputs; operations that none of these needs are left out."""
        outputs = {name: values for name, values in self._outputs.items() if name in layers}
        needed_steps = self._needed(outputs)
        step_order = [step for step in self._steps if step in needed_steps]
        # Those that are the same everywhere come first.
        step_order.sort(key=lambda step: not self._steps[step].uniform)
        return _Allocation(self, step_order, outputs).program()

    def _reserve(self, count: int) -> int:
        """Number the next values of the program, and return the first number."""
        first_value = self._size
        self._size += count
        return first_value

    def _is_uniform(self, value: int) -> bool:
        """Return whether a value is the same at all places."""
        step = self._steps.get(self._owner(value))
        return value in self._constants or (step is not None and step.uniform)

    def _owner(self, value: int) -> int:
        """Return the first result of the operation that gives a value."""
        return self._owners.get(value, value)

    def _add(self, op: Op, operands: tuple[int, ...], settings: tuple[int, ...], results: int, uniform: bool) -> int:
        """Return the first result of an operation; one with the same operands and settings is added only once."""
        key = (op, operands, settings)
        if key not in self._known:
            first_value = self._known[key] = self._reserve(results)
            self._steps[first_value] = _Step(op, operands, settings, results, uniform)
            self._owners.update(dict.fromkeys(range(first_value, first_value + results), first_value))
        return self._known[key]

    def _needed(self, outputs: dict[str, list[int]]) -> set[int]:
        """Return the first results of all operations that outputs depend on."""
        needed_steps: set[int] = set()
        pending = [value for values in outputs.values() for value in values]
        while pending:
            step = self._owner(pending.pop())
            if step in self._steps and step not in needed_steps:
                needed_steps.add(step)
                pending += self._steps[step].operands
        return needed_steps


class _Allocation:
    """Assignment of registers to the values of a program; registers of values that no one reads any more are reused."""

    def __init__(self, builder: ProgramBuilder, order: list[int], outputs: dict[str, list[int]]) -> None:
        self._builder, self._order, self._outputs = builder, order, outputs
        self._register: dict[int, int] = {}
        self._free: list[int] = []
        self._count = 0

    def program(self) -> MaterialProgram:
        """Return the program: operations that are the same everywhere first, then the others with their stores."""
        builder = self._builder
        targets: dict[int, list[tuple[int, int]]] = {}
        for number, values in enumerate(self._outputs.values()):
            for part, value in enumerate(values):
                targets.setdefault(value, []).append((number, part))
        uses = Counter(value for step in self._order for value in builder._steps[step].operands)
        constants = sorted(value for value in builder._constants if uses[value] or value in targets)
        for value in constants:
            self._take(value, 1)
        uniform = sum(builder._steps[step].uniform for step in self._order)
        rows = [self._row(step) for step in self._order[:uniform]]
        # What is the same everywhere is kept, but has to be written for all places.
        rows += self._stores([value for value in targets if builder._is_uniform(value)], targets)
        for step in self._order[uniform:]:
            rows += self._varying_rows(step, uses, targets)
        inputs = self._count_inputs_anew(rows)
        code = np.zeros((len(rows), WORDS), np.int32)
        for number, row in enumerate(rows):
            code[number, : len(row)] = row
        return MaterialProgram(
            code=code,
            uniform=uniform,
            registers=self._count,
            constants=tuple((self._register[value], builder._constants[value]) for value in constants),
            inputs=inputs,
            outputs=tuple((layer, len(values)) for layer, values in self._outputs.items()),
            tables=np.concatenate([*builder._tables, np.zeros(1, np.float32)]).astype(np.float32),
            pictures=tuple(builder.pictures),
        )

    def _row(self, first_value: int) -> tuple[int, ...]:
        """Return the instruction of the operation with a first result, whose results are given registers."""
        operation = self._builder._steps[first_value]
        self._take(first_value, operation.results)
        operands = (self._register[value] for value in operation.operands)
        return (int(operation.op), self._register[first_value], *operands, *operation.settings)

    def _varying_rows(
        self, first_value: int, uses: Counter[int], targets: dict[int, list[tuple[int, int]]]
    ) -> list[tuple[int, ...]]:
        """Return the instructions of an operation that differs between places: its own, and stores of its outputs.

        Registers of values that no later operation reads are free afterwards.

        Args:
            first_value: the operation's first result.
            uses: how many operations still read each value; this one's reads are taken off.
            targets: (output, component) that each value is stored to.
        """
        operation, rows = self._builder._steps[first_value], [self._row(first_value)]
        results = range(first_value, first_value + operation.results)
        rows += self._stores([value for value in results if value in targets], targets)
        uses.subtract(operation.operands)
        # Only now: so no result of the operation is given the register of one of its operands.
        for value in {*results, *operation.operands}:
            if not uses[value] and not self._builder._is_uniform(value):
                self._free.append(self._register[value])
        return rows

    def _count_inputs_anew(self, rows: list[tuple[int, ...]]) -> tuple[SurfaceInput, ...]:
        """Return the inputs that instructions read, in the order of first use; renumber them in the rows, in place."""
        inputs: dict[SurfaceInput, int] = {}
        for number, row in enumerate(rows):
            if row[0] == Op.LOAD:
                surface_input = self._builder.inputs[row[2]]
                rows[number] = (*row[:2], inputs.setdefault(surface_input, len(inputs)), *row[3:])
        return tuple(inputs)

    def _take(self, first_value: int, count: int) -> None:
        """Give registers to ``count`` values that follow on each other: a free one to a single value, else new ones."""
        if count == 1 and self._free:
            self._register[first_value] = self._free.pop()
            return
        for number in range(count):
            self._register[first_value + number] = self._count
            self._count += 1

    def _stores(self, values: Sequence[int], targets: dict[int, list[tuple[int, int]]]) -> list[tuple[int, ...]]:
        """Return the instructions that store values to all (output, component) that they are targets of."""
        return [
            (int(Op.STORE), 0, self._register[value], number, part)
            for value in values
            for number, part in targets[value]
        ]
