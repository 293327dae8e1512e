"""Types of arrays by what they hold, records of arrays, values that repeat, and a threshold that parts them in two."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

AnyArray = NDArray[Any]
Bool = NDArray[np.bool_]
Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Index = NDArray[np.intp]
Int = NDArray[np.int64]
UInt8 = NDArray[np.uint8]
UInt16 = NDArray[np.uint16]


@dataclass(frozen=True)
class ArrayRows:
    """Base of records of arrays that have a row each for the same things; an array that isn't there is None."""

    def select(self, rows: Bool | Index | slice) -> Self:
        """Return a record of the rows chosen by a mask, indices or a slice."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return type(self)(*(None if array is None else take_rows(array, rows) for array in arrays))

    @classmethod
    def join(cls, parts: Sequence[Any]) -> Self:
        """Return one record with the rows of several records of this class, in order; at least one is needed."""

        def joined(arrays: list[Any]) -> AnyArray | None:
            """Return arrays of one field end to end; None where the field has none."""
            return None if arrays[0] is None else np.concatenate(arrays)

        return cls(*(joined([getattr(part, field.name) for part in parts]) for field in fields(cls)))


def take_rows(array: AnyArray, rows: Bool | NDArray[np.integer] | slice) -> AnyArray:
    """Return the rows of an array that are chosen by a mask, indices or a slice, as ``array[rows]`` does."""
    if isinstance(rows, slice):
        return array[rows]
    # For rows of several numbers this is several times as fast.
    return np.take(array, np.flatnonzero(rows) if rows.dtype == np.bool_ else rows, axis=0)


def dot_rows(vectors: Float32, other_vectors: Float32) -> Float32:
    """Return the dot products (N,) of vectors (N, 3), added one after the other: einsum's order is the processor's."""
    return np.asarray(
        vectors[:, 0] * other_vectors[:, 0] + vectors[:, 1] * other_vectors[:, 1] + vectors[:, 2] * other_vectors[:, 2]
    )


def without_repeats(values: Float) -> tuple[Float, Index]:
    """Return values (N,) less those that equal the one before them, (K,), and the (N,) indices of all among these.

    Values that hardly repeat are returned all. So a function of few values that many things share is calculated once
    for each.
    """
    is_new = np.ones(len(values), np.bool_)
    np.not_equal(values[1:], values[:-1], out=is_new[1:])
    if 2 * np.count_nonzero(is_new) > len(values):
        return values, np.arange(len(values))
    return values[is_new], np.cumsum(is_new) - 1


def otsu_threshold(values: Float) -> float:
    """Return Otsu's threshold (1979) of values (N,): the one with the largest variance between the two sides."""
    count, edges = np.histogram(values, bins=256)
    bin_middles = (edges[:-1] + edges[1:]) / 2.0
    count_below, moment_below = np.cumsum(count)[:-1], np.cumsum(count * bin_middles)[:-1]
    count_above = count.sum() - count_below
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_difference = (float((count * bin_middles).sum()) - moment_below) / count_above - moment_below / count_below
        between_variance = np.where(
            (count_below > 0) & (count_above > 0), count_below * count_above * mean_difference**2, 0.0
        )
    return float(edges[1:-1][np.argmax(between_variance)])
