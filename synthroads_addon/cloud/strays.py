"""Strays: the few places far from all others, as of a bird, a mirror, or a vertex that a converter forgot.

Places are counted in cubes of a quarter of a kilometre, of which only those that hold any are kept; cubes that touch
make a part. What lies in parts with hardly anything in them strays from the rest.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Bool, Index, Int

Keys = Int

EDGE = 256.0
"""Edge of a cube, m."""
FARTHEST = 1e8
"""Largest coordinate, m: no map has larger ones, and cubes are numbered up to it."""
_FEW, _SHARE = 10, 1e-4
"""A part with at most so many places, or at most this share of all, strays, unless no part has more."""
_MOST_CUBES = 50_000
"""Cubes of larger edges are taken where there are more: the places lie too far apart to be told apart so finely."""
_BITS = 21
_STEPS = [step for step in product((-1, 0, 1), repeat=3) if any(step)]


class Strays:
    """Detector of outlying places: counts places in cubes, block by block, and finds those far from the rest."""

    def __init__(self) -> None:
        self._edge = EDGE
        self._keys, self._counts = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        self._body: Keys | None = None

    def add(self, xyz: NDArray[np.floating]) -> None:
        """Add places (N, 3), m, of at most `FARTHEST`."""
        keys, counts = np.unique(self._keys_of(xyz), return_counts=True)
        self._merge(np.concatenate([self._keys, keys]), np.concatenate([self._counts, counts]))
        while len(self._keys) > _MOST_CUBES:
            # Four by four by four cubes become one: their three numbers are read from the keys and divided by four.
            self._edge *= 4.0
            offset_numbers = [self._keys >> (_BITS * axis) & (2**_BITS - 1) for axis in range(3)]
            numbers = [(number - 2 ** (_BITS - 1)) >> 2 for number in offset_numbers]
            self._merge(_cube_keys(np.stack(numbers, axis=1)), self._counts)
        self._body = None

    def count(self) -> int:
        """Return the number of places added that stray from the rest."""
        return int(self._counts.sum() - self._counts[np.isin(self._keys, self._body_cubes())].sum())

    def belongs(self, xyz: NDArray[np.floating]) -> Bool:
        """Return a mask (N,) of the places (N, 3), all of them added before, that don't stray."""
        return np.isin(self._keys_of(xyz), self._body_cubes())

    def _keys_of(self, xyz: NDArray[np.floating]) -> Keys:
        """Return the keys (N,) of the cubes that places (N, 3), m, lie in."""
        return _cube_keys(np.floor(np.asarray(xyz, dtype=np.float64) / self._edge).astype(np.int64))

    def _merge(self, keys: Keys, counts: Keys) -> None:
        """Set the cubes from keys (K,), which may repeat, and the number (K,) of places of each."""
        self._keys, owner = np.unique(keys, return_inverse=True)
        self._counts = np.bincount(owner.ravel(), counts, len(self._keys)).astype(np.int64)

    def _body_cubes(self) -> Keys:
        """Return the keys of the cubes that don't stray; cached until places are added."""
        if self._body is None:
            parts = self._connected_parts()
            sizes = np.bincount(parts, self._counts, parts.max(initial=-1) + 1)
            is_large = sizes > max(_FEW, _SHARE * self._counts.sum())
            self._body = self._keys[is_large[parts]] if is_large.any() else self._keys
        return self._body

    def _connected_parts(self) -> Index:
        """Return the number (K,) of the connected part, of cubes that touch, that each cube belongs to."""
        index_of_key = {int(key): index for index, key in enumerate(self._keys)}
        # Differences between the keys of a cube and of its 26 neighbours.
        steps = (_cube_keys(np.array(_STEPS)) - _cube_keys(np.zeros((1, 3), dtype=np.int64))).tolist()
        part = np.full(len(self._keys), -1, dtype=np.intp)
        for seed in range(len(part)):
            if part[seed] >= 0:
                continue
            # Flood fill from a cube that is in no part yet.
            number, pending = part.max() + 1, [seed]
            part[seed] = number
            while pending:
                key = int(self._keys[pending.pop()])
                neighbours = (index_of_key.get(key + step) for step in steps)
                unvisited = [index for index in neighbours if index is not None and part[index] < 0]
                part[unvisited] = number
                pending += unvisited
        return part


def _cube_keys(numbers: Int) -> Keys:
    """Return one integer key (N,) for each cube's three numbers (N, 3), with 21 bits for each of them."""
    positive_numbers = numbers + 2 ** (_BITS - 1)
    return np.asarray(positive_numbers[:, 0] | positive_numbers[:, 1] << _BITS | positive_numbers[:, 2] << 2 * _BITS)
