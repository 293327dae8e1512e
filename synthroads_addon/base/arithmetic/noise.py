"""A random field of unit variance in space: value noise over several octaves, from integer hashes alone.

Nothing is stored: a value depends on nothing but position, wavelength and seed, so that blocks, their order and the
number of workers don't matter. Hashes are 32-bit integers, all else is basic float arithmetic as IEEE 754 rounds it:
the same bits on every machine.

Each octave holds one random number per node of a cubic lattice, uniform with variance 1, interpolated with the weights
s(t) and s(1 - t), s(t) = t^2 (3 - 2t), along each axis. The weights are divided by the root of their squares' sum:
plain interpolation would have only an eighth of the variance in a cell's middle. So the variance is 1 at every point,
on surfaces of any tilt and place. The lattice is turned from octave to octave against the axes of road and scanner.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float, Float32
from ..random_streams import stream

Hash = NDArray[np.uint32]

MAX_OCTAVES = 12
DECAY = 0.5
"""Variance of an octave as a share of the variance of the octave twice as long: a spectrum that falls with the square
of the frequency, as that of unevenness (ISO 8608, waviness 2) and of soils with exponential covariance."""
_CORRELATED = 0.58
"""Length, in cells, that an octave's correlation falls to 1/e over."""
CHUNK = 1 << 15
"""Points worked on at once, so that the arrays stay in a core's own cache. No result depends on it."""
SPREAD = 2.0 / _CORRELATED**2
"""Factor on the squares of a patch's deviations, see `mean_deviation`."""

_AXES = tuple(np.uint32(prime) for prime in (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D))
_FACTORS = tuple(np.uint32(odd) for odd in (0x7FEB352D, 0x846CA68B))
_FIRST, _SECOND = np.uint32(15), np.uint32(13)
_UNIT = np.float32(3.0**0.5 / 2.0**31)
_TURN = ((15.0, 6.0, -10.0), (6.0, 10.0, 15.0), (10.0, -15.0, 6.0))
"""Rows of length 19 at right angles to one another: a rotation without sines. Applied once to four times, it leaves
each axis at least 18 degrees off every axis and diagonal of the lattice (the best of all with whole numbers to 60)."""


class NoiseKernel(Protocol):
    """Interface of what works the field out in place of NumPy, to the same bytes: `scanning.kernels.noise`."""

    def fill(
        self, position: Float, cells: Float, keys: Hash, gains: Float32, patch: tuple[Float, Float] | None
    ) -> Float:
        """Return the values (N,) at positions (N, 3), by cells per metre (N,) or (1,), hash keys, gains and patches."""
        ...


_kernels: list[NoiseKernel] = []
"""Those that are in use, the last one first."""


@contextmanager
def noise_by(kernel: NoiseKernel | None) -> Iterator[None]:
    """Context in which fields are worked out by a kernel, in all threads; by NumPy with None. Results are the same."""
    if kernel is not None:
        _kernels.append(kernel)
    try:
        yield
    finally:
        if kernel is not None:
            _kernels.remove(kernel)


def noise_field(
    position: Float,
    wavelength: float | Float,
    seed: int,
    octaves: int = 4,
    patch_deviations: tuple[Float, Float] | None = None,
) -> Float:
    """Return a random field (N,) at positions (N, 3): mean 0, standard deviation 1, nearly normal from 3 octaves on.

    The correlation falls to 1/e at about 0.28 of the wavelength (4 octaves) and is 0 beyond 1.75 of it.

    Args:
        position: (N, 3) m. Up to 2^31 half wavelengths of the shortest octave from the origin lattices stay distinct.
        wavelength: (N,) or one number, longest wavelength (two cells of the coarsest lattice), m; positive.
        seed: of the field.
        octaves: 1 to `MAX_OCTAVES`, each of half the wavelength and half the variance of the one before.
        patch_deviations: standard deviations (N,) along both axes, m, of the Gaussian patch of a surface over which
            each value is a mean: octaves have the deviations of such means, see `mean_deviation`. None: values of
            places.

    Returns:
        (N,) values.

    Raises:
        ValueError: octaves out of range.
    """
    if not 1 <= octaves <= MAX_OCTAVES:
        raise ValueError(f"octaves must be 1 to {MAX_OCTAVES}")
    keys = _keys(seed)
    variance = DECAY ** np.arange(octaves)
    gains = np.sqrt(variance / variance.sum()).astype(np.float32)
    cells = np.atleast_1d(2.0 / np.asarray(wavelength, dtype=np.float64))
    for kernel in _kernels[-1:]:
        return kernel.fill(position, cells, keys, gains, patch_deviations)
    cells, values = np.broadcast_to(cells, (len(position),)), np.empty(len(position))
    for begin in range(0, len(position), CHUNK):
        block = slice(begin, begin + CHUNK)
        point = [position[block, axis] * cells[block] for axis in range(3)]
        total = np.zeros(len(point[0]), dtype=np.float32)
        patch = None if patch_deviations is None else [axis[block] * cells[block] for axis in patch_deviations]
        for key, gain in zip(keys, gains, strict=False):
            point = _turn_coordinates(point)
            octave = gain * _octave(point, key)
            if patch is not None:
                octave *= mean_deviation(patch[0], patch[1])
                patch = [axis * 2.0 for axis in patch]
            total += octave
            point = [coordinate * 2.0 for coordinate in point]
        values[block] = total
    return values


@lru_cache(maxsize=64)
def _keys(seed: int) -> Hash:
    """Return the keys of a field's octaves (`MAX_OCTAVES`,), which many blocks of points ask for; not to be changed."""
    keys = stream(seed, "noise field").integers(0, 2**32, MAX_OCTAVES, dtype=np.uint32)
    keys.flags.writeable = False
    return keys


def mean_deviation(long_deviation: Float, short_deviation: Float) -> Float32:
    """Return the standard deviation (N,) of means of an octave over Gaussian patches of a surface, 0 to 1.

    The correlation of an octave falls nearly as exp(-(x / l)^2) with l of 0.58 cells, as means over patches of 0.1 to
    3 cells show; of means over a Gaussian patch the variance of such a field is 1 / sqrt((1 + 2 a^2 / l^2) (1 + 2 b^2
    / l^2)). It is kept to 4 % of the octave's variance.

    Args:
        long_deviation, short_deviation: standard deviations a, b (N,) of the patch along its two axes, in cells.
    """
    variance_factor = 1.0 + SPREAD * long_deviation**2
    variance_factor *= 1.0 + SPREAD * short_deviation**2
    # Two roots are exact to the last digits, as a power is, in a fraction of its time.
    return np.asarray(1.0 / np.sqrt(np.sqrt(variance_factor)), dtype=np.float32)


def hash_cells(cells: NDArray[np.int64], key: int) -> NDArray[np.uint32]:
    """Return random whole numbers (N,), uniform from 0 to 2^32 - 1, of cells (3, N) of a lattice, by a key."""
    first_hash, second_hash, third_hash = (
        axis.astype(np.uint32) * prime for axis, prime in zip(cells, _AXES, strict=True)
    )
    node = _mix_bits(first_hash + np.uint32(key))
    node = _mix_bits(node + second_hash)
    node = _mix_bits(node + third_hash)
    node *= _FACTORS[1]
    return node ^ (node >> _FIRST)


def _turn_coordinates(point: list[Float]) -> list[Float]:
    """Return coordinates, three arrays (N,), rotated by `_TURN`."""
    x, y, z = point
    coordinates, product = [], np.empty_like(x)
    for a, b, c in _TURN:
        coordinate = a * x
        coordinate += np.multiply(y, b, out=product)
        coordinate += np.multiply(z, c, out=product)
        coordinate /= 19.0
        coordinates.append(coordinate)
    return coordinates


def _octave(point: list[Float], key: np.uint32) -> Float32:
    """Return value noise of unit variance (N,) at three coordinates (N,), on the lattice of whole numbers.

    A cell's corners lie side by side, as few long calls take less time than many short ones.
    """
    weights: list[Float32] = []
    corner = np.zeros(len(point[0]), dtype=np.uint32)
    corner += key
    for coordinate, prime in zip(point, _AXES, strict=True):
        floor = np.floor(coordinate)
        # Through signed numbers, as what is negative has no unsigned one; the lower 32 bits are the same.
        node = floor.astype(np.int64).astype(np.uint32)
        node *= prime
        corners = np.empty((*corner.shape[:-1], 2, len(node)), dtype=np.uint32)
        np.add(corner, node, out=corners[..., 0, :])
        np.add(corners[..., 0, :], prime, out=corners[..., 1, :])
        corner = _mix_bits(corners)
        weights.append(_weights(np.subtract(coordinate, floor, out=floor).astype(np.float32)))
    # Upper bits, which count, are the best mixed.
    corner *= _FACTORS[1]
    value = corner.view(np.int32).astype(np.float32)
    value *= _UNIT
    for pair in reversed(weights):
        value *= pair
        value = value[..., 0, :] + value[..., 1, :]
    return value


def _weights(t: Float32) -> Float32:
    """Return the weights (2, N) of the nodes below and above at shares t of a cell, their squares summing to 1."""
    weights = np.empty((2, len(t)), dtype=np.float32)
    lower_weights, upper_weights = weights
    np.multiply(t, t, out=upper_weights)
    t *= np.float32(-2.0)
    t += np.float32(3.0)
    upper_weights *= t
    np.subtract(np.float32(1.0), upper_weights, out=lower_weights)
    squares = weights * weights
    scale = squares[1]
    scale += squares[0]
    np.sqrt(scale, out=scale)
    np.divide(np.float32(1.0), scale, out=scale)
    weights *= scale
    return weights


def _mix_bits(node: Hash) -> Hash:
    """Mix the bits of hashes in place, and return them: xor them with shifted bits, twice, around one odd factor."""
    shifted = node >> _FIRST
    node ^= shifted
    node *= _FACTORS[0]
    node ^= np.right_shift(node, _SECOND, out=shifted)
    return node
