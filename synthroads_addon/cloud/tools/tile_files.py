"""Points sorted into tiles on disk, so that a cloud of any size can be worked on tile by tile."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import Int
from ...base.scratch.folders import scratch_folder
from ..points import PointBlock, make_block


class TileFiles:
    """A file of points for each tile; a context manager.

    Args:
        folder: where the files are kept meanwhile, as large as the cloud; a folder in it is made and removed.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._scratch = folder, ExitStack()
        self._type: np.dtype[Any] | None = None
        self._paths: dict[tuple[int, int], Path] = {}

    def __enter__(self) -> Self:
        self._made = self._scratch.enter_context(scratch_folder(self._folder))
        return self

    def __exit__(self, *_: object) -> None:
        self._scratch.close()

    def append(self, block: PointBlock, tile: Int) -> None:
        """Append a block's points to their tiles (N, 2); all blocks must have the same attributes."""
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
        for first, last in zip(starts, np.r_[starts[1:], len(tile)], strict=True):
            key = (int(tile[first, 0]), int(tile[first, 1]))
            path = self._paths.setdefault(key, self._made / f"{key[0]}_{key[1]}")
            with path.open("ab") as file:
                file.write(record[first:last].tobytes())

    def by_tile(self) -> Iterator[tuple[tuple[int, int], PointBlock]]:
        """Yield each tile's numbers and its points in the order handed in; its file is removed."""
        for key, path in sorted(self._paths.items()):
            record = np.fromfile(path, dtype=self._type)
            path.unlink()
            yield key, make_block(**{name: np.ascontiguousarray(record[name]) for name in record.dtype.names or ()})
