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
"""Grid of the tables: cosine of the view, roughness, and root of the reflectance at a right angle. Chosen: albedos are
smooth in all three, so that few entries interpolate them."""
_SAMPLES = 24
"""Microfacets in each of two directions that an entry of the tables is the mean of. Chosen: 576 evenly spread ones."""
_SMOOTHEST = 0.08
"""Least roughness. Chosen: smoother surfaces throw the sun into a spot that no return lies in."""
_MATT_F0 = 0.08
"""Reflectance at a right angle of a specular of 1, as of Blender's Principled BSDF; that of 0.5 is glass's, 4 %."""
_BRIGHTEST = 0.999
"""Largest reflectance at a right angle. Chosen: that of 1 has an infinite index of refraction."""
_LEAST_COSINE = 1e-4
"""Least cosine of the view to the normal. Chosen: keeps the lobe's division by it finite where views graze."""


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
    n_l = np.clip(normal @ sun32, 0.0, None)
    if (loops := point_loops()) is not None:
        return _by_loops(loops, (color, roughness, metallic, specular), (normal, view, sun32), n_l)
    n_v = np.clip(dot_rows(normal, view), _LEAST_COSINE, 1.0)
    # Walter et al. 2007: h = (i + o) / |i + o|, here i the sun and o the view.
    h = view + sun32
    h /= np.maximum(np.sqrt(dot_rows(h, h)), 1e-6)[:, None]
    n_h, v_h = dot_rows(normal, h), dot_rows(view, h)
    rough = np.maximum(roughness, _SMOOTHEST)
    lobe = _gloss(rough, n_l, n_v, np.clip(n_h, 0.0, 1.0))
    tables = _tables()
    place = tables.place(rough, n_v)
    one_bounce = tables.single(place), tables.average(place)
    f0 = np.minimum(_MATT_F0 * specular, _BRIGHTEST)
    root = np.sqrt(f0)
    albedo, f_avg = tables.albedo(place, root), _mean_fresnel(f0, root)
    gloss = (1.0 - metallic) * lobe * _dielectric(f0, v_h) * _compensation(f_avg, one_bounce)
    # The matt base gets what the gloss leaves: (1 - albedo of the gloss) N.L, by Lambert.
    matt = ((1.0 - metallic) * (1.0 - albedo) * n_l)[:, None]
    result = color * matt + gloss[:, None]
    metal = np.flatnonzero(metallic > 0.0)
    if len(metal):
        # Schlick 1994: F = F0 + (1 - F0) (1 - V.H)^5; its mean over all directions is F0 + (1 - F0) / 21.
        schlick = (1.0 - np.clip(v_h[metal], 0.0, 1.0)) ** 5
        metal_f0 = color[metal]
        fresnel = metal_f0 + (1.0 - metal_f0) * schlick[:, None]
        metal_f_avg = metal_f0 + (1.0 - metal_f0) / 21.0
        metal_single = one_bounce[0][metal, None], one_bounce[1][metal, None]
        result[metal] += (metallic[metal] * lobe[metal])[:, None] * fresnel * _compensation(metal_f_avg, metal_single)
    return np.asarray(result, np.float32)


def _by_loops(
    loops: PointLoops,
    layers: tuple[Float32, Float32, Float32, Float32],
    vectors: tuple[Float32, Float32, Float32],
    n_l: Float32,
) -> Float32:
    """Return the sunlight that surfaces reflect by compiled loops, see `reflected_sunlight`; powers are NumPy's."""
    color, roughness, metallic, specular = layers
    n_v, n_h, v_h = loops.halves(*vectors)
    rough, schlick = np.asarray(np.maximum(roughness, _SMOOTHEST), np.float32), np.zeros_like(v_h)
    metal = np.flatnonzero(metallic > 0.0)
    schlick[metal] = (1.0 - np.clip(v_h[metal], 0.0, 1.0)) ** 5
    tables = _tables()
    alpha2 = np.asarray(rough**4, np.float32)  # alpha = roughness^2
    surfaces: list[Float32] = [color, rough, alpha2, metallic, specular, n_l, n_v, n_h, v_h, schlick]
    return loops.reflected(tables.arrays, (*tables.steps, _MATT_F0, _BRIGHTEST), surfaces)


_SingleScatter = tuple[Float32, Float32]
"""Albedo E of microfacets that throw light out at once, for the view, and its mean E_avg over all directions."""


def _gloss(rough: Float32, n_l: Float32, n_v: Float32, n_h: Float32) -> Float32:
    """Return pi D G2 / (4 N.V) of GGX microfacets (N,): the specular lobe times N.L and pi, without Fresnel."""
    alpha2 = rough**4  # alpha = roughness^2
    # Walter et al. 2007, as pi D = alpha^2 / ((N.H)^2 (alpha^2 - 1) + 1)^2.
    denominator = n_h * n_h * (alpha2 - 1.0) + 1.0
    pi_d = alpha2 / (denominator * denominator)
    # Heitz 2014, heights of masking and shadowing correlated: G2 = 1 / (1 + Lambda(L) + Lambda(V)).
    g2 = 1.0 / (1.0 + _smith(alpha2, n_l) + _smith(alpha2, n_v))
    return np.asarray(np.where(n_l > 0.0, pi_d * g2 / (4.0 * n_v), 0.0), np.float32)


def _smith(alpha2: NDArray[np.floating], cosine: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return Smith's masking function of GGX at cosines to the normal; ``alpha2`` is the facets' alpha^2."""
    # Heitz 2014: Lambda = (-1 + sqrt(1 + alpha^2 tan^2 theta)) / 2, with tan^2 = (1 - cos^2) / cos^2.
    cosine2 = np.maximum(cosine * cosine, 1e-9)
    return 0.5 * (np.sqrt(1.0 + alpha2 * (1.0 - cosine2) / cosine2) - 1.0)


def _dielectric(f0: NDArray[np.floating], cosine: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return a dielectric's Fresnel reflectance at cosines of incidence; ``f0`` is that at a right angle."""
    root = np.sqrt(f0)
    eta = (1.0 + root) / (1.0 - root)  # F0 = ((eta - 1) / (eta + 1))^2
    # Walter et al. 2007, with c = |V.H| and g^2 = eta^2 - 1 + c^2:
    # F = 1/2 ((g - c) / (g + c))^2 (1 + ((c (g + c) - 1) / (c (g - c) + 1))^2).
    c = np.clip(cosine, 0.0, 1.0)
    g = np.sqrt(np.maximum(eta * eta - 1.0 + c * c, 1e-12))
    a, b = (g - c) / (g + c), (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return np.asarray(np.where(f0 > 0.0, 0.5 * a * a * (1.0 + b * b), 0.0))


def _compensation(f_avg: NDArray[np.floating], one_bounce: _SingleScatter) -> NDArray[np.floating]:
    """Return the factor by which light that bounces between microfacets makes a gloss brighter.

    Args:
        f_avg: mean Fresnel reflectance over all directions.
        one_bounce: see `_SingleScatter`.
    """
    e, e_avg = one_bounce
    # Turquin 2019: the lobe times 1 + F_ms (1 - E) / E, with the share F_ms of the missing light that isn't absorbed
    # on its further bounces (Kulla and Conty 2017): F_ms = F_avg^2 E_avg / (1 - F_avg (1 - E_avg)).
    missing_light = (1.0 - e) / e
    return np.asarray(1.0 + missing_light * f_avg * f_avg * e_avg / (1.0 - f_avg * (1.0 - e_avg)))


def _mean_fresnel(f0: Float32, root: Float32) -> Float32:
    """Return a dielectric's mean Fresnel reflectance (N,), by that at a right angle and its root."""
    eta = (1.0 + root) / (1.0 - root)
    # Kulla and Conty 2017, their fit for eta > 1: F_avg = (eta - 1) / (4.08567 + 1.00071 eta).
    f_avg = np.where(f0 > 0.0, (eta - 1.0) / (4.08567 + 1.00071 * eta), 0.0)
    return np.asarray(f_avg, np.float32)


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
        cosine = np.linspace(0.02, 1.0, _COSINES)  # from 0.02: at 0 tan theta is infinite
        rough = np.linspace(_SMOOTHEST, 1.0, _ROUGHNESSES)
        root = np.linspace(0.0, np.sqrt(_MATT_F0), _LEVELS)
        self._single = np.empty((_ROUGHNESSES, _COSINES), np.float32)
        self._albedo = np.empty((_ROUGHNESSES, _COSINES, _LEVELS), np.float32)
        for i, alpha in enumerate(rough**2):
            weight, v_h = _visible_facets(alpha, cosine, u, v)
            e = weight.mean(axis=1)  # E = mean of G2 / G1 over the visible normals
            self._single[i] = e
            for k, f0 in enumerate(root**2):
                self._albedo[i, :, k] = np.einsum("ij,ij->i", weight, _dielectric(f0, v_h)) / len(u) / e
        # E_avg = 2 x integral of E mu dmu = integral of E d(mu^2).
        measure = np.maximum(np.gradient(cosine**2), 0.0)
        self._average = (self._single * measure).sum(axis=1) / measure.sum()
        self._cosine, self._rough, self._root = (
            (axis[0], (len(axis) - 1) / (axis[-1] - axis[0]), len(axis) - 1) for axis in (cosine, rough, root)
        )

    @property
    def arrays(self) -> tuple[Float32, Float32, Float]:
        """Return the tables: (R, V) after one bounce, (R, V, L) of dielectrics, and (R,) means of the first."""
        return self._single, self._albedo, self._average

    @property
    def steps(self) -> tuple[float, ...]:
        """Return first value and scale of the grids of roughness, cosine and root."""
        return *self._rough[:2], *self._cosine[:2], *self._root[:2]

    def place(self, rough: Float32, view: Float32) -> _Place:
        """Return where roughnesses (N,) and cosines of the view (N,) lie in the tables of R rows and V columns."""
        rough_step, view_step = _grid_step(rough, self._rough), _grid_step(view, self._cosine)
        (row, _), (column, _) = rough_step, view_step
        return _Place(rough_step, view_step, entry=row * _COSINES + column)

    def single(self, place: _Place) -> Float32:
        """Return the directional albedo (N,) of GGX mirrors after one bounce, interpolated."""
        return _bilinear(self._single, place, place.entry)

    def average(self, place: _Place) -> Float32:
        """Return the one-bounce albedo's cosine-weighted mean over all directions (N,), interpolated."""
        step, share = place.rough
        value_below, value_above = np.take(self._average, step), np.take(self._average, step + 1)
        return np.asarray(value_below * (1.0 - share) + value_above * share, np.float32)

    def albedo(self, place: _Place, root: Float32) -> Float32:
        """Return a dielectric gloss's albedo relative to a mirror's (N,); `root` squared is its normal reflectance."""
        step, share = _grid_step(root, self._root)
        entry = place.entry * _LEVELS + step
        value_below = _bilinear(self._albedo, place, entry, _LEVELS)
        entry += 1
        value_above = _bilinear(self._albedo, place, entry, _LEVELS)
        return np.asarray(value_below * (1.0 - share) + value_above * share, np.float32)


_building = Lock()


def _tables() -> _AlbedoTables:
    """Return the tables, which the first thread that asks for them makes while others wait."""
    with _building:
        return _built_tables()


@lru_cache(maxsize=1)
def _built_tables() -> _AlbedoTables:
    """Return the tables, made by the first call and cached."""
    return _AlbedoTables()


_Axis = tuple[float, float, int]


def _grid_step(values: Float32, axis: _Axis) -> _GridStep:
    """Return the index (N,) of the grid step below each value (N,), and the fraction (N,) of the way to the next.

    Args:
        values: (N,).
        axis: first value of the grid, steps per unit, and index of the last step.
    """
    first_value, scale, last_step = axis
    position = np.clip((values - np.float32(first_value)) * np.float32(scale), 0.0, last_step)
    step = np.minimum(position.astype(np.intp), last_step - 1)
    return step, np.asarray(position - step, np.float32)


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
    value_below = np.take(flat, entry) * (1.0 - v) + np.take(flat, entry + levels) * v
    value_above = np.take(flat, entry + row) * (1.0 - v) + np.take(flat, entry + (row + levels)) * v
    return np.asarray(value_below * (1.0 - u) + value_above * u, np.float32)


def _visible_facets(alpha: float, cosine: Float, u1: Float, u2: Float) -> tuple[Float, Float]:
    """Return weights G2 / G1 and cosines to the view of GGX microfacets, sampled by visible normals.

    By Heitz 2018, "Sampling the GGX distribution of visible normals", whose symbols and order of steps these are. The
    mean of the weights is the share of the light that comes out after one bounce.

    Args:
        alpha: width of the facets.
        cosine: (J,) of the view to the surface's normal.
        u1, u2: (S,) of 0 to 1: where each sample lies.

    Returns:
        (J, S) each.
    """
    mu = cosine[:, None]
    sine = np.sqrt(1.0 - mu * mu)  # the view Ve = (sine, 0, mu)
    # 1. The view of the hemisphere that the facets' ellipsoid becomes: Vh = (alpha Ve_x, 0, Ve_z), made a unit vector.
    vh_x = alpha * sine
    length = np.sqrt(vh_x * vh_x + mu * mu)
    vh_x, vh_z = vh_x / length, mu / length
    # 2. A point (t1, t2) of the hemisphere's area as Vh sees it, in the basis T1 = (0, 1, 0), T2 = Vh x T1.
    r, phi = np.sqrt(u1), 2.0 * np.pi * u2
    t1, t2 = r * np.cos(phi), r * np.sin(phi)
    s = 0.5 * (1.0 + vh_z)
    t2 = (1.0 - s) * np.sqrt(np.maximum(1.0 - t1 * t1, 0.0)) + s * t2
    # 3. Back onto the hemisphere: Nh = t1 T1 + t2 T2 + sqrt(1 - t1^2 - t2^2) Vh.
    t3 = np.sqrt(np.maximum(1.0 - t1 * t1 - t2 * t2, 0.0))
    # 4. Normal of the ellipsoid: Ne = (alpha Nh_x, alpha Nh_y, max(0, Nh_z)), made a unit vector.
    ne = np.stack([alpha * (t3 * vh_x - t2 * vh_z), np.broadcast_to(alpha * t1, t3.shape), t2 * vh_x + t3 * vh_z])
    ne[2] = np.maximum(ne[2], 1e-9)
    ne /= np.sqrt(np.einsum("kij,kij->ij", ne, ne))
    v_h = np.clip(ne[0] * sine + ne[2] * mu, 0.0, 1.0)
    n_l = 2.0 * v_h * ne[2] - mu  # the view mirrored: L = 2 (V.H) H - V
    # G2 / G1 = (1 + Lambda(V)) / (1 + Lambda(V) + Lambda(L)); light that leaves into the surface is lost.
    alpha2 = np.asarray(alpha * alpha)
    lambda_v, lambda_l = _smith(alpha2, mu), _smith(alpha2, np.maximum(n_l, 1e-6))
    return np.where(n_l > 0.0, (1.0 + lambda_v) / (1.0 + lambda_v + lambda_l), 0.0), v_h
