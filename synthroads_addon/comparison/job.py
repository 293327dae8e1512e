"""A comparison of synthetic clouds with real ones from its inputs to its result."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.machine import linear_algebra_on_one_thread
from ..base.progress import Progress, exhaust, silent
from ..cloud.selection.classes import RealClass
from ..cloud.selection.patches import FEATURES, Patches, join_patches, make_patches
from .classifier import Distinction, classifier_auc, distinguish
from .clouds import ROAD, ComparedCloud, find_clouds, read_compared

RINGS = (4.0, 6.0, 10.0, 15.0, 20.0, 30.0, 50.0)
"""Edges of the ranges by which clouds are described whose points say how far they were seen from, m. Chosen: by equal
factors, finer where a car's scanner has most points."""
_FEWEST_OF_RING = 30
"""Patches of a ring that is described. Chosen: quartiles of them."""


@dataclass(frozen=True)
class DescribedCloud:
    """A cloud with the patches of its pavement.

    Attributes:
        cloud: the cloud.
        patches: patches of its pavement.
    """

    cloud: ComparedCloud
    patches: Patches

    def to_dict(self) -> dict[str, Any]:
        """Return the cloud's medians and the figures of its classes and ranges as JSON data."""
        medians = np.median(self.patches.values, axis=0)
        road_level = float(np.median(_decibels(self.cloud.classes[ROAD])))
        return {
            "cloud": self.cloud.name,
            "patches": len(self.patches),
            "density": round(float(np.median(self.patches.density)), 2),
            "medians": {name: _short(value) for name, value in zip(FEATURES, medians, strict=True)},
            "classes": {name: class_figures(points, road_level) for name, points in self.cloud.classes.items()},
            "by_range": range_figures(self.cloud.classes[ROAD], road_level),
        }


@dataclass(frozen=True)
class CloudComparison:
    """Result of a comparison of synthetic clouds with real ones.

    Attributes:
        synthetic, real: the described clouds of both sides.
        distinctions: distinction of each synthetic cloud from all real ones.
        yardstick: distinction of each real cloud from the other real ones; of a single one, of its two halves.
    """

    synthetic: tuple[DescribedCloud, ...]
    real: tuple[DescribedCloud, ...]
    distinctions: tuple[Distinction, ...]
    yardstick: tuple[Distinction, ...]

    def realism(self) -> dict[str, float]:
        """Return 1 - AUC of synthetic clouds over that of real ones, by group: 1 if both are as hard to tell apart."""
        return {
            group: _mean(self.distinctions, group) / max(_mean(self.yardstick, group), 1e-9)
            for group in self.distinctions[0].auc
        }

    def realism_left_out(self, seed: int = 1) -> dict[str, dict[str, float]]:
        """Return realism by real cloud and group, against that cloud alone, by synthetic clouds chosen without it.

        Of the synthetic clouds the half is taken that is hardest to tell from each of the other real ones by all
        statistics; its mean 1 - AUC against the cloud that was left out is divided by that of the other real ones.

        Args:
            seed: seed by which patches and folds are drawn.

        Raises:
            InputError: a cloud has too few patches of another's density.
        """
        real_patches = [cloud.patches for cloud in self.real]
        synthetic_rows, real_rows = (
            [
                [classifier_auc(cloud.patches, patches, seed, cloud.cloud.name) for patches in real_patches]
                for cloud in side
            ]
            for side in (self.synthetic, self.real)
        )
        count_chosen, result = -(-len(synthetic_rows) // 2), {}
        for number, road in enumerate(self.real):
            others = [other for other in range(len(self.real)) if other != number]
            by_likeness = sorted(synthetic_rows, key=lambda row: -_mean_of([row[other]["all"] for other in others]))
            result[road.cloud.name] = {
                group: _mean_of([row[number][group] for row in by_likeness[:count_chosen]])
                / max(_mean_of([real_rows[other][number][group] for other in others]), 1e-9)
                for group in synthetic_rows[0][number]
            }
        return result

    def giveaways(self) -> dict[str, tuple[float, float]]:
        """Return by statistic its mean AUC alone (synthetic, real), ordered from the largest synthetic one."""
        means = {
            name: tuple(
                float(np.mean([distinction.features[name] for distinction in rows]))
                for rows in (self.distinctions, self.yardstick)
            )
            for name in FEATURES
        }
        return dict(sorted(means.items(), key=lambda item: -item[1][0]))  # type: ignore[arg-type]

    def discrepancy(self) -> float:
        """Return the mean squared discrepancy of synthetic clouds as a multiple of that among real ones."""
        synthetic_mean, real_mean = (
            float(np.mean([max(distinction.mmd, 0.0) for distinction in rows]))
            for rows in (self.distinctions, self.yardstick)
        )
        return synthetic_mean / max(real_mean, 1e-6)

    def chamfer(self) -> float:
        """Return the mean density-aware Chamfer distance of synthetic patches to real ones over the yardstick's."""
        synthetic_mean, real_mean = (
            float(np.mean([distinction.chamfer for distinction in rows]))
            for rows in (self.distinctions, self.yardstick)
        )
        return synthetic_mean / max(real_mean, 1e-6)

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison's measures and all clouds' figures as JSON data."""
        return {
            "type": "CloudComparison",
            "realism": {group: round(value, 4) for group, value in self.realism().items()},
            "discrepancy": round(self.discrepancy(), 3),
            "chamfer": round(self.chamfer(), 4),
            "giveaways": {name: [round(value, 4) for value in pair] for name, pair in self.giveaways().items()},
            "synthetic": _joined(self.synthetic, self.distinctions),
            "real": _joined(self.real, self.yardstick),
        }


def _joined(clouds: tuple[DescribedCloud, ...], distinctions: tuple[Distinction, ...]) -> list[dict[str, Any]]:
    """Return for each cloud its figures and its distinction from the others, merged, as JSON data."""
    return [cloud.to_dict() | distinction.to_dict() for cloud, distinction in zip(clouds, distinctions, strict=True)]


def _mean(rows: Sequence[Distinction], group: str) -> float:
    """Return the mean of 1 - AUC in a group, see `_mean_of`."""
    return _mean_of([distinction.auc[group] for distinction in rows])


def _mean_of(aucs: Sequence[float]) -> float:
    """Return the mean of 1 - AUC, with an AUC below 0.5, worse than chance, counted as 0.5."""
    return float(np.mean([1.0 - max(auc, 0.5) for auc in aucs]))


def compare(synthetic: Path, real: Path, seed: int = 1, progress: Progress = silent) -> CloudComparison:
    """Compare synthetic clouds with real ones and return the result; arguments and errors as `compare_steps`."""
    return exhaust(compare_steps(synthetic, real, seed), lambda share: progress("compare", share))


def compare_steps(synthetic: Path, real: Path, seed: int = 1) -> Generator[float, None, CloudComparison]:
    """Compare synthetic with real clouds step by step: yield the share done, 0 to 1, and return the result.

    Args:
        synthetic, real: a cloud, a folder of clouds, or a list of them, see `find_clouds`.
        seed: seed by which patches and folds are drawn.

    Raises:
        InputError: a cloud can't be read, has too little pavement, or none of the other side's density.
    """
    with linear_algebra_on_one_thread(scipy=True):
        return (yield from _compare_steps(synthetic, real, seed))


def _compare_steps(synthetic: Path, real: Path, seed: int) -> Generator[float, None, CloudComparison]:
    """Compare as `compare_steps` does: read all clouds, distinguish real ones from each other, then synthetic ones."""
    clouds = [find_clouds(path) for path in (synthetic, real)]
    step_count, steps_done = 2 * sum(map(len, clouds)), 0
    described_sides: list[list[DescribedCloud]] = [[], []]
    for side, rows in zip(described_sides, clouds, strict=True):
        for path, row in rows:
            cloud = read_compared(path, row)
            side.append(DescribedCloud(cloud, make_patches(cloud.classes[ROAD], cloud.name)))
            steps_done += 1
            yield steps_done / step_count
    real_clouds, yardstick = described_sides[1], []
    for number, described_cloud in enumerate(real_clouds):
        yardstick.append(_against_others(described_cloud, real_clouds[:number] + real_clouds[number + 1 :], seed))
        steps_done += 1
        yield steps_done / step_count
    distinctions, real_patches = [], join_patches([described_cloud.patches for described_cloud in real_clouds])
    for described_cloud in described_sides[0]:
        distinctions.append(distinguish(described_cloud.patches, real_patches, seed, described_cloud.cloud.name))
        steps_done += 1
        yield steps_done / step_count
    return CloudComparison(tuple(described_sides[0]), tuple(real_clouds), tuple(distinctions), tuple(yardstick))


def _against_others(cloud: DescribedCloud, other_clouds: list[DescribedCloud], seed: int) -> Distinction:
    """Return the distinction of a real cloud from the other real ones, or of its halves if it is the only one."""
    if other_clouds:
        return distinguish(
            cloud.patches, join_patches([other_cloud.patches for other_cloud in other_clouds]), seed, cloud.cloud.name
        )
    shuffled_rows = np.random.default_rng(seed).permutation(len(cloud.patches))
    halves = [cloud.patches.select(shuffled_rows[start::2]) for start in (0, 1)]
    return distinguish(halves[0], halves[1], seed, cloud.cloud.name)


def _decibels(points: RealClass) -> Float:
    """Return a class's intensities (N,) in dB."""
    return np.asarray(10.0 * np.log10(points.intensity))


def class_figures(points: RealClass, road: float) -> dict[str, float]:
    """Return counts, dB median over the pavement's (``road``, dB) and dB spread of a class as JSON data."""
    decibels = _decibels(points)
    lower_quartile, median, upper_quartile = np.quantile(decibels, (0.25, 0.5, 0.75))
    total = len(decibels) + points.zeros
    return {
        "points": len(decibels),
        "zero_intensities": round(points.zeros / total, 4),
        "several_returns": round(float(np.mean(points.returns > 1)), 4),
        "median_over_road_db": round(float(median - road), 3),
        "iqr_db": round(float(upper_quartile - lower_quartile), 3),
        "std_db": round(float(decibels.std()), 3),
    }


def range_figures(points: RealClass, road: float) -> list[dict[str, float]]:
    """Return points and dB median over the pavement's in each ring of range as JSON data; empty without ranges."""
    rows = []
    for ring_start, ring_end in pairwise(RINGS):
        in_ring = (points.distance >= ring_start) & (points.distance < ring_end)
        if in_ring.sum() >= _FEWEST_OF_RING:
            median = float(np.median(_decibels(points)[in_ring])) - road
            rows.append(
                {
                    "from": ring_start,
                    "to": ring_end,
                    "points": int(in_ring.sum()),
                    "median_over_road_db": round(median, 3),
                }
            )
    return rows


def _short(value: float) -> float:
    """Return a number rounded to five significant digits."""
    return float(f"{value:.5g}")
