"""Sunlight that surfaces throw back to the scanner, as Blender's Principled BSDF has it, without rendering.

The matt part by Lambert; the gloss by GGX microfacets (Walter et al. 2007, "Microfacet Models for Refraction through
Rough Surfaces") with the light that bounces between them added as by Turquin 2019, "Practical multiple scattering
compensation for microfacet models". What the gloss throws back the matt part below doesn't get.
"""

from __future__ import annotations

from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arithmetic.loops import PointLoops, point_loops
from ...base.arrays import Float, Float32, dot_rows

_COSINES, _ROUGHNESSES, _LEVELS = 24, 16, 12
"""Grid of the tables: cosine of the view, roughness, and root of the reflectance at a right angle."""
_SAMPLES = 24
"""Microfacets in each of two directions that an entry of the tables is the mean of."""
_SMOOTHEST = 0.08
"""Least roughness: smoother surfaces throw the sun into a spot that no return lies in."""
_MATT_F0 = 0.08
"""Reflectance at a right angle of a specular of 1; that of 0.5 is glass's, 4 %."""
_BRIGHTEST = 0.999
"""Largest reflectance at a right angle."""


def reflected_sunlight(
    color: Float32, roughness: Float32, metallic: Float32, specular: Float32, normal: Float32, view: Float32, sun: Float
) -> Float32:
    """Return the sunlight (N, 3) that surfaces reflect to the scanner, relative to a white matt one facing the sun.

    Args:
        color: (N, 3) linear base colours.
        roughness, metallic, specular: (N,) of 0 to 1; a specular of 0.5 is a reflectance of 4 %.
        normal, view: (N, 3) unit vectors: of the surface, and towards the scanner.
        sun: (3,) unit vector towards the sun.
    """
    sun32 = sun.astype(np.float32)
    towards_sun = np.clip(normal @ sun32, 0.0, None)
    if (loops := point_loops()) is not None:
        return _by_loops(loops, (color, roughness, metallic, specular), (normal, view, sun32), towards_sun)
    towards_view = np.clip(dot_rows(normal, view), 1e-4, 1.0)
    half = view + sun32
    half /= np.maximum(np.sqrt(dot_rows(half, half)), 1e-6)[:, None]
    across, between = dot_rows(normal, half), dot_rows(view, half)
    rough = np.maximum(roughness, _SMOOTHEST)
    gloss = _gloss(rough, towards_sun, towards_view, np.clip(across, 0.0, 1.0))
    tables = _tables()
    place = tables.place(rough, towards_view)
    bounced = tables.once(place), tables.average(place)
    level = np.minimum(_MATT_F0 * specular, _BRIGHTEST)
    root = np.sqrt(level)
    albedo, average = tables.albedo(place, root), _mean_fresnel(level, root)
    again = _compensation(average, bounced)
    share = (1.0 - metallic) * gloss * _dielectric(level, between) * again
    matt = ((1.0 - metallic) * (1.0 - albedo) * towards_sun)[:, None]
    result = color * matt + share[:, None]
    metal = np.flatnonzero(metallic > 0.0)
    if len(metal):
        rise = (1.0 - np.clip(between[metal], 0.0, 1.0)) ** 5
        base = color[metal]
        fresnel = base + (1.0 - base) * rise[:, None]
        mean = base + (1.0 - base) / 21.0
        inside = bounced[0][metal, None], bounced[1][metal, None]
        result[metal] += (metallic[metal] * gloss[metal])[:, None] * fresnel * _compensation(mean, inside)
    return np.asarray(result, np.float32)


def _by_loops(
    loops: PointLoops,
    layers: tuple[Float32, Float32, Float32, Float32],
    vectors: tuple[Float32, Float32, Float32],
    towards_sun: Float32,
) -> Float32:
    """Return the sunlight that surfaces reflect by compiled loops, see `reflected_sunlight`; powers are NumPy's."""
    color, roughness, metallic, specular = layers
    seen, across, between = loops.halves(*vectors)
    rough, rise = np.asarray(np.maximum(roughness, _SMOOTHEST), np.float32), np.zeros_like(between)
    metal = np.flatnonzero(metallic > 0.0)
    rise[metal] = (1.0 - np.clip(between[metal], 0.0, 1.0)) ** 5
    tables = _tables()
    square = np.asarray(rough**4, np.float32)
    surfaces: list[Float32] = [color, rough, square, metallic, specular, towards_sun, seen, across, between, rise]
    return loops.reflected(tables.arrays, (*tables.steps, _MATT_F0, _BRIGHTEST), surfaces)


_Bounced = tuple[Float32, Float32]
"""Share of light that microfacets throw out at once, and its mean over all directions."""


def _gloss(rough: Float32, sun: Float32, view: Float32, across: Float32) -> Float32:
    """Return pi * D * G2 / (4 * cosine of the view) of GGX microfacets (N,): the specular lobe without Fresnel."""
    square = rough**4
    spread = across * across * (square - 1.0) + 1.0
    distribution = square / (spread * spread)  # times pi
    shadow = 1.0 / (1.0 + _smith(square, sun) + _smith(square, view))
    return np.asarray(np.where(sun > 0.0, distribution * shadow / (4.0 * view), 0.0), np.float32)


def _smith(square: NDArray[np.floating], cosine: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return Smith's masking function lambda of GGX, of squared widths alpha^2, at cosines to the normal."""
    squared = np.maximum(cosine * cosine, 1e-9)
    return 0.5 * (np.sqrt(1.0 + square * (1.0 - squared) / squared) - 1.0)


def _dielectric(level: NDArray[np.floating], cosine: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return a dielectric's Fresnel reflectance at cosines of incidence; ``level`` is that at a right angle."""
    root = np.sqrt(level)
    eta = (1.0 + root) / (1.0 - root)
    c = np.clip(cosine, 0.0, 1.0)
    g = np.sqrt(np.maximum(eta * eta - 1.0 + c * c, 1e-12))
    a, b = (g - c) / (g + c), (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return np.asarray(np.where(level > 0.0, 0.5 * a * a * (1.0 + b * b), 0.0))


def _compensation(mean: NDArray[np.floating], bounced: _Bounced) -> NDArray[np.floating]:
    """Return the factor by which light that bounces between microfacets makes a gloss brighter (Turquin 2019).

    Args:
        mean: reflectance, over all directions.
        bounced: see `_Bounced`.
    """
    once, average = bounced
    missing = (1.0 - once) / once
    return np.asarray(1.0 + missing * mean * mean * average / (1.0 - mean * (1.0 - average)))


def _mean_fresnel(level: Float32, root: Float32) -> Float32:
    """Return a dielectric's mean Fresnel reflectance (N,), by that at a right angle and its root."""
    eta = (1.0 + root) / (1.0 - root)
    average = np.where(level > 0.0, (eta - 1.0) / (4.08567 + 1.00071 * eta), 0.0)
    return np.asarray(average, np.float32)


_GridStep = tuple[NDArray[np.intp], Float32]
"""Index of the grid step below each of N values, and the fraction of the way to the next."""


class _Place(NamedTuple):
    """Places (N,) in the tables.

    Attributes:
        rough, view: steps of roughness and of the cosine of the view.
        entry: indices of both in a table of as many rows and columns.
    """

    rough: _GridStep
    view: _GridStep
    entry: NDArray[np.intp]


class _AlbedoTables:
    """Tables of GGX albedos over cosine, roughness and reflectance, integrated once and interpolated."""

    def __init__(self) -> None:
        u, v = (axis.ravel() for axis in np.meshgrid(*((np.arange(_SAMPLES) + 0.5) / _SAMPLES for _ in range(2))))
        cosine = np.linspace(0.02, 1.0, _COSINES)
        rough = np.linspace(_SMOOTHEST, 1.0, _ROUGHNESSES)
        root = np.linspace(0.0, np.sqrt(_MATT_F0), _LEVELS)
        self._once = np.empty((_ROUGHNESSES, _COSINES), np.float32)
        self._albedo = np.empty((_ROUGHNESSES, _COSINES, _LEVELS), np.float32)
        for i, width in enumerate(rough**2):
            weight, between = _visible_facets(width, cosine, u, v)
            once = weight.mean(axis=1)
            self._once[i] = once
            for k, level in enumerate(root**2):
                self._albedo[i, :, k] = np.einsum("ij,ij->i", weight, _dielectric(level, between)) / len(u) / once
        over = np.maximum(np.gradient(cosine**2), 0.0)
        self._average = (self._once * over).sum(axis=1) / over.sum()
        self._cosine, self._rough, self._root = (
            (axis[0], (len(axis) - 1) / (axis[-1] - axis[0]), len(axis) - 1) for axis in (cosine, rough, root)
        )

    @property
    def arrays(self) -> tuple[Float32, Float32, Float]:
        """Return the tables: (R, V) after one bounce, (R, V, L) of dielectrics, and (R,) means of the first."""
        return self._once, self._albedo, self._average

    @property
    def steps(self) -> tuple[float, ...]:
        """Return first value and scale of the grids of roughness, cosine and root."""
        return *self._rough[:2], *self._cosine[:2], *self._root[:2]

    def place(self, rough: Float32, view: Float32) -> _Place:
        """Return where roughnesses and cosines of the view (N,) lie in the tables."""
        steps = _grid_step(rough, self._rough), _grid_step(view, self._cosine)
        return _Place(*steps, steps[0][0] * _COSINES + steps[1][0])

    def once(self, place: _Place) -> Float32:
        """Return the directional albedo (N,) of GGX mirrors after one bounce, interpolated."""
        return _bilinear(self._once, place, place.entry)

    def average(self, place: _Place) -> Float32:
        """Return the one-bounce albedo's cosine-weighted mean over all directions (N,), interpolated."""
        low, share = place.rough
        below, above = np.take(self._average, low), np.take(self._average, low + 1)
        return np.asarray(below * (1.0 - share) + above * share, np.float32)

    def albedo(self, place: _Place, root: Float32) -> Float32:
        """Return a dielectric gloss's albedo relative to a mirror's (N,); `root` squared is its normal reflectance."""
        low, share = _grid_step(root, self._root)
        entry = place.entry * _LEVELS + low
        below = _bilinear(self._albedo, place, entry, _LEVELS)
        entry += 1
        above = _bilinear(self._albedo, place, entry, _LEVELS)
        return np.asarray(below * (1.0 - share) + above * share, np.float32)


_building = Lock()


def _tables() -> _AlbedoTables:
    """Return the tables, which the first thread that asks for them makes while others wait."""
    with _building:
        return _built_tables()


@lru_cache(maxsize=1)
def _built_tables() -> _AlbedoTables:
    return _AlbedoTables()


_Axis = tuple[float, float, int]


def _grid_step(values: Float32, axis: _Axis) -> _GridStep:
    """Return the index of the grid step below each value (N,), and the fraction of the way to the next (N,)."""
    first, scale, last = axis
    scaled = np.clip((values - np.float32(first)) * np.float32(scale), 0.0, last)
    low = np.minimum(scaled.astype(np.intp), last - 1)
    return low, np.asarray(scaled - low, np.float32)


def _bilinear(table: Float32, place: _Place, entry: NDArray[np.intp], levels: int = 1) -> Float32:
    """Return values (N,) of a table interpolated over roughness and view.

    Args:
        table: of as many numbers for each roughness and cosine as there are levels.
        place: where.
        entry: indices (N,) of the numbers at the steps below, in the flat table.
        levels: of the table.
    """
    u, v = place.rough[1], place.view[1]
    flat, row = table.ravel(), _COSINES * levels
    low = np.take(flat, entry) * (1.0 - v) + np.take(flat, entry + levels) * v
    high = np.take(flat, entry + row) * (1.0 - v) + np.take(flat, entry + (row + levels)) * v
    return np.asarray(low * (1.0 - u) + high * u, np.float32)


def _visible_facets(width: float, cosine: Float, u: Float, v: Float) -> tuple[Float, Float]:
    """Return weights G2 / G1 and cosines to the view of GGX microfacets, sampled by visible normals (Heitz 2018).

    The mean of the weights is the share of the light that comes out after one bounce.

    Args:
        width: alpha of the facets.
        cosine: (J,) of the view to the surface's normal.
        u, v: (S,) of 0 to 1: where each sample lies.

    Returns:
        (J, S) each.
    """
    mu = cosine[:, None]
    along = width * np.sqrt(1.0 - mu * mu)
    length = np.sqrt(along * along + mu * mu)
    along, up = along / length, mu / length  # the view (x, 0, z), seen by facets as wide as high
    radius, angle = np.sqrt(u), 2.0 * np.pi * v
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    share = 0.5 * (1.0 + up)
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    half = np.stack([width * (z * along - y * up), np.broadcast_to(width * x, z.shape), y * along + z * up])
    half[2] = np.maximum(half[2], 1e-9)
    half /= np.sqrt(np.einsum("kij,kij->ij", half, half))
    between = np.clip(half[0] * np.sqrt(1.0 - mu * mu) + half[2] * mu, 0.0, 1.0)
    out = 2.0 * between * half[2] - mu
    square = np.asarray(width * width)
    seen, both = _smith(square, mu), _smith(square, np.maximum(out, 1e-6))
    return np.where(out > 0.0, (1.0 + seen) / (1.0 + seen + both), 0.0), between
