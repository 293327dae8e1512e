"""Strips of a cloud without times: how pairs of points lie, and differ, says how many there are and what parts them.

Within a strip points keep a distance; those of different strips know nothing of each other. So of S strips, as dense as
each other, the pair correlation (Ripley 1977, Modelling spatial patterns, J. R. Stat. Soc. B 39), the number of pairs
at a distance over that of points at random, is 1 - 1 / S at short distances: all of these pairs are of two strips. At
any distance d a share

    c(d) = (1 - 1 / S) / pair correlation(d)

of the pairs is. The semivariance of the brightness then is

    g(d) = noise + slope d + c(d) G^2 / 2

with the root mean square G of the gain's step between two strips, and the surface's own variation within the half metre
that is looked at, taken as even. The three follow by least squares; so do the parts of the covariance of height and
brightness, of which the first is that of single echoes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..base.arrays import AnyArray, Float, Index

_BINS, _REACH = 22, 2.2
"""Bins of the distance, up to so many times the points' usual distance."""
_SHORT = 0.4
"""Distances below this share of it are of pairs of different strips alone."""
_AT_RANDOM = 0.82
"""Points whose pair correlation at short distances is above this lie at random, or in more strips than can be told."""
_MOST_SQUARES = 1500
_PARTS = 3


@dataclass(frozen=True)
class StripPairs:
    """Strips as pairs of points tell them.

    Attributes:
        strips: how many overlap.
        gain_step: root mean square of the gain's step between two, dB.
        noise: variance of single echoes' brightness, dB^2.
        covariance: of single echoes' height and brightness, m dB.
    """

    strips: int
    gain_step: float
    noise: float
    covariance: float


def strip_pairs(place: Float, owner: Index, height: Float, level: Float, edge: float) -> StripPairs | None:
    """Return what pairs of points within squares say about strips; None where points lie at random.

    Args:
        place: (N, 2) m.
        owner: (N,) square of each point, non-decreasing.
        height: (N,) over the square's surface, m.
        level: (N,) brightness, dB.
        edge: of the squares, which are aligned with the axes, m.
    """
    rows, count = _whole_squares(place, owner, edge)
    if not len(rows):
        return None
    place, owner, height, level = place[rows], owner[rows], height[rows], level[rows]
    usual = edge / np.sqrt(count.mean())
    # Squares are drawn apart, so that no pair is of two of them.
    number = np.cumsum(np.diff(owner, prepend=owner[0]) != 0)
    apart = np.column_stack([place % edge, number * 2.0 * edge])
    one, other = cKDTree(apart).query_pairs(_REACH * usual, output_type="ndarray").T
    distance = np.linalg.norm(apart[one] - apart[other], axis=1)
    edges = np.linspace(0.0, _REACH * usual, _BINS + 1)
    which = np.minimum((distance / edges[1]).astype(np.intp), _BINS - 1)
    pairs = np.bincount(which, minlength=_BINS)
    correlation = pairs / np.maximum(_pairs_at_random(edges / edge) * np.sum(count * (count - 1.0) / 2.0), 1e-9)
    middle = (edges[1:] + edges[:-1]) / 2.0
    short = middle < _SHORT * usual
    nearest = float(pairs[short].sum() / (pairs[short] / np.maximum(correlation[short], 1e-9)).sum())
    if not pairs[short].any() or nearest > _AT_RANDOM:
        return None
    strips = max(round(1.0 / (1.0 - nearest)), 1)
    mixed = np.minimum((1.0 - 1.0 / strips) / np.maximum(correlation, 1e-9), 1.0)
    bright, high = level[one] - level[other], height[one] - height[other]
    terms = np.column_stack([np.ones(_BINS), mixed, middle])
    if strips == 1:
        terms[:, 1] = 0.0
    differ, together = (np.bincount(which, 0.5 * values, _BINS) for values in (bright**2, bright * high))
    # A surface isn't less alike nearby than farther off.
    used = 3 if _least_squares(terms, differ, pairs)[2] > 0.0 else 2
    semivariance, covariance = (_least_squares(terms[:, :used], sums, pairs) for sums in (differ, together))
    step = float(np.sqrt(max(2.0 * semivariance[1], 0.0)))
    return StripPairs(strips, step, max(float(semivariance[0]), 0.0), float(covariance[0]))


def _whole_squares(place: Float, owner: Index, edge: float) -> tuple[Index, Float]:
    """Return the points (N,) of squares that points fill, and how many each holds: at most `_MOST_SQUARES`, spread."""
    part = np.minimum((place % edge / edge * _PARTS).astype(np.int64), _PARTS - 1)
    filled = np.zeros((int(owner.max()) + 1, _PARTS**2), dtype=bool)
    filled[owner, part[:, 0] * _PARTS + part[:, 1]] = True
    whole = np.flatnonzero(filled.all(axis=1))
    whole = whole[:: max(len(whole) // _MOST_SQUARES, 1)]
    rows = np.flatnonzero(np.isin(owner, whole))
    return rows, np.unique(owner[rows], return_counts=True)[1].astype(np.float64)


def _pairs_at_random(edges: Float) -> Float:
    """Return the share (K,) of a unit square's pairs of random points whose distance lies between edges (K + 1,)."""
    cumulative = np.pi * edges**2 - 8.0 / 3.0 * edges**3 + edges**4 / 2.0
    return np.asarray(np.diff(cumulative))


def _least_squares(terms: Float, sums: AnyArray, pairs: Index) -> Float:
    """Return the coefficients of terms (K, T) that fit the means of K bins, each as sure as it has pairs."""
    weight = np.sqrt(pairs)
    mean = sums / np.maximum(pairs, 1)
    return np.asarray(np.linalg.lstsq(terms * weight[:, None], mean * weight, rcond=None)[0])
