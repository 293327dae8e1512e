"""Results of material nodes as functions of arrays: see `fields`.

Formulas are those of Cycles' kernel (svm/math_util.h, color_util.h, map_range.h, mapping_util.h, gradient.h). A field's
values are arrays (N, 4): a colour with alpha, a vector with a fourth component, or a number three times.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float
from .image import PixelPlane

_REC709 = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue in the luminance (ITU-R BT.709)."""
_TOLERANCE = 1e-5
"""Least tolerance of a comparison, and least difference of a refractive index from 1 (Cycles)."""


def grey(number: Float) -> Float:
    """Return numbers (N,) as a field's values (N, 4)."""
    result = np.repeat(number[:, None], 4, axis=1)
    result[:, 3] = 1.0
    return result


def luminance(color: Float) -> Float:
    """Return the grey (N,) of linear colours (N, 4)."""
    return np.asarray(color[:, :3] @ _REC709)


def average(vector: Float) -> Float:
    """Return the means (N,) of vectors' components (N, 4)."""
    return np.asarray(vector[:, :3].mean(axis=1))


def _divide(a: Float, b: Float) -> Float:
    """Return a / b, 0 where b is 0."""
    return np.where(b != 0.0, a / np.where(b != 0.0, b, 1.0), 0.0)


def _wrap(a: Float, b: Float, c: Float) -> Float:
    """Return the number a wrapped into the range from c to b."""
    span = b - c
    return np.where(span != 0.0, a - span * np.floor((a - c) / np.where(span != 0.0, span, 1.0)), c)


def _ping_pong(a: Float, b: Float) -> Float:
    """Return the number a reflected back and forth between 0 and b (a triangle wave)."""
    width = np.where(b != 0.0, b, 1.0)
    periods = (a - width) / (width * 2.0)
    return np.where(b != 0.0, np.abs((periods - np.floor(periods)) * width * 2.0 - width), 0.0)


def _floored_modulo(a: Float, b: Float) -> Float:
    """Return a modulo b with the sign of b, 0 where b is 0."""
    return np.where(b != 0.0, a - np.floor(a / np.where(b != 0.0, b, 1.0)) * b, 0.0)


def _truncated_modulo(a: Float, b: Float) -> Float:
    """Return a modulo b with the sign of a, 0 where b is 0."""
    return np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0)


def _logarithm(a: Float, b: Float) -> Float:
    """Return the logarithm of a to the base b, 0 where either isn't positive."""
    return np.where((a > 0.0) & (b > 0.0), _divide(np.log(np.abs(a)), np.log(np.abs(b))), 0.0)


_OF_ONE: dict[str, Callable[[Float], Any]] = {
    "SQRT": lambda a: np.sqrt(np.maximum(a, 0.0)),
    "INVERSE_SQRT": lambda a: np.where(a > 0.0, 1.0 / np.sqrt(np.where(a > 0.0, a, 1.0)), 0.0),
    "ABSOLUTE": np.abs,
    "EXPONENT": np.exp,
    "SIGN": np.sign,
    "ROUND": lambda a: np.floor(a + 0.5),
    "FLOOR": np.floor,
    "CEIL": np.ceil,
    "TRUNC": np.trunc,
    "FRACT": lambda a: a - np.floor(a),
    "SINE": np.sin,
    "COSINE": np.cos,
    "TANGENT": np.tan,
    "ARCSINE": lambda a: np.arcsin(np.clip(a, -1.0, 1.0)),
    "ARCCOSINE": lambda a: np.arccos(np.clip(a, -1.0, 1.0)),
    "ARCTANGENT": np.arctan,
    "RADIANS": np.deg2rad,
    "DEGREES": np.rad2deg,
}
_OF_TWO: dict[str, Callable[[Float, Float], Any]] = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": _divide,
    "POWER": lambda a, b: np.nan_to_num(np.power(a, b)),
    "LOGARITHM": _logarithm,
    "MINIMUM": np.minimum,
    "MAXIMUM": np.maximum,
    "LESS_THAN": np.less,
    "GREATER_THAN": np.greater,
    "MODULO": _truncated_modulo,
    "FLOORED_MODULO": _floored_modulo,
    "SNAP": lambda a, b: np.floor(_divide(a, b)) * b,
    "PINGPONG": _ping_pong,
    "ARCTAN2": np.arctan2,
}
_OF_THREE: dict[str, Callable[[Float, Float, Float], Any]] = {
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "COMPARE": lambda a, b, c: (a == b) | (np.abs(a - b) <= np.maximum(c, _TOLERANCE)),
    "WRAP": _wrap,
}
MATH: dict[str, tuple[int, Callable[..., Any]]] = {
    name: (count, function)
    for count, functions in enumerate((_OF_ONE, _OF_TWO, _OF_THREE), 1)
    for name, function in functions.items()  # type: ignore[attr-defined]
}
"""Operations of the Math node: number of operands, and the function of these (N,)."""

VECTOR_MATH: dict[str, Callable[..., Any]] = {
    "ADD": lambda a, b, scale: a + b,
    "SUBTRACT": lambda a, b, scale: a - b,
    "MULTIPLY": lambda a, b, scale: a * b,
    "DIVIDE": lambda a, b, scale: _divide(a, b),
    "SCALE": lambda a, b, scale: a * scale[:, :1],
    "ABSOLUTE": lambda a, b, scale: np.abs(a),
    "MINIMUM": lambda a, b, scale: np.minimum(a, b),
    "MAXIMUM": lambda a, b, scale: np.maximum(a, b),
    "FLOOR": lambda a, b, scale: np.floor(a),
    "CEIL": lambda a, b, scale: np.ceil(a),
    "FRACTION": lambda a, b, scale: a - np.floor(a),
    "MODULO": lambda a, b, scale: _truncated_modulo(a, b),
    "DOT_PRODUCT": lambda a, b, scale: grey((a[:, :3] * b[:, :3]).sum(axis=1)),
    "LENGTH": lambda a, b, scale: grey(np.linalg.norm(a[:, :3], axis=1)),
    "DISTANCE": lambda a, b, scale: grey(np.linalg.norm((a - b)[:, :3], axis=1)),
}
"""Operations of the Vector Math node: functions of two vectors (N, 4) and a scale (N, 4)."""

BLEND: dict[str, Callable[[Float, Float, Float], Float]] = {
    "MIX": lambda f, a, b: a + f * (b - a),
    "ADD": lambda f, a, b: a + f * b,
    "SUBTRACT": lambda f, a, b: a - f * b,
    "MULTIPLY": lambda f, a, b: a * (1.0 - f + f * b),
    "SCREEN": lambda f, a, b: 1.0 - (1.0 - f + f * (1.0 - b)) * (1.0 - a),
    "DARKEN": lambda f, a, b: a + f * (np.minimum(a, b) - a),
    "LIGHTEN": lambda f, a, b: a + f * (np.maximum(a, b) - a),
    "DIFFERENCE": lambda f, a, b: a + f * (np.abs(a - b) - a),
    "DIVIDE": lambda f, a, b: np.where(b != 0.0, (1.0 - f) * a + f * _divide(a, b), a),
}
"""Blend types of the Mix node: functions of the factor f, the lower colour a and the upper colour b, all (N, 4)."""


def ramp(table: Float, place: Float, stepped: bool) -> Float:
    """Return a colour ramp's colours (N, 4) at places (N,).

    Args:
        table: (K, 5) the ramp's elements, ascending: place, and colour with alpha.
        place: (N,) places on the ramp.
        stepped: whether the colour is that of the element before a place, else interpolated linearly.
    """
    if stepped:
        return np.asarray(table[np.maximum(np.searchsorted(table[:, 0], place, side="right") - 1, 0), 1:])
    return np.stack([np.interp(place, table[:, 0], table[:, part]) for part in range(1, 5)], axis=1)


def map_range(
    kind: str,
    clamped: bool,
    value: Float,
    from_low: Float,
    from_high: Float,
    to_low: Float,
    to_high: Float,
    steps: Float,
) -> Float:
    """Return numbers (N,) mapped from the range from_low..from_high to the range to_low..to_high.

    The kind is ``LINEAR``, ``STEPPED``, ``SMOOTHSTEP`` (3 s^2 - 2 s^3) or ``SMOOTHERSTEP`` (6 s^5 - 15 s^4 + 10 s^3).
    """
    share = _divide(value - from_low, from_high - from_low)
    if kind == "STEPPED":
        share = np.where(steps > 0.0, _divide(np.floor(share * (steps + 1.0)), steps), 0.0)
    elif kind == "SMOOTHSTEP":
        share = np.clip(share, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
    elif kind == "SMOOTHERSTEP":
        share = np.clip(share, 0.0, 1.0)
        share = share**3 * (share * (share * 6.0 - 15.0) + 10.0)
    result = to_low + share * (to_high - to_low)
    if clamped and kind in ("LINEAR", "STEPPED"):
        result = np.clip(result, np.minimum(to_low, to_high), np.maximum(to_low, to_high))
    return np.asarray(result)


def mapped(inverse: bool, vector: Float, rotation: Float, scale: Float, shift: Float | float) -> Float:
    """Return vectors (N, 3) scaled, rotated (Euler angles about x, y, z, rad) and moved; ``inverse`` undoes that."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rotation).T, np.sin(rotation).T
    # Rows of Rz Ry Rx, as rotations are applied about x first.
    entries = [
        [cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz],
        [cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz],
        [-sy, cy * sx, cy * cx],
    ]
    matrix_rows = [np.stack(np.broadcast_arrays(*row), axis=-1) for row in entries]
    rotation_matrix = np.stack(matrix_rows, axis=1)  # (N, 3, 3), or (1, 3, 3) for a constant rotation
    if inverse:
        rotated = np.einsum("nji,nj->ni", *_broadcast_pairs(rotation_matrix, vector - shift))
        return _divide(rotated, scale + np.zeros_like(vector))
    return np.asarray(np.einsum("nij,nj->ni", *_broadcast_pairs(rotation_matrix, scale * vector)) + shift)


def _broadcast_pairs(matrix: Float, vector: Float) -> tuple[Float, Float]:
    """Return matrices (N, 3, 3) and vectors (N, 3), of which a single one is repeated for all."""
    count = max(len(matrix), len(vector))
    return np.broadcast_to(matrix, (count, 3, 3)), np.broadcast_to(vector, (count, 3))


def checker(place: Float) -> Bool:
    """Return a mask (N,) of the places (N, 3) that have a checker's first colour."""
    # Cycles moves places off whole numbers, where rounding would decide.
    parity = np.floor((place + 1e-6) * 0.999999).astype(np.int64) & 1
    return np.asarray((parity[:, 0] == parity[:, 1]) == parity[:, 2].astype(bool))


def gradient(kind: str, place: Float) -> Float:
    """Return the values (N,) of a gradient texture of a kind at places (N, 3)."""
    x, y, _ = place.T
    rise = np.maximum(1.0 - np.linalg.norm(place, axis=1), 0.0)
    smooth = np.clip(x, 0.0, 1.0)
    result = {
        "LINEAR": x,
        "QUADRATIC": np.maximum(x, 0.0) ** 2,
        "EASING": smooth * smooth * (3.0 - 2.0 * smooth),
        "DIAGONAL": (x + y) / 2.0,
        "RADIAL": np.arctan2(y, x) / (2.0 * np.pi) + 0.5,
        "QUADRATIC_SPHERE": rise**2,
        "SPHERICAL": rise,
    }[kind]
    return np.clip(result, 0.0, 1.0)


def facing(kind: str, parameter: Float, normal_component: Float) -> Float:
    """Return the factor (N,) of a Fresnel node, or of a Layer Weight node, of rays that meet faces.

    Args:
        kind: ``IOR`` for a Fresnel node; ``Fresnel`` or ``Facing`` for these outputs of a Layer Weight node.
        parameter: (N,) refractive index for ``IOR``, else the blend of the Layer Weight node.
        normal_component: (N,) n . d of the face's normal n and the ray's direction d; positive on a face's back.
    """
    cosine, is_back = np.abs(normal_component), normal_component > 0.0
    if kind == "Facing":
        blend = np.clip(parameter, 0.0, 1.0 - 1e-5)
        power = np.where(blend < 0.5, 2.0 * blend, 0.5 / (1.0 - blend))
        return 1.0 - np.where(blend == 0.5, cosine, cosine**power)
    index = np.maximum(parameter, 1.0 + _TOLERANCE) if kind == "IOR" else 1.0 / np.maximum(1.0 - parameter, _TOLERANCE)
    index = np.where(is_back, 1.0 / index, index)
    # Fresnel reflection of unpolarised light at a dielectric (Cook and Torrance 1982, eq. 18); total where g^2 < 0.
    g_squared = index * index - 1.0 + cosine * cosine
    g = np.sqrt(np.maximum(g_squared, 0.0))
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return np.where(g_squared > 0.0, 0.5 * a * a * (1.0 + b * b), 1.0)


def sample_image(planes: PixelPlane, u: Float, v: Float, interpolation: str, extension: str) -> Float:
    """Return an image's values (N, C) at texture coordinates (N,), as an Image Texture node looks them up.

    Args:
        planes: the image's pixels.
        u, v: (N,) coordinates along its width and height; 0 to 1 spans the image.
        interpolation: ``Closest``, ``Linear``, ``Cubic`` or ``Smart``.
        extension: ``REPEAT``, ``EXTEND``, ``CLIP`` or ``MIRROR``.
    """
    height, width = planes.values.shape[:2]
    x, y = np.nan_to_num(u) * width, np.nan_to_num(v) * height
    if interpolation == "Closest":
        return planes.at(_index(np.floor(x), width, extension), _index(np.floor(y), height, extension))
    x, y = x - 0.5, y - 0.5  # pixels' centres lie at halves
    first_x, first_y = np.floor(x), np.floor(y)
    weights = _linear if interpolation == "Linear" else _cubic
    result = np.zeros((len(x), planes.values.shape[2]))
    for column, weight_x in weights(x - first_x):
        for row, weight_y in weights(y - first_y):
            pixel = (_index(first_x + column, width, extension), _index(first_y + row, height, extension))
            result += (weight_x * weight_y)[:, None] * planes.at(*pixel)
    return result


def _linear(t: Float) -> list[tuple[int, Float]]:
    """Return (offset from the lower pixel, weight) of the two pixels of linear interpolation at fractions t (N,)."""
    return [(0, 1.0 - t), (1, t)]


def _cubic(t: Float) -> list[tuple[int, Float]]:
    """Return (offset from the lower pixel, weight) of the four pixels of a cubic B-spline at fractions t (N,)."""
    return [
        (-1, (1.0 - t) ** 3 / 6.0),
        (0, (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0),
        (1, (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0),
        (2, t**3 / 6.0),
    ]


def _index(places: Float, size: int, extension: str) -> np.ndarray[Any, Any]:
    """Return the pixels (N,) at whole-numbered places (N,), which may lie outside the image; -1 for none."""
    pixel = np.clip(places, -1e15, 1e15).astype(np.int64)
    if extension == "REPEAT":
        return pixel % size
    if extension == "MIRROR":
        pixel = pixel % (2 * size)
        return np.where(pixel >= size, 2 * size - 1 - pixel, pixel)
    if extension == "CLIP":
        return np.where((pixel >= 0) & (pixel < size), pixel, -1)
    return np.clip(pixel, 0, size - 1)
