"""Intensities of one cloud mapped onto the distribution of another: quantile on quantile, keeping their order.

Intensities are taken in the 65,536 steps of 16 bits, so that two histograms hold all that there is to know and memory
stays the same for clouds of any size.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...base.arrays import Float, Index, Int
from ...base.errors import InputError
from ..formats.reader import CloudReader
from ..points import PointBlock

LEVELS = 65_536
_GOLDEN = 0.6180339887498949


def steps_per_unit(cloud: CloudReader) -> float:
    """Return the 16-bit steps per unit of a cloud's intensity.

    Where the file doesn't say them, LAS has 1, and of other formats the brightest point is given the largest number.
    """
    header = cloud.header
    if header.intensity_scale is not None:
        return header.intensity_scale
    if header.kind.startswith("LAS"):
        return 1.0
    brightest = max((float(block.intensity.max()) for block in cloud.usable_blocks()), default=0.0)
    return (LEVELS - 1) / brightest if brightest > 0 else 1.0


def levels(intensity: Float, scale: float) -> Index:
    """Return intensities (N,) as 16-bit levels, rounded and clipped to 0 to 65535."""
    return np.clip(np.rint(intensity * scale), 0, LEVELS - 1).astype(np.intp)


def histograms(cloud: CloudReader, scale: float) -> dict[int, Int]:
    """Return the number of points on each intensity level (65536,) by class id; reads the whole cloud."""
    result: dict[int, Int] = {}
    for block in cloud.usable_blocks():
        level = levels(block.intensity, scale)
        for label in np.unique(block.class_id):
            counts = np.bincount(level[block.class_id == label], minlength=LEVELS)
            result[int(label)] = result.get(int(label), np.zeros(LEVELS, dtype=np.int64)) + counts
    return result


def ks_distance(a: Int, b: Int) -> float:
    """Return the Kolmogorov-Smirnov distance of two histograms, 0 to 1; of an empty one as if it were all 0."""
    return float(np.abs(np.cumsum(a) / max(a.sum(), 1) - np.cumsum(b) / max(b.sum(), 1)).max())


class QuantileMap:
    """Monotonic map of intensity levels onto a target's distribution, quantile on quantile; keeps count.

    Points of one level are spread over the target's levels of their share: the k-th of them in the cloud's order takes
    the fraction k x golden section (mod 1) of that share, which fills it evenly, without chance and however the points
    come in blocks.

    Args:
        source, target: (65536,) histograms; neither is empty.

    Attributes:
        mapped: (65536,) histogram of what has been mapped so far.
    """

    def __init__(self, source: Int, target: Int) -> None:
        if source.sum() == 0 or target.sum() == 0:
            raise ValueError("both histograms must hold points")
        ends = np.cumsum(source)
        self._begin = (ends - source) / ends[-1]
        self._share = source / ends[-1]
        self._target = np.cumsum(target) / target.sum()
        self._last = int(np.flatnonzero(target)[-1])
        self._seen = np.zeros(LEVELS, dtype=np.int64)
        self.mapped = np.zeros(LEVELS, dtype=np.int64)

    def map(self, level: Index) -> Index:
        """Return the target's levels (N,) of points, and count them as mapped.

        Args:
            level: (N,) of the points in the cloud's order.
        """
        turn = self._seen[level] + _occurrence(level)
        self._seen += np.bincount(level, minlength=LEVELS)
        quantile = self._begin[level] + self._share[level] * ((turn + 0.5) * _GOLDEN % 1.0)
        result = np.minimum(np.searchsorted(self._target, quantile, side="right"), self._last)
        self.mapped += np.bincount(result, minlength=LEVELS)
        return result


class IntensityMapping:
    """Mapping of a cloud's intensities onto another's distribution, of all points at once or class by class.

    Args:
        source, target: the clouds.
        per_class: map each class on the target's class of the same name; classes that the target lacks are mapped
            together, on all its points.

    Attributes:
        scale: 16-bit steps per unit of the mapped intensities: the target's.
        classes_without_target: names of the classes that the target lacks; empty unless ``per_class``.

    Raises:
        InputError: one of the clouds has no points.
    """

    def __init__(self, source: CloudReader, target: CloudReader, per_class: bool = False) -> None:
        self._steps, self.scale = steps_per_unit(source), steps_per_unit(target)
        source_counts, target_counts = histograms(source, self._steps), histograms(target, self.scale)
        for cloud, counts in ((source, source_counts), (target, target_counts)):
            if not counts:
                raise InputError(str(cloud.header.path), None, "has no points")
        self._have, self._want = _total(source_counts), _total(target_counts)
        self.classes_without_target: list[str] = []
        self._class_targets: dict[int, Int] = {}
        if per_class:
            self._maps = self._class_maps(source, target, source_counts, target_counts)
        else:
            common_map = QuantileMap(self._have, self._want)
            self._maps = dict.fromkeys(source_counts, common_map)

    def blocks(self, source: CloudReader) -> Iterator[PointBlock]:
        """Yield the source's points with mapped intensities; the distances afterwards count these."""
        for block in source.usable_blocks():
            level = levels(block.intensity, self._steps)
            mapped_levels = np.zeros(len(level), dtype=np.intp)
            for table in {id(table): table for table in self._maps.values()}.values():
                labels = [label for label, map_of_label in self._maps.items() if map_of_label is table]
                is_of_table = np.isin(block.class_id, labels)
                mapped_levels[is_of_table] = table.map(level[is_of_table])
            yield replace(block, intensity=mapped_levels / self.scale)

    def distance_before(self) -> float:
        """Return the Kolmogorov-Smirnov distance of the two clouds' intensities before mapping."""
        return ks_distance(self._have, self._want)

    def distance_after(self) -> float:
        """Return the Kolmogorov-Smirnov distance of the intensities mapped so far to the target's."""
        tables = {id(table): table for table in self._maps.values()}.values()
        return ks_distance(_total({i: table.mapped for i, table in enumerate(tables)}), self._want)

    def class_distances(self) -> dict[int, float]:
        """Return the Kolmogorov-Smirnov distances after mapping of classes with maps of their own, by source id."""
        return {
            label: ks_distance(self._maps[label].mapped, target_counts)
            for label, target_counts in self._class_targets.items()
        }

    def _class_maps(
        self, source: CloudReader, target: CloudReader, source_counts: dict[int, Int], target_counts: dict[int, Int]
    ) -> dict[int, QuantileMap]:
        """Return the map of each class of the source, by its number; classes that the target lacks share one.

        Args:
            source, target: the clouds.
            source_counts, target_counts: their histograms, by class.
        """
        target_labels = {name: label for label, name in target.header.scheme.names().items() if label in target_counts}
        names = source.header.scheme.names()
        pairs = {label: target_labels.get(names.get(label, "")) for label in source_counts}
        self._class_targets = {
            label: target_counts[target_label] for label, target_label in pairs.items() if target_label is not None
        }
        maps = {label: QuantileMap(source_counts[label], counts) for label, counts in self._class_targets.items()}
        other_labels = [label for label in source_counts if label not in maps]
        self.classes_without_target = [names.get(label, str(label)) for label in other_labels]
        if other_labels:
            common_map = QuantileMap(_total({label: source_counts[label] for label in other_labels}), self._want)
            maps |= dict.fromkeys(other_labels, common_map)
        return maps


def _total(parts: dict[int, Int]) -> Int:
    """Return the sum of histograms."""
    return np.sum(list(parts.values()), axis=0)


def _occurrence(values: Index) -> Index:
    """Return for each value (N,) the number of equal values that come before it."""
    order = np.argsort(values, kind="stable")
    ordered_values = values[order]
    starts = (
        np.flatnonzero(np.r_[True, ordered_values[1:] != ordered_values[:-1]])
        if len(values)
        else np.zeros(0, dtype=np.intp)
    )
    lengths = np.diff(np.r_[starts, len(values)])
    result = np.empty(len(values), dtype=np.intp)
    result[order] = np.arange(len(values)) - np.repeat(starts, lengths)
    return result
