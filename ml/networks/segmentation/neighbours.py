"""Which points a network thins a cloud out to, and which of them look at which: computed before it, on the CPU.

A network that halves the resolution stage by stage needs only indices and positions of each stage, and those depend on
the geometry alone. So workers that prepare batches build them, with k-d trees, and the network itself only gathers.

Clouds of a batch are packed: their points lie one after the other in arrays (sum N, C), and ``offset`` says where each
cloud ends. No index ever leads from one cloud to another, so a batch gives what its clouds give one by one.

Neighbourhoods hold a limited number of points. Out of a ball with more, the first in the cloud's order are taken, as
PointNet++'s ball query does. That order is a hash of the coordinates: a random subset of the ball, spread over all of
it, that does not depend on the order in which the points came. (The nearest ones would shrink the ball.) Only points
with the very same coordinates keep their given order among themselves.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from synthroads_addon.base.arrays import Float, Int
from synthroads_addon.base.errors import InputError

from ...data.points import voxel_sample

Neighbours = dict[str, torch.Tensor]
"""Tensors by name; ``s`` is a stage's number, 0 being the cloud itself, with M_s points:

- ``positions{s}`` (M_s, 3): m, from the middle of the cloud's extent; in the dtype of the coordinates
- ``offset{s}`` (B,) int64: where each cloud ends
- ``sample{s}`` (M_s,) int64, s > 0: the stage's points among those of the stage before
- ``group{s}`` (M_s, K) int32, s > 0: for each of the stage's points, its neighbours in the stage before
- ``inner{s}`` (M_s, K) int32, s > 0: its neighbours in its own stage; only where the neighbourhood says so
- ``nearest{s}`` (M_{s-1}, 3) int32, s > 0: for each point of the stage before, the nearest three of this stage
- ``weight{s}`` (M_{s-1}, 3): their weights by inverse distance, of the sum 1
"""

_POINTS_INTO = {
    "sample": (-1, torch.int64),
    "group": (-1, torch.int32),
    "inner": (0, torch.int32),
    "nearest": (0, torch.int32),
}
"""Arrays of indices: stage that they point into, relative to their own, and their dtype."""
Sampling = Literal["grid", "farthest"]
_STRIDE = 4
"""One in four points stays in each stage, as in PointNet++ and PointNeXt."""
_CHUNK = 1 << 15
"""Queries whose pairs are held at once. Chosen: bounds memory."""
TINY = 1e-8
"""Added to distances, m, before they are inverted: as in PointNet++."""


@dataclass(frozen=True)
class Neighbourhood:
    """Options for thinning a cloud stage by stage, and for its points' neighbourhoods.

    Attributes:
        radius: radius of the balls around the first stage's points, m; it doubles with each stage.
        neighbours: number of points of a ball; missing ones repeat the first.
        inner: for each stage whether neighbours within the stage are looked for, within twice its radius.
        sampling: ``grid`` keeps of each cell the point nearest to its middle; cells of the first stage are two thirds
            of the radius wide, and double with each stage (a fourth of a surface's points then stays), and
            ``farthest`` keeps exactly one in four, each the farthest from those already kept.
    """

    radius: float = 0.3
    neighbours: int = 32
    inner: tuple[bool, ...] = (True, True, True, True)
    sampling: Sampling = "grid"

    def stage_radius(self, stage: int) -> float:
        """Return the radius of ``group{stage}``, m; that of ``inner{stage}`` is twice as large."""
        return self.radius * 2.0 ** (stage - 1)


def build_neighbours(coord: torch.Tensor, offset: torch.Tensor, neighbourhood: Neighbourhood) -> Neighbours:
    """Return thinned stages and neighbour indices of packed clouds as tensors, see `Neighbours`.

    Args:
        coord: (N, 3) float32 or float64, m; on the CPU.
        offset: (B,) integers: where each cloud ends. Clouds may be empty or of one point.
        neighbourhood: options of the search.

    Raises:
        InputError: the offsets don't fit the points, a coordinate is not finite, or a cloud spans more cells of
            its thinnings than 2^62.
    """
    ends = check_ends(coord, offset)
    bounds = list(itertools.pairwise([0, *ends.tolist()])) or [(0, 0)]
    clouds = [_cloud_stages(coord[begin:end].numpy(), neighbourhood) for begin, end in bounds]
    stages = range(len(neighbourhood.inner) + 1)
    sizes = np.array([[len(cloud[f"positions{stage}"]) for stage in stages] for cloud in clouds], dtype=np.int64)
    begins = np.cumsum(sizes, axis=0) - sizes
    batch_arrays: Neighbours = {}
    for name in clouds[0]:
        stage_step, dtype = _POINTS_INTO.get(name[:-1], (None, coord.dtype))
        shift = [0] * len(clouds) if stage_step is None else begins[:, int(name[-1]) + stage_step].tolist()
        parts = [cloud[name] + step if step else cloud[name] for cloud, step in zip(clouds, shift, strict=True)]
        batch_arrays[name] = torch.from_numpy(np.ascontiguousarray(np.concatenate(parts))).to(dtype)
    for stage in stages:
        batch_arrays[f"offset{stage}"] = torch.from_numpy(np.cumsum(sizes[:, stage])[: len(ends)])
    return batch_arrays


def check_ends(coord: torch.Tensor, offset: torch.Tensor) -> Int:
    """Return where each packed cloud ends (B,); raise `InputError` unless that fits the points and all are finite."""
    if coord.ndim != 2 or coord.shape[1] != 3 or not coord.is_floating_point():
        raise InputError("coord", tuple(coord.shape), "must be floating-point numbers of the shape (N, 3)")
    ends = np.asarray(offset.cpu().numpy(), dtype=np.int64)
    if ends.ndim != 1 or np.any(np.diff(ends, prepend=0) < 0) or (ends[-1] if len(ends) else 0) != len(coord):
        raise InputError("offset", ends.tolist(), f"must rise from 0 or more to the number of points, {len(coord)}")
    if not bool(torch.isfinite(coord).all()):
        raise InputError("coord", "NaN or infinity", "must be finite numbers, m")
    return ends


def _cloud_stages(coord: NDArray[np.floating], neighbourhood: Neighbourhood) -> dict[str, NDArray[np.generic]]:
    """Return positions, samples and neighbours of one cloud's stages, indices counted from its own first point."""
    local = _centre_cloud(coord)
    order = geometric_order(local)
    # What the network sees is rounded to the coordinates' dtype, so neighbours are those of the rounded positions.
    points = local[order].astype(np.float64)
    arrays: dict[str, NDArray[np.generic]] = {"positions0": local}
    tree = cKDTree(points) if len(points) else None
    for stage, has_inner in enumerate(neighbourhood.inner, start=1):
        radius = neighbourhood.stage_radius(stage)
        sample = _sample(points, radius, neighbourhood.sampling)
        sampled_points = points[sample]
        kept_tree = cKDTree(sampled_points) if len(sampled_points) else None
        arrays[f"positions{stage}"] = sampled_points.astype(local.dtype)
        arrays[f"sample{stage}"] = sample
        arrays[f"group{stage}"] = _first_in_ball(kept_tree, tree, radius, neighbourhood.neighbours)
        if has_inner:
            arrays[f"inner{stage}"] = _first_in_ball(kept_tree, kept_tree, 2 * radius, neighbourhood.neighbours)
        arrays[f"nearest{stage}"], arrays[f"weight{stage}"] = nearest_three(points, kept_tree)
        points, tree = sampled_points, kept_tree
    return _in_given_order(arrays, order)


def _centre_cloud(coord: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return coordinates (N, 3) centred on the middle of their bounding box, which doesn't depend on their order."""
    if not len(coord):
        return coord
    coordinates = coord.astype(np.float64)
    return (coordinates - 0.5 * (coordinates.min(axis=0) + coordinates.max(axis=0))).astype(coord.dtype)


def _in_given_order(arrays: dict[str, NDArray[np.generic]], order: Int) -> dict[str, NDArray[np.generic]]:
    """Return arrays whose indices into the cloud, found for points in `order`, are mapped back to the given order."""
    inverse_order = np.empty_like(order)
    inverse_order[order] = np.arange(len(order))
    mapped = {name: order[arrays[name]] if len(order) else arrays[name] for name in ("sample1", "group1")}
    return arrays | mapped | {name: arrays[name][inverse_order] for name in ("nearest1", "weight1")}


def geometric_order(points: NDArray[np.floating]) -> Int:
    """Return a pseudo-random permutation (N,) of points (N, 3), determined by a hash of their coordinates alone."""
    bits = np.ascontiguousarray(points.astype(np.float64) + 0.0).view(np.uint64)  # + 0.0: one zero, not two
    key = np.zeros(len(points), dtype=np.uint64)
    for axis in range(3):
        key = _mix_bits(key ^ bits[:, axis])
    return np.argsort(key, kind="stable")


def _mix_bits(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return hashes of 64-bit keys (the finaliser of SplitMix64; Steele, Lea and Flood, 2014)."""
    key = key + np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))


def _sample(points: Float, radius: float, sampling: Sampling) -> Int:
    """Return the indices of the points that a stage keeps, by grid or by farthest points."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    if sampling == "grid":
        return voxel_sample(points - points.min(axis=0), radius * 2.0 / 3.0)
    return farthest_sample(points, max(len(points) // _STRIDE, 1))


def farthest_sample(points: Float, count: int) -> Int:
    """Return the indices (count,) of farthest-point sampling that starts with point 0; ties go to the first.

    Eldar et al., "The farthest point strategy for progressive image sampling" (1997). Takes N x count distances.
    """
    columns = np.ascontiguousarray(points.T)
    distance = np.full(len(points), np.inf)
    sample = np.zeros(count, dtype=np.int64)
    for step in range(1, count):
        difference = columns - columns[:, sample[step - 1], None]
        np.minimum(distance, np.square(difference, out=difference).sum(axis=0), out=distance)
        sample[step] = distance.argmax()
    return sample


def _first_in_ball(queries: cKDTree | None, support: cKDTree | None, radius: float, limit: int) -> Int:
    """Return indices (M, limit) of the first `limit` support points in each query's ball, padded with the first.

    Every query is a support point itself, so that no ball is empty.
    """
    if queries is None or support is None:
        return np.zeros((0, limit), dtype=np.int64)
    indices = np.full((queries.n, limit), -1, dtype=np.int64)
    for begin in range(0, queries.n, _CHUNK):
        part = queries if queries.n <= _CHUNK else cKDTree(queries.data[begin : begin + _CHUNK])
        pairs = part.sparse_distance_matrix(support, radius, output_type="ndarray")
        pairs = pairs[pairs["v"] < radius]
        key = np.sort(pairs["i"].astype(np.int64) * support.n + pairs["j"])
        query, neighbour = key // support.n, key % support.n
        run_start = np.searchsorted(query, np.arange(part.n))
        rank = np.arange(len(key)) - run_start[query]
        has_room = rank < limit
        indices[begin + query[has_room], rank[has_room]] = neighbour[has_room]
    return np.where(indices < 0, indices[:, :1], indices)


def nearest_three(points: Float, tree: cKDTree | None) -> tuple[Int, Float]:
    """Return indices and inverse-distance weights (N, 3), of the sum 1, of each point's three nearest in a tree.

    Where the tree has fewer, index and weight of the others are 0.
    """
    nearest_index = np.zeros((len(points), 3), dtype=np.int64)
    weight = np.zeros((len(points), 3))
    if tree is not None:
        count = min(tree.n, 3)
        distance, index = tree.query(points, k=[*range(1, count + 1)])
        nearest_index[:, :count], weight[:, :count] = index, 1.0 / (distance + TINY)
        weight /= weight.sum(axis=1, keepdims=True)
    return nearest_index, weight
