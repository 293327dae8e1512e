"""Nodes that work out numbers and vectors: Math, Vector Math, Mapping, Map Range and their like."""

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
    cosine,
    cross,
    dot,
    each,
    floor,
    fraction,
    larger,
    length,
    multiply_add,
    of_vectors,
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
    quotient = safe_divide(a.apply(Op.LOGARITHM), b.apply(Op.LOGARITHM))
    return (a <= 0.0).choose(0.0, (b <= 0.0).choose(0.0, quotient))


def _wrapped(value: Number, most: Number, least: Number) -> Number:
    span = most - least
    return span.equals(0.0).choose(least, multiply_add(-span, floor((value - least) / span), value))


def _ping_pong(a: Number, b: Number) -> Number:
    return b.equals(0.0).choose(0.0, absolute(fraction((a - b) / (b * 2.0)) * b * 2.0 - b))


def _smooth_smaller(a: Number, b: Number, width: Number) -> Number:
    share = larger(width - absolute(a - b), 0.0) / width
    smooth = smaller(a, b) - share * share * share * width * (1.0 / 6.0)
    return width.equals(0.0).choose(smaller(a, b), smooth)


def _compare(a: Number, b: Number, tolerance: Number) -> Number:
    near = absolute(a - b) <= larger(tolerance, _EPSILON)
    return larger(a.equals(b), near)


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
    "WRAP": _wrapped,
    "SMOOTH_MIN": _smooth_smaller,
    "SMOOTH_MAX": lambda a, b, c: -_smooth_smaller(-a, -b, c),
}


_MATH: dict[str, tuple[int, Callable[..., Number]]] = {
    **{name: (1, function) for name, function in _OF_ONE.items()},
    **{name: (2, function) for name, function in _OF_TWO.items()},
    **{name: (3, function) for name, function in _OF_THREE.items()},
}
"""Operations of the Math node: of how many numbers, and the function."""


@reads("Math")
def _math(node: NodeReader) -> Value:
    operation = node.node.operation
    if operation not in _MATH:
        raise node.refuse(operation)
    count, function = _MATH[operation]
    result = function(*(node.number(index) for index in range(count)))
    return saturate(result) if node.node.use_clamp else result


def _project(a: Vector, b: Vector) -> Vector:
    size = dot(b, b)
    share = dot(a, b) / size
    return each(lambda part: size.equals(0.0).choose(0.0, share * part), b)


def _reflect(a: Vector, b: Vector) -> Vector:
    normal = safe_normalize(b)
    return subtracted(a, scaled(normal, 2.0 * dot(a, normal)))


def _refract(incident: Vector, normal: Vector, index: Number) -> Vector:
    normal = safe_normalize(normal)
    along = dot(normal, incident)
    rest = 1.0 - index * index * (1.0 - along * along)
    bent = index * along + root(larger(rest, 0.0))
    result = subtracted(scaled(incident, index), scaled(normal, bent))
    return each(lambda part: (rest < 0.0).choose(0.0, part), result)


def _face_forward(vector: Vector, incident: Vector, reference: Vector) -> Vector:
    towards = dot(reference, incident) < 0.0
    return each(lambda part: towards.choose(part, -part), vector)


def _wrapped_part(value: Number, most: Number, least: Number) -> Number:
    if VECTORS_FUSED:
        return _wrapped(value, most, least)
    span, above = most - least, value - least
    return span.equals(0.0).choose(least, above - span * floor(above / span) + least)


def _vector_remainder(a: Number, b: Number) -> Number:
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
    "MULTIPLY_ADD": lambda a, b, c: each(of_vectors, a, b, c),
    "WRAP": lambda a, b, c: each(_wrapped_part, a, b, c),
    "FACEFORWARD": _face_forward,
}


_VECTOR_MATH: dict[str, tuple[int, Callable[..., Value]]] = {
    **{name: (1, function) for name, function in _VECTORS_OF_ONE.items()},
    **{name: (2, function) for name, function in _VECTORS_OF_TWO.items()},
    **{name: (3, function) for name, function in _VECTORS_OF_THREE.items()},
}
"""Operations of the Vector Math node: of how many vectors, and the function."""


@reads("VectorMath")
def _vector_math(node: NodeReader) -> Value:
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
    return node.vector(0)["XYZ".index(node.socket.identifier)]


@reads("CombineXYZ")
def _combine(node: NodeReader) -> Value:
    return node.number(0), node.number(1), node.number(2)


@reads("Value")
def _value(node: NodeReader) -> Value:
    return node.constant(float(node.node.outputs[0].default_value))


@reads("Clamp")
def _clamp(node: NodeReader) -> Value:
    value, low, high = (node.number(index) for index in range(3))
    if node.node.clamp_type == "RANGE":
        return (low > high).choose(clamp(value, high, low), clamp(value, low, high))
    return clamp(value, low, high)


def _smooth(share: Number, plus: Plus) -> Number:
    return plus(share, -2.0, 3.0) * (share * share)


def _smoother(share: Number, plus: Plus) -> Number:
    return share * share * share * plus(share, plus(share, 6.0, -15.0), 10.0)


def _stepped(share: Number, steps: Number) -> Number:
    return (steps > 0.0).choose(floor(share * (steps + 1.0)) / steps, 0.0)


def _map_number(kind: str, clamped: bool, parts: tuple[Number, ...]) -> Number:
    value, low, high, to_low, to_high, steps = parts
    share = (value - low) / (high - low)
    # From the lower end on, whichever that is.
    first, last = smaller(low, high), larger(low, high)
    if kind == "STEPPED":
        share = _stepped(share, steps)
    elif kind == "SMOOTHSTEP":
        inner = (value - first) / (last - first)
        rising = (value < first).choose(0.0, (value >= last).choose(1.0, _smooth(inner, multiply_add)))
        share = (low > high).choose(1.0 - rising, rising)
    elif kind == "SMOOTHERSTEP":
        rising = _smoother(saturate(safe_divide(value - first, last - first)), multiply_add)
        share = (low > high).choose(1.0 - rising, rising)
    result = high.equals(low).choose(0.0, multiply_add(share, to_high - to_low, to_low))
    return _kept_between(result, to_low, to_high) if clamped else result


def _kept_between(value: Number, low: Number, high: Number) -> Number:
    return (low > high).choose(clamp(value, high, low), clamp(value, low, high))


def _map_part(kind: str, clamped: bool, parts: tuple[Number, ...]) -> Number:
    value, low, high, to_low, to_high, steps = parts
    share = safe_divide(value - low, high - low)
    if kind == "STEPPED":
        share = _stepped(share, steps)
    elif kind == "SMOOTHSTEP":
        share = _smooth(saturate(share), of_vectors)
    elif kind == "SMOOTHERSTEP":
        share = _smoother(saturate(share), of_vectors)
    result = of_vectors(share, to_high - to_low, to_low)
    return _kept_between(result, to_low, to_high) if clamped and kind in ("LINEAR", "STEPPED") else result


@reads("MapRange")
def _map_range(node: NodeReader) -> Value:
    kind, clamped = node.node.interpolation_type, node.node.clamp
    if node.node.data_type == "FLOAT":
        names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
        return _map_number(kind, clamped, tuple(node.number(name) for name in names))
    if node.node.data_type != "FLOAT_VECTOR":
        raise node.refuse(node.node.data_type)
    names = ("Vector", "From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3", "Steps_FLOAT3")
    return each(lambda *parts: _map_part(kind, clamped, parts), *(node.vector(name) for name in names))


@reads("Mapping")
def _mapping(node: NodeReader) -> Value:
    kind = node.node.vector_type
    vector, angles, factors = node.vector("Vector"), node.vector("Rotation"), node.vector("Scale")
    if kind == "TEXTURE":
        moved = subtracted(vector, node.vector("Location"))
        return each(safe_divide, rotated(moved, angles, backwards=True), factors)
    if kind == "NORMAL":
        return safe_normalize(rotated(each(safe_divide, vector, factors), angles))
    turned = rotated(each(lambda p, q: p * q, vector, factors), angles)
    return turned if kind == "VECTOR" else added(turned, node.vector("Location"))


@reads("VectorRotate")
def _rotate(node: NodeReader) -> Value:
    kind, inverted = node.node.rotation_type, node.node.invert
    vector, center = node.vector("Vector"), node.vector("Center")
    moved = subtracted(vector, center)
    if kind == "EULER_XYZ":
        return added(rotated(moved, node.vector("Rotation"), backwards=inverted), center)
    zero, one = node.constant(0.0), node.constant(1.0)
    fixed = {"X_AXIS": (one, zero, zero), "Y_AXIS": (zero, one, zero), "Z_AXIS": (zero, zero, one)}
    axis = fixed.get(kind) or node.vector("Axis")
    size = length(axis)
    unit = each(lambda part: part / size, axis)
    angle = node.number("Angle")
    turned = added(_about(moved, unit, -angle if inverted else angle), center)
    return each(lambda old, new: size.equals(0.0).choose(old, new), vector, turned)


def _about(p: Vector, axis: Vector, angle: Number) -> Vector:
    """Return a vector turned about a unit axis."""
    c, s = cosine(angle), sine(angle)
    rest, (x, y, z) = 1.0 - c, axis
    xx, yy, zz = (multiply_add(rest * part, part, c) for part in axis)
    rows = (
        (xx, multiply_add(rest * x, y, -(z * s)), multiply_add(rest * x, z, y * s)),
        (multiply_add(rest * x, y, z * s), yy, multiply_add(rest * y, z, -(x * s))),
        (multiply_add(rest * x, z, -(y * s)), multiply_add(rest * y, z, x * s), zz),
    )
    return each(lambda *row: _along(row, p), *zip(*rows, strict=True))


def _along(row: tuple[Number, ...], p: Vector) -> Number:
    return multiply_add(row[2], p[2], multiply_add(row[1], p[1], row[0] * p[0]))


@reads("Normal")
def _normal(node: NodeReader) -> Value:
    direction = [float(part) for part in node.node.outputs[0].default_value]
    x, y, z = (node.constant(part / (math.hypot(*direction) or 1.0)) for part in direction)
    if node.socket.identifier == "Normal":
        return x, y, z
    vector = node.vector(0)
    size = length(vector)
    return dot((x, y, z), each(lambda part: part / size, vector))
