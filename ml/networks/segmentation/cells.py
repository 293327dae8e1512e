"""Which cells of a grid a cloud fills, stage by stage, and which look at which: in plain PyTorch, on any device.

Points are gathered into the cells of a grid, these into cells twice as wide, and so on. In the first stages each cell
looks at the cells around it; in the later ones cells are sorted along space-filling curves, and each looks at those of
its patch, a stretch of the curve. All of it is sorting and searching of numbers that tell cells apart.

Clouds of a batch are packed, and each has its cells counted from its own lowest: nothing leads from one to another, and
a batch gives what its clouds give one by one. Cells are numbered by their place and curves visit a cell once, so the
order of the points has no say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from synthroads_addon.base.errors import InputError

from .curves import BITS, Curve, curve_codes
from .neighbours import check_ends

Cells = dict[str, Tensor]
"""Tensors by name; ``s`` is a stage's number from 0, with M_s cells, N the number of points:

- ``cell0`` (N,) int64: the cell of each point
- ``share0`` (N,): one over the number of points in its cell
- ``inside0`` (N, 3): its place in the cell, -0.5 to 0.5 along each axis
- ``ends{s}`` (B,) int64: where each cloud's cells end
- ``near{s}`` (M_s, 27 or 7) int32, early stages: the cells around each, by rising place; M_s where there is none
- ``parent{s}`` (M_{s-1},) int64, s > 0: the cell of this stage that each one of the stage before lies in
- ``children{s}`` (M_s, 8) int64, s > 0: the cells of the stage before in each; empty octants have another one's
- ``grid{s}`` (M_s, 3), late stages: the cells' coordinates, in units of their edge
- ``patch{s}`` (C, P, K) int64, late stages: the cells of each patch along each of C curves
- ``place{s}`` (C, M_s) int64, late stages: where in all patches (P x K) each cell is asked for what it sees
- ``filled{s}`` (P, K) bool, late stages: which slots of the patches count; left out where all do
"""

LARGEST = (1 << BITS) - 2
"""Cells along an axis of a cloud, one to either side being left free."""
_MOST_CLOUDS = 1 << 14
"""Clouds of a batch at most. Chosen: with three coordinates of 16 bits each their numbers fill 62 bits of 64."""
_AXES = 3
"""Of space: x, y, z."""
_CROSS = [4, 10, 12, 13, 14, 16, 22]
"""Out of the 27 cells around one: itself and those that share a face with it."""
_MULTIPLE = 8
"""Of the length of patches: what attention on a GPU needs."""


@dataclass(frozen=True)
class Grid:
    """Options for the cells of a cloud and what they look at.

    Attributes:
        cell: edge of the cells of stage 0, m; it doubles with each stage.
        stages: number of stages.
        attention_from: first stage whose cells attend along curves; earlier ones convolve over cells around.
        cross: whether only the 6 cells that share a face count as neighbours, not all 26.
        curves: curves along which late stages are sorted.
        patch: number of cells that attend to each other along a curve; a multiple of 8.
    """

    cell: float
    stages: int
    attention_from: int
    cross: bool
    curves: tuple[Curve, ...]
    patch: int


def build_cells(coord: Tensor, offset: Tensor, grid: Grid, *, always_masked: bool = False) -> Cells:
    """Return the cells of packed clouds, their neighbours and patches, on the device of the coordinates; see `Cells`.

    Args:
        coord: (N, 3) floating-point numbers, m.
        offset: (B,) integers: where each cloud ends. Clouds may be empty or of one point.
        grid: options of the cells.
        always_masked: whether ``filled{s}`` is returned even where all slots count.

    Raises:
        InputError: the offsets don't fit the points, a coordinate is not finite, there are more than 16,384 clouds, or
            a cloud is wider than 65,534 cells.
    """
    counts = _points_of_clouds(coord, offset)
    clouds = len(counts)
    cloud = torch.repeat_interleave(torch.arange(clouds, device=coord.device), counts, output_size=len(coord))
    cell_coords, place_in_cell = _cell_coords(coord, cloud, clouds, grid.cell)
    keys, cell = torch.unique(_keys(cloud, cell_coords), return_inverse=True)
    points = torch.bincount(cell, minlength=len(keys)).to(coord.dtype)
    cells: Cells = {"cell0": cell, "share0": points.reciprocal()[cell], "inside0": place_in_cell}
    for stage in range(grid.stages):
        if stage:
            cloud, cell_coords = _split_keys(keys)
            coarse_keys, parent = torch.unique(_keys(cloud, cell_coords >> 1), return_inverse=True)
            cells |= {f"parent{stage}": parent, f"children{stage}": _children(cell_coords, parent, len(coarse_keys))}
            keys = coarse_keys
        cloud, cell_coords = _split_keys(keys)
        counts = torch.bincount(cloud, minlength=clouds)
        cells[f"ends{stage}"] = counts.cumsum(0)
        if stage < grid.attention_from:
            neighbour_table = _cells_around(keys)
            cells[f"near{stage}"] = neighbour_table[:, _CROSS].contiguous() if grid.cross else neighbour_table
            continue
        patch, slot_of_cell, slot_mask = _patches(cell_coords, cloud, counts, grid)
        cells |= {f"grid{stage}": cell_coords.to(coord.dtype), f"patch{stage}": patch, f"place{stage}": slot_of_cell}
        if slot_mask is not None or always_masked:
            all_slots = torch.ones(patch.shape[1:], dtype=torch.bool, device=coord.device)
            cells[f"filled{stage}"] = all_slots if slot_mask is None else slot_mask
    return cells


def _points_of_clouds(coord: Tensor, offset: Tensor) -> Tensor:
    """Return the number of points of each cloud (B,), on the coordinates' device; raise `InputError` at faults."""
    ends = check_ends(coord, offset)
    if len(ends) > _MOST_CLOUDS:
        raise InputError("offset", len(ends), f"must not have more than {_MOST_CLOUDS} clouds")
    return torch.from_numpy(np.diff(ends, prepend=0)).to(coord.device)


def _cell_coords(coord: Tensor, cloud: Tensor, clouds: int, edge: float) -> tuple[Tensor, Tensor]:
    """Return the points' cells (N, 3), counted from each cloud's lowest, and places in these (N, 3), -0.5 to 0.5."""
    cell_coordinates = coord / edge
    floor = cell_coordinates.floor()
    lowest = floor.new_zeros(clouds, _AXES)
    lowest.scatter_reduce_(0, cloud[:, None].expand(-1, _AXES), floor, "amin", include_self=False)
    cells = floor - lowest[cloud]
    if len(cells) and (widest := float(cells.max())) >= LARGEST:
        raise InputError(
            "network.cell",
            edge,
            f"must be so large that no cloud is wider than {LARGEST} cells: one is {widest + 1:.0f} wide",
        )
    return cells.long(), cell_coordinates - floor - 0.5


def _keys(cloud: Tensor, cell_coords: Tensor) -> Tensor:
    """Return the key (M,) of each cell: cloud, x, y, z in the bits from high to low, coordinates counted from 1.

    Counted from 1, cells around have keys too.
    """
    x, y, z = (cell_coords + 1).unbind(1)
    return (((cloud << BITS | x) << BITS | y) << BITS) | z


def _split_keys(keys: Tensor) -> tuple[Tensor, Tensor]:
    """Return the clouds (M,) and integer coordinates (M, 3) of cells' keys (M,), the inverse of `_keys`."""
    mask = (1 << BITS) - 1
    cell_coords = torch.stack([(keys >> 2 * BITS) & mask, (keys >> BITS) & mask, keys & mask], dim=1) - 1
    return keys >> 3 * BITS, cell_coords


def _children(cell_coords: Tensor, parent: Tensor, count: int) -> Tensor:
    """Return the cells (count, 8) of the stage before in each cell's octants; empty ones repeat another's cell."""
    parity = cell_coords & 1
    octant = parity[:, 0] << 2 | parity[:, 1] << 1 | parity[:, 2]
    table = torch.full((count * 8,), -1, dtype=torch.int64, device=cell_coords.device)
    table[parent * 8 + octant] = torch.arange(len(cell_coords), device=cell_coords.device)
    table = table.view(count, 8)
    return torch.where(table < 0, table.amax(dim=1, keepdim=True), table)


def _cells_around(keys: Tensor) -> Tensor:
    """Return the 27 cells around each of M cells (M, 27) int32, by rising x, y, z; M where there is none.

    Of three cells in a column, those that are there follow each other in the sorted numbers: one search finds them.
    """
    count = len(keys)
    sides = torch.arange(-1, 2, device=keys.device)
    columns = ((sides[:, None] << BITS) + sides).flatten() << BITS
    targets = keys[:, None] + columns - 1
    position = torch.searchsorted(keys, targets)
    ended_keys = torch.cat([keys, keys.new_full((1,), -1)])
    neighbour_table = torch.empty(count, 9, 3, dtype=torch.int32, device=keys.device)
    for step in range(3):
        exists = ended_keys[position] == targets + step
        neighbour_table[:, :, step] = torch.where(exists, position, count)
        position += exists
    return neighbour_table.flatten(1)


def _patches(cell_coords: Tensor, cloud: Tensor, counts: Tensor, grid: Grid) -> tuple[Tensor, Tensor, Tensor | None]:
    """Return the patches' cells (C, P, K), each cell's slot in them (C, M), and the mask of used slots (P, K) or None.

    Each cloud's curve is cut into stretches as equal as can be, as few as have room in patches. A patch has its stretch
    in the middle and the cells before and after it; where a cloud is too small to fill one, slots stay empty.
    """
    device = cell_coords.device
    sizes: list[int] = counts.tolist()
    width = min(grid.patch, -(-max(sizes, default=0) // _MULTIPLE) * _MULTIPLE)
    numbers = [-(-size // width) if size else 0 for size in sizes]
    number = torch.tensor(numbers, dtype=torch.int64, device=device)
    begin, first_patch = counts.cumsum(0) - counts, number.cumsum(0) - number

    # By patch: its cloud, its stretch of the cloud's curve, and the slots around that stretch.
    owner = torch.repeat_interleave(torch.arange(len(sizes), device=device), number, output_size=sum(numbers))
    size, parts = counts[owner], number[owner]
    patch_number = torch.arange(sum(numbers), device=device) - first_patch[owner]
    stretch_begin, stretch_end = (
        (number_in_cloud * size + parts - 1).div(parts, rounding_mode="floor")
        for number_in_cloud in (patch_number, patch_number + 1)
    )
    start = (stretch_begin - (width - (stretch_end - stretch_begin)).div(2, rounding_mode="floor")).clamp(min=0)
    start = torch.minimum(start, (size - width).clamp(min=0))
    slots = start[:, None] + torch.arange(width, device=device)
    slot_mask = slots < size[:, None]
    slots = begin[owner][:, None] + torch.minimum(slots, size[:, None] - 1)

    # By cell: its patch and slot, in the order of each curve.
    rank = torch.arange(len(cell_coords), device=device) - begin[cloud]
    patch = first_patch[cloud] + (rank * number[cloud]).div(counts[cloud], rounding_mode="floor")
    slot = patch * width + rank - start[patch]
    orders = [torch.argsort(cloud << 3 * BITS | curve_codes(cell_coords, curve)) for curve in grid.curves]
    order = torch.stack(orders)
    slot_of_cell = torch.empty_like(order).scatter_(1, order, slot.expand_as(order))
    return order[:, slots], slot_of_cell, None if all(size >= width for size in sizes if size) else slot_mask
