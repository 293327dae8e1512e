"""Numbers and vectors of a material's program, written as formulas: what Cycles' kernel does, operation by operation.

The order of the operations is that of Cycles, as float32 rounds after each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import bpy

from ....scanning.kernels.program import Op, ProgramBuilder

VECTORS_FUSED = bpy.app.version < (5, 0, 0)
"""Whether Cycles multiplies and adds vectors in one step, as it does numbers."""


@dataclass(frozen=True)
class Number:
    """A number of a program, with the arithmetic of Python."""

    builder: ProgramBuilder
    value: int

    def of(self, other: Operand) -> Number:
        """Return another number of the same program."""
        return other if isinstance(other, Number) else Number(self.builder, self.builder.constant(other))

    def apply(self, op: Op, *others: Operand) -> Number:
        """Return the result of an operation on it and others."""
        values = (self.of(other).value for other in others)
        return Number(self.builder, self.builder.add(op, self.value, *values))

    @property
    def known(self) -> float | None:
        """Return the number that it is; None if it is worked out."""
        return self.builder.number_of(self.value)

    def __add__(self, other: Operand) -> Number:
        return self.apply(Op.ADD, other)

    def __radd__(self, other: float) -> Number:
        return self.of(other) + self

    def __sub__(self, other: Operand) -> Number:
        return self.apply(Op.SUBTRACT, other)

    def __rsub__(self, other: float) -> Number:
        return self.of(other) - self

    def __mul__(self, other: Operand) -> Number:
        return self.apply(Op.MULTIPLY, other)

    def __rmul__(self, other: float) -> Number:
        return self.of(other) * self

    def __truediv__(self, other: Operand) -> Number:
        return self.apply(Op.DIVIDE, other)

    def __rtruediv__(self, other: float) -> Number:
        return self.of(other) / self

    def __neg__(self) -> Number:
        return self.apply(Op.NEGATE)

    def __lt__(self, other: Operand) -> Number:
        return self.apply(Op.LESS, other)

    def __gt__(self, other: Operand) -> Number:
        return self.of(other) < self

    def __le__(self, other: Operand) -> Number:
        return self.apply(Op.LESS_EQUAL, other)

    def __ge__(self, other: Operand) -> Number:
        return self.of(other) <= self

    def equals(self, other: Operand) -> Number:
        """Return 1 where both are the same, else 0."""
        return self.apply(Op.EQUAL, other)

    def choose(self, yes: Operand, no: Operand) -> Number:
        """Return one number where this one isn't 0, another where it is."""
        return self.apply(Op.SELECT, yes, no)


Operand: TypeAlias = "Number | float"
Vector: TypeAlias = tuple[Number, Number, Number]
Plus: TypeAlias = "Callable[[Number, Operand, Operand], Number]"
"""How a product and another number are added up."""


def smaller(a: Number, b: Operand) -> Number:
    """Return the smaller of two numbers, the second where one is none."""
    return a.apply(Op.MINIMUM, b)


def larger(a: Number, b: Operand) -> Number:
    """Return the larger of two numbers, the second where one is none."""
    return a.apply(Op.MAXIMUM, b)


def clamp(a: Number, low: Operand, high: Operand) -> Number:
    """Return a number kept between two others."""
    return smaller(larger(a, low), high)


def saturate(a: Number) -> Number:
    """Return a number kept between 0 and 1."""
    return clamp(a, 0.0, 1.0)


def floor(a: Number) -> Number:
    """Return the largest whole number that isn't larger."""
    return a.apply(Op.FLOOR)


def fraction(a: Number) -> Number:
    """Return what is left of a number beyond the whole."""
    return a - floor(a)


def absolute(a: Number) -> Number:
    """Return a number without its sign."""
    return a.apply(Op.ABSOLUTE)


def root(a: Number) -> Number:
    """Return the square root."""
    return a.apply(Op.SQRT)


def safe_divide(a: Number, b: Operand) -> Number:
    """Return a quotient, 0 where the divisor is 0."""
    return a.apply(Op.SAFE_DIVIDE, b)


def safe_remainder(a: Number, b: Number) -> Number:
    """Return what is left after whole multiples, with the first one's sign; 0 where the second is 0."""
    return b.equals(0.0).choose(0.0, a.apply(Op.REMAINDER, b))


def power(a: Number, b: Number) -> Number:
    """Return a power; 0 of a negative number with a fraction, which has none."""
    result = a.apply(Op.POWER, b)
    # Since 5.0 negative powers of 0 are 0, and not without end.
    return result if VECTORS_FUSED else a.equals(0.0).choose((b < 0.0).choose(0.0, result), result)


def sine(a: Number) -> Number:
    """Return the sine of an angle (rad)."""
    return a.apply(Op.SINE)


def cosine(a: Number) -> Number:
    """Return the cosine of an angle (rad)."""
    return a.apply(Op.COSINE)


def mix(a: Number, b: Number, share: Number) -> Number:
    """Return what lies between two numbers, from the first on."""
    return a + share * (b - a)


def each(function: Callable[..., Number], *vectors: Vector) -> Vector:
    """Return a vector of a function of vectors' components."""
    x, y, z = (function(*parts) for parts in zip(*vectors, strict=True))
    return x, y, z


def multiply_add(a: Number, b: Operand, c: Operand) -> Number:
    """Return a b + c, rounded once: processors have an instruction for it that Cycles takes where one line says so."""
    return a.apply(Op.MULTIPLY_ADD, b, c)


def of_vectors(a: Number, b: Operand, c: Operand) -> Number:
    """Return a b + c as Cycles has it where a, b and c are components of vectors."""
    return multiply_add(a, b, c) if VECTORS_FUSED else a * b + c


def scaled(vector: Vector, factor: Operand) -> Vector:
    """Return a vector times a number."""
    return each(lambda a: a * factor, vector)


def added(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return each(lambda p, q: p + q, a, b)


def subtracted(a: Vector, b: Vector) -> Vector:
    """Return the difference of two vectors."""
    return each(lambda p, q: p - q, a, b)


def dot(a: Vector, b: Vector) -> Number:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (
        multiply_add(a[1], b[2], -(a[2] * b[1])),
        multiply_add(a[2], b[0], -(a[0] * b[2])),
        multiply_add(a[0], b[1], -(a[1] * b[0])),
    )


def length(a: Vector) -> Number:
    """Return the length of a vector."""
    return root(dot(a, a))


def safe_normalize(a: Vector) -> Vector:
    """Return the unit vector, the vector itself where it has no length."""
    size = length(a)
    inverse = 1.0 / size
    return each(lambda part: size.equals(0.0).choose(part, part * inverse), a)


def rotated(vector: Vector, angles: Vector, backwards: bool = False) -> Vector:
    """Return a vector turned by Euler angles (rad) about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = each(cosine, angles), each(sine, angles)
    rows = (
        (cy * cz, multiply_add(sy * sx, cz, -(cx * sz)), multiply_add(sy * cx, cz, sx * sz)),
        (cy * sz, multiply_add(sy * sx, sz, cx * cz), multiply_add(sy * cx, sz, -(sx * cz))),
        (-sy, cy * sx, cy * cx),
    )
    x, y, z = vector
    if backwards:
        (a, b, c) = zip(*rows, strict=True)
        return (dot(a, vector), dot(b, vector), dot(c, vector))
    return each(lambda p, q, r: multiply_add(p, x, multiply_add(q, y, r * z)), *zip(*rows, strict=True))
