"""Vectors turned by a platform's poses in a compiled loop, beside `poses.c`: the bytes of `pulses.turned_vectors`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np

from ...base.arrays import Float, Index
from ..devices.shots import Columns
from ..knots import Track
from .library import NoKernelError, load_kernel

MOST_SETS = 3
"""Sets of vectors that are turned at once; as MOST in poses.c."""
_POINTER, _INT64, _DOUBLE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class CompiledPoses:
    """Poses of tracks at times between their knots, compiled; any threads may use it side by side.

    Raises:
        NoKernelError: this machine has none.
    """

    def __init__(self) -> None:
        self._turn = load_kernel("poses").synthroads_turn
        self._turn.restype = None
        self._turn.argtypes = [
            *(_INT64, _POINTER, _DOUBLE, _DOUBLE, _INT64, _POINTER, _POINTER),
            *(_INT64, _INT64, _POINTER),
            *(_INT64, _POINTER, _POINTER, _POINTER),
        ]

    def turned_vectors(
        self, track: Track, times: Float, vectors: Sequence[Float], columns: Columns | None = None
    ) -> tuple[Float, list[Float]]:
        """Return a track's positions (3, N), m, at times (N,), s, and sets of vectors (3, N) turned by its rotations.

        Args:
            track: two knots or more.
            times: within the track.
            vectors: `MOST_SETS` at most, (3, N), or tables (3, M) of which columns are turned.
            columns: N of such tables; rows are ascending.
        """
        count, sets = len(times), [np.ascontiguousarray(array, np.float64) for array in vectors]
        times, rotation, position = (
            np.ascontiguousarray(array, np.float64) for array in (times, track.rotation, track.position)
        )
        knots, first_column, width = position.shape[1], 0, count
        rows: Index | None = None
        if columns is not None and sets:
            first_column, width = columns.first, sets[0].shape[1]
            rows = None if columns.rows is None else np.ascontiguousarray(columns.rows, np.int64)
            rows_fit = rows is None or (rows.shape == (count,) and rows.min(initial=0) >= 0)
            if first_column < 0 or not width or not rows_fit:
                raise ValueError(
                    f"columns must begin at 0 or later and have {count} rows, none below 0, of a table with columns, "
                    f"but begin at {first_column} of {width}, with rows {rows}"
                )
        shapes = [array.shape for array in sets]
        if len(sets) > MOST_SETS or any(shape != (3, width) for shape in shapes) or rotation.shape != (9, knots):
            raise ValueError(
                f"vectors must be {MOST_SETS} arrays of shape (3, {width}) at most, but have the shapes {shapes}; "
                f"rotations must be (9, {knots}), but are {rotation.shape}"
            )
        place, results = np.empty((3, count)), [np.empty((3, count)) for _ in sets]
        addresses = [(_POINTER * MOST_SETS)(*(array.ctypes.data for array in arrays)) for arrays in (sets, results)]
        self._turn(
            *(count, times.ctypes.data, track.begin, track.spacing, knots, rotation.ctypes.data, position.ctypes.data),
            *(first_column, width, None if rows is None else rows.ctypes.data),
            *(len(sets), *addresses, place.ctypes.data),
        )
        return place, results


@cache
def usable_poses() -> CompiledPoses | NoKernelError:
    """Return the compiled loop, or why this machine has none; found out once."""
    try:
        return CompiledPoses()
    except NoKernelError as error:
        return error
