"""Grid subsampling: of each cell of a cubic grid one point stays, in memory that doesn't grow with the cloud.

The point nearest the cell's centre stays, of equally near ones the first by its attributes: the result depends neither
on the points' order nor on how they come in blocks. Points are first sorted into tiles on disk (a spatial hash), then
tile after tile is thinned out in memory.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import AnyArray, Float, Index, Int
from ...base.errors import InputError
from ...base.scratch.folders import scratch_folder
from ..points import PointBlock, make_block

_CELLS_ACROSS_TILE = 512
_SMALLEST_TILE = 20.0
"""Edge of a tile, m: 40,000 to 100,000 points of a usual scan."""
_TIE_ORDER = ("gps_time", "return_number", "intensity", "range", "instance_id", "class_id", "scan_angle_deg", "strip")


class TileFiles:
    """Scratch files of points, one for each tile, to work on a cloud of any size; a context manager.

    Args:
        folder: where the files are kept meanwhile, as large as the cloud; a folder in it is made and removed.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._scratch = folder, ExitStack()
        self._type: np.dtype[Any] | None = None
        self._paths: dict[tuple[int, int], Path] = {}

    def __enter__(self) -> Self:
        self._scratch_path = self._scratch.enter_context(scratch_folder(self._folder))
        return self

    def __exit__(self, *_: object) -> None:
        self._scratch.close()

    def append(self, block: PointBlock, tile: Int) -> None:
        """Append a block's points to the files of their tiles (N, 2); all blocks must have the same attributes."""
        if len(block) == 0:
            return
        arrays = block.attributes()
        self._type = self._type or np.dtype([(name, a.dtype, a.shape[1:]) for name, a in arrays.items()])
        record = np.empty(len(block), dtype=self._type)
        for name, array in arrays.items():
            record[name] = array
        order = np.lexsort(tile.T)
        tile, record = tile[order], record[order]
        starts = np.flatnonzero(np.r_[True, np.any(tile[1:] != tile[:-1], axis=1)])
        for begin, end in zip(starts, np.r_[starts[1:], len(tile)], strict=True):
            key = (int(tile[begin, 0]), int(tile[begin, 1]))
            path = self._paths.setdefault(key, self._scratch_path / f"{key[0]}_{key[1]}")
            with path.open("ab") as file:
                file.write(record[begin:end].tobytes())

    def by_tile(self) -> Iterator[tuple[tuple[int, int], PointBlock]]:
        """Yield each tile's (column, row) and its points, in the order added, and remove its file."""
        for key, path in sorted(self._paths.items()):
            record = np.fromfile(path, dtype=self._type)
            path.unlink()
            yield key, make_block(**{name: np.ascontiguousarray(record[name]) for name in record.dtype.names or ()})


class GridSubsampler(TileFiles):
    """Subsampler that keeps one point per occupied cell of a cubic grid; a context manager.

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
        """Add a block, thinned at once to save room on the disk; all blocks must have the same attributes."""
        if len(block) == 0:
            return
        self.points_read += len(block)
        block = block.select(keep_one_per_cell(block, self.cell))
        self.append(block, np.floor(block.xyz[:, :2] / self.cell).astype(np.int64) // self._tile)

    def blocks(self) -> Iterator[PointBlock]:
        """Yield the points that stay, tile by tile, ordered by time within a tile, which LAZ packs best."""
        for _, tile in self.by_tile():
            points = tile.select(keep_one_per_cell(tile, self.cell))
            yield points.select(np.lexsort((points.return_number, points.gps_time)))


def keep_one_per_cell(block: PointBlock, cell: float) -> Index:
    """Return the indices of the points nearest to their cells' centres, one per cell, ordered by z, y, x.

    Args:
        block: of points.
        cell: edge of a cell, m.
    """
    cells = np.floor(block.xyz / cell)
    squared_distance = ((block.xyz - (cells + 0.5) * cell) ** 2).sum(axis=1)
    # A step of a billionth of the cell's square: roundings of equal distances must not decide.
    nearness = np.rint(squared_distance / (cell * cell) * 1e9)
    order = _order(block, cells, nearness)
    cells = cells[order]
    begins_cell = np.r_[True, np.any(cells[1:] != cells[:-1], axis=1)] if len(cells) else np.zeros(0, dtype=bool)
    return order[begins_cell]


def _order(block: PointBlock, cells: Float, nearness: Float) -> Index:
    """Return the indices that sort points by cell, then nearness, then position and attributes where they tie.

    Args:
        block: N points.
        cells: (N, 3) numbers of their cells.
        nearness: (N,) the less, the nearer to the cell's centre.
    """
    least_numbers = cells.min(axis=0) if len(cells) else np.zeros(3)
    spans = (cells.max(axis=0) - least_numbers + 1 if len(cells) else np.ones(3)).astype(np.int64)
    if float(np.prod(spans.astype(np.float64))) < 2**62:
        # The three numbers as one, which sorts faster.
        relative = (cells - least_numbers).astype(np.int64)
        key = (relative[:, 2] * spans[1] + relative[:, 1]) * spans[0] + relative[:, 0]
        order = np.lexsort((nearness, key))
        has_ties = (np.diff(key[order]) == 0) & (np.diff(nearness[order]) == 0)
        keys: tuple[AnyArray, ...] = (nearness, key)
    else:
        order = np.lexsort((nearness, *cells.T))
        has_ties = np.all(np.diff(cells[order], axis=0) == 0, axis=1) & (np.diff(nearness[order]) == 0)
        keys = (nearness, *cells.T)
    if not has_ties.any():
        return order
    # Only now, as it is slow: sorted by all attributes as well, of which `lexsort` takes the last one first.
    ties = tuple(np.asarray(getattr(block, name)) for name in reversed(_TIE_ORDER))
    return np.lexsort((*ties, *block.xyz.T, *keys))
