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
    """Return whether two pulses have one peak together.

    Args:
        ratio: (N,) logarithm of the powers' ratio.
        separation: (N,) of the pulses, in rms lengths.
    """
    half = np.maximum(separation / 2.0, 1.0)
    root = np.sqrt(half**2 - 1.0)
    return np.asarray(np.abs(ratio) >= 2.0 * half * root - 2.0 * np.log(half + root))


def merge_peaks(echoes: Echoes, resolution: float) -> Echoes:
    """Return the echoes of pulses (ordered by pulse and range) with those as one that have one peak together.

    Args:
        echoes: a block's.
        resolution: full width at half height of the pulse as a range, m.
    """
    length = resolution / FULL_WIDTH
    for _ in range(_MOST_MERGED - 1):
        first = _unparted(echoes, length)
        if not len(first):
            break
        echoes = _merged(echoes, first, length)
    return echoes


def _unparted(echoes: Echoes, length: float) -> Index:
    """Return the first of each two neighbours that have one peak together; no echo is in two of the pairs."""
    pulse, power = echoes.pulse, np.maximum(echoes.intensity, 1e-300)
    near = np.flatnonzero((pulse[1:] == pulse[:-1]) & (np.diff(echoes.range) < 40.0 * length))
    distance = (echoes.range[near + 1] - echoes.range[near]) / length
    together = have_one_peak(np.log(power[near] / power[near + 1]), distance)
    first = near[together]
    # Of a chain of pairs every second one, beginning with its first.
    begins = np.ones(len(first), dtype=bool)
    begins[1:] = np.diff(first) > 1
    starts = np.flatnonzero(begins)
    place = np.arange(len(first)) - starts[np.cumsum(begins) - 1]
    return np.asarray(first[place % 2 == 0])


def _merged(echoes: Echoes, first: Index, length: float) -> Echoes:
    """Return the echoes with each of the chosen (N,) and the one behind it as one."""
    near, far = echoes.select(first), echoes.select(first + 1)
    shift, power = peak_of(near.intensity, far.intensity, far.range - near.range, length)
    stronger = far.intensity > near.intensity
    others = np.ones(len(echoes.pulse), dtype=bool)
    others[first + 1] = False
    result = echoes.select(others)
    # Where what was behind them is gone, each lies farther ahead by the number of pairs before it.
    place = first - np.arange(len(first))
    result.hit[place] = np.where(stronger, far.hit, near.hit)
    result.range[place] = near.range + shift
    result.intensity[place] = power
    result.weight[place] = near.weight + far.weight
    return result


def peak_of(near: Float, far: Float, separation: Float, length: float) -> tuple[Float, Float]:
    """Return where (N,) behind the near pulse the sum of two pulses peaks, m, and how high.

    Args:
        near, far: (N,) powers.
        separation: (N,) m.
        length: rms length of a pulse, m.
    """
    scale = 0.5 / length**2

    def weights(place: Float, pair: Index | slice) -> tuple[Float, Float]:
        behind = place - separation[pair]
        return near[pair] * np.exp(-scale * place**2), far[pair] * np.exp(-scale * behind**2)

    place, climbing = np.where(far > near, separation, 0.0), np.arange(len(near))
    for _ in range(_STEPS):
        if not len(climbing):
            break
        before = place[climbing]
        one, other = weights(before, climbing)
        after = separation[climbing] * other / np.maximum(one + other, 1e-300)
        place[climbing] = after
        climbing = climbing[np.abs(after - before) > _NEAR_PEAK * length]
    one, other = weights(place, slice(None))
    return place, one + other
