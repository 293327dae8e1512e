"""Nodes of colours: mixes, ramps, curves, and what changes a colour or takes it apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ....base.arrays import Float32
from ....scanning.kernels.program import Op
from .numbers import Number, Vector, absolute, each, fraction, larger, mix, multiply_add, of_vectors, saturate, smaller
from .tree import NodeReader, Value, reads

_STEPS = 256
"""Steps that Cycles divides ramps and curves into."""


@reads("RGB")
def _rgb(node: NodeReader) -> Value:
    red, green, blue, _ = (node.constant(float(part)) for part in node.node.outputs[0].default_value)
    return red, green, blue


def _as(op: Op, color: Vector) -> Vector:
    """Return a colour in another way to write it."""
    builder = color[0].builder
    first = builder.add(op, *(part.value for part in color), results=3)
    return Number(builder, first), Number(builder, first + 1), Number(builder, first + 2)


_INTO = {"HSV": Op.TO_HSV, "HSL": Op.TO_HSL}
_FROM = {"HSV": Op.FROM_HSV, "HSL": Op.FROM_HSL}


@reads("SeparateColor", "SeparateRGB", "SeparateHSV")
def _separate(node: NodeReader) -> Value:
    kind = "HSV" if node.node.bl_idname == "ShaderNodeSeparateHSV" else getattr(node.node, "mode", "RGB")
    color = node.vector(0)
    parts = color if kind == "RGB" else _as(_INTO[kind], color)
    return parts[list(node.node.outputs).index(node.socket)]


@reads("CombineColor", "CombineRGB", "CombineHSV")
def _combine(node: NodeReader) -> Value:
    kind = "HSV" if node.node.bl_idname == "ShaderNodeCombineHSV" else getattr(node.node, "mode", "RGB")
    parts = node.number(0), node.number(1), node.number(2)
    return parts if kind == "RGB" else _as(_FROM[kind], parts)


@reads("RGBToBW")
def _grey(node: NodeReader) -> Value:
    return node.tree.luminance(node.vector(0))


@reads("Gamma")
def _gamma(node: NodeReader) -> Value:
    gamma = node.number(1)
    none = gamma.equals(0.0)
    return each(lambda part: none.choose(1.0, (part > 0.0).choose(part.apply(Op.POWER, gamma), part)), node.vector(0))


@reads("BrightContrast")
def _contrast(node: NodeReader) -> Value:
    bright, contrast = node.number(1), node.number(2)
    factor, offset = 1.0 + contrast, bright - contrast * 0.5
    return each(lambda part: larger(factor * part + offset, 0.0), node.vector(0))


@reads("Invert")
def _invert(node: NodeReader) -> Value:
    share = node.number(0)
    return each(lambda part: share * (1.0 - part) + (1.0 - share) * part, node.vector(1))


@reads("HueSaturation")
def _hue(node: NodeReader) -> Value:
    hue, saturation, value, share = (node.number(name) for name in ("Hue", "Saturation", "Value", "Fac"))
    color = node.vector("Color")
    h, s, v = _as(Op.TO_HSV, color)
    changed = _as(Op.FROM_HSV, (fraction(h + hue + 0.5), saturate(s * saturation), v * value))
    return each(lambda new, old: larger(share * new + (1.0 - share) * old, 0.0), changed, color)


# Mixes.


def _overlay(t: Number, a: Number, b: Number) -> Number:
    rest = 1.0 - t
    dark = a * (rest + 2.0 * t * b)
    bright = 1.0 - (rest + 2.0 * t * (1.0 - b)) * (1.0 - a)
    return (a < 0.5).choose(dark, bright)


def _dodge(t: Number, a: Number, b: Number) -> Number:
    below = 1.0 - t * b
    quotient = a / below
    return a.equals(0.0).choose(a, (below <= 0.0).choose(1.0, (quotient > 1.0).choose(1.0, quotient)))


def _burn(t: Number, a: Number, b: Number) -> Number:
    below = (1.0 - t) + t * b
    burnt = 1.0 - (1.0 - a) / below
    return (below <= 0.0).choose(0.0, (burnt < 0.0).choose(0.0, (burnt > 1.0).choose(1.0, burnt)))


def _soft(t: Number, a: Number, b: Number) -> Number:
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
"""Ways to blend a component of two colours."""


def _blend_hsv(kind: str, t: Number, a: Vector, b: Vector) -> Vector:
    base, other = _as(Op.TO_HSV, a), _as(Op.TO_HSV, b)
    h, s, v = base
    if kind == "SATURATION":
        mixed = _as(Op.FROM_HSV, (h, (1.0 - t) * s + t * other[1], v))
        return each(lambda old, new: s.equals(0.0).choose(old, new), a, mixed)
    if kind == "VALUE":
        return _as(Op.FROM_HSV, (h, s, (1.0 - t) * v + t * other[2]))
    changed = _as(Op.FROM_HSV, (other[0], s if kind == "HUE" else other[1], v))
    return each(lambda old, new: other[1].equals(0.0).choose(old, mix(old, new, t)), a, changed)


def _blend(node: NodeReader, kind: str, t: Number, a: Vector, b: Vector) -> Vector:
    if kind in ("HUE", "SATURATION", "VALUE", "COLOR"):
        return _blend_hsv(kind, t, a, b)
    if kind not in _BLENDS:
        raise node.refuse(kind)
    return each(lambda p, q: _BLENDS[kind](t, p, q), a, b)


@reads("MixRGB")
def _mix_rgb(node: NodeReader) -> Value:
    mixed = _blend(node, node.node.blend_type, saturate(node.number(0)), node.vector(1), node.vector(2))
    return each(saturate, mixed) if node.node.use_clamp else mixed


@reads("Mix")
def _mix(node: NodeReader) -> Value:
    kind, clamped = node.node.data_type, node.node.clamp_factor
    if kind == "VECTOR" and node.node.factor_mode == "NON_UNIFORM":
        shares = node.vector("Factor_Vector")
        shares = each(saturate, shares) if clamped else shares
        ends = node.vector("A_Vector"), node.vector("B_Vector")
        return each(lambda a, b, t: of_vectors(a, 1.0 - t, b * t), *ends, shares)
    share = node.number("Factor_Float")
    share = saturate(share) if clamped else share
    if kind == "FLOAT":
        return multiply_add(node.number("A_Float"), 1.0 - share, node.number("B_Float") * share)
    if kind == "VECTOR":
        ends = node.vector("A_Vector"), node.vector("B_Vector")
        return each(lambda a, b: of_vectors(a, 1.0 - share, b * share), *ends)
    if kind != "RGBA":
        raise node.refuse(kind)
    mixed = _blend(node, node.node.blend_type, share, node.vector("A_Color"), node.vector("B_Color"))
    return each(saturate, mixed) if node.node.clamp_result else mixed


# Ramps and curves.


def _look_up(node: NodeReader, at: Number, table: Float32, interpolate: bool, extrapolate: bool) -> Number:
    start = node.builder.table(table)
    settings = (start, len(table), int(interpolate), int(extrapolate))
    return Number(node.builder, node.builder.add(Op.RAMP, at.value, settings=settings))


@reads("ValToRGB")
def _ramp(node: NodeReader) -> Value:
    ramp, at = node.node.color_ramp, node.number(0)
    colors = np.array([ramp.evaluate(step / _STEPS) for step in range(_STEPS + 1)], np.float32)
    interpolate = ramp.interpolation != "CONSTANT"
    if node.socket.identifier == "Alpha":
        return _look_up(node, at, colors[:, 3], interpolate, False)
    red, green, blue = (_look_up(node, at, colors[:, part], interpolate, False) for part in range(3))
    return red, green, blue


def _curve_range(mapping: Any, count: int) -> tuple[float, float]:
    ends = [[point.location[0] for point in mapping.curves[number].points] for number in range(count)]
    return min(min(places) for places in ends), max(max(places) for places in ends)


def _sampled(mapping: Any, number: int, places: list[float]) -> Float32:
    return np.array([mapping.evaluate(mapping.curves[number], place) for place in places], np.float32)


def _places(low: float, high: float) -> list[float]:
    return [low + step / _STEPS * (high - low) for step in range(_STEPS + 1)]


@reads("FloatCurve")
def _float_curve(node: NodeReader) -> Value:
    mapping = node.node.mapping
    mapping.initialize()
    low, high = _curve_range(mapping, 1)
    share, base = node.number(0), node.number(1)
    table = _sampled(mapping, 0, _places(low, high))
    new = _look_up(node, (base - low) / (high - low), table, True, mapping.extend == "EXTRAPOLATED")
    return (1.0 - share) * base + share * new


@reads("RGBCurve", "VectorCurve")
def _curves(node: NodeReader) -> Value:
    mapping, colored = node.node.mapping, node.node.bl_idname == "ShaderNodeRGBCurve"
    mapping.initialize()
    low, high = _curve_range(mapping, 4 if colored else 3)
    share, color = node.number(0), node.vector(1)
    places = _places(low, high)
    if colored:
        places = _sampled(mapping, 3, places).tolist()
    extended = mapping.extend == "EXTRAPOLATED"
    changed = [
        _look_up(node, (part - low) / (high - low), _sampled(mapping, number, places), True, extended)
        for number, part in enumerate(color)
    ]
    return each(lambda old, new: (1.0 - share) * old + share * new, color, (changed[0], changed[1], changed[2]))
