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


def group_returns(first_signals: HitSignals, late_signals: HitSignals, pulse: Index, resolution: float) -> Echoes:
    """Return the echoes of pulses: hits of one pulse merge where no gap in range exceeds the resolution (m).

    Sorted by range, a hit that lies farther than ``resolution`` behind the one before begins a new return. A return's
    range is the mean of its hits by weight, so that the mean over all returns by their summed weights is the mean over
    the footprint.

    Args:
        first_signals: (K, P) of what K rays of P pulses meet first.
        late_signals: (B,) of what lies behind permeable surfaces.
        pulse: (B,) pulses of these.
        resolution: m.
    """
    nearest_range, farthest_range = first_signals.distance.min(axis=0), first_signals.distance.max(axis=0)
    # All rays of a single pulse hit within the resolution; of a split pulse some do, and the rest hits elsewhere.
    is_single = (farthest_range <= nearest_range + resolution) & (farthest_range < np.inf)
    is_split = ~is_single & (nearest_range < np.inf)
    if len(pulse):
        is_single[pulse] = False
        is_split[pulse] = True
    single_echoes = _whole_pulses(np.flatnonzero(is_single), np.where(is_single, nearest_range, 0.0), first_signals)
    split_pulses = np.flatnonzero(is_split)
    if not len(split_pulses):
        return single_echoes
    return merge_echoes(single_echoes, _split_pulses(split_pulses, first_signals, late_signals, pulse, resolution))


def _whole_pulses(pulse: Index, nearest_range: Float, first_signals: HitSignals) -> Echoes:
    """Return one echo for each of the pulses whose rays all hit within the resolution.

    Args:
        pulse: (M,) these pulses.
        nearest_range: (P,) range of the nearest hit of each of these, m; 0 for other pulses.
        first_signals: (K, P) signals of what the rays of all P pulses meet first.
    """
    rays, pulses = first_signals.distance.shape
    if rays == 1:
        columns = (
            np.take(array[0], pulse)
            for array in (first_signals.distance, first_signals.intensity, first_signals.weight)
        )
        return Echoes(pulse, pulse, *columns)
    # Worked out for all pulses and then taken of these, as most pulses are among them. Differences to the nearest hit
    # keep the last digits.
    weighted_depth = first_signals.distance - nearest_range
    with np.errstate(invalid="ignore"):
        weighted_depth *= first_signals.weight
        total_weight = first_signals.weight.sum(axis=0)
        mean_range = nearest_range + weighted_depth.sum(axis=0) / total_weight
    energy = first_signals.intensity.sum(axis=0)
    strongest_ray = _brightest_ray(first_signals.intensity)
    columns = (np.take(array, pulse) for array in (mean_range, energy, total_weight))
    return Echoes(pulse, np.take(strongest_ray, pulse) * pulses + pulse, *columns)


def _brightest_ray(energy: Float) -> Index:
    """Return the index (P,) of each pulse's ray with the most energy (K, P), the first of equals."""
    largest_energy, result = energy[0].copy(), np.zeros(energy.shape[1], dtype=np.intp)
    for ray, row in enumerate(energy[1:], 1):
        np.copyto(result, ray, where=row > largest_energy)
        np.maximum(largest_energy, row, out=largest_energy)
    return result


def _split_pulses(
    split_pulses: Index, first_signals: HitSignals, late_signals: HitSignals, pulse: Index, resolution: float
) -> Echoes:
    """Return the echoes of pulses that meet surfaces at several ranges, or partly nothing, or something behind.

    Args:
        split_pulses: (M,) these pulses.
        first_signals: (K, P) signals of what K rays of P pulses meet first.
        late_signals: (B,) signals of what lies behind permeable surfaces.
        pulse: (B,) pulses of these; all are among ``split_pulses``.
        resolution: gap in range from which on a hit begins a new echo, m.
    """
    rays, pulses = first_signals.distance.shape
    ranges = np.take(first_signals.distance, split_pulses, axis=1)
    ray, column = np.nonzero(ranges < np.inf)
    # All hits of these pulses in one row: numbers as in `Echoes.hit`, pulses that they belong to, and ranges.
    hits = np.concatenate([ray * pulses + split_pulses[column], rays * pulses + np.arange(len(pulse))])
    owners = np.concatenate([split_pulses[column], pulse])
    hit_ranges = np.concatenate([ranges[ray, column], late_signals.distance])
    # Sorted by pulse, then by range. One key for both: ranges of some kilometres keep a micrometre beside the pulses of
    # a block.
    key_step = 2.0 * max(1.0, float(hit_ranges.max()))
    order = np.argsort(owners * key_step + hit_ranges, kind="stable")
    hits, owners, hit_ranges = hits[order], owners[order], hit_ranges[order]
    begins_echo = np.ones(len(hits), dtype=bool)
    begins_echo[1:] = (owners[1:] != owners[:-1]) | (np.diff(hit_ranges) > resolution)
    starts = np.flatnonzero(begins_echo)
    echo_of_hit = np.cumsum(begins_echo) - 1
    weight = _values_of_hits(first_signals.weight, late_signals.weight, hits)
    energy = _values_of_hits(first_signals.intensity, late_signals.intensity, hits)
    echo_begin, total_weight = hit_ranges[starts], np.add.reduceat(weight, starts)
    # Mean range by weight, as the mean difference to the echo's nearest hit: that keeps the last digits.
    depth = np.add.reduceat(weight * (hit_ranges - echo_begin[echo_of_hit]), starts) / total_weight
    strongest = hits[_strongest(energy, echo_of_hit, starts)]
    total_energy = np.add.reduceat(energy, starts)
    return Echoes(owners[starts], strongest, echo_begin + depth, total_energy, total_weight)


def _values_of_hits(first_values: Float, late_values: Float, hit_numbers: Index) -> Float:
    """Return values (N,) by hit numbers as in `Echoes.hit`: of first hits (K, P), or of those behind (B,)."""
    result = np.take(first_values.ravel(), hit_numbers, mode="clip")
    rows_behind = np.flatnonzero(hit_numbers >= first_values.size)
    result[rows_behind] = late_values[hit_numbers[rows_behind] - first_values.size]
    return np.asarray(result)


def _strongest(energy: Float, group: Index, starts: Index) -> Index:
    """Return the index (G,) of the member with the most energy of each group, the first of equals.

    Args:
        energy: (N,) of the members, group by group.
        group: (N,) that each is in.
        starts: (G,) indices of the groups' first members.
    """
    brightest = np.flatnonzero(energy == np.maximum.reduceat(energy, starts)[group])
    groups = group[brightest]
    is_first = np.ones(len(groups), dtype=bool)
    is_first[1:] = groups[1:] != groups[:-1]
    return np.asarray(brightest[is_first])


def merge_echoes(echoes: Echoes, other_echoes: Echoes) -> Echoes:
    """Return two sets of echoes as one, in the order of pulses; no pulse may be in both."""
    joined_echoes = Echoes.join([echoes, other_echoes])
    return joined_echoes.select(np.argsort(joined_echoes.pulse, kind="stable"))


def number_returns(pulse: Index, maximum: int) -> tuple[Bool, UInt8, UInt8]:
    """Return a mask (N,) of the echoes that are recorded, and for these (R,) the return number and number of returns.

    Args:
        pulse: (N,) pulse of each echo, non-decreasing; within a pulse echoes are ordered by range.
        maximum: most returns recorded of one pulse; farther ones are lost.
    """
    if not len(pulse):
        return np.empty(0, dtype=bool), np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.uint8)
    begins_pulse = np.ones(len(pulse), dtype=bool)
    begins_pulse[1:] = pulse[1:] != pulse[:-1]
    starts = np.flatnonzero(begins_pulse)
    if len(starts) == len(pulse):  # each echo is the only one of its pulse: the mask is all true
        first_numbers = np.ones(len(pulse), dtype=np.uint8)
        return begins_pulse, first_numbers, first_numbers
    echo_count = np.diff(starts, append=len(pulse))  # of each pulse
    number = np.arange(len(pulse)) - np.repeat(starts, echo_count) + 1
    recorded_mask = number <= maximum
    returns = np.repeat(np.minimum(echo_count, maximum), echo_count)
    return recorded_mask, number[recorded_mask].astype(np.uint8), returns[recorded_mask].astype(np.uint8)
