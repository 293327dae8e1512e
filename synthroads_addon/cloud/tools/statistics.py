"""Figures that describe a cloud, gathered block by block: for comparing synthetic scans with real ones."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Index, Int, UInt8, UInt16
from ...materials.reflectance import LUMINANCE
from ..flags import withheld_points
from ..formats.header import CloudHeader
from ..formats.reader import CloudReader
from ..layers import PREDICTED
from ..points import PointBlock
from .predicted import PredictedCounts

AREA_CELL = 1.0
"""Edge of the cells whose occupied ones are a cloud's area, m."""
RADIUS = 0.5
"""Radius of the neighbourhood that roughness is of, m."""
SAMPLES = 5000
"""Points of each class whose roughness is measured."""
_FEWEST_NEIGHBOURS = 8
_MOST_PAIRS = 3e8
_PAIRS_AT_ONCE = 4_000_000


def luminance(rgb: UInt16) -> Float:
    """Return the luma 0.3 r + 0.59 g + 0.11 b (N,), 0 to 1, of 16-bit sRGB colours (N, 3).

    Example:
        >>> import numpy as np
        >>> luminance(np.array([[65535, 65535, 65535], [65535, 0, 0]], dtype=np.uint16)).round(3).tolist()
        [1.0, 0.3]
    """
    return rgb @ LUMINANCE / 65535.0


def cloud_statistics(cloud: CloudReader, radius: float = RADIUS, samples: int = SAMPLES) -> dict[str, Any]:
    """Return a cloud's statistics, of all points and of each class, as JSON data; the cloud is read twice.

    ``density`` is points per m2 of the 1 m cells that hold any; ``roughness`` the mean surface variation
    l0 / (l0 + l1 + l2), l0 the smallest eigenvalue of the covariance of the points within ``radius`` (Pauly et al.
    2002), of ``samples`` points per class; intensity is a share of 16 bits where the file has those or says its scale.
    None stands where the file doesn't hold what a figure needs. Withheld points are only counted. Of a cloud with
    predicted classes there are their points too, and how they agree with its own (`PredictedCounts.figures`).
    """
    header = cloud.header
    first_pass = _FirstPass(cloud, samples)
    predicted = PredictedCounts(header) if header.predicted else None
    withheld_count = 0
    for block in cloud.blocks():
        is_usable = cloud.usable_points(block, noise=True)
        withheld_count += len(block) - int(np.count_nonzero(is_usable))
        if not is_usable.any():
            continue
        used_points = block.select(is_usable)
        first_pass.add(used_points)
        if predicted:
            predicted.add(used_points)
    result = _header_figures(header, withheld_count, predicted is not None) | {"roughness_radius": radius}
    if predicted:
        result |= predicted.figures()
    if first_pass.moments.count.sum() == 0:
        return result | {"bounds": None, "all": None, "classes": {}}
    roughness = _Roughness(first_pass.samples(radius), radius)
    if radius > 0 and samples > 0:
        for block in cloud.blocks():
            roughness.add(block.select(~withheld_points(block)).xyz)
    names = header.scheme.names()
    roughness_by_class = roughness.by_class()
    present = np.flatnonzero(first_pass.moments.count)
    table = {names.get(int(c), f"class_{c}"): first_pass.figures([int(c)], roughness_by_class) for c in present}
    bounds = {"low": np.round(first_pass.low, 4).tolist(), "high": np.round(first_pass.high, 4).tolist()}
    return result | {
        "bounds": bounds,
        "all": first_pass.figures([int(c) for c in present], roughness_by_class),
        "classes": table,
    }


def _header_figures(header: CloudHeader, withheld_count: int, has_predicted: bool) -> dict[str, Any]:
    """Return what a cloud's header says, as JSON data.

    Args:
        header: the cloud's.
        withheld_count: number of points that are withheld.
        has_predicted: whether there are predicted classes, which the statistics don't leave out.
    """
    return {
        "file": header.path.name,
        "kind": header.kind,
        "points": header.count,
        "withheld": withheld_count,
        "epsg": header.epsg,
        "height_epsg": header.height_epsg,
        "coordinate_system": header.system.label if header.system else None,
        "unit_factors": None if header.place.scale is None else header.place.scale.tolist(),
        "attributes": list(header.attributes),
        "left_out": [name for name in header.left_out if name != PREDICTED or not has_predicted],
        "class_scheme": header.scheme.name,
        "class_field": header.class_field,
    }


class Moments:
    """Running count, mean and sum of squared deviations of several quantities, for each class label.

    Args:
        width: number of quantities.
    """

    def __init__(self, width: int) -> None:
        self.count = np.zeros(256, dtype=np.int64)
        self.mean = np.zeros((width, 256))
        self.squares = np.zeros((width, 256))

    def add(self, label: UInt8, values: Iterable[Float]) -> None:
        """Add points to the moments of their classes.

        Two sets with means m1 and m2 and counts n1 and n2 have together the squares S1 + S2 + (m2 - m1)^2 n1 n2 / (n1
        + n2) (Chan, Golub and LeVeque 1979).

        Args:
            label: (N,) classes.
            values: quantities, (N,) each.
        """
        count = np.bincount(label, minlength=256)
        divisor = np.maximum(count, 1)
        total = np.maximum(self.count + count, 1)
        for row, value in enumerate(values):
            mean = np.bincount(label, value, 256) / divisor
            squares = np.bincount(label, (value - mean[label]) ** 2, 256)
            step = np.where(count > 0, mean - self.mean[row], 0.0)
            self.squares[row] += squares + step**2 * self.count * count / total
            self.mean[row] += step * count / total
        self.count += count

    def mean_and_deviation(self, row: int, labels: list[int]) -> tuple[float, float]:
        """Return mean and standard deviation of one quantity over all points of some labels."""
        count = self.count[labels]
        mean = float(np.average(self.mean[row, labels], weights=count))
        squares = float((self.squares[row, labels] + count * (self.mean[row, labels] - mean) ** 2).sum())
        return mean, float(np.sqrt(squares / count.sum()))


class _FirstPass:
    """Statistics of one pass over the points: moments, bounds, area, and the points to measure roughness at."""

    def __init__(self, cloud: CloudReader, samples: int) -> None:
        header = cloud.header
        self.moments = Moments(3)
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.has_color = header.has_color
        self.full_scale = header.intensity_scale or 1.0
        if header.intensity_scale is not None or header.kind.startswith("LAS"):
            self.full_scale /= 65535.0
        self._cells = _Cells()
        self._samples = {label: _Sample(samples) for label in range(256)}

    def add(self, block: PointBlock) -> None:
        """Add a block's points to moments, bounds, area and samples."""
        values = (block.xyz[:, 2], block.intensity * self.full_scale, luminance(block.rgb))
        self.moments.add(block.class_id, values)
        self.low = np.minimum(self.low, block.xyz.min(axis=0))
        self.high = np.maximum(self.high, block.xyz.max(axis=0))
        self._cells.add(block.xyz, block.class_id)
        ranks = hash_positions(block.xyz)
        for label in np.unique(block.class_id):
            is_of_class = block.class_id == label
            self._samples[int(label)].add(block.xyz[is_of_class], ranks[is_of_class])

    def samples(self, radius: float) -> dict[int, Float]:
        """Return the places (S, 3) to measure roughness at, by class; fewer in dense clouds to bound the time."""
        places = {label: sample.xyz for label, sample in self._samples.items() if len(sample.xyz)}
        density = self.moments.count.sum() / max(1.0, self._cells.area(None))
        # Each place is compared with the points in nine cells of the ground, a radius wide.
        pairs = sum(map(len, places.values())) * density * 9 * radius**2
        share = min(1.0, _MOST_PAIRS / max(pairs, 1.0))
        return {label: xyz[: max(1, int(len(xyz) * share))] for label, xyz in places.items()}

    def figures(self, labels: list[int], roughness_by_class: dict[int, tuple[float, int]]) -> dict[str, Any]:
        """Return the statistics of some classes' points together, as JSON data."""
        count = int(self.moments.count[labels].sum())
        area = self._cells.area(labels)
        height, intensity, luminance_moments = (self.moments.mean_and_deviation(row, labels) for row in range(3))
        # Point formats with colours are used without them: all points are black then.
        has_color = self.has_color and luminance_moments != (0.0, 0.0)
        rough_classes = [label for label in labels if label in roughness_by_class]
        roughness = [roughness_by_class[label][0] for label in rough_classes]
        weights = self.moments.count[rough_classes]
        return {
            "points": count,
            "area_m2": area,
            "density": count / area,
            "height_mean": height[0],
            "height_std": height[1],
            "roughness": float(np.average(roughness, weights=weights)) if rough_classes else None,
            "roughness_samples": sum(roughness_by_class[label][1] for label in rough_classes),
            "intensity_mean": intensity[0],
            "intensity_std": intensity[1],
            "luminance_mean": luminance_moments[0] if has_color else None,
            "luminance_std": luminance_moments[1] if has_color else None,
        }


class _Cells:
    """Set of the occupied 1 m cells of the ground, by class."""

    def __init__(self) -> None:
        self._keys = np.zeros(0, dtype=np.int64)
        self._new: list[Int] = []
        self._pending = 0

    def add(self, xyz: Float, label: UInt8) -> None:
        """Add the cells that places (N, 3), m, of classes (N,) lie in.

        A key holds the cell's column and row, 26 bits each, and the class in the last 8 bits.
        """
        column = np.clip(np.floor(xyz[:, :2] / AREA_CELL), -(2**25), 2**25 - 1).astype(np.int64) + 2**25
        self._new.append(np.unique(((column[:, 0] << 26 | column[:, 1]) << 8) | label))
        self._pending += len(self._new[-1])
        if self._pending > len(self._keys) + 1_000_000:
            self._settle()

    def area(self, labels: list[int] | None) -> float:
        """Return the area, m2, of the cells that points of some classes (None: all) occupy."""
        self._settle()
        keys = self._keys if labels is None else self._keys[np.isin(self._keys & 255, labels)]
        return float(len(np.unique(keys >> 8))) * AREA_CELL**2

    def _settle(self) -> None:
        """Merge the keys that were added since the last time into the set."""
        self._keys = np.unique(np.concatenate([self._keys, *self._new]))
        self._new, self._pending = [], 0


class _Sample:
    """A sample of the points of lowest hash rank, which doesn't depend on the points' order."""

    def __init__(self, size: int) -> None:
        self._size = size
        self.xyz = np.zeros((0, 3))
        self._ranks = np.zeros(0, dtype=np.uint64)

    def add(self, xyz: Float, ranks: NDArray[np.uint64]) -> None:
        """Add places (N, 3), m, with their hash ranks (N,), and keep the places of lowest rank."""
        if len(self._ranks) >= self._size:
            has_low_rank = ranks < self._ranks[-1] if self._size else np.zeros(len(ranks), dtype=bool)
            xyz, ranks = xyz[has_low_rank], ranks[has_low_rank]
        ranks = np.concatenate([self._ranks, ranks])
        order = np.argsort(ranks, kind="stable")[: self._size]
        self.xyz, self._ranks = np.concatenate([self.xyz, xyz])[order], ranks[order]


def hash_positions(xyz: Float) -> NDArray[np.uint64]:
    """Return a 64-bit hash (N,) of each position (N, 3), rounded to 0.1 mm (SplitMix64, Steele et al. 2014)."""
    hashes = np.zeros(len(xyz), dtype=np.uint64)
    for axis in range(3):
        hashes += np.rint(xyz[:, axis] * 1e4).astype(np.int64).view(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        hashes = (hashes ^ (hashes >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        hashes = (hashes ^ (hashes >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        hashes ^= hashes >> np.uint64(31)
    return hashes


class _Roughness:
    """Covariances of the points around given places, gathered block by block.

    Args:
        places: (S, 3) map coordinates by class.
        radius: of the neighbourhood, m.
    """

    def __init__(self, places: dict[int, Float], radius: float) -> None:
        self._radius = radius
        self._places = np.concatenate(list(places.values())) if places else np.zeros((0, 3))
        self._label = np.repeat(list(places), [len(xyz) for xyz in places.values()]).astype(np.intp)
        self._sums = np.zeros((10, len(self._places)))
        # A place is entered under the nine columns of the ground around it: each point then looks into its own only.
        self._corner = self._places[:, :2].min(axis=0) - 2 * radius if len(self._places) else np.zeros(2)
        neighbour_steps = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        columns = (self._column(self._places)[:, None, :] + neighbour_steps).reshape(-1, 2)
        keys = columns[:, 0] << 31 | columns[:, 1]
        order = np.argsort(keys, kind="stable")
        self._entries = order // len(neighbour_steps)
        self._keys, self._starts = np.unique(keys[order], return_index=True)
        self._counts = np.diff(np.r_[self._starts, len(order)])

    def add(self, xyz: Float) -> None:
        """Add a block's points (N, 3) to the covariances of the places that they are near."""
        if not len(self._keys):
            return
        column = self._column(xyz)
        rows = np.flatnonzero(np.all((column >= 0) & (column < 2**31), axis=1))
        key = column[rows, 0] << 31 | column[rows, 1]
        # Points whose column has entries, and the slot of the column among those that have any.
        slot = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        has_entries = self._keys[slot] == key
        rows, slot = rows[has_entries], slot[has_entries]
        for part in _bounded_slices(self._counts[slot]):
            # A pair for each point of the part and each place that is entered under its column.
            counts = self._counts[slot[part]]
            point = np.repeat(rows[part], counts)
            number_in_slot = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
            place = self._entries[np.repeat(self._starts[slot[part]], counts) + number_in_slot]
            self._gather(xyz[point] - self._places[place], place)

    def by_class(self) -> dict[int, tuple[float, int]]:
        """Return the mean surface variation, and the number of places that it was measured at, by class."""
        # Sums over the points around each place: their number, x, y and z, and the products of these.
        count, sums, products = self._sums[0], self._sums[1:4], self._sums[4:]
        is_measured = count >= _FEWEST_NEIGHBOURS
        divisor = np.maximum(count, 1)
        mean, mean_products = sums / divisor, products / divisor
        covariance = np.empty((len(count), 3, 3))
        for row, (i, j) in enumerate(_PAIRS):
            covariance[:, i, j] = covariance[:, j, i] = mean_products[row] - mean[i] * mean[j]
        # Surface variation: the least eigenvalue over the sum of all three (Pauly et al. 2002).
        eigenvalues = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
        total = eigenvalues.sum(axis=1)
        variation = eigenvalues[:, 0] / np.where(total > 0, total, 1.0)
        result = {}
        for label in np.unique(self._label[is_measured]):
            is_of_class = is_measured & (self._label == label)
            result[int(label)] = float(variation[is_of_class].mean()), int(is_of_class.sum())
        return result

    def _column(self, xyz: Float) -> Int:
        """Return the column and row (N, 2) of the ground's cells, a radius wide, that places (N, 2 or more) lie in."""
        return np.floor((xyz[:, :2] - self._corner) / max(self._radius, 1e-9)).astype(np.int64)

    def _gather(self, step: Float, place: Index) -> None:
        """Add pairs of a point and a place to the places' sums, of those that lie within the radius.

        Args:
            step: (N, 3) from the place to the point, m.
            place: (N,) index of the place.
        """
        in_radius = (step**2).sum(axis=1) <= self._radius**2
        step, place = step[in_radius], place[in_radius]
        size = len(self._places)
        self._sums[0] += np.bincount(place, minlength=size)
        for axis in range(3):
            self._sums[1 + axis] += np.bincount(place, step[:, axis], size)
        for row, (i, j) in enumerate(_PAIRS):
            self._sums[4 + row] += np.bincount(place, step[:, i] * step[:, j], size)


_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _bounded_slices(counts: Index) -> Iterator[slice]:
    """Yield slices over points, in order, of at most `_PAIRS_AT_ONCE` pairs each, or of one point.

    Args:
        counts: (N,) pairs of each point.
    """
    pairs_up_to = np.cumsum(counts)
    begin = 0
    while begin < len(counts):
        pairs_before = pairs_up_to[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(pairs_up_to, pairs_before + _PAIRS_AT_ONCE)))
        yield slice(begin, end)
        begin = end
