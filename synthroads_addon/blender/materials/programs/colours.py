"""Nodes of colours: mixes, ramps, curves, conversions and adjustments.

Formulas, and the order of their operations, are those of Cycles' kernel (svm/color_util.h, ramp_util.h).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ....base.arrays import Float32
from ....scanning.kernels.program import Op
from .numbers import (
    Number,
    Vector,
    absolute,
    component_multiply_add,
    each,
    fraction,
    larger,
    mix,
    multiply_add,
    saturate,
    smaller,
)
from .tree import NodeReader, Value, reads

_STEPS = 256
"""Steps into which Cycles divides ramps and curves."""


@reads("RGB")
def _rgb(node: NodeReader) -> Value:
    """Return the constant colour of an RGB node."""
    red, green, blue, _ = (node.constant(float(part)) for part in node.node.outputs[0].default_value)
    return red, green, blue


def _convert_color(op: Op, color: Vector) -> Vector:
    """Return a colour converted to or from another colour model by an operation with three results."""
    builder = color[0].builder
    first_result = builder.add(op, *(part.value for part in color), results=3)
    return Number(builder, first_result), Number(builder, first_result + 1), Number(builder, first_result + 2)


_TO_MODEL = {"HSV": Op.TO_HSV, "HSL": Op.TO_HSL}
_FROM_MODEL = {"HSV": Op.FROM_HSV, "HSL": Op.FROM_HSL}


@reads("SeparateColor", "SeparateRGB", "SeparateHSV")
def _separate(node: NodeReader) -> Value:
    """Return one component of a colour, in the node's colour model."""
    kind = "HSV" if node.node.bl_idname == "ShaderNodeSeparateHSV" else getattr(node.node, "mode", "RGB")
    color = node.vector(0)
    parts = color if kind == "RGB" else _convert_color(_TO_MODEL[kind], color)
    return parts[list(node.node.outputs).index(node.socket)]


@reads("CombineColor", "CombineRGB", "CombineHSV")
def _combine(node: NodeReader) -> Value:
    """Return the colour of three components, in the node's colour model."""
    kind = "HSV" if node.node.bl_idname == "ShaderNodeCombineHSV" else getattr(node.node, "mode", "RGB")
    parts = node.number(0), node.number(1), node.number(2)
    return parts if kind == "RGB" else _convert_color(_FROM_MODEL[kind], parts)


@reads("RGBToBW")
def _grey(node: NodeReader) -> Value:
    """Return the luminance of a colour."""
    return node.tree.luminance(node.vector(0))


@reads("Gamma")
def _gamma(node: NodeReader) -> Value:
    """Return a colour to the power gamma: 1 where gamma is 0, unchanged where a component is 0 or less."""
    gamma = node.number(1)
    is_zero = gamma.equals(0.0)
    return each(
        lambda part: is_zero.choose(1.0, (part > 0.0).choose(part.apply(Op.POWER, gamma), part)), node.vector(0)
    )


@reads("BrightContrast")
def _contrast(node: NodeReader) -> Value:
    """Return the result of a Brightness/Contrast node."""
    brightness, contrast = node.number(1), node.number(2)
    factor, offset = 1.0 + contrast, brightness - contrast * 0.5
    return each(lambda part: larger(factor * part + offset, 0.0), node.vector(0))


@reads("Invert")
def _invert(node: NodeReader) -> Value:
    """Return a colour mixed with its inverse."""
    share = node.number(0)
    return each(lambda part: share * (1.0 - part) + (1.0 - share) * part, node.vector(1))


@reads("HueSaturation")
def _hue(node: NodeReader) -> Value:
    """Return the result of a Hue/Saturation/Value node."""
    hue, saturation, value, share = (node.number(name) for name in ("Hue", "Saturation", "Value", "Fac"))
    color = node.vector("Color")
    h, s, v = _convert_color(Op.TO_HSV, color)
    adjusted_color = _convert_color(Op.FROM_HSV, (fraction(h + hue + 0.5), saturate(s * saturation), v * value))
    return each(
        lambda adjusted_part, part: larger(share * adjusted_part + (1.0 - share) * part, 0.0), adjusted_color, color
    )


# Mixes.


def _overlay(t: Number, a: Number, b: Number) -> Number:
    """Return the blend Overlay of components a and b by the factor t."""
    lower_weight = 1.0 - t
    multiplied = a * (lower_weight + 2.0 * t * b)
    screened = 1.0 - (lower_weight + 2.0 * t * (1.0 - b)) * (1.0 - a)
    return (a < 0.5).choose(multiplied, screened)


def _dodge(t: Number, a: Number, b: Number) -> Number:
    """Return the blend Color Dodge of components a and b by the factor t."""
    divisor = 1.0 - t * b
    quotient = a / divisor
    return a.equals(0.0).choose(a, (divisor <= 0.0).choose(1.0, (quotient > 1.0).choose(1.0, quotient)))


def _burn(t: Number, a: Number, b: Number) -> Number:
    """Return the blend Color Burn of components a and b by the factor t."""
    divisor = (1.0 - t) + t * b
    result = 1.0 - (1.0 - a) / divisor
    return (divisor <= 0.0).choose(0.0, (result < 0.0).choose(0.0, (result > 1.0).choose(1.0, result)))


def _soft(t: Number, a: Number, b: Number) -> Number:
    """Return the blend Soft Light of components a and b by the factor t."""
    screen = 1.0 - (1.0 - b) * (1.0 - a)
    return (1.0 - t) * a + t * ((1.0 - a) * b * a + a * screen)


_BLENDS: dict[str, Callable[[Number, Number, Number], Number]] = {
    "MIX": lambda t, a, b: mix(a, b, t),
    "ADD": lambda t, a, b: mix(a, a + b, t),
    "MULTIPLY": lambda t, a, b: mix(a, a * b, t),
    "SCREEN": lambda t, a, b: 1.0 - ((1.0 - t) + t * (1.0 - b)) * (1.0 - a),
    "OVERLAY": _overlay,
    "SUBTRACT": lambda t, a, b: mix(a, a - b, t),
    "DIVIDE": lambda t, a, b: b.equals(0.0).choose(a, (1.0 - t) * a + t * a / b),
    "DIFFERENCE": lambda t, a, b: mix(a, absolute(a - b), t),
    "EXCLUSION": lambda t, a, b: larger(mix(a, a + b - 2.0 * a * b, t), 0.0),
    "DARKEN": lambda t, a, b: mix(a, smaller(a, b), t),
    "LIGHTEN": lambda t, a, b: mix(a, larger(a, b), t),
    "DODGE": _dodge,
    "BURN": _burn,
    "SOFT_LIGHT": _soft,
    "LINEAR_LIGHT": lambda t, a, b: a + t * (2.0 * b - 1.0),
}
"""Blend types of a component: functions of the factor t, the lower colour's a and the upper colour's b."""


def _blend_hsv(kind: str, t: Number, a: Vector, b: Vector) -> Vector:
    """Return the blend Hue, Saturation, Value or Color of colours a and b by the factor t."""
    base_hsv, upper_hsv = _convert_color(Op.TO_HSV, a), _convert_color(Op.TO_HSV, b)
    h, s, v = base_hsv
    # A colour without saturation has no hue: there the base colour stays.
    if kind == "SATURATION":
        mixed_color = _convert_color(Op.FROM_HSV, (h, (1.0 - t) * s + t * upper_hsv[1], v))
        return each(lambda base_part, upper_part: s.equals(0.0).choose(base_part, upper_part), a, mixed_color)
    if kind == "VALUE":
        return _convert_color(Op.FROM_HSV, (h, s, (1.0 - t) * v + t * upper_hsv[2]))
    upper_color = _convert_color(Op.FROM_HSV, (upper_hsv[0], s if kind == "HUE" else upper_hsv[1], v))
    return each(
        lambda base_part, upper_part: upper_hsv[1].equals(0.0).choose(base_part, mix(base_part, upper_part, t)),
        a,
        upper_color,
    )


def _blend(node: NodeReader, kind: str, t: Number, a: Vector, b: Vector) -> Vector:
    """Return colours a and b blended by the factor t, in a blend type of the Mix node."""
    if kind in ("HUE", "SATURATION", "VALUE", "COLOR"):
        return _blend_hsv(kind, t, a, b)
    if kind not in _BLENDS:
        raise node.refuse(kind)
    return each(lambda p, q: _BLENDS[kind](t, p, q), a, b)


@reads("MixRGB")
def _mix_rgb(node: NodeReader) -> Value:
    """Return the result of a MixRGB node, the older form of the Mix node."""
    color = _blend(node, node.node.blend_type, saturate(node.number(0)), node.vector(1), node.vector(2))
    return each(saturate, color) if node.node.use_clamp else color


@reads("Mix")
def _mix(node: NodeReader) -> Value:
    """Return the result of a Mix node of numbers, vectors or colours."""
    kind, clamps_factor = node.node.data_type, node.node.clamp_factor
    if kind == "VECTOR" and node.node.factor_mode == "NON_UNIFORM":
        shares = node.vector("Factor_Vector")
        shares = each(saturate, shares) if clamps_factor else shares
        ends = node.vector("A_Vector"), node.vector("B_Vector")
        return each(lambda a, b, t: component_multiply_add(a, 1.0 - t, b * t), *ends, shares)
    share = node.number("Factor_Float")
    share = saturate(share) if clamps_factor else share
    if kind == "FLOAT":
        return multiply_add(node.number("A_Float"), 1.0 - share, node.number("B_Float") * share)
    if kind == "VECTOR":
        ends = node.vector("A_Vector"), node.vector("B_Vector")
        return each(lambda a, b: component_multiply_add(a, 1.0 - share, b * share), *ends)
    if kind != "RGBA":
        raise node.refuse(kind)
    color = _blend(node, node.node.blend_type, share, node.vector("A_Color"), node.vector("B_Color"))
    return each(saturate, color) if node.node.clamp_result else color


# Ramps and curves.


def _look_up(node: NodeReader, place: Number, table: Float32, interpolate: bool, extrapolate: bool) -> Number:
    """Return the value of a table, whose entries are evenly spaced from 0 to 1, at a place.

    Args:
        node: the node that is read.
        place: place in the table, 0 to 1.
        table: (T,) the entries.
        interpolate: whether to interpolate linearly between entries; else the entry before the place is taken.
        extrapolate: whether the curve goes on straight beyond 0 and 1.
    """
    table_start = node.builder.table(table)
    settings = (table_start, len(table), int(interpolate), int(extrapolate))
    return Number(node.builder, node.builder.add(Op.RAMP, place.value, settings=settings))


@reads("ValToRGB")
def _ramp(node: NodeReader) -> Value:
    """Return the result of a Color Ramp node: a colour, or its alpha."""
    ramp, place = node.node.color_ramp, node.number(0)
    colors = np.array([ramp.evaluate(step / _STEPS) for step in range(_STEPS + 1)], np.float32)
    interpolate = ramp.interpolation != "CONSTANT"
    if node.socket.identifier == "Alpha":
        return _look_up(node, place, colors[:, 3], interpolate, False)
    red, green, blue = (_look_up(node, place, colors[:, part], interpolate, False) for part in range(3))
    return red, green, blue


def _curve_range(mapping: Any, count: int) -> tuple[float, float]:
    """Return the least and the largest place of the points of a mapping's first curves."""
    point_places = [[point.location[0] for point in mapping.curves[number].points] for number in range(count)]
    return min(min(places) for places in point_places), max(max(places) for places in point_places)


def _sampled(mapping: Any, number: int, places: list[float]) -> Float32:
    """Return the values (P,) of one curve of a mapping at P places."""
    return np.array([mapping.evaluate(mapping.curves[number], place) for place in places], np.float32)


def _places(start: float, end: float) -> list[float]:
    """Return the evenly spaced places from `start` to `end`, `_STEPS` + 1 of them, at which a curve is sampled."""
    return [start + step / _STEPS * (end - start) for step in range(_STEPS + 1)]


@reads("FloatCurve")
def _float_curve(node: NodeReader) -> Value:
    """Return the result of a Float Curve node."""
    mapping = node.node.mapping
    mapping.initialize()
    start, end = _curve_range(mapping, 1)
    share, base = node.number(0), node.number(1)
    table = _sampled(mapping, 0, _places(start, end))
    curve_value = _look_up(node, (base - start) / (end - start), table, True, mapping.extend == "EXTRAPOLATED")
    return (1.0 - share) * base + share * curve_value


@reads("RGBCurve", "VectorCurve")
def _curves(node: NodeReader) -> Value:
    """Return the result of an RGB Curves or Vector Curves node."""
    mapping, is_color = node.node.mapping, node.node.bl_idname == "ShaderNodeRGBCurve"
    mapping.initialize()
    start, end = _curve_range(mapping, 4 if is_color else 3)
    share, color = node.number(0), node.vector(1)
    places = _places(start, end)
    if is_color:
        # The combined curve (number 3) is applied before those of red, green and blue.
        places = _sampled(mapping, 3, places).tolist()
    extrapolates = mapping.extend == "EXTRAPOLATED"
    curve_values = [
        _look_up(node, (part - start) / (end - start), _sampled(mapping, number, places), True, extrapolates)
        for number, part in enumerate(color)
    ]
    return each(
        lambda component, curve_value: (1.0 - share) * component + share * curve_value,
        color,
        (curve_values[0], curve_values[1], curve_values[2]),
    )
