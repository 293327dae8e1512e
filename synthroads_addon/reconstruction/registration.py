"""The path made parallel to the road: each stretch is laid over those before it so that lines and edges coincide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..base.arrays import Float
from .path import SPACING, CloudPath
from .profiles import ACROSS, Grid, Profiles
from .smoothing import smooth

STEP, WINDOW = 10, 20
"""Metres from one stretch to the next, and in a stretch."""
_SHEARS = np.linspace(-0.06, 0.06, 25)
_REACH = 0.8  # m that a stretch may lie beside where the ones before it lead
_LOOSE = 0.15  # more of it per stretch without lines
_MEMORY = 0.85  # of the template from one stretch to the next
_PRIOR = 0.15  # of the best score is lost _REACH beside what was expected
_WAVELENGTH = 60.0  # m
_EDGE = 0.3  # weight of the pavement's edges beside paint


@dataclass(frozen=True)
class _Fit:
    shift: float
    shear: float
    score: float


def register_path(path: CloudPath, profiles: Profiles) -> CloudPath:
    """Return a path parallel to what its profiles show: its offset from any line of the road changes slowly at most.

    Stretches of 20 m are sheared and shifted against the mean of those before them, beginning with the most usual one.
    Without lines and edges the path stays as it is.
    """
    signal = evidence(profiles)
    starts = np.arange(0, max(1, len(signal) - WINDOW + 1), STEP)
    blocks = [_shear_profiles(signal[row : row + WINDOW]) for row in starts]
    energy = np.array([float((block**2).sum(axis=1).max()) for block in blocks])
    if energy.max() <= 0.0:
        return path
    first = _most_usual(blocks)
    fits = [_Fit(0.0, 0.0, 0.0)] * len(blocks)
    fits[first] = _self_fit(blocks[first])
    _follow(blocks, fits, range(first + 1, len(blocks)), first)
    _follow(blocks, fits, range(first - 1, -1, -1), first)
    middles = SPACING * (starts + 0.5 * min(WINDOW, len(signal)))
    weights = np.array([fit.score for fit in fits])
    if len(fits) < 5 or (weights > 0).sum() < 5:
        return path
    shifts = np.where(weights > 0, [fit.shift for fit in fits], np.nan)
    shift = smooth(shifts, np.ones(len(shifts)), STEP * SPACING, _WAVELENGTH, usual=ACROSS).values
    along = path.stations - path.start
    ends = np.gradient(shift, middles)
    inside = np.interp(along, middles, shift)
    inside += np.where(along < middles[0], (along - middles[0]) * ends[0], 0.0)
    inside += np.where(along > middles[-1], (along - middles[-1]) * ends[-1], 0.0)
    return path.moved(inside)


def _self_fit(block: Float) -> _Fit:
    """Return the fit of a stretch to itself: the shear under which its rows lie over each other best."""
    return _Fit(0.0, float(_SHEARS[int((block**2).sum(axis=1).argmax())]), 1.0)


def _most_usual(blocks: list[Float]) -> int:
    """Return the stretch that is most like its neighbours: no hatching, no arrows, no bridge above."""
    alike = np.zeros(len(blocks) + 1)
    for number in range(len(blocks) - 1):
        fit = _best(blocks[number + 1], _shift_profile(blocks[number], _self_fit(blocks[number])), 0.0, 2.0 * _REACH)
        alike[number + 1] = fit.score if fit is not None else 0.0
    return int(np.minimum(alike[:-1], alike[1:]).argmax())


def evidence(profiles: Profiles) -> Grid:
    """Return what profiles (S, U) are laid over each other by: paint and edges of the pavement; 0 without points."""
    paint = np.clip(np.nan_to_num(profiles.paint), 0.0, 1.0)
    signal = ndimage.gaussian_filter1d(paint, 1.5, axis=1)
    if profiles.paved is not None:
        paved = ndimage.gaussian_filter(np.nan_to_num(profiles.paved), (1.0, 2.0))
        signal = signal + _EDGE * np.abs(np.gradient(paved, axis=1))
    return np.asarray(signal, dtype=np.float32)


def _shear_profiles(block: Grid) -> Float:
    """Return the mean profile (shears, U) of a stretch (rows, U) under each shear."""
    middle = 0.5 * (len(block) - 1)
    result = np.zeros((len(_SHEARS), block.shape[1]))
    for number, shear in enumerate(_SHEARS):
        for row, values in enumerate(block):
            result[number] += np.roll(values, -round(shear * (row - middle) * SPACING / ACROSS))
    return result / len(block)


def _follow(blocks: list[Float], fits: list[_Fit], order: range, first: int) -> None:
    """Fit stretch after stretch to the template of those before; write the fits in place."""
    if not len(order):
        return
    sign = order.step
    template = _shift_profile(blocks[first], fits[first])
    last, loose = fits[first], _REACH
    distance = 0
    for index in order:
        distance += 1
        expected = last.shift + sign * distance * STEP * SPACING * last.shear
        fit = _best(blocks[index], template, expected, loose)
        if fit is None:
            loose = min(loose + _LOOSE, 3.0 * _REACH)
            continue
        fits[index] = fit
        template = _MEMORY * template + (1.0 - _MEMORY) * _shift_profile(blocks[index], fit)
        last, loose, distance = fit, _REACH, 0


def _shift_profile(block: Float, fit: _Fit) -> Float:
    number = int(np.abs(_SHEARS - fit.shear).argmin())
    return np.roll(block[number], -round(fit.shift / ACROSS))


def _best(block: Float, template: Float, expected: float, reach: float) -> _Fit | None:
    """Return the shift and shear that lay a stretch over a template best; None where it shows nothing alike."""
    bins = int(np.ceil(reach / ACROSS))
    middle = round(expected / ACROSS)
    shifts = np.arange(middle - bins, middle + bins + 1)
    scores = np.array([np.roll(block, -shift, axis=1) @ template for shift in shifts])
    away = (shifts * ACROSS - expected) / reach
    judged = scores - _PRIOR * float(scores.max()) * away[:, None] ** 2
    at, shear = np.unravel_index(int(judged.argmax()), judged.shape)
    size = float(np.sqrt((block[shear] ** 2).sum() * (template**2).sum()))
    if size <= 0.0 or scores[at, shear] < 0.3 * size:
        return None
    return _Fit(float(shifts[at] * ACROSS), float(_SHEARS[shear]), float(scores[at, shear] / size))
