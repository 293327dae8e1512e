"""Convolution over the cells that a cloud fills: what lies around a cell, and is there, by weights for each place.

Graham, Engelcke and van der Maaten, "3D semantic segmentation with submanifold sparse convolutional networks" (2018):
only filled cells have an output, so that surfaces stay as thin as they are. Of the cell n(i, k) at offset k from cell
i, with inputs x, outputs y and weights W:

    y_i = sum over k of x_n(i, k) W_k
    dL/dx_j = sum over k and all i with n(i, k) = j of dL/dy_i W_k^T
    dL/dW_k = sum over i of x_n(i, k)^T dL/dy_i

On a CPU it is done offset by offset for the pairs of cells that are there (the rule book of that paper): of a surface
not half of them. A GPU would wait for so many small steps; there all offsets are gathered (im2col), empty ones as
zeros, and one product of matrices does the rest. Either way nothing of the size cells x offsets x channels is kept for
the gradient, and no two numbers are added to one at the same time, so that all runs are the same.
"""

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor, nn

_CHUNK = 1 << 26
"""Numbers that are gathered at once on a GPU. Chosen: 256 MiB in single precision, enough to keep a GPU busy."""


class CellConvolution(nn.Module):
    """A layer without bias over the cells around each cell.

    Args:
        offsets: number of offsets around a cell, its own included.
        in_channels, out_channels: channels of the input and the output.
    """

    def __init__(self, offsets: int, in_channels: int, out_channels: int) -> None:
        super().__init__()
        limit = (offsets * in_channels) ** -0.5  # 1 / sqrt(fan in), as PyTorch's convolutions begin with
        self.weight = nn.Parameter(torch.empty(offsets, in_channels, out_channels).uniform_(-limit, limit))

    def forward(self, values: Tensor, around: "Around") -> Tensor:
        """Return features (M, out_channels) of cells with features (M, in_channels)."""
        device = values.device.type
        weight: Tensor = self.weight
        if torch.is_autocast_enabled(device):
            autocast_type = torch.get_autocast_dtype(device)
            values, weight = values.to(autocast_type), weight.to(autocast_type)
        return convolve(values, weight, around)


class Around:
    """Table of the cells around each cell.

    Args:
        near: (M, K) integers: the cells n(i, k) around each of M; M where there is none. Offsets must be in an order
            that is its reverse when seen from the other cell, as rising ones are: of K offsets k and K - 1 - k are
            opposite.
    """

    def __init__(self, neighbour_table: Tensor) -> None:
        self.near = neighbour_table
        self._pairs: list[tuple[Tensor, Tensor]] | None = None

    def pairs(self) -> list[tuple[Tensor, Tensor]]:
        """Return for each offset k the cells i that have a neighbour there, and these neighbours n(i, k); cached."""
        if self._pairs is None:
            near_by_offset = self.near.T.contiguous()
            mask = near_by_offset < near_by_offset.shape[1]
            counts = mask.sum(dim=1).tolist()
            centres, neighbours = mask.nonzero()[:, 1], near_by_offset[mask].long()
            self._pairs = list(zip(centres.split(counts), neighbours.split(counts), strict=True))
        return self._pairs


def convolve(values: Tensor, weight: Tensor, around: Around) -> Tensor:
    """Return the sums (M, D) over the offsets around each cell of the values there (M, C) times `weight` (K, C, D)."""
    if torch.compiler.is_exporting():  # a graph without chunks and gradients
        return _gather_neighbours(_append_zeros(values), around.near) @ weight.flatten(0, 1)
    algorithm = _Pairwise if values.device.type == "cpu" else _Gathered
    result: Tensor = algorithm.apply(values, weight, around)
    return result


class _Pairwise(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, weight: Tensor, around: Around) -> Tensor:
        """Return the convolution (M, D), offset by offset over the pairs of filled cells."""
        ctx.save_for_backward(values, weight)
        ctx.around = around
        total = _zero_sums(len(values), weight.shape[2], values)
        # Within one offset no cell occurs twice on either side: no two summands meet, so that the order is fixed.
        for (centres, neighbours), matrix in zip(around.pairs(), weight, strict=True):
            total.index_add_(0, centres, (values.index_select(0, neighbours) @ matrix).to(total.dtype))
        return total.to(values.dtype)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        """Return the gradients of values (M, C) and weight (K, C, D), by the equations of the module."""
        values, weight = ctx.saved_tensors
        of_values = _zero_sums(len(values), values.shape[1], values) if ctx.needs_input_grad[0] else None
        of_weight = torch.empty_like(weight) if ctx.needs_input_grad[1] else None
        for k, (centres, neighbours) in enumerate(ctx.around.pairs()):
            gradient = gradients[0].index_select(0, centres)
            if of_values is not None:
                of_values.index_add_(0, neighbours, (gradient @ weight[k].T).to(of_values.dtype))
            if of_weight is not None:
                of_weight[k] = values.index_select(0, neighbours).T @ gradient
        return None if of_values is None else of_values.to(values.dtype), of_weight, None


class _Gathered(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, weight: Tensor, around: Around) -> Tensor:
        """Return the convolution (M, D) by one product of matrices per chunk of cells."""
        ctx.save_for_backward(values, weight, around.near)
        return _product(values, weight, around.near)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        """Return the gradients of values (M, C) and weight (K, C, D), by the equations of the module."""
        values, weight, neighbour_table = ctx.saved_tensors
        gradient = gradients[0].contiguous()
        of_values = of_weight = None
        if ctx.needs_input_grad[0]:  # n(i, k) = j means n(j, K - 1 - k) = i: a convolution with reversed offsets
            of_values = _product(gradient, weight.flip(0).transpose(1, 2), neighbour_table)
        if ctx.needs_input_grad[1]:
            total = _zero_sums(weight.shape[0] * weight.shape[1], weight.shape[2], weight)
            values_and_zeros = _append_zeros(values)
            for rows in _chunks(neighbour_table, values.shape[1]):
                total += _gather_neighbours(values_and_zeros, neighbour_table[rows]).T @ gradient[rows]
            of_weight = total.to(weight.dtype).view_as(weight)
        return of_values, of_weight, None


def _zero_sums(rows: int, columns: int, like: Tensor) -> Tensor:
    """Return zeros (rows, columns) for sums: in float32 instead of bfloat16, whose 8 bits soon drop summands."""
    return like.new_zeros(rows, columns, dtype=torch.float32 if like.dtype == torch.bfloat16 else like.dtype)


def _product(values: Tensor, weight: Tensor, neighbour_table: Tensor) -> Tensor:
    """Return the convolution (M, D) of values (M, C), gathered chunk by chunk."""
    values_and_zeros, matrix = _append_zeros(values), weight.reshape(-1, weight.shape[2])
    parts = [
        _gather_neighbours(values_and_zeros, neighbour_table[rows]) @ matrix
        for rows in _chunks(neighbour_table, values.shape[1])
    ]
    return torch.cat(parts) if parts else values.new_empty(0, weight.shape[2])


def _append_zeros(values: Tensor) -> Tensor:
    """Return the values (M, C) with a row of zeros after them, for offsets at which there is no cell."""
    return torch.cat([values, values.new_zeros(1, values.shape[1])])


def _gather_neighbours(values_and_zeros: Tensor, neighbour_table: Tensor) -> Tensor:
    """Return the values (M, K C) around each cell, offset by offset, from values with a row of zeros at the end."""
    return values_and_zeros.index_select(0, neighbour_table.reshape(-1)).unflatten(0, neighbour_table.shape).flatten(1)


def _chunks(neighbour_table: Tensor, channels: int) -> Iterator[slice]:
    """Yield slices of the cells so short that the values gathered for them are no more than `_CHUNK` numbers."""
    rows = max(_CHUNK // (neighbour_table.shape[1] * channels), 1)
    for begin in range(0, len(neighbour_table), rows):
        yield slice(begin, begin + rows)
