"""Numbers and vectors of a material's program, written as formulas: the operations of Cycles' kernel, one by one.

Arithmetic on a `Number` doesn't compute, but adds an operation to the program. The order of operations is that of
Cycles, as float32 rounds after each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import bpy

from ....scanning.kernels.program import Op, ProgramBuilder

VECTORS_FUSED = bpy.app.version < (5, 0, 0)
"""Whether Cycles multiplies and adds components of vectors with one rounding (fused), as it does numbers."""


@dataclass(frozen=True)
class Number:
    """A number that a program computes when it runs; Python's operators add operations to the program.

    Attributes:
        builder: builder of the program.
        value: index of the number among the program's values.
    """

    builder: ProgramBuilder
    value: int

    def as_number(self, operand: Operand) -> Number:
        """Return an operand as a number of the same program; a float becomes a constant."""
        return operand if isinstance(operand, Number) else Number(self.builder, self.builder.constant(operand))

    def apply(self, op: Op, *operands: Operand) -> Number:
        """Add an operation on this number and further operands to the program; return its result."""
        values = (self.as_number(operand).value for operand in operands)
        return Number(self.builder, self.builder.add(op, self.value, *values))

    @property
    def constant_value(self) -> float | None:
        """Return the value of a constant; None if the program computes the number."""
        return self.builder.number_of(self.value)

    def __add__(self, other: Operand) -> Number:
        return self.apply(Op.ADD, other)

    def __radd__(self, other: float) -> Number:
        return self.as_number(other) + self

    def __sub__(self, other: Operand) -> Number:
        return self.apply(Op.SUBTRACT, other)

    def __rsub__(self, other: float) -> Number:
        return self.as_number(other) - self

    def __mul__(self, other: Operand) -> Number:
        return self.apply(Op.MULTIPLY, other)

    def __rmul__(self, other: float) -> Number:
        return self.as_number(other) * self

    def __truediv__(self, other: Operand) -> Number:
        return self.apply(Op.DIVIDE, other)

    def __rtruediv__(self, other: float) -> Number:
        return self.as_number(other) / self

    def __neg__(self) -> Number:
        return self.apply(Op.NEGATE)

    def __lt__(self, other: Operand) -> Number:
        return self.apply(Op.LESS, other)

    def __gt__(self, other: Operand) -> Number:
        return self.as_number(other) < self

    def __le__(self, other: Operand) -> Number:
        return self.apply(Op.LESS_EQUAL, other)

    def __ge__(self, other: Operand) -> Number:
        return self.as_number(other) <= self

    def equals(self, other: Operand) -> Number:
        """Return 1 where both numbers are equal, else 0."""
        return self.apply(Op.EQUAL, other)

    def choose(self, if_true: Operand, if_false: Operand) -> Number:
        """Return `if_true` where this number isn't 0, `if_false` where it is."""
        return self.apply(Op.SELECT, if_true, if_false)


Operand: TypeAlias = "Number | float"
Vector: TypeAlias = tuple[Number, Number, Number]
Plus: TypeAlias = "Callable[[Number, Operand, Operand], Number]"
"""Function that returns a b + c, with or without rounding the product."""


def smaller(a: Number, b: Operand) -> Number:
    """Return the smaller of two numbers, b where either is NaN."""
    return a.apply(Op.MINIMUM, b)


def larger(a: Number, b: Operand) -> Number:
    """Return the larger of two numbers, b where either is NaN."""
    return a.apply(Op.MAXIMUM, b)


def clamp(a: Number, minimum: Operand, maximum: Operand) -> Number:
    """Return a number clamped between a minimum and a maximum."""
    return smaller(larger(a, minimum), maximum)


def saturate(a: Number) -> Number:
    """Return a number clamped between 0 and 1."""
    return clamp(a, 0.0, 1.0)


def floor(a: Number) -> Number:
    """Return the largest whole number that isn't larger."""
    return a.apply(Op.FLOOR)


def fraction(a: Number) -> Number:
    """Return a - floor(a)."""
    return a - floor(a)


def absolute(a: Number) -> Number:
    """Return the absolute value of a number."""
    return a.apply(Op.ABSOLUTE)


def root(a: Number) -> Number:
    """Return the square root of a number."""
    return a.apply(Op.SQRT)


def safe_divide(a: Number, b: Operand) -> Number:
    """Return a quotient, 0 where the divisor is 0."""
    return a.apply(Op.SAFE_DIVIDE, b)


def safe_remainder(a: Number, b: Number) -> Number:
    """Return the remainder of a / b with the sign of a; 0 where b is 0."""
    return b.equals(0.0).choose(0.0, a.apply(Op.REMAINDER, b))


def power(a: Number, b: Number) -> Number:
    """Return a to the power b; 0 for a negative a and a fractional b."""
    result = a.apply(Op.POWER, b)
    # Since Blender 5.0 negative powers of 0 are 0, not infinite.
    return result if VECTORS_FUSED else a.equals(0.0).choose((b < 0.0).choose(0.0, result), result)


def sine(a: Number) -> Number:
    """Return the sine of an angle (rad)."""
    return a.apply(Op.SINE)


def cosine(a: Number) -> Number:
    """Return the cosine of an angle (rad)."""
    return a.apply(Op.COSINE)


def mix(a: Number, b: Number, share: Number) -> Number:
    """Return a + share (b - a)."""
    return a + share * (b - a)


def each(function: Callable[..., Number], *vectors: Vector) -> Vector:
    """Return the vector of a function's values for each component of some vectors."""
    x, y, z = (function(*parts) for parts in zip(*vectors, strict=True))
    return x, y, z


def multiply_add(a: Number, b: Operand, c: Operand) -> Number:
    """Return a b + c rounded once (fused), as compilers translate such terms of Cycles' kernel."""
    return a.apply(Op.MULTIPLY_ADD, b, c)


def component_multiply_add(a: Number, b: Operand, c: Operand) -> Number:
    """Return a b + c as this Blender's Cycles computes it for components of vectors: fused or not."""
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
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product of two vectors."""
    return (
        multiply_add(a[1], b[2], -(a[2] * b[1])),
        multiply_add(a[2], b[0], -(a[0] * b[2])),
        multiply_add(a[0], b[1], -(a[1] * b[0])),
    )


def length(a: Vector) -> Number:
    """Return the length of a vector."""
    return root(dot(a, a))


def safe_normalize(a: Vector) -> Vector:
    """Return the unit vector of a vector, the vector itself where its length is 0."""
    size = length(a)
    inverse = 1.0 / size
    return each(lambda part: size.equals(0.0).choose(part, part * inverse), a)


def rotated(vector: Vector, angles: Vector, backwards: bool = False) -> Vector:
    """Return a vector rotated by Euler angles (rad) about x, then y, then z; `backwards` by the inverse rotation."""
    (cx, cy, cz), (sx, sy, sz) = each(cosine, angles), each(sine, angles)
    rows = (
        (cy * cz, multiply_add(sy * sx, cz, -(cx * sz)), multiply_add(sy * cx, cz, sx * sz)),
        (cy * sz, multiply_add(sy * sx, sz, cx * cz), multiply_add(sy * cx, sz, -(sx * cz))),
        (-sy, cy * sx, cy * cx),
    )
    x, y, z = vector
    if backwards:  # the inverse of a rotation matrix is its transpose
        (a, b, c) = zip(*rows, strict=True)
        return (dot(a, vector), dot(b, vector), dot(c, vector))
    return each(lambda p, q, r: multiply_add(p, x, multiply_add(q, y, r * z)), *zip(*rows, strict=True))
