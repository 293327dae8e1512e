"""Nodes that compute numbers and vectors: Math, Vector Math, Mapping, Map Range and similar ones.

Formulas, and the order of their operations, are those of Cycles' kernel (svm/math_util.h, map_range.h, mapping_util.h).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from ....scanning.kernels.program import Op
from .numbers import (
    VECTORS_FUSED,
    Number,
    Plus,
    Vector,
    absolute,
    added,
    clamp,
    component_multiply_add,
    cosine,
    cross,
    dot,
    each,
    floor,
    fraction,
    larger,
    length,
    multiply_add,
    power,
    root,
    rotated,
    safe_divide,
    safe_normalize,
    safe_remainder,
    saturate,
    scaled,
    sine,
    smaller,
    subtracted,
)
from .tree import NodeReader, Value, reads

_EPSILON = 1.1920929e-07
"""Distance from 1 to the next float32: the least tolerance of a comparison."""


def _logarithm(a: Number, b: Number) -> Number:
    """Return the logarithm of a to the base b, 0 where either isn't positive."""
    quotient = safe_divide(a.apply(Op.LOGARITHM), b.apply(Op.LOGARITHM))
    return (a <= 0.0).choose(0.0, (b <= 0.0).choose(0.0, quotient))


def _wrap(value: Number, maximum: Number, minimum: Number) -> Number:
    """Return a number wrapped into the range from minimum to maximum."""
    span = maximum - minimum
    return span.equals(0.0).choose(minimum, multiply_add(-span, floor((value - minimum) / span), value))


def _ping_pong(a: Number, b: Number) -> Number:
    """Return the number a reflected back and forth between 0 and b (a triangle wave)."""
    return b.equals(0.0).choose(0.0, absolute(fraction((a - b) / (b * 2.0)) * b * 2.0 - b))


def _smooth_smaller(a: Number, b: Number, width: Number) -> Number:
    """Return the smaller of a and b, blended smoothly (cubic) where they differ by less than a width."""
    share = larger(width - absolute(a - b), 0.0) / width
    smooth_minimum = smaller(a, b) - share * share * share * width * (1.0 / 6.0)
    return width.equals(0.0).choose(smaller(a, b), smooth_minimum)


def _compare(a: Number, b: Number, tolerance: Number) -> Number:
    """Return 1 where a and b differ by no more than the tolerance, else 0."""
    is_close = absolute(a - b) <= larger(tolerance, _EPSILON)
    return larger(a.equals(b), is_close)


_OF_ONE: dict[str, Callable[[Number], Number]] = {
    "SQRT": lambda a: root(larger(a, 0.0)),
    "INVERSE_SQRT": lambda a: (a > 0.0).choose(1.0 / root(a), 0.0),
    "ABSOLUTE": absolute,
    "EXPONENT": lambda a: a.apply(Op.EXPONENT),
    "SIGN": lambda a: a.apply(Op.SIGN),
    "ROUND": lambda a: floor(a + 0.5),
    "FLOOR": floor,
    "CEIL": lambda a: a.apply(Op.CEIL),
    "TRUNC": lambda a: a.apply(Op.TRUNCATE),
    "FRACT": fraction,
    "SINE": sine,
    "COSINE": cosine,
    "TANGENT": lambda a: a.apply(Op.TANGENT),
    "ARCSINE": lambda a: a.apply(Op.ARCSINE),
    "ARCCOSINE": lambda a: a.apply(Op.ARCCOSINE),
    "ARCTANGENT": lambda a: a.apply(Op.ARCTANGENT),
    "SINH": lambda a: a.apply(Op.SINH),
    "COSH": lambda a: a.apply(Op.COSH),
    "TANH": lambda a: a.apply(Op.TANH),
    "RADIANS": lambda a: a * (math.pi / 180.0),
    "DEGREES": lambda a: a * (180.0 / math.pi),
}
_OF_TWO: dict[str, Callable[[Number, Number], Number]] = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": safe_divide,
    "POWER": power,
    "LOGARITHM": _logarithm,
    "MINIMUM": smaller,
    "MAXIMUM": larger,
    "LESS_THAN": lambda a, b: a < b,
    "GREATER_THAN": lambda a, b: a > b,
    "MODULO": safe_remainder,
    "FLOORED_MODULO": lambda a, b: b.equals(0.0).choose(0.0, multiply_add(-floor(a / b), b, a)),
    "SNAP": lambda a, b: floor(safe_divide(a, b)) * b,
    "PINGPONG": _ping_pong,
    "ARCTAN2": lambda a, b: a.apply(Op.ARCTAN2, b),
}
_OF_THREE: dict[str, Callable[[Number, Number, Number], Number]] = {
    "MULTIPLY_ADD": multiply_add,
    "COMPARE": _compare,
    "WRAP": _wrap,
    "SMOOTH_MIN": _smooth_smaller,
    "SMOOTH_MAX": lambda a, b, c: -_smooth_smaller(-a, -b, c),
}


_MATH: dict[str, tuple[int, Callable[..., Number]]] = {
    **{name: (1, function) for name, function in _OF_ONE.items()},
    **{name: (2, function) for name, function in _OF_TWO.items()},
    **{name: (3, function) for name, function in _OF_THREE.items()},
}
"""Operations of the Math node: number of operands, and the function."""


@reads("Math")
def _math(node: NodeReader) -> Value:
    """Return the result of a Math node."""
    operation = node.node.operation
    if operation not in _MATH:
        raise node.refuse(operation)
    count, function = _MATH[operation]
    result = function(*(node.number(index) for index in range(count)))
    return saturate(result) if node.node.use_clamp else result


def _project(a: Vector, b: Vector) -> Vector:
    """Return the projection of vector a onto b, 0 where b is 0: b (a . b) / (b . b)."""
    size = dot(b, b)
    share = dot(a, b) / size
    return each(lambda part: size.equals(0.0).choose(0.0, share * part), b)


def _reflect(a: Vector, b: Vector) -> Vector:
    """Return vector a mirrored at the plane with normal b: a - 2 n (a . n), n = b / |b|."""
    normal = safe_normalize(b)
    return subtracted(a, scaled(normal, 2.0 * dot(a, normal)))


def _refract(incident: Vector, normal: Vector, index: Number) -> Vector:
    """Return the refracted direction by Snell's law; 0 at total reflection. The index is the ratio of both media's."""
    normal = safe_normalize(normal)
    cosine = dot(normal, incident)
    # Squared cosine of the refracted angle: 1 - index^2 (1 - cosine^2), negative at total reflection.
    squared_cosine = 1.0 - index * index * (1.0 - cosine * cosine)
    normal_factor = index * cosine + root(larger(squared_cosine, 0.0))
    result = subtracted(scaled(incident, index), scaled(normal, normal_factor))
    return each(lambda part: (squared_cosine < 0.0).choose(0.0, part), result)


def _face_forward(vector: Vector, incident: Vector, reference: Vector) -> Vector:
    """Return a vector, reversed unless the reference vector points against the incident one."""
    is_against = dot(reference, incident) < 0.0
    return each(lambda part: is_against.choose(part, -part), vector)


def _wrap_component(value: Number, maximum: Number, minimum: Number) -> Number:
    """Return a component of a vector wrapped into a range, in the order of operations of this Blender."""
    if VECTORS_FUSED:
        return _wrap(value, maximum, minimum)
    span, excess = maximum - minimum, value - minimum
    return span.equals(0.0).choose(minimum, excess - span * floor(excess / span) + minimum)


def _vector_remainder(a: Number, b: Number) -> Number:
    """Return the remainder of components of vectors, in the order of operations of this Blender; 0 where b is 0."""
    if VECTORS_FUSED:
        return safe_remainder(a, b)
    return b.equals(0.0).choose(0.0, a - b * (a / b).apply(Op.TRUNCATE))


_VECTORS_OF_ONE: dict[str, Callable[[Vector], Value]] = {
    "NORMALIZE": safe_normalize,
    "LENGTH": length,
    **{
        name: partial(each, _OF_ONE[name])
        for name in ("FLOOR", "CEIL", "ROUND", "ABSOLUTE", "SINE", "COSINE", "TANGENT", "SIGN")
    },
    "FRACTION": partial(each, fraction),
}
_VECTORS_OF_TWO: dict[str, Callable[[Vector, Vector], Value]] = {
    "ADD": added,
    "SUBTRACT": subtracted,
    "MULTIPLY": lambda a, b: each(lambda p, q: p * q, a, b),
    "DIVIDE": lambda a, b: each(safe_divide, a, b),
    "CROSS_PRODUCT": cross,
    "PROJECT": _project,
    "REFLECT": _reflect,
    "DOT_PRODUCT": dot,
    "DISTANCE": lambda a, b: length(subtracted(a, b)),
    "SNAP": lambda a, b: each(_OF_TWO["SNAP"], a, b),
    "MODULO": lambda a, b: each(_vector_remainder, a, b),
    "MINIMUM": lambda a, b: each(smaller, a, b),
    "MAXIMUM": lambda a, b: each(larger, a, b),
    "POWER": lambda a, b: each(_OF_TWO["POWER"], a, b),
}
_VECTORS_OF_THREE: dict[str, Callable[[Vector, Vector, Vector], Value]] = {
    "MULTIPLY_ADD": lambda a, b, c: each(component_multiply_add, a, b, c),
    "WRAP": lambda a, b, c: each(_wrap_component, a, b, c),
    "FACEFORWARD": _face_forward,
}


_VECTOR_MATH: dict[str, tuple[int, Callable[..., Value]]] = {
    **{name: (1, function) for name, function in _VECTORS_OF_ONE.items()},
    **{name: (2, function) for name, function in _VECTORS_OF_TWO.items()},
    **{name: (3, function) for name, function in _VECTORS_OF_THREE.items()},
}
"""Operations of the Vector Math node: number of vectors, and the function."""


@reads("VectorMath")
def _vector_math(node: NodeReader) -> Value:
    """Return the result of a Vector Math node: a vector or a number, by its output."""
    operation = node.node.operation
    result: Value | None = None
    if operation == "SCALE":
        result = scaled(node.vector("Vector"), node.number("Scale"))
    elif operation == "REFRACT":
        result = _refract(node.vector("Vector"), node.vector("Vector_001"), node.number("Scale"))
    elif operation in _VECTOR_MATH:
        count, function = _VECTOR_MATH[operation]
        result = function(*(node.vector(name) for name in ("Vector", "Vector_001", "Vector_002")[:count]))
    if result is None:
        raise node.refuse(operation)
    if isinstance(result, Number) != (node.socket.type == "VALUE"):
        raise node.refuse(node.socket.name)  # an output that the operation doesn't have
    return result


@reads("SeparateXYZ")
def _separate(node: NodeReader) -> Value:
    """Return one component of a vector."""
    return node.vector(0)["XYZ".index(node.socket.identifier)]


@reads("CombineXYZ")
def _combine(node: NodeReader) -> Value:
    """Return the vector of three numbers."""
    return node.number(0), node.number(1), node.number(2)


@reads("Value")
def _value(node: NodeReader) -> Value:
    """Return the constant of a Value node."""
    return node.constant(float(node.node.outputs[0].default_value))


@reads("Clamp")
def _clamp(node: NodeReader) -> Value:
    """Return the result of a Clamp node."""
    value, minimum, maximum = (node.number(index) for index in range(3))
    if node.node.clamp_type == "RANGE":
        return (minimum > maximum).choose(clamp(value, maximum, minimum), clamp(value, minimum, maximum))
    return clamp(value, minimum, maximum)


def _smooth(share: Number, plus: Plus) -> Number:
    """Return the smooth step 3 s^2 - 2 s^3 of a share s; `plus(a, b, c)` is a b + c."""
    return plus(share, -2.0, 3.0) * (share * share)


def _smoother(share: Number, plus: Plus) -> Number:
    """Return the smoother step 6 s^5 - 15 s^4 + 10 s^3 of a share s; `plus(a, b, c)` is a b + c."""
    return share * share * share * plus(share, plus(share, 6.0, -15.0), 10.0)


def _stepped(share: Number, steps: Number) -> Number:
    """Return a share rounded down to whole steps; 0 without steps."""
    return (steps > 0.0).choose(floor(share * (steps + 1.0)) / steps, 0.0)


def _map_number(kind: str, clamped: bool, parts: tuple[Number, ...]) -> Number:
    """Return the result of a Map Range node of numbers.

    Args:
        kind: ``LINEAR``, ``STEPPED``, ``SMOOTHSTEP`` or ``SMOOTHERSTEP``.
        clamped: whether the result is clamped to the target range.
        parts: value, from_low, from_high, to_low, to_high, steps.
    """
    value, from_low, from_high, to_low, to_high, steps = parts
    share = (value - from_low) / (from_high - from_low)
    # The smooth steps run from the lower end of the range to the upper, whichever is which, and are then mirrored.
    range_start, range_end = smaller(from_low, from_high), larger(from_low, from_high)
    if kind == "STEPPED":
        share = _stepped(share, steps)
    elif kind == "SMOOTHSTEP":
        range_share = (value - range_start) / (range_end - range_start)
        step = (value < range_start).choose(0.0, (value >= range_end).choose(1.0, _smooth(range_share, multiply_add)))
        share = (from_low > from_high).choose(1.0 - step, step)
    elif kind == "SMOOTHERSTEP":
        step = _smoother(saturate(safe_divide(value - range_start, range_end - range_start)), multiply_add)
        share = (from_low > from_high).choose(1.0 - step, step)
    result = from_high.equals(from_low).choose(0.0, multiply_add(share, to_high - to_low, to_low))
    return _clamp_between(result, to_low, to_high) if clamped else result


def _clamp_between(value: Number, limit_a: Number, limit_b: Number) -> Number:
    """Return a value clamped between two limits in any order."""
    return (limit_a > limit_b).choose(clamp(value, limit_b, limit_a), clamp(value, limit_a, limit_b))


def _map_component(kind: str, clamped: bool, parts: tuple[Number, ...]) -> Number:
    """Return a component of the result of a Map Range node of vectors; arguments are those of `_map_number`."""
    value, from_low, from_high, to_low, to_high, steps = parts
    share = safe_divide(value - from_low, from_high - from_low)
    if kind == "STEPPED":
        share = _stepped(share, steps)
    elif kind == "SMOOTHSTEP":
        share = _smooth(saturate(share), component_multiply_add)
    elif kind == "SMOOTHERSTEP":
        share = _smoother(saturate(share), component_multiply_add)
    result = component_multiply_add(share, to_high - to_low, to_low)
    return _clamp_between(result, to_low, to_high) if clamped and kind in ("LINEAR", "STEPPED") else result


@reads("MapRange")
def _map_range(node: NodeReader) -> Value:
    """Return the result of a Map Range node."""
    kind, clamped = node.node.interpolation_type, node.node.clamp
    if node.node.data_type == "FLOAT":
        names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
        return _map_number(kind, clamped, tuple(node.number(name) for name in names))
    if node.node.data_type != "FLOAT_VECTOR":
        raise node.refuse(node.node.data_type)
    names = ("Vector", "From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3", "Steps_FLOAT3")
    return each(lambda *parts: _map_component(kind, clamped, parts), *(node.vector(name) for name in names))


@reads("Mapping")
def _mapping(node: NodeReader) -> Value:
    """Return the result of a Mapping node."""
    kind = node.node.vector_type
    vector, angles, factors = node.vector("Vector"), node.vector("Rotation"), node.vector("Scale")
    if kind == "TEXTURE":
        shifted_vector = subtracted(vector, node.vector("Location"))
        return each(safe_divide, rotated(shifted_vector, angles, backwards=True), factors)
    if kind == "NORMAL":
        return safe_normalize(rotated(each(safe_divide, vector, factors), angles))
    rotated_vector = rotated(each(lambda p, q: p * q, vector, factors), angles)
    return rotated_vector if kind == "VECTOR" else added(rotated_vector, node.vector("Location"))


@reads("VectorRotate")
def _rotate(node: NodeReader) -> Value:
    """Return the result of a Vector Rotate node."""
    kind, is_inverse = node.node.rotation_type, node.node.invert
    vector, centre = node.vector("Vector"), node.vector("Center")
    shifted_vector = subtracted(vector, centre)
    if kind == "EULER_XYZ":
        return added(rotated(shifted_vector, node.vector("Rotation"), backwards=is_inverse), centre)
    zero, one = node.constant(0.0), node.constant(1.0)
    fixed_axes = {"X_AXIS": (one, zero, zero), "Y_AXIS": (zero, one, zero), "Z_AXIS": (zero, zero, one)}
    axis = fixed_axes.get(kind) or node.vector("Axis")
    size = length(axis)
    unit_axis = each(lambda part: part / size, axis)
    angle = node.number("Angle")
    rotated_vector = added(_rotate_about(shifted_vector, unit_axis, -angle if is_inverse else angle), centre)
    # Without an axis nothing is rotated.
    return each(
        lambda input_part, rotated_part: size.equals(0.0).choose(input_part, rotated_part), vector, rotated_vector
    )


def _rotate_about(p: Vector, axis: Vector, angle: Number) -> Vector:
    """Return a vector rotated about a unit axis by an angle, rad (Rodrigues' rotation matrix)."""
    c, s = cosine(angle), sine(angle)
    one_minus_cosine, (x, y, z) = 1.0 - c, axis
    xx, yy, zz = (multiply_add(one_minus_cosine * part, part, c) for part in axis)
    rows = (
        (xx, multiply_add(one_minus_cosine * x, y, -(z * s)), multiply_add(one_minus_cosine * x, z, y * s)),
        (multiply_add(one_minus_cosine * x, y, z * s), yy, multiply_add(one_minus_cosine * y, z, -(x * s))),
        (multiply_add(one_minus_cosine * x, z, -(y * s)), multiply_add(one_minus_cosine * y, z, x * s), zz),
    )
    return each(lambda *row: _row_product(row, p), *zip(*rows, strict=True))


def _row_product(row: tuple[Number, ...], p: Vector) -> Number:
    """Return the scalar product of a matrix's row and a vector."""
    return multiply_add(row[2], p[2], multiply_add(row[1], p[1], row[0] * p[0]))


@reads("Normal")
def _normal(node: NodeReader) -> Value:
    """Return the result of a Normal node: its direction, or the cosine between this and the input."""
    direction = [float(part) for part in node.node.outputs[0].default_value]
    x, y, z = (node.constant(part / (math.hypot(*direction) or 1.0)) for part in direction)
    if node.socket.identifier == "Normal":
        return x, y, z
    vector = node.vector(0)
    size = length(vector)
    return dot((x, y, z), each(lambda part: part / size, vector))
