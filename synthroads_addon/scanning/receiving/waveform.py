"""Echoes that a pulse can't part: the sum of two Gaussian pulses has two peaks or one.

Two echoes of the powers a and b, a distance d apart along the beam, of pulses with the rms length p, have one peak
together if the absolute value of ln(a / b) is at least

    2 D sqrt(D^2 - 1) - 2 ln(D + sqrt(D^2 - 1)),   D = d / (2 p),

and in any case while D is at most 1 (Behboodian 1970, On the modes of a mixture of two normal distributions,
Technometrics 12). Such echoes are one return at the range of that peak: points that trail between an edge and what is
behind it. The peak is found by the fixed point r = sum of w r / sum of w with the weights w = a exp(-(r - r_a)^2 /
(2 p^2)), which climbs from the stronger echo.
"""

import numpy as np

from ...base.arrays import Bool, Float, Index
from ..returns import Echoes

FULL_WIDTH = 2.0 * np.sqrt(2.0 * np.log(2.0))
"""Full width at half height of a Gaussian over its rms width."""
_STEPS = 60
_NEAR_PEAK = 1e-6
"""Step of the fixed point that is its last, in rms lengths of the pulse."""
_MOST_MERGED = 8
"""Echoes that one return is made of, at most."""


def have_one_peak(ratio: Float, separation: Float) -> Bool:
    """Return a mask (N,) of the pairs of pulses that have one peak together: Behboodian's condition above.

    Args:
        ratio: (N,) logarithm of the powers' ratio.
        separation: (N,) of the pulses, in rms lengths.
    """
    half_separation = np.maximum(separation / 2.0, 1.0)
    root = np.sqrt(half_separation**2 - 1.0)
    return np.asarray(np.abs(ratio) >= 2.0 * half_separation * root - 2.0 * np.log(half_separation + root))


def merge_peaks(echoes: Echoes, resolution: float) -> Echoes:
    """Return the echoes of a block with those as one that have one peak together.

    Args:
        echoes: a block's, ordered by pulse and range.
        resolution: full width at half height of the pulse as a range, m.
    """
    length = resolution / FULL_WIDTH
    for _ in range(_MOST_MERGED - 1):
        front_echoes = _pairs_with_one_peak(echoes, length)
        if not len(front_echoes):
            break
        echoes = _merge_pairs(echoes, front_echoes, length)
    return echoes


def _pairs_with_one_peak(echoes: Echoes, length: float) -> Index:
    """Return the front echo of each two neighbours that have one peak together; no echo is in two of the pairs.

    Args:
        echoes: of a block, ordered by pulse and range.
        length: rms length of a pulse, m.
    """
    pulse, power = echoes.pulse, np.maximum(echoes.intensity, 1e-300)
    # Beyond 40 lengths no ratio of powers that numbers can have makes one peak of two.
    candidates = np.flatnonzero((pulse[1:] == pulse[:-1]) & (np.diff(echoes.range) < 40.0 * length))
    separation = (echoes.range[candidates + 1] - echoes.range[candidates]) / length
    log_ratio = np.log(power[candidates] / power[candidates + 1])
    front = candidates[have_one_peak(log_ratio, separation)]
    # Of a chain of pairs every second one, beginning with its first.
    begins_chain = np.ones(len(front), dtype=bool)
    begins_chain[1:] = np.diff(front) > 1
    chain_starts = np.flatnonzero(begins_chain)
    place_in_chain = np.arange(len(front)) - chain_starts[np.cumsum(begins_chain) - 1]
    return np.asarray(front[place_in_chain % 2 == 0])


def _merge_pairs(echoes: Echoes, front_index: Index, length: float) -> Echoes:
    """Return echoes in which pairs of neighbours are one echo each, at the peak of their sum.

    Args:
        echoes: of a block, ordered by pulse and range.
        front_index: (N,) the front echo of each pair, ascending; the rear one follows it.
        length: rms length of a pulse, m.
    """
    front, rear = echoes.select(front_index), echoes.select(front_index + 1)
    shift, power = peak_of(front.intensity, rear.intensity, rear.range - front.range, length)
    rear_is_stronger = rear.intensity > front.intensity
    keep_mask = np.ones(len(echoes.pulse), dtype=bool)
    keep_mask[front_index + 1] = False
    result = echoes.select(keep_mask)
    # With the rear echoes gone, each front echo lies farther ahead by the number of pairs before it.
    place = front_index - np.arange(len(front_index))
    result.hit[place] = np.where(rear_is_stronger, rear.hit, front.hit)
    result.range[place] = front.range + shift
    result.intensity[place] = power
    result.weight[place] = front.weight + rear.weight
    return result


def peak_of(front_power: Float, rear_power: Float, separation: Float, length: float) -> tuple[Float, Float]:
    """Return where (N,) behind the front pulse the sum of two pulses peaks, m, and how high.

    Args:
        front_power, rear_power: (N,).
        separation: (N,) m.
        length: rms length of a pulse, m.
    """
    scale = 0.5 / length**2

    def weights(place: Float, pair: Index | slice) -> tuple[Float, Float]:
        """Return the powers of both pulses of pairs at places behind the front one, m."""
        behind_rear = place - separation[pair]
        return front_power[pair] * np.exp(-scale * place**2), rear_power[pair] * np.exp(-scale * behind_rear**2)

    # The fixed point of the module's formula, from the stronger pulse; `climbing` are the pairs that still move.
    place, climbing = np.where(rear_power > front_power, separation, 0.0), np.arange(len(front_power))
    for _ in range(_STEPS):
        if not len(climbing):
            break
        old_place = place[climbing]
        front_weight, rear_weight = weights(old_place, climbing)
        total_weight = np.maximum(front_weight + rear_weight, 1e-300)
        new_place = separation[climbing] * rear_weight / total_weight
        place[climbing] = new_place
        climbing = climbing[np.abs(new_place - old_place) > _NEAR_PEAK * length]
    front_weight, rear_weight = weights(place, slice(None))
    return place, front_weight + rear_weight
