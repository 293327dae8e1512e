"""A cloud's points in memory, for learning: local coordinates, shares instead of raw steps, classes by name."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import AnyArray, Bool, Float, Float32, Index, Int, UInt8
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.cloud.colours import SIXTEEN_BITS
from synthroads_addon.cloud.formats.header import CloudHeader
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock

GROUND_CLASSES = ("ground", "road", "road_marking", "roadside", "road_surface")
"""Names of a road and the ground beside it, in the project's own schemes and in LAS's codes (ASPRS)."""
UNSORTED_CLASSES = ("never_classified", "unclassified")
"""Names of points that nobody has sorted."""
ROAD_CLASSES = ("road", "road_marking", "road_surface")


@dataclass(frozen=True)
class Points:
    """N points of one cloud in memory: local coordinates, intensities, colours and classes.

    Attributes:
        origin: (3,) float64 map coordinates that were subtracted, whole metres.
        xyz: (N, 3) float64 local coordinates, m.
        intensity: (N,) float32, as a share of the file's 16 bits.
        rgb: (N, 3) float32 sRGB from 0 to 1; 0 without colours.
        class_id: (N,) uint8, in the file's own scheme.
        class_names: name of each class by its id.
        has_color: whether the points have colours; a file whose colours are all 0 has none.
        epsg: code of the map coordinate system, None if the file doesn't say.
        place: coordinate system of the points, and that of their file.
    """

    origin: Float
    xyz: AnyArray
    intensity: Float32
    rgb: AnyArray
    class_id: UInt8
    class_names: Mapping[int, str] = field(default_factory=dict)
    has_color: bool = False
    epsg: int | None = None
    place: Placement = field(default_factory=Placement)
    per_point: ClassVar[tuple[str, ...]] = ("xyz", "intensity", "rgb", "class_id")

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, keep: Bool | Index | slice) -> Self:
        """Return the points chosen by a mask, indices or a slice."""
        return replace(self, **{name: getattr(self, name)[keep] for name in self.per_point})

    def class_table(self, names: Collection[str]) -> Bool:
        """Return a lookup table (256,) by class id: whether the class has one of the names."""
        return np.array([self.class_names.get(number) in names for number in range(256)])

    def of_class(self, names: Collection[str]) -> Bool:
        """Return a mask (N,) of the points whose class has one of the names."""
        return np.asarray(self.class_table(names)[self.class_id])


def read_points(path: Path, classes: Collection[str] | None = None) -> Points:
    """Read a cloud's points that are neither withheld nor noise into memory, or only those of some classes.

    Args:
        path: the cloud.
        classes: names of the classes to keep; None: every point.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file is no cloud, is damaged, or holds no point of these classes.
    """
    with open_cloud(path) as cloud:
        header = cloud.header
        names = header.scheme.names()
        class_mask = np.array([classes is None or names.get(number) in classes for number in range(256)])
        blocks = [block.select(class_mask[block.class_id]) for block in cloud.usable_blocks()]
    blocks = [block for block in blocks if len(block)]
    if not blocks:
        lack = "no point at all" if classes is None else f"no point of the classes {', '.join(sorted(classes))}"
        raise InputError(str(path), None, f"must hold points; it has {lack}")
    return points_of(header, blocks)


def read_ground(path: Path) -> Points:
    """Read the points of the road and the ground beside it, by their classes; all points of a cloud without classes.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file is no cloud, is damaged, or is classified but has no ground.
    """
    points = read_points(path)
    ground = points.of_class(GROUND_CLASSES)
    if ground.any():
        return points.select(ground)
    if points.of_class(UNSORTED_CLASSES).all():
        return points
    raise InputError(str(path), None, f"must have points of at least one of the classes {', '.join(GROUND_CLASSES)}")


def points_of(header: CloudHeader, blocks: Sequence[PointBlock], colored: bool | None = None) -> Points:
    """Return blocks of a cloud concatenated as `Points`: shifted to a local origin, intensities and colours as shares.

    Args:
        header: header of the cloud's file.
        blocks: blocks of the cloud, at least one.
        colored: whether the cloud has any colour that isn't black; None to look it up in the blocks.
    """
    xyz, intensity, rgb, class_id = (
        np.concatenate([getattr(block, name) for block in blocks]) for name in ("xyz", "intensity", "rgb", "class_id")
    )
    origin = np.floor(xyz.min(axis=0))
    colored = bool(rgb.any()) if colored is None else colored
    return Points(
        origin=origin,
        xyz=xyz - origin,
        intensity=(intensity * ((header.intensity_scale or 1.0) / SIXTEEN_BITS)).astype(np.float32),
        rgb=(rgb / SIXTEEN_BITS).astype(np.float32),
        class_id=class_id,
        class_names=header.scheme.names(),
        has_color=header.has_color and colored,
        epsg=header.epsg,
        place=header.place,
    )


def voxel_sample(coord: NDArray[np.floating[Any]], cell: float) -> Index:
    """Return the ascending indices of one point per occupied cell of a cubic grid: the nearest to the cell's centre.

    Of equally near points the first counts.

    Args:
        coord: (N, 3) m, counted from a cell's corner.
        cell: edge of the cells, m.

    Raises:
        InputError: the points lie too far apart for cells of this size.
    """
    if len(coord) == 0:
        return np.zeros(0, dtype=np.intp)
    steps = np.asarray(coord, dtype=np.float64) / cell
    cells = np.floor(steps)
    key = cell_keys(cells)
    order = np.lexsort((np.square(steps - cells - 0.5).sum(axis=1), key))
    is_first = np.r_[True, np.diff(key[order]) != 0]
    return np.sort(order[is_first])


def cell_keys(cells: Float) -> Int:
    """Return an integer key (N,) per cell of integer coordinates (N, 3), equal for equal cells, within this array only.

    Raises:
        InputError: the cells span more than 64 bits can tell apart.
    """
    lowest_cell = cells.min(axis=0)
    spans = cells.max(axis=0) - lowest_cell + 1
    if not float(np.prod(spans)) < 2**62:  # so that NaN is refused too
        text = " x ".join(f"{span:.0f}" for span in spans)
        raise InputError("coord", text, "must span fewer than 2^62 cells in all")
    relative = (cells - lowest_cell).astype(np.int64)
    width, depth = int(spans[0]), int(spans[1])
    return np.asarray((relative[:, 2] * depth + relative[:, 1]) * width + relative[:, 0])
