"""Patches of pavement, and the statistics of each that tell what kind of scanner and surface it comes from.

No statistic depends on the road's course, the scanner's gain or the units of the intensity: a patch's points are
described by how they are spread, how they lie about their plane, and how their intensities differ among each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ...base.arrays import AnyArray, Float, Index
from ...base.errors import InputError
from .classes import RealClass, RealCloud

EDGE = 1.5
"""Edge of a patch, m."""
FEWEST = 20
"""Points that a patch must have."""
_PARTS = 3
"""Each of so many parts of a patch, along each edge, must hold a point: others are cut off by what lies beside."""
_STEP = 0.1
"""Width of the bins within which densities count as equal, of their logarithm."""
_NEIGHBOURS = 8
_SECTORS = 12
_BESIDE = 1.0
"""Points beside the pavement are looked for so far from it, m: farther than the eighth neighbour is."""
_RISE = 0.3
"""Height, m, above the pavement or below it up to which points are of its surface."""

GROUPS: dict[str, tuple[str, ...]] = {
    "pattern": ("clark_evans", "spacing_variation", "direction_entropy", "second_neighbour", "eighth_neighbour"),
    "geometry": ("residual_mm", "residual_skew", "residual_kurtosis", "curvature", "residual_roughness"),
    "intensity": (
        *("intensity_iqr_db", "intensity_skew", "intensity_kurtosis", "neighbour_noise_db", "short_semivariance"),
        *("height_correlation", "level_db"),
    ),
}
"""Statistics of a patch by what they are about: how points are spread, how they lie, and how bright they are."""
FEATURES = tuple(name for names in GROUPS.values() for name in names)


@dataclass(frozen=True)
class Patches:
    """Statistics of P square patches of a cloud's pavement.

    Attributes:
        place: (P, 2) corner of each, map, m.
        density: (P,) points per m2.
        values: (P, F) in the order of `FEATURES`.
        points: of each patch (N, 3): place from its corner, and height over its plane, m.
    """

    place: Float
    density: Float
    values: Float
    points: tuple[Float, ...] = ()

    def __len__(self) -> int:
        return len(self.place)

    def select(self, rows: Index) -> Patches:
        """Return the chosen patches."""
        points = tuple(self.points[row] for row in rows) if self.points else ()
        return Patches(self.place[rows], self.density[rows], self.values[rows], points)


def with_points_beside(cloud: RealCloud, points: RealClass) -> RealClass:
    """Return a class with the places of all other points of its cloud that lie near it and on the same surface.

    How points are spread then doesn't depend on where the class ends, at a marking or an edge.
    """
    lowest, highest = points.place.min(axis=0) - _BESIDE, points.place.max(axis=0) + _BESIDE
    nearby = cloud.xyz[((cloud.xyz > lowest) & (cloud.xyz < highest)).all(axis=1)]
    distance, neighbour = cKDTree(points.place[:, :2]).query(nearby[:, :2], distance_upper_bound=_BESIDE)
    # Beyond the bound the distance is inf; at 0 it is a point of the class itself.
    is_other = np.isfinite(distance) & (distance > 0.0)
    rise = nearby[is_other, 2] - points.place[neighbour[is_other], 2]
    return replace(points, beside=nearby[is_other, :2][np.abs(rise) < _RISE])


def join_patches(parts: list[Patches]) -> Patches:
    """Return the patches of several clouds as one set, their places shifted apart so that they share no block."""
    shifts = [np.array([1e7 * number, 0.0]) for number in range(len(parts))]
    return Patches(
        np.concatenate([part.place + shift for part, shift in zip(parts, shifts, strict=True)]),
        np.concatenate([part.density for part in parts]),
        np.concatenate([part.values for part in parts]),
        tuple(points for part in parts for points in part.points),
    )


def make_patches(road: RealClass, name: str) -> Patches:
    """Return the statistics of all patches of the pavement that points fill.

    Raises:
        InputError: no square of `EDGE` has enough points in all of its parts.
    """
    if len(road.place) <= _NEIGHBOURS:
        raise InputError(name, len(road.place), f"has no {EDGE:g} m of pavement with {FEWEST} points or more")
    points = _Neighbourhood.of(road)
    cell = np.floor(road.place[:, :2] / EDGE).astype(np.int64)
    corners, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    rows = np.split(np.argsort(owner.ravel(), kind="stable"), np.cumsum(count)[:-1])
    patch_numbers = [
        number for number in np.flatnonzero(count >= FEWEST) if _is_whole(road.place[rows[number]], corners[number])
    ]
    if not patch_numbers:
        raise InputError(name, None, f"has no {EDGE:g} m of pavement with {FEWEST} points or more")
    values = np.array([points.describe(rows[number]) for number in patch_numbers])
    places = tuple(_above_plane(road.place[rows[number]], corners[number] * EDGE) for number in patch_numbers)
    return Patches(corners[patch_numbers] * EDGE, count[patch_numbers] / EDGE**2, values, places)


def _above_plane(place: Float, corner: AnyArray) -> Float:
    """Return a patch's points (N, 3) from its corner, with heights over its plane, m."""
    residual, _ = _fit_surface(place)
    return np.column_stack([place[:, :2] - corner, residual])


def _is_whole(place: Float, corner: AnyArray) -> bool:
    """Return whether a patch has points in all of its `_PARTS` x `_PARTS` parts."""
    part = np.floor((place[:, :2] / EDGE - corner) * _PARTS).astype(np.int64)
    return len(np.unique(part[:, 0] * _PARTS + part[:, 1])) == _PARTS**2


@dataclass(frozen=True)
class _Neighbourhood:
    """Points (N,) with their `_NEIGHBOURS` nearest ones in plan.

    Attributes:
        place: (N, 3) from the first point, m.
        level: (N,) intensity from the cloud's median, dB.
        distance: (N, K) of the nearest points of the surface, m, beside the pavement as well.
        neighbour: (N, K) rows of the nearest of the pavement.
        sector: (N,) of the direction to the nearest of the surface, which has no sign.
    """

    place: Float
    level: Float
    distance: Float
    neighbour: Index
    sector: Index

    @classmethod
    def of(cls, road: RealClass) -> _Neighbourhood:
        """Return the pavement points with their nearest neighbours in plan and intensities in dB."""
        place = road.place - road.place[0]
        distance, neighbour = cKDTree(place[:, :2]).query(place[:, :2], k=_NEIGHBOURS + 1)
        surface, nearest = place[:, :2], neighbour
        if road.beside is not None:
            surface = np.concatenate([surface, road.beside - road.place[0, :2]])
            distance, nearest = cKDTree(surface).query(place[:, :2], k=_NEIGHBOURS + 1)
        offset = surface[nearest[:, 1]] - place[:, :2]
        angle = np.arctan2(offset[:, 1], offset[:, 0]) % np.pi
        sector = np.minimum((angle / np.pi * _SECTORS).astype(np.int64), _SECTORS - 1)
        level = 10.0 * np.log10(road.intensity)
        return cls(place, level - np.median(level), distance[:, 1:], neighbour[:, 1:], sector)

    def describe(self, rows: Index) -> list[float]:
        """Return the statistics of one patch's points, in the order of `FEATURES`."""
        residual, curvature = _fit_surface(self.place[rows])
        return [*self._pattern(rows), *self._geometry(rows, residual, curvature), *self._intensity(rows, residual)]

    def _pattern(self, rows: Index) -> list[float]:
        """Return the statistics of how a patch's points are spread in plan.

        The ratio of Clark and Evans (1954) is 1 where points lie at random, 2 for a square lattice; the entropy of the
        directions to the nearest neighbours is 1 where all occur alike.
        """
        nearest, second_nearest, eighth_nearest = (
            np.maximum(self.distance[rows, k], 1e-4) for k in (0, 1, _NEIGHBOURS - 1)
        )
        share = np.bincount(self.sector[rows], minlength=_SECTORS) / len(rows)
        share = share[share > 0.0]
        return [
            2.0 * nearest.mean() * np.sqrt(len(rows)) / EDGE,
            nearest.std() / nearest.mean(),
            -(share * np.log(share)).sum() / np.log(_SECTORS),
            np.median(second_nearest / nearest),
            eighth_nearest.std() / eighth_nearest.mean(),
        ]

    def _geometry(self, rows: Index, residual: Float, curvature: float) -> list[float]:
        """Return the statistics of how a patch's points lie about their plane; roughness in mm."""
        skew, kurtosis = _shape(residual)
        steps = self.place[self.neighbour[rows, 0], 2] - self.place[rows, 2]
        deviation = max(float(residual.std()), 1e-6)
        return [1e3 * deviation, skew, kurtosis, curvature, float(np.sqrt(np.mean(steps**2))) / deviation]

    def _intensity(self, rows: Index, residual: Float) -> list[float]:
        """Return the statistics of a patch's intensities, in dB, among each other and to the cloud's median."""
        level = self.level[rows]
        skew, kurtosis = _shape(level)
        lower_quartile, median, upper_quartile = np.quantile(level, (0.25, 0.5, 0.75))
        differences = self.level[self.neighbour[rows, :3]] - level[:, None]
        variance = float(level.var())
        return [
            upper_quartile - lower_quartile,
            skew,
            kurtosis,
            float(np.abs(differences[:, 0]).mean()),
            0.5 * float(np.mean(differences**2)) / max(variance, 1e-9),
            _correlation(level, residual),
            median,
        ]


def _fit_surface(place: Float) -> tuple[Float, float]:
    """Return the residuals (N,), m, of points (N, 3) about their plane, and a parabola's larger curvature, 1/m."""
    x, y, z = (place - place.mean(axis=0)).T
    plane = np.stack([np.ones_like(x), x, y], axis=1)
    parabola = np.concatenate([plane, np.stack([x * x, x * y, y * y], axis=1)], axis=1)
    residual = z - plane @ np.linalg.lstsq(plane, z, rcond=None)[0]
    xx, xy, yy = np.linalg.lstsq(parabola, z, rcond=None)[0][3:]
    return residual, float(np.abs(np.linalg.eigvalsh([[2.0 * xx, xy], [xy, 2.0 * yy]])).max())


def _shape(values: Float) -> tuple[float, float]:
    """Return skewness and (non-excess) kurtosis of values (N,); 0 for both if all are alike."""
    deviation = values.std()
    if deviation < 1e-9:
        return 0.0, 0.0
    standardised = (values - values.mean()) / deviation
    return float(np.mean(standardised**3)), float(np.mean(standardised**4))


def _correlation(a: Float, b: Float) -> float:
    """Return Pearson's correlation of two arrays (N,); 0 where one of them doesn't vary."""
    if a.std() < 1e-9 or b.std() < 1e-9:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def match_density(a: Patches, b: Patches, seed: int, most_patches: int) -> tuple[Patches, Patches]:
    """Return equally many random patches of two sets, with like densities (bins of 10 %).

    A denser cloud has other statistics for that alone.

    Args:
        a, b: the sets.
        seed: by which patches are drawn.
        most_patches: number of patches at most.
    """
    random = np.random.default_rng(seed)
    rows_a, rows_b = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    bins_a, bins_b = (np.floor(np.log(patches.density) / _STEP).astype(np.int64) for patches in (a, b))
    for number in np.intersect1d(bins_a, bins_b):
        candidates_a = random.permutation(np.flatnonzero(bins_a == number))
        candidates_b = random.permutation(np.flatnonzero(bins_b == number))
        common_count = min(len(candidates_a), len(candidates_b))
        rows_a.append(candidates_a[:common_count])
        rows_b.append(candidates_b[:common_count])
    all_a, all_b = np.concatenate(rows_a), np.concatenate(rows_b)
    order = random.permutation(len(all_a))[:most_patches]
    return a.select(all_a[order]), b.select(all_b[order])
