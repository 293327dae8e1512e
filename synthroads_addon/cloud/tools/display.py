"""A cloud thinned out to be looked at: a stated number of points, read block by block, with colours by what is asked.

Of a cloud of N points B are kept: the file's points are cut into B runs of N/B neighbours, and of each run the one that
a keyed random number picks stays. So the number is exact, the same file gives the same points however it is read, every
strip keeps its share, and no pattern of lines arises as it would from every n-th point. They are shuffled
so that the first of them, however many, are an even choice as well: as many as can be drawn while a view is turned.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ...base.arrays import Float, Float32, Int, UInt8
from ...base.classes import ClassScheme, PointClass
from ...base.errors import InputError
from ...base.random_streams import stream
from ..formats.header import CloudHeader
from ..formats.registry import open_cloud
from .picture import Brightness, grays

ColourBy = Literal["class", "intensity", "rgb", "height"]
COLOURINGS: tuple[ColourBy, ...] = get_args(ColourBy)
BLOCK = 50_000
"""Points that are read at a time, those of one chunk of LAZ: some hundredths of a second on one core, so that a window
stays alive beside it."""

_HEIGHT_STOPS = ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725")
"""Viridis at equal steps: even in brightness, and told apart by the colour-blind (S. van der Walt, N. Smith, 2015)."""


@dataclass
class DisplayCloud:
    """A random subset of N points of a cloud's file, in random order, to be drawn in a viewport.

    Attributes:
        header: what the file says of itself.
        origin: (3,) map coordinates that `xyz` counts from, m.
        xyz: (N, 3) float32 coordinates less the origin, subtracted in float64, m.
        class_id: (N,) uint8 classes of the header's scheme.
        rgb: (N, 3) uint8 sRGB.
        brightness: (N,) float32, see `Brightness`.
        brightness_text: what that is.
        counts: (256,) points of each class in the whole file.
    """

    header: CloudHeader
    origin: Float
    xyz: Float32
    class_id: UInt8
    rgb: UInt8
    brightness: Float32
    brightness_text: str
    counts: Int
    _colors: tuple[ColourBy, UInt8] | None = field(default=None, repr=False)
    _limits: dict[str, tuple[float, float]] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def total(self) -> int:
        """Return the number of points of the whole file."""
        return int(self.counts.sum())

    def colorings(self) -> tuple[ColourBy, ...]:
        """Return the quantities that the points can be coloured by; ``rgb`` only if the file has colours."""
        return tuple(name for name in COLOURINGS if name != "rgb" or self.header.has_color)

    def classes(self) -> list[tuple[PointClass, int]]:
        """Return the classes that occur in the file, with their numbers of points, by increasing id."""
        scheme: ClassScheme = self.header.scheme
        rows = {row.id: row for row in scheme.rows}
        return [
            (rows.get(i) or PointClass(i, scheme.names().get(i, f"class {i}"), i, _rgb_of(scheme, i)), int(n))
            for i, n in enumerate(self.counts)
            if n
        ]

    def limits(self, by: ColourBy) -> tuple[float, float]:
        """Return the 0.5 and 99.5 % quantiles that the first and last colour stand for; heights in map m; cached."""
        if by not in self._limits:
            values, shift = (self.brightness, 0.0) if by == "intensity" else (self.xyz[:, 2], self.origin[2])
            minimum, maximum = np.quantile(values, [0.005, 0.995])
            self._limits[by] = (float(minimum + shift), float(maximum + shift))
        return self._limits[by]

    def colors(self, by: ColourBy) -> UInt8:
        """Return the points' colours (N, 4), opaque 8-bit sRGB; the last ones are kept until `forget_colors`."""
        if self._colors is None or self._colors[0] != by:
            self._colors = None
            colors = np.empty((len(self), 4), np.uint8)
            colors[:, :3], colors[:, 3] = self._rgb_by(by), 255
            self._colors = by, colors
        return self._colors[1]

    def forget_colors(self) -> None:
        """Free the memory of the colours that were computed last."""
        self._colors = None

    def _rgb_by(self, by: ColourBy) -> UInt8:
        """Return the points' colours (N, 3), 8-bit sRGB, by a quantity."""
        if by == "class":
            return self.header.scheme.colors()[self.class_id]
        if by == "rgb":
            return self.rgb
        if by == "intensity":
            shades, _ = grays(self.brightness.astype(np.float64), np.ones(len(self), dtype=bool), self.brightness_text)
            return shades.astype(np.uint8)
        minimum, maximum = (value - self.origin[2] for value in self.limits("height"))
        share = np.clip((self.xyz[:, 2] - minimum) / max(maximum - minimum, 1e-9), 0.0, 1.0)
        return height_colors()[np.nan_to_num(share * 255.0).astype(np.uint8)]


def height_colors() -> UInt8:
    """Return a colour table (256, 3), 8-bit sRGB, from low to high: Viridis."""
    stops = np.array([[int(stop[i : i + 2], 16) for i in (1, 3, 5)] for stop in _HEIGHT_STOPS], dtype=np.float64)
    positions = np.linspace(0.0, len(stops) - 1.0, 256)
    return np.column_stack([np.interp(positions, np.arange(len(stops)), stops[:, i]) for i in range(3)]).astype(
        np.uint8
    )


def chosen_points(count: int, budget: int) -> Int:
    """Return the increasing indices (min(count, budget),) of a stratified random choice of ``count`` points."""
    if count <= budget:
        return np.arange(count, dtype=np.int64)
    edges = np.arange(budget + 1, dtype=np.int64) * count // budget
    picks = stream(0, "display", count, budget).random(budget)
    return edges[:-1] + (picks * np.diff(edges)).astype(np.int64)


def drawing_order(count: int) -> Int:
    """Return a random permutation (count,): where each chosen point, in the file's order, is drawn."""
    return stream(0, "drawing order", count).permutation(count)


def read_display(
    path: Path,
    budget: int,
    origin: Float | None = None,
    progress: Callable[[float], None] = lambda share: None,
    block: int = BLOCK,
) -> DisplayCloud:
    """Read a cloud block by block and return a random choice of at most ``budget`` points, to be drawn.

    Memory is that of ``budget`` points (20 bytes each, 8 more while the file is read, and 4 for a colouring) and one
    block.

    Args:
        path: LAS, LAZ, PLY, E57 or NPZ.
        budget: largest number of points that are kept.
        origin: (3,) map coordinates of the frame that the points are drawn in; near the first point if None.
        progress: called with the share that is read after each block; what it raises ends the reading.
        block: points that are read at a time; the result doesn't depend on it.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it is no cloud, damaged, or has no points; or the budget is below 1.
    """
    if budget < 1:
        raise InputError("points", budget, "must be at least 1")
    with open_cloud(path) as cloud:
        indices = chosen_points(cloud.header.count, budget)
        if len(indices) == 0:
            raise InputError(str(path), None, "has no points")
        size, places = len(indices), drawing_order(len(indices)).astype(np.uint32)
        indices = indices if cloud.header.count >= 2**32 else indices.astype(np.uint32)
        xyz, class_id = np.empty((size, 3), np.float32), np.empty(size, np.uint8)
        rgb, brightness, counts = np.empty((size, 3), np.uint8), np.empty(size, np.float32), np.zeros(256, np.int64)
        measure, position, filled_count = Brightness(), 0, 0
        for points in cloud.blocks(block):
            origin = np.floor(points.xyz[0]) if origin is None else np.asarray(origin, np.float64)
            counts += np.bincount(points.class_id, minlength=256)
            filled_end = int(np.searchsorted(indices, position + len(points)))
            block_rows, display_rows = indices[filled_count:filled_end] - position, places[filled_count:filled_end]
            xyz[display_rows] = points.xyz[block_rows] - origin
            class_id[display_rows] = points.class_id[block_rows]
            rgb[display_rows] = points.rgb[block_rows] >> 8
            brightness[display_rows] = np.nan_to_num(measure.values(points)[block_rows])
            position, filled_count = position + len(points), filled_end
            progress(position / cloud.header.count)
        assert origin is not None
        return DisplayCloud(cloud.header, origin, xyz, class_id, rgb, brightness, measure.text, counts)


def _rgb_of(scheme: ClassScheme, number: int) -> tuple[int, int, int]:
    """Return the colour of a class number in a scheme, 8-bit sRGB."""
    red, green, blue = (int(value) for value in scheme.colors()[number])
    return red, green, blue
