"""The points that a road is reconstructed from, sorted by what they can tell. Instance numbers are never read."""

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from pathlib import Path as FilePath
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..base.arrays import Bool, Float, Index
from ..base.classes import ClassScheme
from ..base.errors import InputError
from ..base.maps.places import Placement
from ..base.progress import Progress, silent
from ..cloud.formats.registry import open_cloud
from ..cloud.strays import Strays
from .path import CloudPath

_Points = tuple[Float, NDArray[np.float32], NDArray[np.uint8]]

FEWEST_POINTS = 2000
"""Fewer points on the road's surface than this are no road that could be measured. Chosen: ten on each metre of 200
m."""
_LABELLED_SHARE = 0.01
"""Share of the surface's points that must be labelled pavement for the labels to be believed. Chosen: stray labels are
less."""
_UNSORTED_SHARE = 0.5
"""Share of the points without any class from which on the cloud is sorted by height. Chosen: the most of them."""
CELL = 0.5
"""Edge of the cells whose lowest points make the ground, m. Chosen: several points of most clouds lie in one."""
WINDOW = 9
"""Cells across which nothing that stands may fill: what is narrower than ``CELL * WINDOW`` falls off the ground.
Chosen: 4.5 m, wider than lorries."""
_STEP = 0.15
"""Height above the opened surface from which on a point is no ground, m. Chosen: a kerb."""
_MOST_CELLS = 1 << 24
"""Cells of one grid; points over more are worked on tile by tile, of which only those with points in them are made.
Chosen: 128 MiB for each grid."""
_TILE, _MARGIN = 1024, 128
"""Cells along an edge of a tile, and around it those whose points count for its ground as well. Chosen: the margin is
wider than the window, and than most gaps that are filled."""


class PointKind(IntEnum):
    """Kind of surface or object that a point lies on, as far as the reconstruction tells them apart."""

    OTHER = 0
    UNSORTED = 1
    GROUND = 2
    VERGE = 3
    PAVEMENT = 4
    MARKING = 5
    GUARDRAIL = 6
    BARRIER = 7
    NOISE_BARRIER = 8
    POST = 9
    FURNITURE = 10


SURFACE = (PointKind.GROUND, PointKind.VERGE, PointKind.PAVEMENT, PointKind.MARKING)
"""Classes that lie flat."""
STANDING = (PointKind.GUARDRAIL, PointKind.BARRIER, PointKind.NOISE_BARRIER, PointKind.POST, PointKind.FURNITURE)
"""Classes that stand on the road or beside it, and are looked for."""

KIND_OF_CLASS = {
    "ground": PointKind.GROUND,
    "roadside": PointKind.VERGE,
    "road": PointKind.PAVEMENT,
    "road_surface": PointKind.PAVEMENT,
    "road_marking": PointKind.MARKING,
    "guardrail": PointKind.GUARDRAIL,
    "barrier": PointKind.BARRIER,
    "noise_barrier": PointKind.NOISE_BARRIER,
    "warning_post": PointKind.POST,
    "road_furniture": PointKind.FURNITURE,
    "never_classified": PointKind.UNSORTED,
    "unclassified": PointKind.UNSORTED,
    "unlabelled": PointKind.UNSORTED,
}
"""Kind of point by class name, of the project's schemes and of LAS; points of other classes are not used."""


@dataclass(frozen=True)
class RoadCloud:
    """N points of a cloud that a road is reconstructed from, sorted by what they lie on.

    Attributes:
        xyz: (N, 3) local coordinates, m: map coordinates less the origin.
        intensity: (N,) float32, in the file's own unit.
        kind: (N,) uint8 of `PointKind`; none is OTHER.
        origin: (3,) map coordinates, m, whole metres.
        place: map system of the coordinates, and that of the file.
        labelled: whether classes tell pavement from ground.
        marked: whether classes tell markings from pavement.
        read: number of the file's points that are neither withheld nor noise.
        classes: number of these points by class name.
        strays: number of points far from all others, which aren't used.
    """

    xyz: Float
    intensity: NDArray[np.float32]
    kind: NDArray[np.uint8]
    origin: Float
    place: Placement
    labelled: bool
    marked: bool
    read: int
    classes: dict[str, int]
    strays: int = 0

    @property
    def epsg(self) -> int | None:
        """Return the EPSG code of the map system, None if it isn't named or has none."""
        return self.place.epsg

    @cached_property
    def surface(self) -> Index:
        """Return the indices of the points on ground, verge, pavement and markings; cached."""
        return np.flatnonzero(self.of(*SURFACE))

    def near(self, path: CloudPath, distance: float) -> Self:
        """Return the cloud with only the points within a distance (m) of a path, to some 4 m."""
        near_mask = path.within(self.xyz[:, :2], distance)
        return replace(self, xyz=self.xyz[near_mask], intensity=self.intensity[near_mask], kind=self.kind[near_mask])

    def of(self, *kinds: PointKind) -> Bool:
        """Return a mask (N,) of the points of these kinds."""
        return np.isin(self.kind, kinds)


def read_road_cloud(path: FilePath, progress: Progress = silent) -> RoadCloud:
    """Read the points of a cloud file that a reconstruction uses, each with the kind of surface or object it lies on.

    ``progress`` is called after each block with the share of the file's points that were read. Classes are those that
    the file holds: the project's own, in any scheme whose names are known, or the LAS classification; withheld points
    and noise are left out. A mostly unclassified cloud is split by height into ground and objects.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file is no cloud, or holds too few points of ground or road.
    """
    parts: list[_Points] = []
    with open_cloud(path) as cloud:
        header = cloud.header
        table = _kind_table(header.scheme)
        names = header.scheme.names()
        counts = np.zeros(256, dtype=np.int64)
        for block in cloud.usable_blocks():
            kind = table[block.class_id]
            counts += np.bincount(block.class_id, minlength=256)
            is_used = kind != PointKind.OTHER
            parts.append((block.xyz[is_used], block.intensity[is_used].astype(np.float32), kind[is_used]))
            progress("cloud", min(1.0, float(counts.sum()) / max(header.count, 1)))
    if not sum(len(part[0]) for part in parts):
        class_names = ", ".join(KIND_OF_CLASS)
        raise InputError(str(path), None, f"holds no points of a class that a road is made from ({class_names})")
    xyz, intensity, kind = map(np.concatenate, zip(*parts, strict=True))
    strays = Strays()
    strays.add(xyz)
    stay = strays.belongs(xyz) if strays.count() else np.ones(len(xyz), dtype=bool)
    points = xyz[stay], intensity[stay], kind[stay]
    classes = {names.get(int(c), f"class_{c}"): int(counts[c]) for c in np.flatnonzero(counts)}
    return replace(_sort_by_height(path, points, header.place, classes), strays=strays.count())


def _kind_table(scheme: ClassScheme) -> NDArray[np.uint8]:
    """Return the table (256,) from a class scheme's ids to `PointKind`."""
    table = np.full(256, PointKind.OTHER, dtype=np.uint8)
    for number, name in scheme.names().items():
        table[number] = KIND_OF_CLASS.get(name, PointKind.OTHER)
    return table


def _sort_by_height(path: FilePath, points: _Points, placement: Placement, classes: dict[str, int]) -> RoadCloud:
    """Return the cloud with unclassified points left out, or told apart by height if most points are unclassified.

    Below 0.12 m above the ground they are ground, from 0.2 m to 8 m they are furniture (chosen: kerbs lie between,
    trees and bridges above).
    """
    xyz, intensity, kind = points
    origin = np.round(np.append(xyz[:, :2].mean(axis=0), xyz[:, 2].min()))
    xyz = xyz - origin
    is_unclassified = kind == PointKind.UNSORTED
    if is_unclassified.mean() > _UNSORTED_SHARE and np.isin(kind, SURFACE).sum() < FEWEST_POINTS:
        height = above_ground(xyz)
        kind = np.where(is_unclassified & (np.abs(height) < 0.12), PointKind.GROUND, kind).astype(np.uint8)
        kind = np.where(is_unclassified & (height >= 0.2) & (height < 8.0), PointKind.FURNITURE, kind).astype(np.uint8)
    has_kind = kind != PointKind.UNSORTED
    xyz, intensity, kind = xyz[has_kind], intensity[has_kind], kind[has_kind]
    surface = np.isin(kind, SURFACE)
    if surface.sum() < FEWEST_POINTS:
        requirement = f"at least {FEWEST_POINTS} points of ground or road are needed"
        raise InputError(str(path), int(surface.sum()), requirement)
    is_pavement = np.isin(kind, (PointKind.PAVEMENT, PointKind.MARKING))
    has_pavement_class = bool(is_pavement.sum() > _LABELLED_SHARE * surface.sum())
    # Chosen: a scan with markings shows them on more than 0.1 % of its pavement; fewer points are stray.
    has_marking_class = has_pavement_class and bool((kind == PointKind.MARKING).sum() > 0.001 * is_pavement.sum())
    return RoadCloud(
        xyz, intensity, kind, origin, placement, has_pavement_class, has_marking_class, sum(classes.values()), classes
    )


def above_ground(xyz: Float) -> Float:
    """Return the heights (N,), m, of points (N, 3) above a ground surface estimated from them.

    The ground is the lowest point of each cell, opened by a window (so that cars, barriers and bushes fall off),
    gaps filled from the nearest cell, and smoothed. Memory is bounded by the cells that hold points, not by what lies
    between them.
    """
    if not len(xyz):
        return np.zeros(0)
    span = np.ptp(np.floor(xyz[:, :2] / CELL), axis=0) + 1.0
    if span.prod() <= _MOST_CELLS:
        return _above_grid(xyz)
    result = np.empty(len(xyz))
    tile = np.floor(xyz[:, :2] / (CELL * _TILE)).astype(np.int64)
    order = np.lexsort(tile.T)
    starts = np.flatnonzero(np.r_[True, np.any(np.diff(tile[order], axis=0) != 0, axis=1)])
    groups = {(int(tile[part[0], 0]), int(tile[part[0], 1])): part for part in np.split(order, starts[1:])}
    for (column, row), rows in groups.items():
        corner = np.array([column, row]) * CELL * _TILE
        adjacent_points = [groups.get((column + i, row + j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        tile_points = np.concatenate([rows, *(part for part in adjacent_points if part is not None)])
        corner_offset = xyz[tile_points, :2] - corner
        in_margin = np.all((corner_offset >= -_MARGIN * CELL) & (corner_offset < (_TILE + _MARGIN) * CELL), axis=1)
        in_margin[: len(rows)] = True
        result[rows] = _above_grid(xyz[tile_points[in_margin]])[: len(rows)]
    return result


def _above_grid(xyz: Float) -> Float:
    """Return the heights (N,), m, of points (N, 3) above the ground surface of one grid that covers them all."""
    lowest_cell = np.floor(xyz[:, :2].min(axis=0) / CELL)
    cell = (np.floor(xyz[:, :2] / CELL) - lowest_cell).astype(np.int64)
    shape = tuple(cell.max(axis=0) + 1)
    lowest = np.full(shape, np.inf)
    np.minimum.at(lowest, (cell[:, 0], cell[:, 1]), xyz[:, 2])
    is_empty = ~np.isfinite(lowest)
    nearest_cells = ndimage.distance_transform_edt(is_empty, return_distances=False, return_indices=True)
    filled_heights = lowest[tuple(nearest_cells)]
    # Opening: the largest of the smallest in a window, which nothing narrower than the window survives.
    opened = ndimage.grey_opening(filled_heights, size=(WINDOW, WINDOW))
    # Where little was opened away the lowest points themselves are the ground: an opening cuts off every crest.
    ground = ndimage.uniform_filter(np.where(filled_heights - opened > _STEP, opened, filled_heights), 3)
    grid_position = xyz[:, :2] / CELL - lowest_cell - 0.5
    ground_below = ndimage.map_coordinates(ground, grid_position.T, order=1, mode="nearest")
    return xyz[:, 2] - np.asarray(ground_below)
