"""Textures that are worked out: noise, cells, waves, bricks and their like."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ....scanning.kernels.program import Op
from .numbers import (
    VECTORS_FUSED,
    Number,
    Vector,
    absolute,
    clamp,
    cosine,
    each,
    floor,
    larger,
    length,
    multiply_add,
    safe_divide,
    saturate,
    scaled,
    sine,
    smaller,
)
from .tree import NodeReader, Value, reads

_DIMENSIONS = {"1D": 1, "2D": 2, "3D": 3, "4D": 4}
_FACTORS = ("Fac", "Factor", "Value")


class _Place:
    """A place in one to four dimensions that noise is looked up at."""

    def __init__(self, parts: list[Number]) -> None:
        self.parts = parts

    @property
    def dimensions(self) -> int:
        return len(self.parts)

    def values(self) -> list[int]:
        """Return four values: those that a dimension lacks are any."""
        return (
            [part.value for part in (self.parts * 4)[:4]]
            if len(self.parts) == 1
            else [
                *(part.value for part in self.parts),
                *[self.parts[0].value] * (4 - len(self.parts)),
            ]
        )

    def moved(self, node: NodeReader, seed: int) -> _Place:
        """Return another place, far enough away for another noise, by the number that Cycles calls its seed."""
        offsets = []
        for axis in range(self.dimensions):
            key = [float(seed)] if self.dimensions == 1 else [float(seed), float(axis)]
            share = hashed(node, [node.constant(part) for part in key])
            fused = self.dimensions > 1 and not VECTORS_FUSED
            offsets.append(multiply_add(share, 100.0, 100.0) if fused else 100.0 + share * 100.0)
        return _Place([part + offset for part, offset in zip(self.parts, offsets, strict=True)])


def hashed(node: NodeReader, parts: list[Number]) -> Number:
    """Return a number from 0 to 1 that looks random and follows from one to four others."""
    values = [part.value for part in [*parts, parts[0], parts[0], parts[0]][:4]]
    return Number(node.builder, node.builder.add(Op.HASH, *values, settings=(len(parts),)))


def _texture_place(node: NodeReader, dimensions: int, scale: Number | None) -> _Place:
    parts: list[Number] = []
    if dimensions > 1:
        parts += list(node.place())[: min(dimensions, 3)]
    if dimensions in (1, 4):
        parts.append(node.number("W"))
    return _Place(parts if scale is None else [part * scale for part in parts])


_KINDS = ("MULTIFRACTAL", "FBM", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
"""Ways to add up octaves, as materials.c counts them."""


def fractal(node: NodeReader, place: _Place, kind: str, normalized: bool, parts: list[Number]) -> Number:
    """Return octaves of noise added up: their detail, roughness, lacunarity, offset and gain."""
    values = [*place.values(), *(part.value for part in parts)]
    settings = (place.dimensions, _KINDS.index(kind), int(normalized))
    return Number(node.builder, node.builder.add(Op.FRACTAL, *values, settings=settings))


@reads("TexNoise")
def _noise(node: NodeReader) -> Value:
    item = node.node
    dimensions = _DIMENSIONS[item.noise_dimensions]
    place = _texture_place(node, dimensions, node.number("Scale"))
    detail, roughness = clamp(node.number("Detail"), 0.0, 15.0), larger(node.number("Roughness"), 0.0)
    rest = [node.number(name) for name in ("Lacunarity", "Offset", "Gain")]
    if node.number("Distortion").known != 0.0:
        raise node.refuse("Distortion")  # it makes more of the last digits of a place than results may differ by

    def at(place: _Place) -> Number:
        return fractal(node, place, item.noise_type, item.normalize, [detail, roughness, *rest])

    if node.socket.identifier in _FACTORS:
        return at(place)
    return at(place), at(place.moved(node, dimensions)), at(place.moved(node, dimensions + 1))


@reads("TexWhiteNoise")
def _white_noise(node: NodeReader) -> Value:
    dimensions = _DIMENSIONS[node.node.noise_dimensions]
    vector, w = list(node.vector("Vector")), node.number("W")
    parts = {1: [w], 2: vector[:2], 3: vector, 4: [*vector, w]}[dimensions]
    if node.socket.identifier == "Value":
        return hashed(node, parts)
    if dimensions == 4:
        x, y, z, _ = parts
        others = [z, x, w, y], [w, z, y, x]
    else:
        others = [*parts, node.constant(1.0)], [*parts, node.constant(2.0)]
    return hashed(node, parts), hashed(node, others[0]), hashed(node, others[1])


_FEATURES = ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS")
_METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
"""As materials.c counts them."""
_OF_FLOATS = 8
"""Number that is added to the dimensions where the cells' numbers are hashed as floats."""


@reads("TexVoronoi")
def _voronoi(node: NodeReader) -> Value:
    item = node.node
    dimensions = _DIMENSIONS[item.voronoi_dimensions]
    scale = node.number("Scale")
    place = _texture_place(node, dimensions, scale)
    detail, roughness = clamp(node.number("Detail"), 0.0, 15.0), saturate(node.number("Roughness"))
    smoothness = clamp(node.number("Smoothness") / 2.0, 0.0, 0.5)
    lacunarity, exponent = node.number("Lacunarity"), node.number("Exponent")
    randomness = saturate(node.number("Randomness"))
    parts = (detail, roughness, lacunarity, smoothness, exponent, randomness)
    # Until 5.0 cells' points came from floats.
    kinds = _FEATURES.index(item.feature), _METRICS.index(item.distance), int(item.normalize)
    settings = (dimensions + (_OF_FLOATS if VECTORS_FUSED else 0), *kinds)
    values = [*place.values(), *(part.value for part in parts)]
    first = node.builder.add(Op.VORONOI, *values, settings=settings, results=8)
    results = [Number(node.builder, first + number) for number in range(8)]
    x, y, z, w = (safe_divide(part, scale) for part in results[4:])
    answers: dict[str, Value] = {
        "Distance": results[0],
        "Radius": results[0],
        "Color": (results[1], results[2], results[3]),
        "Position": (x, y, z),
        "W": w,
    }
    return answers[node.socket.identifier]


@reads("TexWave")
def _wave(node: NodeReader) -> Value:
    item = node.node
    place = scaled(node.place(), node.number("Scale"))
    place = each(lambda part: (part + 0.000001) * 0.999999, place)
    phase = node.number("Phase Offset")
    if node.number("Distortion").known != 0.0 or VECTORS_FUSED:
        raise node.refuse("Distortion")  # as of noise; before 5.0 the last digits are others without it, too
    if item.wave_type == "BANDS":
        x, y, z = place
        along = {"X": x, "Y": y, "Z": z, "DIAGONAL": x + y + z}[item.bands_direction]
        number = along * (10.0 if item.bands_direction == "DIAGONAL" else 20.0) + phase
    else:
        zero = node.constant(0.0)
        left = [zero if axis == item.rings_direction else part for axis, part in zip("XYZ", place, strict=True)]
        number = length((left[0], left[1], left[2])) * 20.0 + phase
    result = _profile(item.wave_profile, number)
    return result if node.socket.identifier in _FACTORS else (result, result, result)


def _profile(kind: str, number: Number) -> Number:
    if kind == "SIN":
        return 0.5 + 0.5 * sine(number - math.pi / 2.0)
    turns = number / (2.0 * math.pi)
    if kind == "SAW":
        return turns - floor(turns)
    return absolute(turns - floor(turns + 0.5)) * 2.0


_TURNS: tuple[tuple[int, Callable[[Number, Number, Number], Number]], ...] = (
    (1, lambda x, y, z: -cosine(x - y + z)),
    (0, lambda x, y, z: cosine(x - y - z)),
    (2, lambda x, y, z: sine(-x - y - z)),
    (0, lambda x, y, z: -cosine(-x + y - z)),
    (1, lambda x, y, z: -sine(-x + y + z)),
    (1, lambda x, y, z: -cosine(-x + y + z)),
    (0, lambda x, y, z: cosine(x + y + z)),
    (2, lambda x, y, z: sine(x + y - z)),
    (0, lambda x, y, z: -cosine(-x - y + z)),
    (1, lambda x, y, z: -sine(x - y + z)),
)
"""Steps of the magic texture: which of x, y and z becomes what."""


def _turbulence(depth: int, strength: Number, start: Vector) -> Vector:
    if depth <= 0:
        return start
    parts = list(scaled(start, strength))
    for axis, turned in _TURNS[:depth]:
        parts[axis] = turned(*parts) * strength
    return parts[0], parts[1], parts[2]


@reads("TexMagic")
def _magic(node: NodeReader) -> Value:
    depth, scale, strength = node.node.turbulence_depth, node.number("Scale"), node.number("Distortion")
    if not VECTORS_FUSED:
        raise node.refuse("Distortion")  # since 5.0 sines make more of the last digits
    px, py, pz = each(lambda part: part.apply(Op.REMAINDER, 2.0 * math.pi), node.place())
    x = sine((px + py + pz) * 5.0 * scale)
    y = cosine((-px + py - pz) * 5.0 * scale)
    z = -cosine((-px - py + pz) * 5.0 * scale)
    x, y, z = _turbulence(depth, strength, (x, y, z))
    twice, none = strength * 2.0, strength.equals(0.0)
    color = each(lambda part: 0.5 - none.choose(part, part / twice), (x, y, z))
    return (color[0] + color[1] + color[2]) * (1.0 / 3.0) if node.socket.identifier in _FACTORS else color


@reads("TexChecker")
def _checker(node: NodeReader) -> Value:
    place = scaled(node.place(), node.number("Scale"))
    first = place[0].apply(Op.CHECKER, place[1], place[2])
    if node.socket.identifier in _FACTORS:
        return first
    return each(first.choose, node.vector("Color1"), node.vector("Color2"))


@reads("TexBrick")
def _brick(node: NodeReader) -> Value:
    item: Any = node.node
    x, y, _ = scaled(node.place(), node.number("Scale"))
    names = ("Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
    parts = [x, y, *(node.number(name) for name in names)]
    parts += [node.constant(float(item.offset)), node.constant(float(item.squash))]
    settings = (int(item.offset_frequency), int(item.squash_frequency), int(not VECTORS_FUSED))
    first = node.builder.add(Op.BRICK, *(part.value for part in parts), settings=settings, results=2)
    tint, mortar = Number(node.builder, first), Number(node.builder, first + 1)
    if node.socket.identifier in _FACTORS:
        return mortar
    mixed = each(lambda a, b: (1.0 - tint) * a + tint * b, node.vector("Color1"), node.vector("Color2"))
    bricks = each(lambda a, b: mortar.equals(1.0).choose(a, b), node.vector("Color1"), mixed)
    return each(lambda a, b: a * (1.0 - mortar) + b * mortar, bricks, node.vector("Mortar"))


@reads("TexGradient")
def _gradient(node: NodeReader) -> Value:
    kind, place = node.node.gradient_type, node.place()
    x, y, _ = place
    if kind == "LINEAR":
        result = x
    elif kind == "QUADRATIC":
        result = larger(x, 0.0) * larger(x, 0.0)
    elif kind == "EASING":
        smooth = smaller(larger(x, 0.0), 1.0)
        square = smooth * smooth
        result = 3.0 * square - 2.0 * square * smooth
    elif kind == "DIAGONAL":
        result = (x + y) * 0.5
    elif kind == "RADIAL":
        result = y.apply(Op.ARCTAN2, x) / (2.0 * math.pi) + 0.5
    else:
        rise = larger(0.999999 - length(place), 0.0)
        result = rise * rise if kind == "QUADRATIC_SPHERE" else rise
    result = saturate(result)
    return result if node.socket.identifier in _FACTORS else (result, result, result)
