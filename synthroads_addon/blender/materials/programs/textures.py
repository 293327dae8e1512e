"""Procedural textures: noise, cells, waves, bricks and others.

Formulas, and the order of their operations, are those of Cycles' kernel (svm/noisetex.h, voronoi.h, wave.h, magic.h,
brick.h, gradient.h).
"""

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
"""Identifiers of outputs that are numbers, not colours."""


class _Place:
    """A place in one to four dimensions that noise is looked up at."""

    def __init__(self, parts: list[Number]) -> None:
        self.parts = parts

    @property
    def dimensions(self) -> int:
        """Return the number of coordinates."""
        return len(self.parts)

    def values(self) -> list[int]:
        """Return the indices of four values, as operations expect them; beyond the place's dimensions any will do."""
        padding = [self.parts[0]] * (4 - len(self.parts))
        return [part.value for part in (*self.parts, *padding)]

    def moved(self, node: NodeReader, seed: int) -> _Place:
        """Return the place moved along each axis by 100 to 200 units, to where the noise is independent.

        The offsets are those of Cycles' `random_float_offset` to `random_float4_offset`: 100 + 100 hash(seed) in one
        dimension, 100 + 100 hash(seed, axis) in several.
        """
        offsets = []
        for axis in range(self.dimensions):
            key = [float(seed)] if self.dimensions == 1 else [float(seed), float(axis)]
            hash_value = hashed(node, [node.constant(part) for part in key])
            # Since Blender 5.0 product and sum are rounded at once in several dimensions, and only there.
            is_rounded_once = self.dimensions > 1 and not VECTORS_FUSED
            offsets.append(multiply_add(hash_value, 100.0, 100.0) if is_rounded_once else 100.0 + hash_value * 100.0)
        return _Place([part + offset for part, offset in zip(self.parts, offsets, strict=True)])


def hashed(node: NodeReader, parts: list[Number]) -> Number:
    """Return a hash, from 0 to 1, of one to four numbers."""
    values = [part.value for part in [*parts, parts[0], parts[0], parts[0]][:4]]
    return Number(node.builder, node.builder.add(Op.HASH, *values, settings=(len(parts),)))


def _texture_place(node: NodeReader, dimensions: int, scale: Number | None) -> _Place:
    """Return the place at which a texture of some dimensions is looked up, times its scale."""
    parts: list[Number] = []
    if dimensions > 1:
        parts += list(node.place())[: min(dimensions, 3)]
    if dimensions in (1, 4):
        parts.append(node.number("W"))
    return _Place(parts if scale is None else [part * scale for part in parts])


_KINDS = ("MULTIFRACTAL", "FBM", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
"""Kinds of fractal noise, numbered as in materials.c."""


def fractal(node: NodeReader, place: _Place, kind: str, normalized: bool, parts: list[Number]) -> Number:
    """Return fractal noise at a place.

    Args:
        node: the node that is read.
        place: where the noise is looked up.
        kind: one of `_KINDS`.
        normalized: whether the result is mapped to 0..1.
        parts: detail, roughness, lacunarity, offset and gain.
    """
    values = [*place.values(), *(part.value for part in parts)]
    settings = (place.dimensions, _KINDS.index(kind), int(normalized))
    return Number(node.builder, node.builder.add(Op.FRACTAL, *values, settings=settings))


@reads("TexNoise")
def _noise(node: NodeReader) -> Value:
    """Return the result of a Noise Texture node without distortion: a number, or a colour of three noises."""
    noise_node = node.node
    dimensions = _DIMENSIONS[noise_node.noise_dimensions]
    place = _texture_place(node, dimensions, node.number("Scale"))
    detail, roughness = clamp(node.number("Detail"), 0.0, 15.0), larger(node.number("Roughness"), 0.0)
    other_parts = [node.number(name) for name in ("Lacunarity", "Offset", "Gain")]
    if node.number("Distortion").constant_value != 0.0:
        raise node.refuse("Distortion")  # it amplifies rounding errors of the place beyond the tolerance of results

    def noise_at(place: _Place) -> Number:
        return fractal(node, place, noise_node.noise_type, noise_node.normalize, [detail, roughness, *other_parts])

    if node.socket.identifier in _FACTORS:
        return noise_at(place)
    return noise_at(place), noise_at(place.moved(node, dimensions)), noise_at(place.moved(node, dimensions + 1))


@reads("TexWhiteNoise")
def _white_noise(node: NodeReader) -> Value:
    """Return the result of a White Noise Texture node: a hash of the place, or a colour of three hashes."""
    dimensions = _DIMENSIONS[node.node.noise_dimensions]
    vector, w = list(node.vector("Vector")), node.number("W")
    parts = {1: [w], 2: vector[:2], 3: vector, 4: [*vector, w]}[dimensions]
    if node.socket.identifier == "Value":
        return hashed(node, parts)
    if dimensions == 4:
        x, y, z, _ = parts
        other_keys = [z, x, w, y], [w, z, y, x]
    else:
        other_keys = [*parts, node.constant(1.0)], [*parts, node.constant(2.0)]
    return hashed(node, parts), hashed(node, other_keys[0]), hashed(node, other_keys[1])


_FEATURES = ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS")
_METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
"""Features and metrics of the Voronoi texture, numbered as in materials.c."""
_FLOAT_HASH = 8
"""Number that materials.c expects to be added to the dimensions if cells are hashed as floats, not as integers."""


@reads("TexVoronoi")
def _voronoi(node: NodeReader) -> Value:
    """Return the result of a Voronoi Texture node."""
    voronoi_node = node.node
    dimensions = _DIMENSIONS[voronoi_node.voronoi_dimensions]
    scale = node.number("Scale")
    place = _texture_place(node, dimensions, scale)
    detail, roughness = clamp(node.number("Detail"), 0.0, 15.0), saturate(node.number("Roughness"))
    smoothness = clamp(node.number("Smoothness") / 2.0, 0.0, 0.5)
    lacunarity, exponent = node.number("Lacunarity"), node.number("Exponent")
    randomness = saturate(node.number("Randomness"))
    parts = (detail, roughness, lacunarity, smoothness, exponent, randomness)
    # Before Blender 5.0 the points of cells were hashes of floats.
    kinds = _FEATURES.index(voronoi_node.feature), _METRICS.index(voronoi_node.distance), int(voronoi_node.normalize)
    settings = (dimensions + (_FLOAT_HASH if VECTORS_FUSED else 0), *kinds)
    values = [*place.values(), *(part.value for part in parts)]
    first_result = node.builder.add(Op.VORONOI, *values, settings=settings, results=8)
    results = [Number(node.builder, first_result + number) for number in range(8)]
    x, y, z, w = (safe_divide(part, scale) for part in results[4:])
    outputs: dict[str, Value] = {
        "Distance": results[0],
        "Radius": results[0],
        "Color": (results[1], results[2], results[3]),
        "Position": (x, y, z),
        "W": w,
    }
    return outputs[node.socket.identifier]


@reads("TexWave")
def _wave(node: NodeReader) -> Value:
    """Return the result of a Wave Texture node without distortion."""
    wave_node = node.node
    place = scaled(node.place(), node.number("Scale"))
    # Cycles moves places off whole numbers, where rounding would decide.
    place = each(lambda part: (part + 0.000001) * 0.999999, place)
    phase = node.number("Phase Offset")
    if node.number("Distortion").constant_value != 0.0 or VECTORS_FUSED:
        raise node.refuse("Distortion")  # see `_noise`; before 5.0 results differ in the last digits even without it
    if wave_node.wave_type == "BANDS":
        x, y, z = place
        band_coordinate = {"X": x, "Y": y, "Z": z, "DIAGONAL": x + y + z}[wave_node.bands_direction]
        number = band_coordinate * (10.0 if wave_node.bands_direction == "DIAGONAL" else 20.0) + phase
    else:
        zero = node.constant(0.0)
        ring_parts = [
            zero if axis == wave_node.rings_direction else part for axis, part in zip("XYZ", place, strict=True)
        ]
        number = length((ring_parts[0], ring_parts[1], ring_parts[2])) * 20.0 + phase
    result = _profile(wave_node.wave_profile, number)
    return result if node.socket.identifier in _FACTORS else (result, result, result)


def _profile(kind: str, number: Number) -> Number:
    """Return the profile of a wave, 0 to 1, at a phase (rad)."""
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
"""Steps of the magic texture: axis that is replaced, and the function of x, y and z that replaces it."""


def _turbulence(depth: int, strength: Number, start: Vector) -> Vector:
    """Return the components of the magic texture after `depth` steps; none leaves them as they are."""
    if depth <= 0:
        return start
    parts = list(scaled(start, strength))
    for axis, replacement in _TURNS[:depth]:
        parts[axis] = replacement(*parts) * strength
    return parts[0], parts[1], parts[2]


@reads("TexMagic")
def _magic(node: NodeReader) -> Value:
    """Return the result of a Magic Texture node."""
    depth, scale, strength = node.node.turbulence_depth, node.number("Scale"), node.number("Distortion")
    if not VECTORS_FUSED:
        raise node.refuse("Distortion")  # since 5.0 its sines amplify rounding errors
    px, py, pz = each(lambda part: part.apply(Op.REMAINDER, 2.0 * math.pi), node.place())
    x = sine((px + py + pz) * 5.0 * scale)
    y = cosine((-px + py - pz) * 5.0 * scale)
    z = -cosine((-px - py + pz) * 5.0 * scale)
    x, y, z = _turbulence(depth, strength, (x, y, z))
    doubled_strength, is_zero = strength * 2.0, strength.equals(0.0)
    color = each(lambda part: 0.5 - is_zero.choose(part, part / doubled_strength), (x, y, z))
    return (color[0] + color[1] + color[2]) * (1.0 / 3.0) if node.socket.identifier in _FACTORS else color


@reads("TexChecker")
def _checker(node: NodeReader) -> Value:
    """Return the result of a Checker Texture node."""
    place = scaled(node.place(), node.number("Scale"))
    is_first_color = place[0].apply(Op.CHECKER, place[1], place[2])
    if node.socket.identifier in _FACTORS:
        return is_first_color
    return each(is_first_color.choose, node.vector("Color1"), node.vector("Color2"))


@reads("TexBrick")
def _brick(node: NodeReader) -> Value:
    """Return the result of a Brick Texture node."""
    brick_node: Any = node.node
    x, y, _ = scaled(node.place(), node.number("Scale"))
    names = ("Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
    parts = [x, y, *(node.number(name) for name in names)]
    parts += [node.constant(float(brick_node.offset)), node.constant(float(brick_node.squash))]
    settings = (int(brick_node.offset_frequency), int(brick_node.squash_frequency), int(not VECTORS_FUSED))
    first_result = node.builder.add(Op.BRICK, *(part.value for part in parts), settings=settings, results=2)
    tint, mortar = Number(node.builder, first_result), Number(node.builder, first_result + 1)
    if node.socket.identifier in _FACTORS:
        return mortar
    brick_color = each(lambda a, b: (1.0 - tint) * a + tint * b, node.vector("Color1"), node.vector("Color2"))
    bricks = each(lambda a, b: mortar.equals(1.0).choose(a, b), node.vector("Color1"), brick_color)
    return each(lambda a, b: a * (1.0 - mortar) + b * mortar, bricks, node.vector("Mortar"))


@reads("TexGradient")
def _gradient(node: NodeReader) -> Value:
    """Return the result of a Gradient Texture node."""
    kind, place = node.node.gradient_type, node.place()
    x, y, _ = place
    if kind == "LINEAR":
        result = x
    elif kind == "QUADRATIC":
        result = larger(x, 0.0) * larger(x, 0.0)
    elif kind == "EASING":
        clamped_x = smaller(larger(x, 0.0), 1.0)
        square = clamped_x * clamped_x
        result = 3.0 * square - 2.0 * square * clamped_x
    elif kind == "DIAGONAL":
        result = (x + y) * 0.5
    elif kind == "RADIAL":
        result = y.apply(Op.ARCTAN2, x) / (2.0 * math.pi) + 0.5
    else:
        radial_share = larger(0.999999 - length(place), 0.0)
        result = radial_share * radial_share if kind == "QUADRATIC_SPHERE" else radial_share
    result = saturate(result)
    return result if node.socket.identifier in _FACTORS else (result, result, result)
