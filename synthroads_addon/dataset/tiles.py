"""A cloud cut into square tiles on disk, so that layouts can be written tile by tile in bounded memory."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.arrays import Float
from ..cloud.points import PointBlock
from ..cloud.tools.subsample import TileFiles


@dataclass(frozen=True)
class Tile:
    """The points of one square tile of a cloud, and where it lies.

    Attributes:
        row, column: of the tile, counted northwards and eastwards from the origin's.
        corner: (3,) map coordinates of its south-western corner at the height of the origin, m.
        points: its points, in the order handed in.
    """

    row: int
    column: int
    corner: Float
    points: PointBlock

    @property
    def name(self) -> str:
        """Return the tile's name, such as n00e03 or s01w02, by its row and column."""
        north, east = ("s" if self.row < 0 else "n"), ("w" if self.column < 0 else "e")
        return f"{north}{abs(self.row):02d}{east}{abs(self.column):02d}"


class TileSorter(TileFiles):
    """Sorts a cloud's blocks of points into square tiles on disk; a context manager.

    Args:
        edge: of a tile, m.
        origin: (3,) map coordinates of a tile's corner, m.
        folder: see `TileFiles`.
    """

    def __init__(self, edge: float, origin: Float, folder: Path) -> None:
        super().__init__(folder)
        self.edge = edge
        self.origin = np.asarray(origin, dtype=np.float64)

    def add(self, blocks: Iterable[PointBlock]) -> None:
        """Sort blocks of points into the tiles' files; all must have the same attributes."""
        for block in blocks:
            place = np.floor((block.xyz[:, :2] - self.origin[:2]) / self.edge).astype(np.int64)
            self.append(block, place[:, ::-1])

    def tiles(self) -> Iterator[Tile]:
        """Yield the tiles with their points, by row and column."""
        for (row, column), points in self.by_tile():
            corner = self.origin + np.array([column * self.edge, row * self.edge, 0.0])
            yield Tile(row, column, corner, points)
