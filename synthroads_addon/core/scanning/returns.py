"""From the rays of a pulse to its returns: echoes closer than the range resolution are one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Echoes:
    """Returns of a block of pulses, ordered by pulse and range.

    Attributes:
        pulse: (N,) index of the pulse.
        ray: (N,) flat index (pulse * K + k) of the ray that carries the most energy of the return.
        range: (N,) mean range of the return's rays, weighted by ``share * reflectance``, m.
        intensity: (N,) sum over the return's rays.
    """

    pulse: NDArray[np.intp]
    ray: NDArray[np.intp]
    range: Float
    intensity: Float


def group_returns(ranges: Float, weights: Float, intensities: Float, resolution: float) -> Echoes:
    """Group the rays of every pulse into returns.

    Sorted by range, a ray that lies farther than ``resolution`` behind the one before begins a new return.

    Args:
        ranges: (P, K) m; inf where a ray hit nothing.
        weights: (P, K) weight of each ray in the mean range.
        intensities: (P, K) intensity that each ray adds.
        resolution: m.
    """
    _pulses, _rays = ranges.shape
    nearest, farthest = ranges.min(axis=1), ranges.max(axis=1)
    with np.errstate(invalid="ignore"):
        single = farthest - nearest <= resolution  # NaN (nothing hit at all) is not single
    mixed = np.flatnonzero(~single & np.isfinite(nearest))
    one = _whole_pulses(np.flatnonzero(single), ranges, weights, intensities)
    several = _split_pulses(mixed, ranges, weights, intensities, resolution)
    merged = [np.concatenate([getattr(one, f), getattr(several, f)]) for f in ("pulse", "ray", "range", "intensity")]
    order = np.lexsort((merged[2], merged[0]))
    return Echoes(*(column[order] for column in merged))


def _whole_pulses(pulse: NDArray[np.intp], ranges: Float, weights: Float, intensities: Float) -> Echoes:
    """Return one echo for each pulse whose rays all hit within the resolution."""
    if ranges.shape[1] == 1:
        return Echoes(pulse, pulse, ranges[pulse, 0], intensities[pulse, 0])
    reference = ranges[pulse].min(axis=1)
    weight = weights[pulse]
    # Averaging differences to the nearest ray keeps the last digits of long ranges.
    mean = reference + np.einsum("pk,pk->p", weight, ranges[pulse] - reference[:, None]) / weight.sum(axis=1)
    energy = intensities[pulse]
    strongest = pulse * ranges.shape[1] + energy.argmax(axis=1)
    return Echoes(pulse, strongest, mean, energy.sum(axis=1))


def _split_pulses(
    pulse: NDArray[np.intp], ranges: Float, weights: Float, intensities: Float, resolution: float
) -> Echoes:
    """Return the echoes of pulses whose rays hit at several ranges, or partly nothing."""
    rays = ranges.shape[1]
    order = np.argsort(ranges[pulse], axis=1, kind="stable")
    flat = (pulse[:, None] * rays + order).ravel()
    distance = ranges.ravel()[flat]
    hit = np.isfinite(distance)
    flat, distance = flat[hit], distance[hit]
    owner = flat // rays
    begins = np.ones(len(flat), dtype=bool)
    begins[1:] = (np.diff(owner) != 0) | (np.diff(distance) > resolution)
    starts = np.flatnonzero(begins)
    if len(starts) == 0:
        nothing = np.empty(0, dtype=np.intp)
        return Echoes(nothing, nothing, np.empty(0), np.empty(0))
    group = np.cumsum(begins) - 1
    weight, energy = weights.ravel()[flat], intensities.ravel()[flat]
    nearest = distance[starts]
    mean = nearest + np.add.reduceat(weight * (distance - nearest[group]), starts) / np.add.reduceat(weight, starts)
    strongest = np.lexsort((-energy, group))[starts]
    return Echoes(owner[starts], flat[strongest], mean, np.add.reduceat(energy, starts))


def number_returns(
    pulse: NDArray[np.intp], maximum: int
) -> tuple[NDArray[np.bool_], NDArray[np.uint8], NDArray[np.uint8]]:
    """Return which echoes are recorded, and for these the return number and the number of returns.

    Args:
        pulse: (N,) pulse of each echo, non-decreasing; within a pulse ordered by range.
        maximum: most returns recorded of one pulse; farther ones are lost.
    """
    begins = np.ones(len(pulse), dtype=bool)
    begins[1:] = np.diff(pulse) != 0
    starts = np.flatnonzero(begins)
    group = np.cumsum(begins) - 1
    number = np.arange(len(pulse)) - starts[group] + 1 if len(pulse) else np.empty(0, dtype=np.intp)
    keep = number <= maximum
    counts = np.minimum(np.bincount(group, minlength=len(starts)), maximum) if len(pulse) else group
    return keep, number[keep].astype(np.uint8), counts[group[keep]].astype(np.uint8)
