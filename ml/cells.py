"""Cubic grids: which cell a point lies in, and one point for each cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.errors import InputError


def thin(coord: NDArray[np.floating[Any]], cell: float) -> NDArray[np.intp]:
    """Return the indices of the points that stay, one per occupied cell of a cubic grid, in order.

    The point nearest the cell's centre stays, of equally near ones the first.

    Args:
        coord: (N, 3) m, counted from a cell's corner.
        cell: edge of the cells, m.

    Raises:
        InputError: the points lie too far apart for cells of this size.
    """
    if len(coord) == 0:
        return np.zeros(0, dtype=np.intp)
    steps = np.asarray(coord, dtype=np.float64) / cell
    cells = np.floor(steps)
    key = cell_keys(cells)
    order = np.lexsort((np.square(steps - cells - 0.5).sum(axis=1), key))
    first = np.r_[True, np.diff(key[order]) != 0]
    return np.sort(order[first])


def cell_keys(cells: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return one number per cell (N, 3) of whole numbers, unique within the array.

    Raises:
        InputError: the cells span more than 64 bits can tell apart.
    """
    low = cells.min(axis=0)
    spans = cells.max(axis=0) - low + 1
    if not float(np.prod(spans)) < 2**62:  # so that NaN is refused too
        text = " x ".join(f"{span:.0f}" for span in spans)
        raise InputError("coord", text, "must span fewer than 2^62 cells in all")
    relative = (cells - low).astype(np.int64)
    width, depth = int(spans[0]), int(spans[1])
    return np.asarray((relative[:, 2] * depth + relative[:, 1]) * width + relative[:, 0])
