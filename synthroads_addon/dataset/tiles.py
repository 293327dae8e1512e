"""A cloud cut into square tiles on disk, so that layouts can be written tile by tile in bounded memory."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import PointBlock, make_block


@dataclass(frozen=True)
class Tile:
    """The points of one tile.

    Attributes:
        row, column: of the tile, counted northwards and eastwards from the origin's.
        corner: (3,) map coordinates of its south-western corner at the height of the origin, m.
        points: its points, in the order handed in.
    """

    row: int
    column: int
    corner: NDArray[np.float64]
    points: PointBlock

    @property
    def name(self) -> str:
        """Return a name that sorts well: n00e03, s01w02."""
        north, east = ("s" if self.row < 0 else "n"), ("w" if self.column < 0 else "e")
        return f"{north}{abs(self.row):02d}{east}{abs(self.column):02d}"


class TileSorter:
    """Takes a cloud's blocks and gives them back tile by tile; a context manager.

    Args:
        edge: of a tile, m.
        origin: (3,) map coordinates of a tile's corner, m.
        folder: where the tiles are kept meanwhile; a folder in it is made and removed.
    """

    def __init__(self, edge: float, origin: NDArray[np.float64], folder: Path) -> None:
        self.edge = edge
        self.origin = np.asarray(origin, dtype=np.float64)
        self._folder = folder
        self._names: list[str] = []
        self._type: np.dtype[Any] | None = None
        self._tiles: dict[tuple[int, int], Path] = {}

    def __enter__(self) -> TileSorter:
        self._made = Path(tempfile.mkdtemp(prefix=".tiles-", dir=self._folder))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self._made, ignore_errors=True)

    def add(self, blocks: Iterable[PointBlock]) -> None:
        """Take blocks; all must have the same attributes."""
        for block in blocks:
            arrays = block.attributes()
            if self._type is None:
                self._names = list(arrays)
                self._type = np.dtype([(name, array.dtype, array.shape[1:]) for name, array in arrays.items()])
            record = np.empty(len(block), dtype=self._type)
            for name, array in arrays.items():
                record[name] = array
            place = np.floor((block.xyz[:, :2] - self.origin[:2]) / self.edge).astype(np.int64)
            for column, row in np.unique(place, axis=0).tolist():
                key = (row, column)
                path = self._tiles.setdefault(key, self._made / f"{row}_{column}")
                with path.open("ab") as file:
                    file.write(record[(place[:, 0] == column) & (place[:, 1] == row)].tobytes())

    def tiles(self) -> Iterator[Tile]:
        """Yield the tiles by row and column."""
        for row, column in sorted(self._tiles):
            record = np.fromfile(self._tiles[row, column], dtype=self._type)
            points = make_block(**{name: np.ascontiguousarray(record[name]) for name in self._names})
            corner = self.origin + np.array([column * self.edge, row * self.edge, 0.0])
            yield Tile(row, column, corner, points)
