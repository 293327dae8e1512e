"""The beam's footprint as a few weighted rays whose moments are those of the Gaussian beam."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

RINGS = {1: 0, 7: 1, 19: 2, 37: 3, 61: 4}
"""Rays per pulse and their rings: ring i carries 6 i rays around the central one."""


@dataclass(frozen=True)
class BeamPattern:
    """Rays of one pulse.

    Attributes:
        across: (K, 2) deflections in units of the beam's radius at 1/e^2: in the scan plane, and across it.
        weights: (K,) shares of the pulse's energy; their sum is 1.
    """

    across: Float
    weights: Float


@cache
def beam_pattern(rays: int) -> BeamPattern:
    """Return the pattern of 1, 7, 19, 37 or 61 rays.

    With u = 2 r^2 / w^2 the energy of a Gaussian beam of radius w (at 1/e^2) is distributed as exp(-u). The ring radii
    and weights are the nodes of the Gauss-Radau-Laguerre rule with a node at 0: with n nodes the mean of any polynomial
    in u up to degree 2 n - 2 is exact, and so are the angular means up to the number of rays of the smallest ring.
    """
    nodes, weights = _radau_laguerre(RINGS[rays] + 1)
    across, shares = [np.zeros((1, 2))], [weights[:1]]
    for ring, (node, weight) in enumerate(zip(nodes[1:], weights[1:], strict=True), start=1):
        count = 6 * ring
        angle = 2.0 * np.pi * (np.arange(count) + 0.5 * (ring % 2)) / count
        across.append(np.sqrt(node / 2.0) * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        shares.append(np.full(count, weight / count))
    return BeamPattern(np.concatenate(across), np.concatenate(shares))


def _radau_laguerre(count: int) -> tuple[Float, Float]:
    """Return nodes and weights (count,) of the Radau rule for the weight exp(-u) on [0, inf) with the node 0.

    The other nodes are the roots of the Laguerre polynomial L_{n-1}^{(1)}, whose coefficients are
    (-1)^k binom(n, n - 1 - k) / k!; the weights follow from the first moments k!.
    """
    from math import comb, factorial

    degree = count - 1
    coefficients = [(-1) ** k * comb(degree + 1, degree - k) / factorial(k) for k in range(degree + 1)]
    nodes = np.concatenate([[0.0], np.sort(np.polynomial.polynomial.polyroots(coefficients).real)])
    moments = np.array([float(factorial(k)) for k in range(count)])
    scale = max(nodes.max(), 1.0)
    powers = (nodes / scale) ** np.arange(count)[:, None]
    return nodes, np.linalg.solve(powers, moments / scale ** np.arange(count))
