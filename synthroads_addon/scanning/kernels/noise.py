"""The random field of relief, waves and brightness in a compiled loop, beside `noise.c`: the bytes of NumPy."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from ...base.arithmetic.noise import SPREAD, Hash
from ...base.arrays import Float, Float32
from .library import NoKernelError, load_kernel

_POINTER, _INT64 = ctypes.c_void_p, ctypes.c_int64


class CompiledNoise:
    """The sums of octaves of `base.arithmetic.noise.noise_field`, compiled; any threads may use it side by side.

    Raises:
        NoKernelError: this machine has none.
    """

    def __init__(self) -> None:
        self._fill = load_kernel("noise").synthroads_noise
        self._fill.restype = None
        self._fill.argtypes = [
            *(_INT64, _POINTER, _POINTER, _INT64, _POINTER, _POINTER, _INT64, _POINTER, _POINTER),
            *(ctypes.c_double, _POINTER),
        ]

    def fill(
        self, position: Float, cells: Float, keys: Hash, gains: Float32, patch: tuple[Float, Float] | None
    ) -> Float:
        """Return the values (N,) at positions (N, 3), m.

        Args:
            position: m.
            cells: (N,) or (1,) of the coarsest lattice per metre.
            keys: of the octaves' hashes, as many as gains or more.
            gains: of the octaves.
            patch: see ``averaged`` of `noise_field`.
        """
        result = np.empty(len(position))
        position, cells = np.ascontiguousarray(position, np.float64), np.ascontiguousarray(cells, np.float64)
        sides = () if patch is None else tuple(np.ascontiguousarray(side, np.float64) for side in patch)
        count = len(result)
        if position.shape != (count, 3):
            raise ValueError(f"places must have the shape (N, 3), but have {position.shape}")
        if any(side.shape != (count,) for side in sides):
            raise ValueError(f"patches must have the shape ({count},) each, but have {[side.shape for side in sides]}")
        if cells.shape not in ((1,), (count,)):
            raise ValueError(f"cells must have the shape (1,) or ({count},), but have {cells.shape}")
        self._fill(
            *(count, position.ctypes.data, cells.ctypes.data, int(len(cells) > 1)),
            *(keys.ctypes.data, gains.ctypes.data, len(gains)),
            *((side.ctypes.data for side in sides) if sides else (None, None)),
            *(SPREAD, result.ctypes.data),
        )
        return result


@cache
def usable_noise() -> CompiledNoise | NoKernelError:
    """Return the compiled loop, or why this machine has none; found out once."""
    try:
        return CompiledNoise()
    except NoKernelError as error:
        return error
