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
        """Raise the cells of one grid that boxes touch to the boxes' values, where they are lower.

        Args:
            level: number of the grid.
            begin, end: (2, N) lowest and highest corners of the boxes in plan, m.
            value: (N,) or one for all.
        """
        grid = self._grids[level]
        first_cell, last_cell = (np.asarray(place / np.float32(self.cells[level]), np.int32) for place in (begin, end))
        for axis in (0, 1):
            np.clip(first_cell[axis], 0, grid.shape[axis] - 1, out=first_cell[axis])
            np.clip(last_cell[axis], 0, grid.shape[axis] - 1, out=last_cell[axis])
        # One cell of all boxes after the other; boxes that are smaller than the largest one draw their last cell again.
        rows, columns = (int((last_cell[axis] - first_cell[axis]).max(initial=0)) + 1 for axis in (0, 1))
        for row, column in np.ndindex(rows, columns):
            cell = np.minimum(first_cell[0] + row, last_cell[0]).astype(np.intp) * grid.shape[1]
            cell += np.minimum(first_cell[1] + column, last_cell[1])
            np.maximum.at(grid.reshape(-1), cell, value)

    def spread(self) -> AnyArray:
        """Raise each grid to what was drawn in coarser ones; return the finest, which then has all."""
        grids = self._grids
        for fine_grid, coarse_grid in zip(grids[-2::-1], grids[:0:-1], strict=True):
            for fine_cells, coarse_cells in _quarters(fine_grid, coarse_grid):
                np.maximum(fine_cells, coarse_cells, out=fine_cells)
        return grids[0]

    def finish(self) -> None:
        """Raise each grid to what was drawn in the others, and make the grids ready for `largest`."""
        self.spread()
        grids = self._grids
        for fine_grid, coarse_grid in pairwise(grids):
            for fine_cells, coarse_cells in _quarters(fine_grid, coarse_grid):
                np.maximum(fine_cells, coarse_cells, out=coarse_cells)
        for grid in grids:  # from now on each cell has the largest value of the two by two cells that begin with it
            grid[:-1] = np.maximum(grid[:-1], grid[1:])
            grid[:, :-1] = np.maximum(grid[:, :-1], grid[:, 1:])
        self._values = np.concatenate([grid.reshape(-1) for grid in grids])
        self._grids = []

    def level_of(self, width: Float) -> Index:
        """Return the number (N,) of the finest grid in which boxes of widths (N,), m, are at most `WINDOW` cells wide.

        For boxes that are wider than that in the last grid it is L, the number of grids.
        """
        level = np.zeros(len(width), np.intp)
        for cell in self.cells.tolist():
            is_wider = width > WINDOW * cell
            if not is_wider.any():
                break
            level += is_wider
        return level

    def largest(self, level: Index, x: Float, y: Float) -> AnyArray:
        """Return the largest values (N,) in boxes up to `WINDOW` cells wide.

        Args:
            level: (N,) grids that are looked into.
            x, y: (N,) lowest corners of the boxes, m.
        """
        scale = np.take(1.0 / self.cells, level)
        rows, columns, first_index = (np.take(values, level) for values in (self._rows, self._columns, self._first))
        row, column = (x * scale).astype(np.intp), (y * scale).astype(np.intp)
        # Four cells, each of which stands for two by two, cover the four by four cells that a box may touch.
        row_starts = [first_index + np.clip(row + shift, 0, rows - 1) * columns for shift in (0, 2)]
        column_numbers = [np.clip(column + shift, 0, columns - 1) for shift in (0, 2)]
        maxima = [np.take(self._values, start + number) for start in row_starts for number in column_numbers]
        return np.asarray(np.maximum(np.maximum(maxima[0], maxima[1]), np.maximum(maxima[2], maxima[3])))


def _quarters(fine_grid: AnyArray, coarse_grid: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Yield, for each corner of the coarse cells, the fine cells there and the coarse cells that they lie in."""
    for row, column in np.ndindex(2, 2):
        fine_cells = fine_grid[row::2, column::2]
        yield fine_cells, coarse_grid[: fine_cells.shape[0], : fine_cells.shape[1]]


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
        self, vertices: Float32, triangles: NDArray[np.int32], longest_piece: float, least_cell: float = 0.0
    ) -> None:
        """Draw triangles; those that are longer in plan than ``longest_piece`` (m) are cut into pieces before.

        Args:
            vertices: (3, V) m.
            triangles: (T, 3) vertices of each.
            longest_piece: m.
            least_cell: see `draw_boxes`.
        """
        for start in range(0, len(triangles), _AT_ONCE):
            corners = vertices[:, triangles[start : start + _AT_ONCE].T]  # coordinate, corner, triangle
            for part in _pieces(corners, longest_piece):
                self.draw_boxes(*extremes(part), least_cell)

    def draw_boxes(self, lowest_corners: Float32, highest_corners: Float32, least_cell: float = 0.0) -> None:
        """Draw the tops of boxes, each in the grid of the finest cells in which it is two cells wide at most.

        Args:
            lowest_corners, highest_corners: (3, N) m.
            least_cell: if above 0, boxes are drawn in no grid of cells finer than this (m), where they are one cell
                wide at most.
        """
        cells = self._grids.cells
        width = np.maximum(highest_corners[0] - lowest_corners[0], highest_corners[1] - lowest_corners[1])
        if least_cell:
            level = np.searchsorted(cells[:-1], np.maximum(width, np.float32(least_cell)))
        else:
            level = np.searchsorted(2.0 * cells[:-1], width)
        # Heights as 16-bit codes, rounded up; the lowest code is that of empty cells.
        code = np.ceil(highest_corners[2] / self._step) - _CODES / 2.0
        code = np.clip(code, _EMPTY + 1, -_EMPTY - 1).astype(np.int16)
        for number in np.unique(level).tolist():
            rows = np.flatnonzero(level == number)
            self._grids.draw(number, lowest_corners[:2, rows], highest_corners[:2, rows], code[rows])
            self._top = max(self._top, float(code[rows].max()))

    def finish(self) -> None:
        """Make the grids ready for `passed_by`, once all is drawn."""
        self._grids.finish()

    def passed_by(self, corner: Float, width: Float, towards: Float) -> Bool:
        """Return a mask (N,) of the beams that pass above everything, from the boxes that they end in to the sky.

        Args:
            corner: (3, N) lowest corner of the boxes, m.
            width: (N,) larger side in plan of the boxes, m.
            towards: (3, N) unit vectors back along the beams; the third component is positive.
        """
        grids, coarsest_level, codes_per_metre = self._grids, len(self._grids.cells) - 1, 1.0 / self._step
        x, y, lowest_code = corner[0], corner[1], corner[2] * codes_per_metre - _CODES / 2.0
        level = grids.level_of(width)
        is_free = level <= coarsest_level
        is_free &= grids.largest(np.minimum(level, coarsest_level), x, y) <= lowest_code
        # Beams that nothing blocks yet, and that aren't above everything: each is followed box by box.
        rows = np.flatnonzero(is_free & (lowest_code < self._top))
        beams = _Beams(rows, x[rows], y[rows], lowest_code[rows], width[rows], level[rows], *towards[:, rows])
        beams.rise *= codes_per_metre
        while len(beams.number):
            np.minimum(beams.level + 1, coarsest_level, out=beams.level)
            length, box_corner = beams.next_boxes(grids.cells, self._top)
            is_above = grids.largest(beams.level, *box_corner) <= beams.lowest
            is_free[beams.number[~is_above]] = False
            beams.advance(length)
            beams = beams.select(np.flatnonzero(is_above & (beams.lowest < self._top)))
        return is_free


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

    def next_boxes(self, cells: Float, top_code: float) -> tuple[Float, list[Float]]:
        """Return the next part of each beam: its length (N,), m, and x and y (N,) of its box's lowest corner, m.

        A part is as long as the box around it may be in the grid of the beam's level, and ends where the beam has
        passed everything.

        Args:
            cells: (L,) widths of the levels' cells, m.
            top_code: code above which nothing is any more.
        """
        length = (top_code - self.lowest) / self.rise
        speed = np.maximum(np.abs(self.ahead), np.abs(self.aside))
        room = WINDOW * np.take(cells, self.level) - self.width
        # In the last grid a box may be as large as the area: there the length has no limit.
        np.minimum(length, room / np.maximum(speed, 1e-9), where=self.level < len(cells) - 1, out=length)
        return length, [self.x + np.minimum(length * self.ahead, 0.0), self.y + np.minimum(length * self.aside, 0.0)]

    def advance(self, length: Float) -> None:
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


def _pieces(corners: Float32, longest_piece: float) -> Iterator[Float32]:
    """Yield triangles, and long ones in pieces: they are cut at the middle of their longest side until all are short.

    Args:
        corners: (3, 3, T) by coordinate and corner, m.
        longest_piece: largest extent of a piece along x or y, m.
    """
    while corners.shape[2]:
        lowest_corners, highest_corners = extremes(corners[:2])
        is_long = np.maximum(*(highest_corners - lowest_corners)) > longest_piece
        if not is_long.any():
            yield corners
            return
        yield corners[:, :, ~is_long]
        corners = corners[:, :, is_long]
        # Longest side in plan: from corner a to b, opposite to c.
        squared_length = np.square(np.roll(corners, -1, axis=1) - corners)[:2].sum(axis=0)
        side = squared_length.argmax(axis=0)
        a, b, c = (np.take_along_axis(corners, ((side + i) % 3)[None, None], axis=1)[:, 0] for i in range(3))
        middle = (a + b) * np.float32(0.5)
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=2)
