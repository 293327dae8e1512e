"""Results of material nodes as functions of arrays: see `fields`. Definitions are those of Cycles' kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float
from .image import PixelPlane

_REC709 = np.array([0.2126, 0.7152, 0.0722])
_SMALL = 1e-5


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
    return np.where(b != 0.0, a / np.where(b != 0.0, b, 1.0), 0.0)


def _wrap(a: Float, b: Float, c: Float) -> Float:
    span = b - c
    return np.where(span != 0.0, a - span * np.floor((a - c) / np.where(span != 0.0, span, 1.0)), c)


def _ping_pong(a: Float, b: Float) -> Float:
    width = np.where(b != 0.0, b, 1.0)
    share = (a - width) / (width * 2.0)
    return np.where(b != 0.0, np.abs((share - np.floor(share)) * width * 2.0 - width), 0.0)


def _floored(a: Float, b: Float) -> Float:
    return np.where(b != 0.0, a - np.floor(a / np.where(b != 0.0, b, 1.0)) * b, 0.0)


def _truncated(a: Float, b: Float) -> Float:
    return np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0)


def _logarithm(a: Float, b: Float) -> Float:
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
    "MODULO": _truncated,
    "FLOORED_MODULO": _floored,
    "SNAP": lambda a, b: np.floor(_divide(a, b)) * b,
    "PINGPONG": _ping_pong,
    "ARCTAN2": np.arctan2,
}
_OF_THREE: dict[str, Callable[[Float, Float, Float], Any]] = {
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "COMPARE": lambda a, b, c: (a == b) | (np.abs(a - b) <= np.maximum(c, _SMALL)),
    "WRAP": _wrap,
}
MATH: dict[str, tuple[int, Callable[..., Any]]] = {
    name: (count, function)
    for count, functions in enumerate((_OF_ONE, _OF_TWO, _OF_THREE), 1)
    for name, function in functions.items()  # type: ignore[attr-defined]
}
"""Operations of the Math node: of how many numbers (N,), and the function."""

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
    "MODULO": lambda a, b, scale: _truncated(a, b),
    "DOT_PRODUCT": lambda a, b, scale: grey((a[:, :3] * b[:, :3]).sum(axis=1)),
    "LENGTH": lambda a, b, scale: grey(np.linalg.norm(a[:, :3], axis=1)),
    "DISTANCE": lambda a, b, scale: grey(np.linalg.norm((a - b)[:, :3], axis=1)),
}
"""Operations of the Vector Math node on two vectors (N, 4) and a number."""

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
"""Ways to blend two colours (N, 4) by a factor."""


def ramp(table: Float, place: Float, stepped: bool) -> Float:
    """Return a colour ramp's colours (N, 4) at places (N,) by its elements (K, 5): place and colour."""
    if stepped:
        return np.asarray(table[np.maximum(np.searchsorted(table[:, 0], place, side="right") - 1, 0), 1:])
    return np.stack([np.interp(place, table[:, 0], table[:, part]) for part in range(1, 5)], axis=1)


def map_range(
    kind: str, clamped: bool, value: Float, low: Float, high: Float, to_low: Float, to_high: Float, steps: Float
) -> Float:
    """Return numbers (N,) mapped from a range to another: ``LINEAR``, ``STEPPED``, ``SMOOTHSTEP``, ``SMOOTHERSTEP``."""
    share = _divide(value - low, high - low)
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


def mapped(inverse: bool, vector: Float, rotation: Float, scale: Float, move: Float | float) -> Float:
    """Return vectors (N, 3) that are scaled, rotated (Euler angles, rad) and moved; ``inverse`` undoes that."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rotation).T, np.sin(rotation).T
    rows = [
        [cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz],
        [cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz],
        [-sy, cy * sx, cy * cx],
    ]
    turn = np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=1)  # (n, 3, 3)
    if inverse:
        return _divide(np.einsum("nji,nj->ni", *_alike(turn, vector - move)), scale + np.zeros_like(vector))
    return np.asarray(np.einsum("nij,nj->ni", *_alike(turn, scale * vector)) + move)


def _alike(turn: Float, vector: Float) -> tuple[Float, Float]:
    count = max(len(turn), len(vector))
    return np.broadcast_to(turn, (count, 3, 3)), np.broadcast_to(vector, (count, 3))


def checker(place: Float) -> Bool:
    """Return a mask (N,) of the places (N, 3) that have a checker's first colour."""
    cell = np.floor((place + 1e-6) * 0.999999).astype(np.int64) & 1
    return np.asarray((cell[:, 0] == cell[:, 1]) == cell[:, 2].astype(bool))


def gradient(kind: str, place: Float) -> Float:
    """Return the gradient texture of a kind at places (N, 3)."""
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


def facing(kind: str, given: Float, along: Float) -> Float:
    """Return a Fresnel node's factor (N,), or a Layer Weight's, of rays that meet faces with n . d = ``along`` (N,).

    Args:
        kind: ``IOR`` (given is the index), or the Layer Weight's ``Fresnel`` or ``Facing`` (given is the blend).
        given: (N,).
        along: (N,).
    """
    cosine, back = np.abs(along), along > 0.0
    if kind == "Facing":
        blend = np.clip(given, 0.0, 1.0 - 1e-5)
        power = np.where(blend < 0.5, 2.0 * blend, 0.5 / (1.0 - blend))
        return 1.0 - np.where(blend == 0.5, cosine, cosine**power)
    index = np.maximum(given, 1.0 + _SMALL) if kind == "IOR" else 1.0 / np.maximum(1.0 - given, _SMALL)
    index = np.where(back, 1.0 / index, index)
    square = index * index - 1.0 + cosine * cosine
    g = np.sqrt(np.maximum(square, 0.0))
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return np.where(square > 0.0, 0.5 * a * a * (1.0 + b * b), 1.0)


def sample_image(planes: PixelPlane, u: Float, v: Float, interpolation: str, extension: str) -> Float:
    """Return an image's values (N, C) at texture coordinates (N,), as an Image Texture node looks them up.

    Args:
        planes: the image.
        u, v: (N,).
        interpolation: ``Closest``, ``Linear``, ``Cubic`` or ``Smart``.
        extension: ``REPEAT``, ``EXTEND``, ``CLIP`` or ``MIRROR``.
    """
    height, width = planes.values.shape[:2]
    x, y = np.nan_to_num(u) * width, np.nan_to_num(v) * height
    if interpolation == "Closest":
        return planes.at(_index(np.floor(x), width, extension), _index(np.floor(y), height, extension))
    x, y = x - 0.5, y - 0.5
    low_x, low_y = np.floor(x), np.floor(y)
    weights = _linear if interpolation == "Linear" else _cubic
    result = np.zeros((len(x), planes.values.shape[2]))
    for column, across in weights(x - low_x):
        for row, up in weights(y - low_y):
            at = (_index(low_x + column, width, extension), _index(low_y + row, height, extension))
            result += (across * up)[:, None] * planes.at(*at)
    return result


def _linear(t: Float) -> list[tuple[int, Float]]:
    return [(0, 1.0 - t), (1, t)]


def _cubic(t: Float) -> list[tuple[int, Float]]:
    return [
        (-1, (1.0 - t) ** 3 / 6.0),
        (0, (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0),
        (1, (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0),
        (2, t**3 / 6.0),
    ]


def _index(at: Float, size: int, extension: str) -> np.ndarray[Any, Any]:
    """Return the pixels (N,) that whole places (N,) along a side stand for; -1 for none."""
    number = np.clip(at, -1e15, 1e15).astype(np.int64)
    if extension == "REPEAT":
        return number % size
    if extension == "MIRROR":
        number = number % (2 * size)
        return np.where(number >= size, 2 * size - 1 - number, number)
    if extension == "CLIP":
        return np.where((number >= 0) & (number < size), number, -1)
    return np.clip(number, 0, size - 1)
