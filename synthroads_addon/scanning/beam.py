"""The beam's footprint as a few weighted rays whose moments are those of the Gaussian beam.

Lengths across the beam are in units of its radius w, where the energy per area has fallen to 1/e^2 of the peak's: the
beam of full divergence D has w = tan(D / 2) at a distance of 1. The two divergences of an elliptical beam scale the
pattern's two coordinates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError

RINGS: dict[int, tuple[int, ...]] = {1: (), 7: (6,), 19: (6, 12), 37: (6, 12, 18), 61: (6, 12, 18, 24)}
"""Rays per pulse -> rays on each ring around the central one, from the inside."""


@dataclass(frozen=True)
class BeamPattern:
    """Deflections and energy weights of the K rays that sample one pulse's beam, the central ray first.

    Attributes:
        across: (K, 2) deflections in units of the beam's radius at 1/e^2: in the scan plane, and across it.
        weights: (K,) shares of the pulse's energy; their sum is 1.
    """

    across: Float
    weights: Float

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.weights)


@cache
def beam_pattern(rings: tuple[int, ...]) -> BeamPattern:
    """Return the central ray and rings of weighted rays that sample a Gaussian beam; cached, arrays are read-only.

    With u = 2 r^2 / w^2 a Gaussian beam's energy is distributed as exp(-u). The rings' radii and weights are the nodes
    and weights of the Gauss-Radau-Laguerre rule with a node at 0: with R rings the mean of every polynomial in u up to
    degree 2 R is exact, so what depends on the radius alone has its exact mean up to r^(4 R). Evenly spread rays make
    angular means exact up to one degree less than their number. A polynomial in the two deflections has therefore its
    exact mean over the Gaussian beam up to the total degree ``min(4 R + 1, n - 1)``, with n rays on the ring that has
    the fewest: 5 for ``(6,)`` and ``(6, 12)``, 9 for ``(10, 10)``. Rings of as many rays are turned by half a step
    against each other so that their wrong moments, of the order n, cancel as far as they can (wholly for ``(4, 4)``).

    Args:
        rings: rays on each ring, from the inside, 3 or more; none leaves the central ray alone.

    Raises:
        InputError: a ring has fewer than 3 rays: its mean would lie beside the axis.

    Example:
        >>> pattern = beam_pattern((6,))  # one ray in the middle and six around it
        >>> len(pattern), round(float(pattern.weights.sum()), 6)
        (7, 1.0)
    """
    for count in rings:
        if count < 3:
            raise InputError("beam rings", count, "needs at least 3 rays on each ring")
    nodes, weights = _radau_laguerre(len(rings))
    radii = np.sqrt(nodes[1:] / 2.0)
    deflections, ray_weights = [np.zeros((1, 2))], [weights[:1]]
    for count, radius, weight, phase in zip(rings, radii, weights[1:], _phases(rings, radii, weights[1:]), strict=True):
        angle = 2.0 * np.pi * (np.arange(count) + phase) / count
        deflections.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        ray_weights.append(np.full(count, weight / count))
    pattern = BeamPattern(np.concatenate(deflections), np.concatenate(ray_weights))
    pattern.across.setflags(write=False)
    pattern.weights.setflags(write=False)
    return pattern


def _radau_laguerre(rings: int) -> tuple[Float, Float]:
    """Return the Gauss-Radau-Laguerre nodes and weights (rings + 1,) for exp(-u) on [0, inf), with the node 0 fixed.

    The other nodes are those of the Gauss rule for u exp(-u), the eigenvalues of its Jacobi matrix (Golub & Welsch
    1969; its lower half is enough), and their weights that rule's, divided by the node. The node 0 weighs
    1 / (rings + 1).
    """
    if rings == 0:
        return np.zeros(1), np.ones(1)
    # Recurrence of the generalised Laguerre polynomials for the weight u exp(-u): 2 n + 2 on the Jacobi matrix's
    # diagonal, sqrt(n (n + 1)) beside it.
    order = np.arange(rings, dtype=np.float64)
    diagonal, off_diagonal = 2.0 * order + 2.0, np.sqrt(order[1:] * (order[1:] + 1.0))
    nodes, eigenvectors = np.linalg.eigh(np.diag(diagonal) + np.diag(off_diagonal, -1))
    # Golub & Welsch: a node's weight is the square of the first component of its eigenvector.
    weights = np.concatenate([[1.0 / (rings + 1)], eigenvectors[0] ** 2 / nodes])
    return np.concatenate([[0.0], nodes]), weights / weights.sum()


def _phases(rings: tuple[int, ...], radii: Float, weights: Float) -> Float:
    """Return each ring's rotation, 0 or half a step of its rays, so that the rings' residual moments cancel.

    A ring of n rays has one wrong moment of order n, of the size ``weight radius^n``; half a step turns its sign. Rings
    of different numbers of rays take turns, so that their rays don't line up.
    """
    turns = np.array([0.5 * (ring % 2 == 0) for ring in range(len(rings))])
    for count in set(rings):
        ring_numbers = [ring for ring, rays in enumerate(rings) if rays == count]
        sizes = weights[ring_numbers] * radii[ring_numbers] ** count
        residual_moment, first_turn = 0.0, turns[ring_numbers[0]]
        # From the largest moment down, each ring is turned so that its own moment makes the sum smaller.
        for position in np.argsort(-sizes, kind="stable"):
            sign = -1.0 if residual_moment > 0.0 else 1.0
            turns[ring_numbers[position]] = first_turn if sign > 0.0 else 0.5 - first_turn
            residual_moment += sign * sizes[position]
    return turns


def beam_radii(divergence: Sequence[float]) -> tuple[float, float]:
    """Return a beam's two radii at 1/e^2, m per metre of distance, from its two full divergence angles (rad).

    Example:
        >>> [round(100.0 * radius, 3) for radius in beam_radii((0.0005, 0.0011))]  # m, at a distance of 100 m
        [0.025, 0.055]
    """
    return math.tan(divergence[0] / 2.0), math.tan(divergence[1] / 2.0)


def outer_radii(rings: tuple[int, ...], divergence: Sequence[float]) -> tuple[float, float]:
    """Return the half axes of the ellipse that holds all rays of a pulse, m per metre of distance.

    Args:
        rings: rays on each ring.
        divergence: two full angles at 1/e2, rad.
    """
    deflections = beam_pattern(rings).across
    outermost = float(np.sqrt(np.square(deflections).sum(axis=1).max()))  # in units of the beam's radius at 1/e^2
    radii = beam_radii(divergence)
    return outermost * radii[0], outermost * radii[1]


def conical_directions(
    direction: Float, in_plane: Float, across: Float, pattern: BeamPattern, divergence: Sequence[float]
) -> Float:
    """Return the unit directions (3, K, P) of the K rays of each pulse, which diverge from the aperture.

    A ray points along ``axis + tan(D / 2) deflection``, normalised. On a plane at a right angle to the axis the rays
    meet the points of the pattern, scaled to the footprint: all moments that `beam_pattern` keeps are exact there.
    With a divergence of 0 all rays are the axis, to the bit.

    Args:
        direction, in_plane, across: (3, P) unit vectors at right angles to each other: axis, and the beam's two axes.
        pattern: K rays.
        divergence: full angles at 1/e^2 along ``in_plane`` and ``across``, rad, 0 to below pi.

    Returns:
        (3, K, P) unit vectors. With one ray they are views of ``direction`` itself.
    """
    rays = len(pattern)
    if rays == 1:
        return direction[:, None, :]
    factors = beam_factors(pattern, divergence)
    return _sum_products(tuple(zip((direction, in_plane, across), factors, strict=True)), rays)


def beam_factors(pattern: BeamPattern, divergence: Sequence[float]) -> tuple[Float, Float, Float]:
    """Return the factors (K,) on a beam's axis and its two axes across whose sum is each ray's direction, of length 1.

    Args:
        pattern: K rays.
        divergence: full angles at 1/e^2 along both, rad, 0 to below pi.
    """
    radius = beam_radii(divergence)
    x, y = pattern.across[:, 0] * radius[0], pattern.across[:, 1] * radius[1]
    length = 1.0 / np.sqrt(1.0 + x * x + y * y)
    return length, x * length, y * length


def cylindrical_offsets(
    in_plane: Float, across: Float, pattern: BeamPattern, divergence: Sequence[float], distance: Float
) -> Float:
    """Return the offsets (3, K, P), m, of parallel rays' origins that cover the footprint at a distance.

    The rays keep the axis's direction; on a plane at a right angle to it all moments that `beam_pattern` keeps are
    exact at ``distance``, and the footprint is as large before and behind.

    Args:
        in_plane, across: (3, P) unit vectors across the beam.
        pattern: K rays.
        divergence: full angles at 1/e^2 along ``in_plane`` and ``across``, rad, 0 to below pi.
        distance: (P,) to the first hit of the central ray, m; where it isn't a finite number above 0, all rays of the
            pulse are the central one.

    Returns:
        (3, K, P) m.
    """
    radius = beam_radii(divergence)
    range_of_footprint = np.where((distance > 0.0) & (distance < np.inf), distance, 0.0)
    x, y = pattern.across[:, 0] * radius[0], pattern.across[:, 1] * radius[1]
    return _sum_products(((in_plane * range_of_footprint, x), (across * range_of_footprint, y)), len(pattern))


def _sum_products(terms: Sequence[tuple[Float, Float]], rays: int) -> Float:
    """Return the sum of outer products of (K,) factors and (3, P) vectors as (3, K, P).

    Products and sums of single numbers, not a matrix product: BLAS rounds as it splits the work, by position and cores.
    The pulses stand side by side, as there are many more of them: rows that long are worked on fastest.
    """
    pulses = terms[0][0].shape[1]
    result, product = np.empty((3, rays, pulses)), np.empty(pulses)
    for component, ray in np.ndindex(3, rays):  # row by row: a row stays in the processor's cache
        total = result[component, ray]
        np.multiply(terms[0][0][component], terms[0][1][ray], out=total)
        for vectors, factors in terms[1:]:
            total += np.multiply(vectors[component], factors[ray], out=product)
    return result
