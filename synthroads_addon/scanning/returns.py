"""From the surfaces that the rays of a pulse meet to its returns: echoes closer than the range resolution are one."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import ArrayRows, Bool, Float, Index, UInt8

LEAST_REFLECTANCE = 1e-6
"""Least reflectance that a hit has in a return's mean range, so that black surfaces have a range as well."""


@dataclass(frozen=True)
class Echoes(ArrayRows):
    """Returns of a block of pulses, ordered by pulse and range.

    Attributes:
        pulse: (N,) index of the pulse.
        hit: (N,) the hit that carries the most energy of the return: k * P + p for ray k of pulse p, and K * P + b for
            the b-th hit behind a permeable surface.
        range: (N,) mean range of the return's hits by their weights, m.
        intensity: (N,) sum over the return's hits.
        weight: (N,) likewise.
    """

    pulse: Index
    hit: Index
    range: Float
    intensity: Float
    weight: Float


@dataclass(frozen=True)
class HitSignals(ArrayRows):
    """Signals that single hits send back, before they are grouped into returns; all arrays have one shape.

    Attributes:
        distance: m; inf where nothing is hit.
        weight: in the mean range, positive.
        intensity: of each hit.
    """

    distance: Float
    weight: Float
    intensity: Float


BothSignals = tuple[HitSignals, HitSignals]
"""Signals of what rays meet first, and of what they meet behind permeable surfaces."""


def group_returns(first: HitSignals, behind: HitSignals, pulse: Index, resolution: float) -> Echoes:
    """Return the echoes of pulses: hits of one pulse merge where no gap in range exceeds the resolution (m).

    Sorted by range, a hit that lies farther than ``resolution`` behind the one before begins a new return. A return's
    range is the mean of its hits by weight, so that the mean over all returns by their summed weights is the mean over
    the footprint.

    Args:
        first: (K, P) of what K rays of P pulses meet first.
        behind: (B,) of what lies behind permeable surfaces.
        pulse: (B,) pulses of these.
        resolution: m.
    """
    nearest, farthest = first.distance.min(axis=0), first.distance.max(axis=0)
    single = (farthest <= nearest + resolution) & (farthest < np.inf)
    mixed = ~single & (nearest < np.inf)
    if len(pulse):
        single[pulse] = False
        mixed[pulse] = True
    one = _whole_pulses(np.flatnonzero(single), np.where(single, nearest, 0.0), first)
    chosen = np.flatnonzero(mixed)
    if not len(chosen):
        return one
    return merge_echoes(one, _split_pulses(chosen, first, behind, pulse, resolution))


def _whole_pulses(pulse: Index, nearest: Float, first: HitSignals) -> Echoes:
    """Return one echo for each of the pulses whose rays all hit within the resolution."""
    rays, pulses = first.distance.shape
    if rays == 1:
        columns = (np.take(array[0], pulse) for array in (first.distance, first.intensity, first.weight))
        return Echoes(pulse, pulse, *columns)
    # Worked out for all pulses and taken of these: most are. Differences to the nearest keep the last digits.
    near = first.distance - nearest
    with np.errstate(invalid="ignore"):
        near *= first.weight
        total = first.weight.sum(axis=0)
        mean = nearest + near.sum(axis=0) / total
    energy = first.intensity.sum(axis=0)
    strongest = _brightest_ray(first.intensity)
    columns = (np.take(array, pulse) for array in (mean, energy, total))
    return Echoes(pulse, np.take(strongest, pulse) * pulses + pulse, *columns)


def _brightest_ray(energy: Float) -> Index:
    """Return the index (P,) of each pulse's ray with the most energy (K, P), the first of equals."""
    most, result = energy[0].copy(), np.zeros(energy.shape[1], dtype=np.intp)
    for ray, row in enumerate(energy[1:], 1):
        np.copyto(result, ray, where=row > most)
        np.maximum(most, row, out=most)
    return result


def _split_pulses(chosen: Index, first: HitSignals, behind: HitSignals, pulse: Index, resolution: float) -> Echoes:
    """Return the echoes of pulses that meet surfaces at several ranges, or partly nothing, or something behind."""
    rays, pulses = first.distance.shape
    near = np.take(first.distance, chosen, axis=1)
    ray, column = np.nonzero(near < np.inf)
    hit = np.concatenate([ray * pulses + chosen[column], rays * pulses + np.arange(len(pulse))])
    owner = np.concatenate([chosen[column], pulse])
    reach = np.concatenate([near[ray, column], behind.distance])
    # One key for both: ranges of some kilometres keep a micrometre beside the pulses of a block.
    order = np.argsort(owner * (2.0 * max(1.0, float(reach.max()))) + reach, kind="stable")
    hit, owner, reach = hit[order], owner[order], reach[order]
    begins = np.ones(len(hit), dtype=bool)
    begins[1:] = (owner[1:] != owner[:-1]) | (np.diff(reach) > resolution)
    starts = np.flatnonzero(begins)
    group = np.cumsum(begins) - 1
    share = _values_of_hits(first.weight, behind.weight, hit)
    energy = _values_of_hits(first.intensity, behind.intensity, hit)
    begin, total = reach[starts], np.add.reduceat(share, starts)
    mean = begin + np.add.reduceat(share * (reach - begin[group]), starts) / total
    strongest = hit[_strongest(energy, group, starts)]
    return Echoes(owner[starts], strongest, mean, np.add.reduceat(energy, starts), total)


def _values_of_hits(first: Float, behind: Float, hit: Index) -> Float:
    """Return the values of hits, of the first ones (K, P) or of those behind (B,), by numbers as `Echoes.hit`."""
    result = np.take(first.ravel(), hit, mode="clip")
    late = np.flatnonzero(hit >= first.size)
    result[late] = behind[hit[late] - first.size]
    return np.asarray(result)


def _strongest(energy: Float, group: Index, starts: Index) -> Index:
    """Return the index of each group's member with the most energy, the first of equals."""
    brightest = np.flatnonzero(energy == np.maximum.reduceat(energy, starts)[group])
    owner = group[brightest]
    first = np.ones(len(owner), dtype=bool)
    first[1:] = owner[1:] != owner[:-1]
    return np.asarray(brightest[first])


def merge_echoes(one: Echoes, several: Echoes) -> Echoes:
    """Return two sets of echoes joined, in the order of pulses; no pulse is in both."""
    echoes = Echoes.join([one, several])
    return echoes.select(np.argsort(echoes.pulse, kind="stable"))


def number_returns(pulse: Index, maximum: int) -> tuple[Bool, UInt8, UInt8]:
    """Return a mask (N,) of the echoes that are recorded, and for these the return number and number of returns.

    Args:
        pulse: (N,) pulse of each echo, non-decreasing; within a pulse ordered by range.
        maximum: most returns recorded of one pulse; farther ones are lost.
    """
    if not len(pulse):
        return np.empty(0, dtype=bool), np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.uint8)
    begins = np.ones(len(pulse), dtype=bool)
    begins[1:] = pulse[1:] != pulse[:-1]
    starts = np.flatnonzero(begins)
    if len(starts) == len(pulse):
        ones = np.ones(len(pulse), dtype=np.uint8)
        return begins, ones, ones
    length = np.diff(starts, append=len(pulse))
    number = np.arange(len(pulse)) - np.repeat(starts, length) + 1
    keep = number <= maximum
    counts = np.repeat(np.minimum(length, maximum), length)
    return keep, number[keep].astype(np.uint8), counts[keep].astype(np.uint8)
