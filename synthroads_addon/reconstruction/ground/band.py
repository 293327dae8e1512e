"""The dark band: pavement darker than the ground on both sides of it, and no rougher, where no paint tells more.

In each stretch bands are looked for whose brightness rises at both ends and is even in between; of these the course is
taken that moves least along the road. A street's band ends at the kerbs, not behind lighter footways beside it.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float
from ..profiles import ACROSS, STRETCH, Grid, Profiles, median_profile, remove_grade
from ..smoothing import fill_gaps

_NARROWEST, _WIDEST = 3.0, 12.0
"""Widths of the band, m. Chosen: a lane; three lanes with shoulders."""
_BESIDE = 0.8
"""Width on either side of an edge whose brightness is compared, m. Chosen: a footway is wider."""
_PAINT = 9
"""Widest bright strip that is paint, bins. Chosen: double lines, gutters."""
FULL = 0.15
"""Rise of the brightness' logarithm that counts fully. Chosen: 0.65 dB; more makes no better an edge."""
_UNEVEN = 1.0
"""Weight of the logarithm's deviation within the band. Chosen: a band of two grounds loses more than its edges gain."""
_LEAST = 0.03
"""Score from which on a band counts. Chosen: a fifth of a full one."""
_ROUGHER = 1.3
"""Roughness of the band over the lesser one beside it, at most. Chosen: footways are as smooth as streets."""
_SUNK, _BANK = 0.4, (3, 13)
"""Height of the ground on both sides above the band, m, from which on it is a channel, and the bins beyond its edges in
which. Chosen: twice a high kerb; a metre of bank."""
_SLIP = 0.03
"""Score that a move by a metre from one stretch to the next costs, of each edge. Chosen: a jump of 5 m is no better
than no band."""
_CHOICES = 8
"""Bands of a stretch that a course may go through. Chosen: those of street, footways and gardens."""


@dataclass(frozen=True)
class DarkBand:
    """Edges of the dark band.

    Attributes:
        right, left: (K,) m; NaN where no band is seen.
        score: (K,) how clear it is, 0 to `FULL`.
    """

    right: Float
    left: Float
    score: Float

    @property
    def seen(self) -> float:
        """Return the share of the stretches in which it is seen."""
        return float(np.isfinite(self.right).mean())

    def share(self, profiles: Profiles) -> Grid:
        """Return shares of pavement (S, U): 1 in the band, bridged in gaps, 0 beside; NaN without points."""
        right, left = (
            np.repeat(fill_gaps(edge), STRETCH)[: len(profiles.stations)] for edge in (self.right, self.left)
        )
        inside = (profiles.offsets > right[:, None]) & (profiles.offsets < left[:, None])
        return np.where(np.isfinite(profiles.brightness), inside, np.nan).astype(np.float32)


def find_band(profiles: Profiles) -> DarkBand:
    """Return the dark band along the road that is clearest and moves least."""
    stretches = profiles.stretches
    height = remove_grade(profiles.height)
    step = np.abs(np.diff(height, axis=1, append=np.nan))
    choices = []
    for number in range(stretches):
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.log(median_profile(profiles.brightness, number))
        bands = _bands_of(profiles, level, median_profile(step, number))
        choices.append(_without_channels(profiles, bands, median_profile(height, number)))
    return _course(choices)


def _without_channels(profiles: Profiles, bands: Float, height: Float) -> Float:
    """Return the bands (C, 3) of a profile of heights (U,), m, that don't lie deep between banks, as water does."""
    keep = np.ones(len(bands), dtype=bool)
    for row, (right, left, _) in enumerate(bands):
        first, last = profiles.column(right), profiles.column(left)
        parts = (
            height[first:last],
            height[max(0, first - _BANK[1]) : max(0, first - _BANK[0])],
            height[last + _BANK[0] : last + _BANK[1]],
        )
        band, *banks = (
            float(np.median(part[np.isfinite(part)])) if np.isfinite(part).any() else np.nan for part in parts
        )
        keep[row] = not min(banks) - band > _SUNK
    return bands[keep]


def _bands_of(profiles: Profiles, level: Float, rough: Float) -> Float:
    """Return right edge, left edge (m) and score (C, 3) of the best bands in a profile's brightness' logarithm (U,)."""
    known = np.isfinite(level)
    if known.sum() < round(_NARROWEST / ACROSS):
        return np.empty((0, 3))
    even = ndimage.median_filter(fill_gaps(np.where(known, level, np.nan)), _PAINT)
    width, reach = len(even), round(_BESIDE / ACROSS)
    total, square, seen = (np.append(0.0, np.cumsum(values)) for values in (even, even**2, known.astype(np.float64)))
    roughness = np.append(0.0, np.cumsum(np.where(np.isfinite(rough), rough, 0.0)))
    rough_seen = np.append(0.0, np.cumsum(np.isfinite(rough).astype(np.float64)))
    # Edge i lies before bin i: the means of the bins before and behind it.
    edges = np.arange(reach, width - reach + 1)
    before, behind = (total[edges] - total[edges - reach]) / reach, (total[edges + reach] - total[edges]) / reach
    seen_before, seen_behind = seen[edges] - seen[edges - reach], seen[edges + reach] - seen[edges]
    is_seen = (2 * seen_before >= reach) & (2 * seen_behind >= reach)
    fall, rise = (np.where(is_seen, sign * (behind - before), -np.inf) for sign in (-1.0, 1.0))
    rights, lefts = (edges[_peaks(gain)] for gain in (fall, rise))
    result = []
    for first in rights:
        for last in lefts:
            size = last - first
            if not _NARROWEST <= size * ACROSS <= _WIDEST:
                continue
            # The blur at both ends is no unevenness of the band.
            inner_first, inner_last = first + 3, last - 3
            count = inner_last - inner_first
            mean = (total[inner_last] - total[inner_first]) / count
            deviation = np.sqrt(max((square[inner_last] - square[inner_first]) / count - mean**2, 0.0))
            clear = min(fall[first - reach], rise[last - reach], FULL)
            score = clear - _UNEVEN * deviation
            inside = _mean(roughness, rough_seen, first, last)
            beside = min(
                _mean(roughness, rough_seen, first - reach, first), _mean(roughness, rough_seen, last, last + reach)
            )
            if score > _LEAST and not inside > _ROUGHER * beside:
                result.append(
                    (profiles.offsets[first] - 0.5 * ACROSS, profiles.offsets[last - 1] + 0.5 * ACROSS, score)
                )
    return np.array(sorted(result, key=lambda row: -row[2])[:_CHOICES]).reshape(-1, 3)


def _peaks(gain: Float) -> Bool:
    """Return a mask (E,) of the places where a rise of brightness is largest within some bins, and not just noise."""
    return (gain >= ndimage.maximum_filter1d(gain, 5)) & (gain > _LEAST)


def _mean(total: Float, count: Float, first: int, last: int) -> float:
    """Return the mean of bins from cumulative sums and counts (U + 1,); NaN where few are known."""
    known = count[last] - count[first]
    return float((total[last] - total[first]) / known) if known >= 3 else np.nan


def _course(choices: list[Float]) -> DarkBand:
    """Return the bands of the course through stretches' choices (C, 3) that has the largest score (Viterbi 1967)."""
    # The last state of each stretch is: no band is seen. Its edges are those of where the course comes from.
    states = [np.vstack([choice, [np.nan, np.nan, 0.0]]) for choice in choices]
    best, links, places = states[0][:, 2], [], states[0][:, :2]
    for state in states[1:]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            move = np.abs(state[:, None, :2] - places[None]).sum(axis=2)
        gain = best[None] - _SLIP * np.where(np.isfinite(move), move, 0.0)
        link = gain.argmax(axis=1)
        links.append(link)
        best = gain.max(axis=1) + state[:, 2]
        places = np.where(np.isfinite(state[:, :2]), state[:, :2], places[link])
    index = int(best.argmax())
    path = [index]
    for link in reversed(links):
        index = int(link[index])
        path.append(index)
    rows = np.array([state[one] for state, one in zip(states, reversed(path), strict=True)])
    return DarkBand(rows[:, 0], rows[:, 1], rows[:, 2])
