"""A material's parameters from a real class: brightness and spread by quantiles, facet slope by incidence angles, the
wavelength of the variation by how alike neighbours are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arithmetic.noise import noise_field
from ..base.arrays import Float, Index
from ..base.errors import InputError
from ..materials.reflectance import LUMINANCE, facet_terms
from ..materials.surfaces import OCTAVES
from ..materials.table import Material
from .expected import Expectation, ReceiverModel

Function = Callable[[Float], Float]

FITTED = (0.25, 0.5, 0.75, 0.9)
"""Quantiles that a fit holds. Chosen: both spreads are told from either side of the median, and the tail above, where
markings and gloss are."""
SHOWN = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)
"""Quantiles that a report shows: the others say how far the fit can be trusted beyond. Chosen: both tails."""
WAVELENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Wavelengths that are tried, m. Chosen: by factors of 2, from a tyre's width to a stretch of pavement that was laid at
once."""
BRIGHTEST = 0.98
"""Largest reflectivity that a material is given. Chosen: as of the whitest standards."""
_SPREADS = (0.002, 1.5)
"""Least and largest spread, in logarithms. Chosen: the first is none, the second a factor of 4.5."""
_QUARTILE = 0.6745
"""Quartile of the standard normal distribution."""
_STEPS = 40
"""Levenberg and Marquardt's steps at most. Chosen: three parameters take some ten."""
_DONE = 1e-4
"""Step, in logarithms, at which the fit ends. Chosen: a hundredth of a percent."""
_CELLS = (0.4, 1.0, 2.5, 6.0, 15.0, 40.0)
"""Squares within which points are compared, m. Chosen: by factors of 2.5, across the wavelengths that are tried."""
_FEWEST_PAIRS = 50
"""Degrees of freedom of a variance within squares at least. Chosen: it is then known to a fifth (2 / n under the
root)."""


@dataclass(frozen=True)
class Fit:
    """Fitted level and spreads of a class's material.

    Attributes:
        level: factor on the material's linear intensities: the device's gain times the change of the brightness.
        below, above: spreads, see `materials.surfaces`.
    """

    level: float
    below: float
    above: float


def interquartile_range(quantiles: Float) -> float:
    """Return the interquartile range of `FITTED` quantiles (4,), at least a millionth of their median."""
    return max(float(quantiles[2] - quantiles[0]), 1e-6 * abs(float(quantiles[1])), 1e-300)


def fit_level_and_spreads(
    expectation: Expectation,
    material: Material,
    quantiles: Float,
    receiver: ReceiverModel,
    side: tuple[Material, float] | None = None,
    with_spreads: bool = True,
) -> Fit:
    """Return level and spreads at which the expected quantiles fit the cloud's best (least squares).

    Levenberg and Marquardt's method on the differences over the interquartile range.

    Args:
        expectation: the places of the class.
        material: to begin with.
        quantiles: (4,) `FITTED` quantiles as stored.
        receiver: the device.
        side: for a strip, the material beside it and its level.
        with_spreads: whether the spreads are fitted as well; else they are the material's.
    """
    width = interquartile_range(quantiles)

    def residual(x: Float) -> Float:
        """Return the errors (4,) of the expected quantiles, over the interquartile range, at parameters."""
        linear = apply_gain(expectation, material, _fit(x, material), side)
        return np.asarray((np.quantile(receiver.to_stored(linear), FITTED) - quantiles) / width)

    start = float(np.median(expectation.linear_intensities(material, side[0] if side else None)))
    if start <= 0.0:
        raise InputError("material", material.to_dict(), "gives nothing back at these incidence angles and ranges")
    level = np.log(float(receiver.to_linear(quantiles[1:2])[0]) / start)
    if not with_spreads:
        return _fit(_levenberg_marquardt(residual, np.array([level])), material)
    # A quartile of a normal distribution lies 0.6745 standard deviations from its median; spreads are of logarithms.
    log_linear = np.log(receiver.to_linear(quantiles))
    sigma = [max(0.02, abs(float(log_linear[1 + direction] - log_linear[1])) / _QUARTILE) for direction in (-1, 1)]
    return _fit(_levenberg_marquardt(residual, np.array([level, *np.log(sigma)])), material)


def apply_gain(expectation: Expectation, material: Material, fit: Fit, side: tuple[Material, float] | None) -> Float:
    """Return the linear intensities (`SAMPLES`,) of a material with a fit's spreads, times the fit's level.

    Args:
        expectation: the places of the class.
        material: of the class.
        fit: its level and spreads.
        side: for a strip, the material beside it and its level, which stays as it is.
    """
    uneven = material.model_copy(update={"spread_below": fit.below, "spread_above": fit.above})
    if side is None:
        return fit.level * expectation.linear_intensities(uneven)
    # The side's level is divided by the fit's, by which all is multiplied afterwards.
    side_material, side_level = side
    side_material = brighten_material(side_material, side_level / fit.level, limited=False)
    return fit.level * expectation.linear_intensities(uneven, side_material)


def _fit(x: Float, material: Material) -> Fit:
    """Return the fit that parameters of the search stand for.

    Args:
        x: (1,) or (3,) logarithms of the level and of the spreads below and above.
        material: whose spreads are taken where there are none in ``x``.
    """
    level = float(np.exp(np.clip(x[0], -200.0, 200.0)))
    if len(x) == 1:
        return Fit(level, material.spread_below, material.spread_above)
    spread_below, spread_above = np.exp(np.clip(x[1:], *np.log(_SPREADS)))
    return Fit(level, float(spread_below), float(spread_above))


def _levenberg_marquardt(residual: Function, x: Float) -> Float:
    """Return the parameters (P,) at which the sum of squared residuals is least, from ``x`` (P,) downhill.

    Args:
        residual: returns the residuals (M,) at parameters.
        x: where the search begins.
    """
    damping, r = 1e-3, residual(x)
    for _ in range(_STEPS):
        # Central differences. Quantiles of samples have steps: the derivative is taken over far more than one of these.
        jacobian = np.column_stack([(residual(x + h) - residual(x - h)) / 2e-3 for h in 1e-3 * np.eye(len(x))])
        normal = jacobian.T @ jacobian
        # Marquardt 1963: (J'J + lambda diag(J'J)) delta = -J'r; lambda falls with each success and rises with each
        # failure, by a factor of 5 (chosen).
        scale = np.diag(np.maximum(np.diag(normal), 1e-9))
        delta = np.clip(np.linalg.solve(normal + damping * scale, -jacobian.T @ r), -1.0, 1.0)
        new_r = residual(x + delta)
        if new_r @ new_r < r @ r:
            x, r, damping = x + delta, new_r, max(damping / 5.0, 1e-9)
            if np.abs(delta).max() < _DONE:
                break
        elif damping > 1e6:
            break
        else:
            damping *= 5.0
    return x


def common_gain(
    materials: Sequence[Material],
    levels: Sequence[float],
    held_index: int | None = None,
    known_gain: float | None = None,
) -> float:
    """Return the one gain of the device that explains the levels of all classes.

    It is the level of the held material, or the known gain. Without either it is the gain that changes the materials'
    brightness least (the mean of the levels' logarithms), but never so small that a material had to reflect more than
    `BRIGHTEST`.

    Args:
        materials: of the classes.
        levels: fitted level of each.
        held_index: index of the material whose brightness stays as it is.
        known_gain: of the device.

    Raises:
        InputError: with the known gain or the held material another one had to reflect more than that.
    """
    least_gain = max(level * row.reflectivity / BRIGHTEST for row, level in zip(materials, levels, strict=True))
    gain = levels[held_index] if held_index is not None else known_gain
    if gain is None:
        return max(float(np.exp(np.mean(np.log(levels)))), least_gain)
    if least_gain > gain * (1.0 + 1e-9):
        requirement = f"a material would have to reflect {least_gain / gain * BRIGHTEST:.2f} of the light"
        raise InputError("--gain" if held_index is None else "--hold", gain, requirement)
    return gain


def brighten_material(material: Material, change: float, limited: bool = True) -> Material:
    """Return a material with reflectivity and retro-reflection multiplied by ``change``.

    The base colour is what the camera sees: it stays as long as a specular share of 0 to 1 can make the reflectivity.

    Args:
        material: to be changed.
        change: above 0.
        limited: refuse a reflectivity above `BRIGHTEST`; else the result may be any, and serves to compute only.
    """
    reflectivity, metal = change * material.reflectivity, material.metallic
    luminance = float(np.array(material.base_color) @ LUMINANCE)
    # `reflectivity` of the table is metal Y + (1 - metal) (specular + Y / 2), with the colour's luminance Y.
    specular = (reflectivity - metal * luminance) / max(1.0 - metal, 1e-9) - 0.5 * luminance
    update: dict[str, Any] = {"specular": specular, "retroreflection": change * material.retroreflection}
    if not limited:
        return material.model_copy(update=update)
    if reflectivity > BRIGHTEST * (1.0 + 1e-6):
        raise InputError("reflectivity", round(reflectivity, 3), f"no material reflects more than {BRIGHTEST:g}")
    if not 0.0 <= specular <= 1.0:
        color = np.array(material.base_color) * change
        if color.max() > 1.0 or change * material.specular > 1.0:
            raise InputError("specular", round(specular, 3), "no base colour and specular of 0 to 1 make this material")
        update |= {"base_color": tuple(color.tolist()), "specular": change * material.specular}
    return material.model_copy(update=update)


def fitted_slope(incidence: Float, linear: Float) -> float | None:
    """Return the facet slope (rad) whose fall-off with incidence fits a class best; None if angles differ too little.

    Args:
        incidence: (N,) rad.
        linear: (N,) linear intensities without the fall-off with the distance.

    Returns:
        The slope; None where most angles differ by less than 10 degrees, which says nothing about it.
    """
    edges = np.quantile(incidence, np.linspace(0.0, 1.0, 13))
    if edges[-2] - edges[1] < np.deg2rad(10.0):
        return None
    owner = np.clip(np.searchsorted(edges, incidence, side="right") - 1, 0, 11)
    # Equal numbers of points in each of twelve groups of angles, whose medians outliers don't move.
    angle = np.array([np.median(incidence[owner == number]) for number in range(12) if (owner == number).any()])
    median = np.array([np.median(linear[owner == number]) for number in range(12) if (owner == number).any()])
    slopes = np.linspace(0.0, 1.5, 76)
    a, b = (terms[:, None] for terms in facet_terms(slopes))
    # Oren and Nayar 1994, seen from where the light is: cos(theta) (A + B sin(theta) tan(theta)), up to a factor, which
    # the deviation of the logarithms leaves out.
    model = a * np.cos(angle) + b * np.sin(angle) ** 2
    misfit = np.log(median / model)
    return float(slopes[misfit.std(axis=1).argmin()])


def fitted_wavelength(place: Float, intensity: Float, noise: float = 0.0) -> float:
    """Return the one of `WAVELENGTHS`, m, whose random field correlates over distance most like a real class.

    Intensities are taken by rank, as normal scores, so that no model of the distribution is needed. What is compared
    are their variances within squares of several sizes, with the field's at the same places.

    Args:
        place: (N, 3) m.
        intensity: (N,) in any unit.
        noise: share of the variance that is the single points' and no field's.
    """
    squares = [_members(place, size) for size in _CELLS]
    real_variance = np.maximum((_variance_within(_normal_scores(intensity), squares) - noise) / (1.0 - noise), 0.0)
    misfits = []
    for wavelength in WAVELENGTHS:
        values = noise_field(place - place.min(axis=0), wavelength, 1, OCTAVES)
        misfits.append(float(np.nansum((_variance_within(_normal_scores(values), squares) - real_variance) ** 2)))
    return WAVELENGTHS[int(np.argmin(misfits))]


def _members(place: Float, size: float) -> Index:
    """Return the number (N,) of the square of a size (m) that each point (N, 3) lies in."""
    cell = np.floor(place[:, :2] / size).astype(np.int64)
    _, owner = np.unique(cell[:, 0] * 2_000_003 + cell[:, 1], return_inverse=True)
    return np.asarray(owner.ravel(), dtype=np.intp)


def _variance_within(values: Float, squares: list[Index]) -> Float:
    """Return the variance within squares of each size as a share of the total; NaN where too few points share a square.

    Args:
        values: (N,).
        squares: for each size the square (N,) of each value.
    """
    result = []
    for owner in squares:
        count = np.bincount(owner)
        mean = np.bincount(owner, values) / np.maximum(count, 1)
        square = ((values - mean[owner]) ** 2)[count[owner] > 1].sum()
        freedom = (count[count > 1] - 1).sum()  # each square's mean takes one degree
        result.append(square / freedom / values.var() if freedom >= _FEWEST_PAIRS else np.nan)
    return np.array(result)


def _normal_scores(values: Float) -> Float:
    """Return normal scores (N,) of values by rank, by a rational approximation (Abramowitz & Stegun 26.2.23)."""
    q = np.empty(len(values))
    q[np.argsort(values, kind="stable")] = (np.arange(len(values)) + 0.5) / len(values)
    # x = t - (c0 + c1 t + c2 t^2) / (1 + d1 t + d2 t^2 + d3 t^3), t = sqrt(-2 ln p), of the tail's probability p.
    t = np.sqrt(-2.0 * np.log(np.minimum(q, 1.0 - q)))
    numerator = 2.515517 + t * (0.802853 + t * 0.010328)
    denominator = 1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308))
    return np.asarray(np.sign(q - 0.5) * (t - numerator / denominator))
