"""Thinned stages and neighbour indices of packed clouds in plain PyTorch, on the device where the points lie.

What `neighbours.build_neighbours` finds with k-d trees on the CPU, cloud by cloud, is found here for all clouds of a
batch at once, by sorting points into cells: the same samples and the same neighbours. It is for GPUs, on which a
training would otherwise wait for its workers; on a CPU k-d trees are faster.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from synthroads_addon.base.errors import InputError

from .neighbours import TINY, Neighbourhood, Neighbours, check_ends

_PAIRS = {"cpu": 1 << 20}
"""Pairs of queries and candidates that are held at once. Chosen: 4 MiB for each number of a pair."""
_PAIRS_ELSEWHERE = 1 << 23
"""The same on a GPU. Chosen: 32 MiB for each number of a pair in single precision."""
_LARGEST_KEY = 2**62
"""Largest number of cells. Chosen: keys have 63 bits, one of them to spare."""


def build_neighbours(coord: Tensor, offset: Tensor, neighbourhood: Neighbourhood) -> Neighbours:
    """Return thinned stages and neighbour indices of packed clouds as tensors on their device, see `Neighbours`.

    Args:
        coord: (N, 3) float32 or float64, m.
        offset: (B,) integers: where each cloud ends. Clouds may be empty or of one point.
        neighbourhood: options of the search; its sampling must be ``grid``.

    Raises:
        InputError: the offsets don't fit the points, a coordinate is not finite, a cloud spans more cells of its
            thinnings than 2^62, or the sampling is another one, which is a loop over points.
    """
    if neighbourhood.sampling != "grid":
        raise InputError("sampling", neighbourhood.sampling, "must be grid where neighbours are found on a GPU")
    ends = torch.from_numpy(check_ends(coord, offset)).to(coord.device)
    count = len(ends)
    cloud = _clouds_of(ends, len(coord))
    local = _centre_clouds(coord, cloud, count)
    order = _geometric_order(local, cloud)
    # What the network sees is rounded to the coordinates' dtype, so neighbours are those of the rounded positions.
    points = _Points(local[order].double(), cloud, count)  # sorting by cloud leaves which point is of which
    neighbours: Neighbours = {"positions0": local, "offset0": ends}
    for stage, has_inner in enumerate(neighbourhood.inner, start=1):
        radius = neighbourhood.stage_radius(stage)
        sample = _grid_sample(points, radius * 2.0 / 3.0)
        sampled = points.select(sample)
        neighbours[f"positions{stage}"] = sampled.xyz.to(local.dtype)
        neighbours[f"offset{stage}"] = torch.searchsorted(
            sampled.cloud, torch.arange(count, device=coord.device), right=True
        )
        neighbours[f"sample{stage}"] = sample
        neighbours[f"group{stage}"] = _first_in_ball(sampled, points, radius, neighbourhood.neighbours)
        if has_inner:
            neighbours[f"inner{stage}"] = _first_in_ball(sampled, sampled, 2 * radius, neighbourhood.neighbours)
        nearest_index, weight = _nearest_three(points, sampled, radius)
        neighbours[f"nearest{stage}"], neighbours[f"weight{stage}"] = nearest_index, weight.to(local.dtype)
        points = sampled
    return _in_given_order(neighbours, order)


@dataclass(frozen=True)
class _Points:
    """Points of a stage.

    Attributes:
        xyz: (N, 3) float64, m, those of each cloud one after the other.
        cloud: (N,) index of each point's cloud.
        count: number of clouds.
    """

    xyz: Tensor
    cloud: Tensor
    count: int

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, keep: Tensor) -> _Points:
        """Return the points at these indices."""
        return _Points(self.xyz[keep], self.cloud[keep], self.count)


@dataclass(frozen=True)
class _Cells:
    """Cells that points are sorted into, numbered so that those along z follow each other and no two clouds touch.

    Attributes:
        edge: edge of a cell, m.
        low: (3,) lowest cell of all points along each axis.
        spans: number of cells along each axis, with one more on either side.
    """

    edge: float
    low: Tensor
    spans: tuple[int, int, int]

    @classmethod
    def around(cls, points: _Points, edge: float) -> _Cells:
        """Return the cells of an edge (m) around some points, at least one."""
        cells = torch.floor(points.xyz / edge)
        lowest_cell = cells.amin(dim=0)
        cells_x, cells_y, cells_z = (int(span) for span in (cells.amax(dim=0) - lowest_cell + 3).tolist())
        _check_cells((cells_x, cells_y, cells_z), points.count)
        return cls(edge, lowest_cell, (cells_x, cells_y, cells_z))

    def cell_coords(self, points: _Points) -> Tensor:
        """Return each point's cell (N, 3), counted from 1."""
        return (torch.floor(points.xyz / self.edge) - self.low).long() + 1

    def keys(self, cell_coords: Tensor, cloud: Tensor) -> Tensor:
        """Return the keys of cells (...), given their integer coordinates (..., 3) and clouds (...)."""
        cells_x, cells_y, cells_z = self.spans
        return ((cloud * cells_x + cell_coords[..., 0]) * cells_y + cell_coords[..., 1]) * cells_z + cell_coords[..., 2]


def _check_cells(spans: tuple[int, int, int], clouds: int) -> None:
    """Refuse a grid with more cells than 62-bit keys can number."""
    if spans[0] * spans[1] * spans[2] * max(clouds, 1) >= _LARGEST_KEY:
        raise InputError("coord", " x ".join(map(str, spans)), "must span fewer than 2^62 cells in all")


def _clouds_of(ends: Tensor, points: int) -> Tensor:
    """Return the cloud's index of each of N packed points, given where the clouds end (B,)."""
    return torch.searchsorted(ends, torch.arange(points, device=ends.device), right=True)


def _lowest_coordinates(xyz: Tensor, cloud: Tensor, count: int) -> Tensor:
    """Return the least coordinates of each cloud (B, 3); infinity for an empty one."""
    lowest = xyz.new_full((count, 3), torch.inf)
    return lowest.scatter_reduce_(0, cloud[:, None].expand(-1, 3), xyz, "amin")


def _centre_clouds(coord: Tensor, cloud: Tensor, count: int) -> Tensor:
    """Return coordinates (N, 3) centred on the middle of their cloud's bounding box."""
    coordinates = coord.double()
    middle = 0.5 * (_lowest_coordinates(coordinates, cloud, count) - _lowest_coordinates(-coordinates, cloud, count))
    return (coordinates - middle[cloud]).to(coord.dtype)


def _geometric_order(points: Tensor, cloud: Tensor) -> Tensor:
    """Return the permutation (N,) of `neighbours.geometric_order`, of each cloud by itself."""
    bits = (points.double() + 0.0).contiguous().view(torch.int64)  # + 0.0: one zero, not two
    key = torch.zeros_like(cloud)
    for axis in range(3):
        key = _mix_bits(key ^ bits[:, axis])
    order = torch.argsort(key ^ _as_signed(1 << 63), stable=True)  # as if it had no sign
    return order[torch.argsort(cloud[order], stable=True)]


def _mix_bits(key: Tensor) -> Tensor:
    """Return hashes of 64-bit keys, as `neighbours` does: SplitMix64's finaliser on numbers with a sign."""
    key = key + _as_signed(0x9E3779B97F4A7C15)
    key = (key ^ _shift_right(key, 30)) * _as_signed(0xBF58476D1CE4E5B9)
    key = (key ^ _shift_right(key, 27)) * _as_signed(0x94D049BB133111EB)
    return key ^ _shift_right(key, 31)


def _as_signed(number: int) -> int:
    """Return the signed number with the same 64 bits as an unsigned one (two's complement)."""
    return number - (1 << 64) if number >= 1 << 63 else number


def _shift_right(key: Tensor, bits: int) -> Tensor:
    """Return 64-bit keys shifted to the right, zeros from the left."""
    return (key >> bits) & ((1 << (64 - bits)) - 1)


def _grid_sample(points: _Points, edge: float) -> Tensor:
    """Return the ascending indices of the point nearest to the centre of each occupied cell, as `voxel_sample` does."""
    if not len(points):
        return points.cloud
    steps = (points.xyz - _lowest_coordinates(points.xyz, points.cloud, points.count)[points.cloud]) / edge
    cells = torch.floor(steps)
    cells_x, cells_y, cells_z = (int(span) for span in (cells.amax(dim=0) + 1).tolist())
    _check_cells((cells_x, cells_y, cells_z), points.count)
    number = cells.long()
    key = ((points.cloud * cells_x + number[:, 0]) * cells_y + number[:, 1]) * cells_z + number[:, 2]
    order = torch.argsort(_squared_lengths(steps - cells - 0.5), stable=True)
    order = order[torch.argsort(key[order], stable=True)]
    return order[_first_of_each(key[order])].sort().values


def _squared_lengths(vectors: Tensor) -> Tensor:
    """Return the squared lengths (N,) of vectors (N, 3), summed in the order in which NumPy sums them."""
    squares = vectors * vectors
    return squares[:, 0] + squares[:, 1] + squares[:, 2]


def _first_of_each(sorted_values: Tensor) -> Tensor:
    """Return a mask (N,) of the first of each run of equal values."""
    is_first = torch.ones_like(sorted_values, dtype=torch.bool)
    is_first[1:] = sorted_values[1:] != sorted_values[:-1]
    return is_first


def _pairs(queries: _Points, support: _Points, edge: float) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Yield (query, support point, distance) of all pairs in neighbouring cells of an edge, by blocks of queries.

    All support points within the edge of a query are among them. The arrays (P,) have the queries in ascending order,
    and a query's pairs are never parted.
    """
    cells = _Cells.around(support, edge)
    key, order = cells.keys(cells.cell_coords(support), support.cloud).sort(stable=True)
    limits = torch.tensor(cells.spans, device=key.device) - 1
    # Of far queries too, whose cells don't hold anything: the nearest ones that are numbered.
    query_cell = cells.cell_coords(queries).clamp(min=torch.zeros_like(limits), max=limits)
    column_steps = torch.cartesian_prod(torch.arange(-1, 2), torch.arange(-1, 2)).to(query_cell)
    columns = query_cell[:, None].expand(-1, len(column_steps), 3).clone()
    columns[..., :2] += column_steps
    in_grid = ((columns[..., :2] >= 0) & (columns[..., :2] <= limits[:2])).all(dim=-1)
    columns[..., :2].clamp_(min=0)
    lower_cell, upper_cell = (columns.clone() for _ in range(2))
    lower_cell[..., 2].sub_(1).clamp_(min=0)
    upper_cell[..., 2] = torch.minimum(upper_cell[..., 2] + 1, limits[2])
    cloud = queries.cloud[:, None].expand(-1, len(column_steps))
    begin = torch.searchsorted(key, cells.keys(lower_cell, cloud))
    length = (torch.searchsorted(key, cells.keys(upper_cell, cloud), right=True) - begin) * in_grid
    total = length.sum(dim=1).cumsum(dim=0)
    for rows in _blocks(total, _PAIRS.get(key.device.type, _PAIRS_ELSEWHERE)):
        lengths = length[rows].reshape(-1)
        column = torch.repeat_interleave(torch.arange(len(lengths), device=key.device), lengths)
        place_in_run = torch.arange(len(column), device=key.device) - (lengths.cumsum(dim=0) - lengths)[column]
        support_index = order[begin[rows].reshape(-1)[column] + place_in_run]
        query = rows.start + torch.div(column, len(column_steps), rounding_mode="floor")
        yield query, support_index, _squared_lengths(queries.xyz[query] - support.xyz[support_index]).sqrt()


def _blocks(total: Tensor, pairs: int) -> Iterator[slice]:
    """Yield slices of queries with at most ``pairs`` pairs, or of one query; ``total`` (M,) is their running sum."""
    sums = total.cpu()
    begin, pairs_before = 0, 0
    while begin < len(sums):
        end = max(int(torch.searchsorted(sums, pairs_before + pairs, right=True)), begin + 1)
        yield slice(begin, end)
        begin, pairs_before = end, int(sums[end - 1])


def _first_in_ball(queries: _Points, support: _Points, radius: float, limit: int) -> Tensor:
    """Return indices (M, limit) int32 of the first support points in each query's ball, padded with the first.

    Every query is a support point itself, so that no ball is empty.
    """
    indices = torch.full((len(queries), limit), -1, dtype=torch.int32, device=queries.xyz.device)
    if not len(queries):
        return indices
    for query, support_index, distance in _pairs(queries, support, radius):
        in_ball = distance < radius
        key = (query[in_ball] * len(support) + support_index[in_ball]).sort().values
        row = torch.div(key, len(support), rounding_mode="floor")
        rank = _ranks(row)
        has_room = rank < limit
        indices[row[has_room], rank[has_room]] = (key % len(support))[has_room].int()
    return torch.where(indices < 0, indices[:, :1], indices)


def _ranks(sorted_values: Tensor) -> Tensor:
    """Return the rank (N,), from 0, of each value in its run of equal values."""
    indices = torch.arange(len(sorted_values), device=sorted_values.device)
    return indices - torch.cummax(indices * _first_of_each(sorted_values), dim=0).values


def _nearest_three(points: _Points, support: _Points, radius: float) -> tuple[Tensor, Tensor]:
    """Return indices (N, 3) int32 and inverse-distance weights (N, 3) of each point's three nearest support points.

    Where a cloud has fewer, the missing ones have the index of its first and the weight 0. The search goes on with
    doubled cells for points that have too few within reach.
    """
    device = points.xyz.device
    weight = points.xyz.new_zeros(len(points), 3)
    if not len(points):
        return weight.int(), weight
    begins = torch.searchsorted(support.cloud, torch.arange(points.count, device=device))
    nearest_index = begins[points.cloud][:, None].repeat(1, 3)
    count = torch.bincount(support.cloud, minlength=points.count).clamp(max=3)[points.cloud]
    extent = float((support.xyz.amax(dim=0) - support.xyz.amin(dim=0)).amax())
    open_points, edge = torch.arange(len(points), device=device), 4.0 / 3.0 * radius
    while len(open_points):
        queries = points.select(open_points)
        nearest_found, distance = nearest_index[open_points], points.xyz.new_full((len(open_points), 3), torch.inf)
        # Of each query's pairs, sorted by distance, keep the nearest three.
        for query, support_index, step in _pairs(queries, support, edge):
            order = torch.argsort(step, stable=True)
            order = order[torch.argsort(query[order], stable=True)]
            rank = _ranks(query[order])
            order, rank = order[rank < 3], rank[rank < 3]
            nearest_found[query[order], rank], distance[query[order], rank] = support_index[order], step[order]
        # Done if no nearer point can lie beyond the cells searched, or if these hold everything.
        farthest_distance = distance.gather(1, (count[open_points] - 1)[:, None])[:, 0]
        is_done = (farthest_distance <= edge) | torch.full_like(
            farthest_distance, edge > 2.0 * (extent + radius), dtype=torch.bool
        )
        nearest_index[open_points[is_done]] = nearest_found[is_done]
        weight[open_points[is_done]] = 1.0 / (distance[is_done] + TINY)
        open_points, edge = open_points[~is_done], 2.0 * edge
    return nearest_index.int(), weight / weight.sum(dim=1, keepdim=True)


def _in_given_order(neighbours: Neighbours, order: Tensor) -> Neighbours:
    """Return tensors whose indices into the clouds, found for points in `order`, are mapped back to the given order."""
    inverse_order = torch.empty_like(order)
    inverse_order[order] = torch.arange(len(order), device=order.device)
    mapped = {name: order[neighbours[name].long()].to(neighbours[name].dtype) for name in ("sample1", "group1")}
    return neighbours | mapped | {name: neighbours[name][inverse_order] for name in ("nearest1", "weight1")}
