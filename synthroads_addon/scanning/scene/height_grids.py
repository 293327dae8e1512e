"""Grids in plan that are asked for the largest value within boxes, and the largest heights of a scene as such grids."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ...base.arrays import AnyArray, Bool, Float, Float32, Index

STEP = 0.005
"""Heights are kept in steps of this, m; in larger ones where a scene is higher than 16 bits of them."""
WINDOW = 3
"""Cells that a box may be wide: it touches four of them at most."""
_EMPTY = int(np.iinfo(np.int16).min)
_CODES = 60_000
_AT_ONCE = 1 << 16
"""Triangles that are drawn together: their arrays stay in the processor's cache."""


class PlanGrids:
    """Grids over an area, the cells of each twice as wide as of the one before, with the largest value in each cell.

    Args:
        size: (2,) of the area, m; places are counted from its corner.
        cell: width of the finest grid's cells, m.
        dtype: of the values.
        empty: value of cells where nothing was drawn; no value is less.

    Attributes:
        cells: (L,) widths of the grids' cells, m; in the last grid the area is one box.
    """

    def __init__(self, size: Float, cell: float, dtype: DTypeLike, empty: float) -> None:
        shapes = [tuple(max(1, int(np.ceil(side / cell))) for side in size)]
        while max(shapes[-1]) > WINDOW:
            shapes.append(tuple(-(-side // 2) for side in shapes[-1]))
        self.cells: Float = cell * 2.0 ** np.arange(len(shapes))
        self._grids: list[AnyArray] = [np.full(shape, empty, dtype) for shape in shapes]
        self._rows, self._columns = np.array(shapes, np.intp).T
        self._first: Index = np.cumsum([0, *(grid.size for grid in self._grids)], dtype=np.intp)[:-1]
        self._values: AnyArray = np.empty(0, dtype)

    def draw(self, level: int, begin: Float32, end: Float32, value: AnyArray | int) -> None:
        """Raise the cells that boxes (2, N), from ``begin`` to ``end`` (m), touch in one grid to values (N,)."""
        grid = self._grids[level]
        first, last = (np.asarray(corner / np.float32(self.cells[level]), np.int32) for corner in (begin, end))
        for axis in (0, 1):
            np.clip(first[axis], 0, grid.shape[axis] - 1, out=first[axis])
            np.clip(last[axis], 0, grid.shape[axis] - 1, out=last[axis])
        rows, columns = (int((last[axis] - first[axis]).max(initial=0)) + 1 for axis in (0, 1))
        for row, column in np.ndindex(rows, columns):
            cell = np.minimum(first[0] + row, last[0]).astype(np.intp) * grid.shape[1]
            cell += np.minimum(first[1] + column, last[1])
            np.maximum.at(grid.reshape(-1), cell, value)

    def spread(self) -> AnyArray:
        """Give each grid what was drawn in coarser ones; return the finest, whose values are then whole."""
        grids = self._grids
        for fine, coarse in zip(grids[-2::-1], grids[:0:-1], strict=True):
            for part, inner in _quarters(fine, coarse):
                np.maximum(part, inner, out=part)
        return grids[0]

    def finish(self) -> None:
        """Give each grid what was drawn in the others, and make the grids ready to be asked."""
        self.spread()
        grids = self._grids
        for fine, coarse in pairwise(grids):
            for part, inner in _quarters(fine, coarse):
                np.maximum(part, inner, out=inner)
        for grid in grids:  # each cell stands for a box of two by two from now on
            grid[:-1] = np.maximum(grid[:-1], grid[1:])
            grid[:, :-1] = np.maximum(grid[:, :-1], grid[:, 1:])
        self._values = np.concatenate([grid.reshape(-1) for grid in grids])
        self._grids = []

    def level_of(self, width: Float) -> Index:
        """Return the finest grids (N,) that boxes of a width (N,), m, may be asked of; L for wider ones than all."""
        level = np.zeros(len(width), np.intp)
        for cell in self.cells.tolist():
            wider = width > WINDOW * cell
            if not wider.any():
                break
            level += wider
        return level

    def largest(self, level: Index, x: Float, y: Float) -> AnyArray:
        """Return the largest values (N,) in boxes with corners at x, y (N,), m, up to `WINDOW` cells wide."""
        scale = np.take(1.0 / self.cells, level)
        rows, columns, first = (np.take(values, level) for values in (self._rows, self._columns, self._first))
        i, k = (x * scale).astype(np.intp), (y * scale).astype(np.intp)
        lines = [first + np.clip(i + shift, 0, rows - 1) * columns for shift in (0, 2)]
        places = [np.clip(k + shift, 0, columns - 1) for shift in (0, 2)]
        maxima = [np.take(self._values, line + place) for line in lines for place in places]
        return np.asarray(np.maximum(np.maximum(maxima[0], maxima[1]), np.maximum(maxima[2], maxima[3])))


def _quarters(fine: AnyArray, coarse: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Yield the cells of a fine grid that lie in the same corner of a coarse grid's cells, and these cells."""
    for row, column in np.ndindex(2, 2):
        part = fine[row::2, column::2]
        yield part, coarse[: part.shape[0], : part.shape[1]]


class HeightGrids:
    """Largest heights of what was drawn, which beams must pass above.

    What is drawn may stand higher by a step, and wider by two cells, than it is; never lower or narrower.

    Args:
        bounds: (2, 3) smallest and largest corner of all that will be drawn, m; places are counted from the first.
        cell: width of the finest grid's cells, m.
    """

    def __init__(self, bounds: Float, cell: float) -> None:
        height = float(bounds[1, 2] - bounds[0, 2])
        self._step = max(STEP, height / _CODES)
        self._grids = PlanGrids(bounds[1, :2] - bounds[0, :2], cell, np.int16, _EMPTY)
        self._top = float(_EMPTY)

    def draw_triangles(
        self, vertices: Float32, triangles: NDArray[np.int32], longest: float, finest: float = 0.0
    ) -> None:
        """Draw triangles (T, 3); what is longer in plan than ``longest`` (m) is cut into pieces before.

        Args:
            vertices: (3, V) m.
            triangles: (T, 3) vertices of each.
            longest: m.
            finest: see `draw_boxes`.
        """
        for start in range(0, len(triangles), _AT_ONCE):
            corners = vertices[:, triangles[start : start + _AT_ONCE].T]  # coordinate, corner, triangle
            for part in _pieces(corners, longest):
                self.draw_boxes(*extremes(part), finest)

    def draw_boxes(self, low: Float32, high: Float32, finest: float = 0.0) -> None:
        """Draw boxes with corners (3, N), m, each in the grid of the finest cells of which it is two wide at most.

        Boxes that are drawn in no grid of cells finer than ``finest`` (m) are one cell wide at most.
        """
        cells = self._grids.cells
        width = np.maximum(high[0] - low[0], high[1] - low[1])
        if finest:
            level = np.searchsorted(cells[:-1], np.maximum(width, np.float32(finest)))
        else:
            level = np.searchsorted(2.0 * cells[:-1], width)
        code = np.ceil(high[2] / self._step) - _CODES / 2.0
        code = np.clip(code, _EMPTY + 1, -_EMPTY - 1).astype(np.int16)
        for number in np.unique(level).tolist():
            mine = np.flatnonzero(level == number)
            self._grids.draw(number, low[:2, mine], high[:2, mine], code[mine])
            self._top = max(self._top, float(code[mine].max()))

    def finish(self) -> None:
        """Make the grids ready to be asked, once all is drawn."""
        self._grids.finish()

    def passed_by(self, corner: Float, width: Float, towards: Float) -> Bool:
        """Return a mask (N,) of the beams that pass above everything, from the boxes that they end in to the sky.

        Args:
            corner: (3, N) lowest corner of the boxes, m.
            width: (N,) larger side in plan of the boxes, m.
            towards: (3, N) unit vectors back along the beams; the third component is positive.
        """
        grids, last, scale = self._grids, len(self._grids.cells) - 1, 1.0 / self._step
        x, y, lowest = corner[0], corner[1], corner[2] * scale - _CODES / 2.0
        level = grids.level_of(width)
        free = level <= last
        free &= grids.largest(np.minimum(level, last), x, y) <= lowest
        left = np.flatnonzero(free & (lowest < self._top))
        beams = _Beams(left, x[left], y[left], lowest[left], width[left], level[left], *towards[:, left])
        beams.rise *= scale
        while len(beams.number):
            np.minimum(beams.level + 1, last, out=beams.level)
            length, begin = beams.next_boxes(grids.cells, self._top)
            above = grids.largest(beams.level, *begin) <= beams.lowest
            free[beams.number[~above]] = False
            beams.go_on(length)
            beams = beams.select(np.flatnonzero(above & (beams.lowest < self._top)))
        return free


@dataclass
class _Beams:
    """Beams that are followed back from where they end, box after box, each box twice as long as the one before.

    Attributes:
        number: (N,) of each.
        x, y, lowest: (N,) lowest corner of the box that each has in cross-section; the third as a code.
        width: (N,) of this box in plan, m.
        level: (N,) grid that it was asked of.
        ahead, aside, rise: (N,) by how much they go on, for each metre; the third in codes.
    """

    number: Index
    x: Float
    y: Float
    lowest: Float
    width: Float
    level: Index
    ahead: Float
    aside: Float
    rise: Float

    def next_boxes(self, cells: Float, top: float) -> tuple[Float, list[Float]]:
        """Return the lengths (N,), m, of the parts that fit into boxes of the beams' levels, and these boxes' corners.

        Args:
            cells: (L,) widths of the levels' cells, m.
            top: code above which nothing is any more.
        """
        length = (top - self.lowest) / self.rise
        speed = np.maximum(np.abs(self.ahead), np.abs(self.aside))
        room = WINDOW * np.take(cells, self.level) - self.width
        np.minimum(length, room / np.maximum(speed, 1e-9), where=self.level < len(cells) - 1, out=length)
        return length, [self.x + np.minimum(length * self.ahead, 0.0), self.y + np.minimum(length * self.aside, 0.0)]

    def go_on(self, length: Float) -> None:
        """Move the boxes on by lengths (N,), m, in place."""
        self.x = self.x + length * self.ahead
        self.y = self.y + length * self.aside
        self.lowest = self.lowest + length * self.rise

    def select(self, rows: Index) -> _Beams:
        """Return the beams of these rows."""
        values: dict[str, Any] = vars(self)
        return _Beams(**{name: array[rows] for name, array in values.items()})


def extremes(corners: Float32) -> tuple[Float32, Float32]:
    """Return the smallest and the largest coordinates (D, T) of triangles (D, 3, T), by coordinate and corner."""
    a, b, c = (corners[:, i] for i in range(3))
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _pieces(corners: Float32, longest: float) -> Iterator[Float32]:
    """Yield triangles (3, 3, T), by coordinate and corner, the long ones cut at the middle of their longest side."""
    while corners.shape[2]:
        low, high = extremes(corners[:2])
        long = np.maximum(*(high - low)) > longest
        if not long.any():
            yield corners
            return
        yield corners[:, :, ~long]
        corners = corners[:, :, long]
        side = np.square(np.roll(corners, -1, axis=1) - corners)[:2].sum(axis=0).argmax(axis=0)
        a, b, c = (np.take_along_axis(corners, ((side + i) % 3)[None, None], axis=1)[:, 0] for i in range(3))
        middle = (a + b) * np.float32(0.5)
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=2)
