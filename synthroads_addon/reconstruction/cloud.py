"""The points that a road is reconstructed from, sorted by what they can tell. Instance numbers are never read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from ..base.classes import ClassScheme
from ..base.errors import InputError
from ..cloud.formats.registry import open_cloud
from ..cloud.strays import Strays
from .ground import above_ground
from .path import CloudPath

Float = NDArray[np.float64]

FEWEST_POINTS = 2000
"""Fewer points on the road's surface than this are no road that could be measured."""
_LABELLED_SHARE = 0.01  # of the surface's points must be labelled pavement for the labels to be believed
_UNSORTED_SHARE = 0.5  # of the points without any class: the cloud has to be sorted by height


class PointKind(IntEnum):
    """Class of a point, as far as the reconstruction asks."""

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
"""Names of classes of the project and of LAS; what isn't here is not used."""


@dataclass(frozen=True)
class RoadCloud:
    """The points that count.

    Attributes:
        xyz: (N, 3) m, less the origin.
        intensity: (N,) float32, in the file's own unit.
        kind: (N,) uint8 of `PointKind`; none is OTHER.
        origin: (3,) map coordinates, m, whole metres.
        epsg: code of the map system, or None.
        labelled: whether pavement is told from ground by class.
        marked: whether markings are told from pavement by class.
        read: points in the file.
        classes: number of points in the file by class name.
        strays: points far from all others, which aren't used.
    """

    xyz: Float
    intensity: NDArray[np.float32]
    kind: NDArray[np.uint8]
    origin: Float
    epsg: int | None
    labelled: bool
    marked: bool
    read: int
    classes: dict[str, int]
    strays: int = 0

    @cached_property
    def surface(self) -> NDArray[np.intp]:
        """Return the indices of the points that lie flat."""
        return np.flatnonzero(self.of(*SURFACE))

    def near(self, path: CloudPath, distance: float) -> RoadCloud:
        """Return the points within a distance (m) of a path, roughly."""
        kept = path.within(self.xyz[:, :2], distance)
        return replace(self, xyz=self.xyz[kept], intensity=self.intensity[kept], kind=self.kind[kept])

    def of(self, *kinds: PointKind) -> NDArray[np.bool_]:
        """Return the mask (N,) of some kinds."""
        return np.isin(self.kind, kinds)


def read_road_cloud(path: FilePath) -> RoadCloud:
    """Read the points of a cloud that a reconstruction looks at.

    Classes are those that the file itself says: the project's own, in any scheme whose names are known, or the LAS
    classification. A cloud that is for the most part unclassified is sorted into ground and what stands on it.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no cloud, or holds too few points of ground or road.
    """
    parts: list[tuple[Float, NDArray[np.float32], NDArray[np.uint8]]] = []
    with open_cloud(path) as cloud:
        header = cloud.header
        table = kind_table(header.scheme)
        names = header.scheme.names()
        counts = np.zeros(256, dtype=np.int64)
        for block in cloud.blocks():
            kind = table[block.class_id]
            counts += np.bincount(block.class_id, minlength=256)
            kept = kind != PointKind.OTHER
            parts.append((block.xyz[kept], block.intensity[kept].astype(np.float32), kind[kept]))
    if not sum(len(part[0]) for part in parts):
        known = ", ".join(KIND_OF_CLASS)
        raise InputError(str(path), None, f"holds no points of a class that a road is made from ({known})")
    xyz, intensity, kind = (np.concatenate([part[i] for part in parts]) for i in range(3))
    xyz, intensity, kind, strays = _without_strays(xyz, intensity, kind)
    origin = np.round(np.append(xyz[:, :2].mean(axis=0), xyz[:, 2].min()))
    xyz = xyz - origin
    found = {names.get(int(c), f"class_{c}"): int(counts[c]) for c in np.flatnonzero(counts)}
    return replace(_sorted_cloud(path, xyz, intensity, kind, (origin, header.epsg, found)), strays=strays)


def _without_strays(
    xyz: Float, intensity: NDArray[np.float32], kind: NDArray[np.uint8]
) -> tuple[Float, NDArray[np.float32], NDArray[np.uint8], int]:
    """Return the points without those that lie far from all others, and how many these are."""
    strays = Strays()
    strays.add(xyz)
    count = strays.count()
    if not count:
        return xyz, intensity, kind, 0
    stay = strays.stay(xyz)
    return xyz[stay], intensity[stay], kind[stay], count


def kind_table(scheme: ClassScheme) -> NDArray[np.uint8]:
    """Return the (256,) table from a scheme's ids to `PointKind`."""
    table = np.full(256, PointKind.OTHER, dtype=np.uint8)
    for number, name in scheme.names().items():
        table[number] = KIND_OF_CLASS.get(name, PointKind.OTHER)
    return table


def _sorted_cloud(
    path: FilePath,
    xyz: Float,
    intensity: NDArray[np.float32],
    kind: NDArray[np.uint8],
    told: tuple[Float, int | None, dict[str, int]],
) -> RoadCloud:
    """Return the cloud after what has no class was sorted by height, or left out."""
    origin, epsg, classes = told
    unsorted = kind == PointKind.UNSORTED
    surface = np.isin(kind, SURFACE)
    if unsorted.mean() > _UNSORTED_SHARE and surface.sum() < FEWEST_POINTS:
        height = above_ground(xyz)
        kind = np.where(unsorted & (np.abs(height) < 0.12), PointKind.GROUND, kind).astype(np.uint8)
        kind = np.where(unsorted & (height >= 0.2) & (height < 8.0), PointKind.FURNITURE, kind).astype(np.uint8)
    kept = kind != PointKind.UNSORTED
    xyz, intensity, kind = xyz[kept], intensity[kept], kind[kept]
    surface = np.isin(kind, SURFACE)
    if surface.sum() < FEWEST_POINTS:
        allowed = f"at least {FEWEST_POINTS} points of ground or road are needed"
        raise InputError(str(path), int(surface.sum()), allowed)
    paved = np.isin(kind, (PointKind.PAVEMENT, PointKind.MARKING))
    labelled = bool(paved.sum() > _LABELLED_SHARE * surface.sum())
    marked = labelled and bool((kind == PointKind.MARKING).sum() > 0.001 * paved.sum())
    return RoadCloud(xyz, intensity, kind, origin, epsg, labelled, marked, sum(classes.values()), classes)
