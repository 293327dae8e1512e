"""Points gathered into the cells of a picture, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import AnyArray, Bool, Float, Index, UInt8
from ..points import PointBlock


@dataclass(frozen=True)
class Axes:
    """Coordinates along the picture's edges.

    Attributes:
        left, low: of the lower left corner, m.
        across, up: of a pixel, m.
    """

    left: float
    low: float
    across: float
    up: float


class Brightness:
    """Values drawn as intensity: times the squared range where the points have one, so that nearness doesn't show.

    Attributes:
        text: what it is.
    """

    text = "intensity as stored"

    def values(self, block: PointBlock) -> Float:
        """Return a block's values (N,)."""
        if not len(block) or np.isnan(block.range[0]):
            return block.intensity
        self.text = "intensity x squared range (white target = 1)"
        return block.intensity * block.range**2


class Raster:
    """A picture's cells, row 0 at the top: mean intensity and colour of each, and the class of its foremost point.

    Args:
        axes: coordinates of the cells.
        size: number of cells across and up.

    Attributes:
        count: (cells,) points in each cell.
        brightness: what the mean intensity is of.
        label: (cells,) class of the foremost point; 255 where there is none.
    """

    def __init__(self, axes: Axes, size: tuple[int, int]) -> None:
        self.axes, self.brightness = axes, Brightness()
        self.width, self.height = size
        cells = self.width * self.height
        self.count = np.zeros(cells)
        self.label = np.full(cells, 255, dtype=np.uint8)
        self._intensity = np.zeros(cells)
        self._rgb = np.zeros((3, cells))
        self._front = np.full(cells, -np.inf)

    def add(self, block: PointBlock, place: tuple[Float, Float], depth: Float) -> None:
        """Add a block's points.

        Args:
            block: N points.
            place: their two coordinates (N,) in the picture, m; what lies outside is left out.
            depth: (N,) the larger, the further in front.
        """
        brightness = self.brightness.values(block)
        column = np.floor((place[0] - self.axes.left) / self.axes.across)
        row = self.height - 1 - np.floor((place[1] - self.axes.low) / self.axes.up)
        inside = np.flatnonzero((column >= 0) & (column < self.width) & (row >= 0) & (row < self.height))
        if len(inside) == 0:
            return
        cell = (row[inside] * self.width + column[inside]).astype(np.intp)
        first, last = int(cell.min()), int(cell.max()) + 1
        window, size, within = slice(first, last), last - first, cell - first
        self.count[window] += np.bincount(within, minlength=size)
        self._intensity[window] += np.bincount(within, brightness[inside], size)
        for channel in range(3):
            self._rgb[channel, window] += np.bincount(within, block.rgb[inside, channel], size)
        self._keep_foremost(cell, depth[inside], block.class_id[inside])

    def intensity(self) -> Float:
        """Return the mean intensity (cells,); 0 where there are no points."""
        return self._intensity / np.maximum(self.count, 1)

    def rgb(self) -> Float:
        """Return the mean colour (cells, 3), 0 to 255."""
        return (self._rgb / np.maximum(self.count, 1) / 257.0).T

    def picture(self, colors: AnyArray, paper: tuple[int, int, int]) -> UInt8:
        """Return colours (cells, 3) as a picture (height, width, 3), with larger dots the fewer cells are filled."""
        shape = (self.height, self.width)
        filled = (self.count > 0).reshape(shape)
        result = np.where(self.count[:, None] > 0, colors, paper).astype(np.uint8).reshape(*shape, 3)
        for _ in range(self._dot_growth(filled)):
            result, filled = _grow_cells(result, filled)
        return result

    def _dot_growth(self, filled: Bool) -> int:
        """Return by how many cells dots are to grow: by none where most cells between points are filled."""
        rows, columns = filled.any(axis=1), filled.any(axis=0)
        used = filled[rows][:, columns]
        share = float(used.mean()) if used.size else 1.0
        neighbours = float((used[:, 1:] & used[:, :-1]).sum() / max(1, used.sum())) if used.size else 1.0
        return 0 if share > 0.35 or neighbours > 0.8 else 1 if neighbours > 0.4 else 2

    def _keep_foremost(self, cell: Index, depth: Float, label: UInt8) -> None:
        np.maximum.at(self._front, cell, depth)
        foremost = depth == self._front[cell]
        self.label[cell[foremost]] = label[foremost]


def _grow_cells(picture: UInt8, filled: Bool) -> tuple[UInt8, Bool]:
    """Fill empty cells beside filled ones with their colours."""
    result, done = picture.copy(), filled.copy()
    for axis, step in ((1, 1), (1, -1), (0, 1), (0, -1)):
        near, color = np.roll(filled, step, axis), np.roll(picture, step, axis)
        edge: list[slice | int] = [slice(None), slice(None)]
        edge[axis] = 0 if step == 1 else -1
        near[tuple(edge)] = False  # nothing comes round from the other side
        new = near & ~done
        result[new] = color[new]
        done |= new
    return result, done
