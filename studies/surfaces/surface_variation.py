"""How rough a cloud's surfaces are: eigenvalue surface variation, and the residual about planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Index = NDArray[np.intp]

_QUERIES = 2048
"""Points whose neighbours are gathered at once; what keeps memory bounded."""


def surface_variation(xyz: Float, radius: float, rows: Index | None = None, fewest: int = 8) -> Float:
    """Return the surface variation l0 / (l0 + l1 + l2) (K,) around points (Pauly, Gross, Kobbelt 2002), 0 to 1/3.

    l0 <= l1 <= l2 are the eigenvalues of the covariance of all points within a sphere. A plane with noise of standard
    deviation s along its normal has about 2 s^2 / radius^2, whatever the density of the points, as long as s is small.

    Args:
        xyz: (N, 3) coordinates, m.
        radius: of the sphere, m.
        rows: (K,) indices of the points in whose places to measure; all if None.
        fewest: neighbours, the point itself included, that it takes; 4 or more.

    Returns:
        (K,) 0 to 1/3; NaN where there are too few neighbours.
    """
    centres = np.arange(len(xyz)) if rows is None else np.asarray(rows)
    result = np.full(len(centres), np.nan)
    if len(xyz) == 0:
        return result
    grid = _Grid(xyz, radius)
    for first_row in range(0, len(centres), _QUERIES):
        query_rows = centres[first_row : first_row + _QUERIES]
        query, neighbour = grid.pairs(query_rows)
        shift = xyz[neighbour] - xyz[query_rows][query]
        is_near = np.einsum("ij,ij->i", shift, shift) <= radius * radius
        result[first_row : first_row + _QUERIES] = _variation(query[is_near], shift[is_near], len(query_rows), fewest)
    return result


def _variation(query: Index, shift: Float, count: int, fewest: int) -> Float:
    """Return the surface variation of each query from the vectors to its neighbours."""
    number = np.bincount(query, minlength=count).astype(np.float64)
    has_enough = number >= max(fewest, 4)
    divisor = np.maximum(number, 1.0)
    mean = np.stack([np.bincount(query, shift[:, i], count) for i in range(3)], axis=1) / divisor[:, None]
    shift = shift - mean[query]
    covariance = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(i, 3):
            moment = np.bincount(query, shift[:, i] * shift[:, j], count) / np.maximum(number - 1.0, 1.0)
            covariance[:, i, j] = covariance[:, j, i] = moment
    values = np.clip(np.linalg.eigvalsh(covariance), 0.0, None)
    total = values.sum(axis=1)
    return np.where(has_enough & (total > 0.0), values[:, 0] / np.where(total > 0.0, total, 1.0), np.nan)


class _Grid:
    """Spatial index of points by square columns one radius wide in plan.

    Attributes:
        stride: difference between the keys of columns that are neighbours in x; of neighbours in y it is 1.
        key: (N,) key of each point's column.
        order: (N,) rows of the points in the order of their keys.
        sorted_keys: (N,) the keys in that order.
    """

    def __init__(self, xyz: Float, radius: float) -> None:
        """Sort the points (N, 3), m, by the keys of their columns."""
        # Counting begins with 1, and the stride leaves a number free behind the last: beyond either end in y lies an
        # empty column, so that no key beside a column is that of a column in the next row.
        column = np.floor((xyz[:, :2] - xyz[:, :2].min(axis=0)) / radius).astype(np.int64) + 1
        self.stride = int(column[:, 1].max()) + 2
        self.key = column[:, 0] * self.stride + column[:, 1]
        self.order = np.argsort(self.key, kind="stable")
        self.sorted_keys = self.key[self.order]

    def pairs(self, query_rows: Index) -> tuple[Index, Index]:
        """Return candidate pairs: positions in `query_rows`, and rows of all points in the nine columns around each."""
        steps = np.array([row * self.stride for row in (-1, 0, 1)])
        first_keys = (self.key[query_rows][:, None] + steps - 1).ravel()
        start = np.searchsorted(self.sorted_keys, first_keys, "left")
        length = np.searchsorted(self.sorted_keys, first_keys + 2, "right") - start
        ends = np.cumsum(length)
        run = np.repeat(np.arange(len(length)), length)
        place = np.arange(int(ends[-1]) if len(ends) else 0) - (ends - length)[run] + start[run]
        return run // len(steps), self.order[place]


def plane_residuals(xyz: Float, size: float, fewest: int = 10) -> tuple[Float, Float]:
    """Return per square patch the standard deviation of heights about its least-squares plane, m, and its points.

    Patches are squares of a level grid; the deviation has n - 3 degrees of freedom. Left out are patches with too few
    points, and those whose points spread less than an eighth of the size in some direction: a single scan line doesn't
    tell a plane.

    Args:
        xyz: (N, 3) coordinates of one surface, m.
        size: of a patch, m.
        fewest: points of a patch; 4 or more.

    Returns:
        (P,) standard deviations, m; (P,) numbers of points.
    """
    cell = np.floor((xyz[:, :2] - xyz[:, :2].min(axis=0, initial=np.inf)) / size).astype(np.int64)
    _, patch, number = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    patch = patch.ravel()
    count = len(number)
    mean = np.stack([np.bincount(patch, xyz[:, i], count) for i in range(3)], axis=1) / number[:, None]
    x, y, z = (xyz - mean[patch]).T
    products = (x * x, x * y, y * y, x * z, y * z, z * z)
    xx, xy, yy, xz, yz, zz = (np.bincount(patch, product, count) for product in products)
    half_trace, spread = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    is_usable = (number >= max(fewest, 4)) & (half_trace - spread >= number * (size / 8.0) ** 2)
    xx, xy, yy, xz, yz, zz = (moment[is_usable] for moment in (xx, xy, yy, xz, yz, zz))
    determinant = xx * yy - xy * xy
    explained_squares = (yy * xz * xz - 2.0 * xy * xz * yz + xx * yz * yz) / determinant
    return np.sqrt(np.clip(zz - explained_squares, 0.0, None) / (number[is_usable] - 3.0)), number[is_usable].astype(
        np.float64
    )
