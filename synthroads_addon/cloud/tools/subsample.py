"""Grid subsampling: of each cell of a cubic grid one point stays, in memory that doesn't grow with the cloud.

The point nearest the cell's centre stays, of equally near ones the first by its attributes: the result depends neither
on the points' order nor on how they come in blocks. Points are first sorted into tiles on disk (a spatial hash), then
tile after tile is thinned out in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ...base.errors import InputError
from ..points import PointBlock
from .tile_files import TileFiles

_CELLS_ACROSS_TILE = 512
_SMALLEST_TILE = 20.0
"""Edge of a tile, m: 40,000 to 100,000 points of a usual scan."""
_TIE_ORDER = ("gps_time", "return_number", "intensity", "range", "instance_id", "class_id", "scan_angle_deg", "strip")


class GridSubsampler(TileFiles):
    """Takes a cloud's blocks and gives back one point per occupied cell; a context manager.

    Args:
        cell: edge of the grid's cells, m; a cell's corners are whole multiples of it in map coordinates.
        folder: where the tiles are kept meanwhile, as large as the cloud; a folder in it is made and removed.

    Attributes:
        points_read: points handed in so far.
    """

    def __init__(self, cell: float, folder: Path) -> None:
        if not 0.0005 <= cell <= 1000:
            raise InputError("grid", cell, "must be 0.0005 to 1000 m")
        super().__init__(folder)
        self.cell = float(cell)
        self.points_read = 0
        self._tile = max(_CELLS_ACROSS_TILE, int(np.ceil(_SMALLEST_TILE / self.cell)))  # cells: none is cut in two

    def add(self, block: PointBlock) -> None:
        """Take a block; all blocks must have the same attributes. Thinning it at once saves room on the disk."""
        if len(block) == 0:
            return
        self.points_read += len(block)
        block = block.select(keep_one_per_cell(block, self.cell))
        self.append(block, np.floor(block.xyz[:, :2] / self.cell).astype(np.int64) // self._tile)

    def blocks(self) -> Iterator[PointBlock]:
        """Yield what stays, tile by tile, by time within a tile (which LAZ packs best): the order handed in is lost."""
        for _, tile in self.by_tile():
            points = tile.select(keep_one_per_cell(tile, self.cell))
            yield points.select(np.lexsort((points.return_number, points.gps_time)))


def keep_one_per_cell(block: PointBlock, cell: float) -> Index:
    """Return the indices of the points that stay of a block, ordered by their cells (z, then y, then x)."""
    cells = np.floor(block.xyz / cell)
    away = ((block.xyz - (cells + 0.5) * cell) ** 2).sum(axis=1)
    # A step of a billionth of the cell's square: roundings of equal distances must not decide.
    nearness = np.rint(away / (cell * cell) * 1e9)
    order = _order(block, cells, nearness)
    cells = cells[order]
    first = np.r_[True, np.any(cells[1:] != cells[:-1], axis=1)] if len(cells) else np.zeros(0, dtype=bool)
    return order[first]


def _order(block: PointBlock, cells: Float, nearness: Float) -> Index:
    """Return the order by cell, then nearness; where points tie, by position and attributes."""
    low = cells.min(axis=0) if len(cells) else np.zeros(3)
    spans = (cells.max(axis=0) - low + 1 if len(cells) else np.ones(3)).astype(np.int64)
    if float(np.prod(spans.astype(np.float64))) < 2**62:
        relative = (cells - low).astype(np.int64)
        key = (relative[:, 2] * spans[1] + relative[:, 1]) * spans[0] + relative[:, 0]
        order = np.lexsort((nearness, key))
        tied = (np.diff(key[order]) == 0) & (np.diff(nearness[order]) == 0)
        keys: tuple[AnyArray, ...] = (nearness, key)
    else:
        order = np.lexsort((nearness, *cells.T))
        tied = np.all(np.diff(cells[order], axis=0) == 0, axis=1) & (np.diff(nearness[order]) == 0)
        keys = (nearness, *cells.T)
    if not tied.any():
        return order
    ties = tuple(np.asarray(getattr(block, name)) for name in reversed(_TIE_ORDER))
    return np.lexsort((*ties, *block.xyz.T, *keys))
