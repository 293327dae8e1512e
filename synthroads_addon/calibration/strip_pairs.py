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

_BINS = 22
"""Bins of the distance. Chosen: a tenth of the points' spacing each, so that the nearest pairs fill several."""
_REACH = 2.2
"""Longest distance of a pair, in spacings of the points. Chosen: the second row of points lies within it."""
_SHORT = 0.4
"""Longest distance, in spacings, at which pairs are of two strips alone. Chosen: points of one strip keep farther
off."""
_RANDOM = 0.82
"""Largest pair correlation at short distances that is read as strips. Chosen: 1 - 1 / S of 5.6 strips; points at random
have 1, and many strips come near to that."""
_MOST_SQUARES = 1500
"""Squares that are looked at. Chosen: bounds the pairs, and so the work, of a large cloud."""
_PARTS = 3
"""Parts along each edge of a square, all of which must hold points. Chosen: a square cut by the road's edge has fewer,
and the pairs at random of a whole square would be too many for it."""


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
    pairs = _pairs_of(place[rows], owner[rows], edge, count)
    is_short = pairs.d < _SHORT * pairs.spacing
    if not pairs.count[is_short].any():
        return None
    # Pairs found over pairs expected, both summed over the short distances: 1 - 1 / S.
    g_short = float(pairs.count[is_short].sum() / (pairs.count[is_short] / np.maximum(pairs.g[is_short], 1e-9)).sum())
    if g_short > _RANDOM:
        return None
    strips = max(round(1.0 / (1.0 - g_short)), 1)
    semivariance, covariance = _variogram_fits(pairs, height[rows], level[rows], 1.0 - 1.0 / strips)
    # The model's coefficient of c(d) is G^2 / 2.
    gain_step = float(np.sqrt(max(2.0 * semivariance[1], 0.0)))
    return StripPairs(strips, gain_step, max(float(semivariance[0]), 0.0), float(covariance[0]))


@dataclass(frozen=True)
class _Pairs:
    """Pairs (P,) of points within squares, and their distances in bins (K,).

    Attributes:
        i, j: (P,) the points of each pair.
        nth: (P,) bin of its distance.
        count: (K,) pairs.
        d: (K,) distance in the middle of each bin, m.
        g: (K,) pair correlation.
        spacing: of the points, m.
    """

    i: Index
    j: Index
    nth: Index
    count: Index
    d: Float
    g: Float
    spacing: float


def _pairs_of(place: Float, owner: Index, edge: float, points: Float) -> _Pairs:
    """Return the pairs of points within the same square, and their pair correlation.

    Args:
        place: (N, 2) m.
        owner: (N,) square of each point, non-decreasing.
        edge: of the squares, m.
        points: (Q,) in each square.
    """
    spacing = edge / np.sqrt(points.mean())
    # A third coordinate sets the squares two edges apart: no pair within reach is of two of them.
    square = np.cumsum(np.diff(owner, prepend=owner[0]) != 0)
    position = np.column_stack([place % edge, square * 2.0 * edge])
    i, j = cKDTree(position).query_pairs(_REACH * spacing, output_type="ndarray").T
    distance = np.linalg.norm(position[i] - position[j], axis=1)
    bin_edges = np.linspace(0.0, _REACH * spacing, _BINS + 1)
    bin_numbers = np.minimum((distance / bin_edges[1]).astype(np.intp), _BINS - 1)
    count = np.bincount(bin_numbers, minlength=_BINS)
    # g(d) = pairs at d over pairs that as many points at random would have there (Ripley 1977).
    random_pairs = _pairs_at_random(bin_edges / edge) * np.sum(points * (points - 1.0) / 2.0)
    return _Pairs(
        i,
        j,
        bin_numbers,
        count,
        (bin_edges[1:] + bin_edges[:-1]) / 2.0,
        count / np.maximum(random_pairs, 1e-9),
        spacing,
    )


def _variogram_fits(pairs: _Pairs, height: Float, level: Float, two_strips: float) -> tuple[Float, Float]:
    """Return the coefficients (T,) that fit the level's semivariance, and those that fit its covariance with height.

    They are of the terms 1, c(d) and d; the third is left out where it would be negative.

    Args:
        pairs: of N points.
        height: (N,) m.
        level: (N,) dB.
        two_strips: 1 - 1 / S.
    """
    c = np.minimum(two_strips / np.maximum(pairs.g, 1e-9), 1.0)
    terms = np.column_stack([np.ones(_BINS), c, pairs.d])
    if two_strips == 0.0:
        terms[:, 1] = 0.0
    level_step, height_step = level[pairs.i] - level[pairs.j], height[pairs.i] - height[pairs.j]
    # Matheron's estimator, gamma(d) = mean of (z_i - z_j)^2 / 2, here as sums over each bin; and its cross term.
    gamma, cross = (
        np.bincount(pairs.nth, 0.5 * product, _BINS) for product in (level_step**2, level_step * height_step)
    )
    # A surface isn't less alike nearby than farther off: a falling slope is left out, and both fitted without it.
    size = 3 if _least_squares(terms, gamma, pairs.count)[2] > 0.0 else 2
    semivariance, covariance = (_least_squares(terms[:, :size], sums, pairs.count) for sums in (gamma, cross))
    return semivariance, covariance


def _whole_squares(place: Float, owner: Index, edge: float) -> tuple[Index, Float]:
    """Return the points (M,) of squares that are filled with points, and the number (Q,) of points in each.

    A square is filled if each of its `_PARTS` x `_PARTS` parts holds points. Of more than `_MOST_SQUARES` squares that
    many, spread evenly, are taken.

    Args:
        place: (N, 2) m.
        owner: (N,) square of each point.
        edge: of the squares, m.
    """
    part = np.minimum((place % edge / edge * _PARTS).astype(np.int64), _PARTS - 1)
    occupancy = np.zeros((int(owner.max()) + 1, _PARTS**2), dtype=bool)
    occupancy[owner, part[:, 0] * _PARTS + part[:, 1]] = True
    squares = np.flatnonzero(occupancy.all(axis=1))
    squares = squares[:: max(len(squares) // _MOST_SQUARES, 1)]
    rows = np.flatnonzero(np.isin(owner, squares))
    return rows, np.unique(owner[rows], return_counts=True)[1].astype(np.float64)


def _pairs_at_random(edges: Float) -> Float:
    """Return the share (K,) of a unit square's pairs of random points whose distance lies between edges (K + 1,)."""
    # Square line picking (Ghosh 1951), of distances r <= 1: F(r) = pi r^2 - 8/3 r^3 + r^4 / 2.
    f = np.pi * edges**2 - 8.0 / 3.0 * edges**3 + edges**4 / 2.0
    return np.asarray(np.diff(f))


def _least_squares(terms: Float, sums: AnyArray, pairs: Index) -> Float:
    """Return the coefficients of terms (K, T) that fit the means of K bins, each as sure as it has pairs."""
    weight = np.sqrt(pairs)  # a mean of n pairs has the variance 1 / n
    mean = sums / np.maximum(pairs, 1)
    return np.asarray(np.linalg.lstsq(terms * weight[:, None], mean * weight, rcond=None)[0])
