"""Convolution over the cells that a cloud fills: what lies around a cell, and is there, by weights for each place.

Graham, Engelcke and van der Maaten, "3D semantic segmentation with submanifold sparse convolutional networks" (2018):
only filled cells have a result, so that surfaces stay as thin as they are.

On a CPU it is done place by place for the pairs of cells that are there: of a surface not half of them. A GPU would
wait for so many small steps; there all places are gathered, empty ones as zeros, and one product of matrices does the
rest. Either way nothing of the size cells x places x channels is kept for the gradient, and no two numbers are added to
one at the same time, so that all runs are the same.
"""

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor, nn

_CHUNK = 1 << 26
"""Numbers that are gathered at once on a GPU, to be busy."""


class CellConvolution(nn.Module):
    """A layer without bias over the cells around each cell.

    Args:
        places: around a cell, itself among them.
        few: channels that go in.
        many: channels that come out.
    """

    def __init__(self, places: int, few: int, many: int) -> None:
        super().__init__()
        bound = (places * few) ** -0.5
        self.weight = nn.Parameter(torch.empty(places, few, many).uniform_(-bound, bound))

    def forward(self, values: Tensor, around: "Around") -> Tensor:
        """Return features (M, many) of cells with features (M, few)."""
        device = values.device.type
        weight: Tensor = self.weight
        if torch.is_autocast_enabled(device):
            half = torch.get_autocast_dtype(device)
            values, weight = values.to(half), weight.to(half)
        return convolve(values, weight, around)


class Around:
    """Which cells lie around which.

    Args:
        near: (M, K) integers: the cells around each of M; M where there is none. Places must be in an order that is its
            reverse when seen from the other cell, as rising ones are.
    """

    def __init__(self, near: Tensor) -> None:
        self.near = near
        self._pairs: list[tuple[Tensor, Tensor]] | None = None

    def pairs(self) -> list[tuple[Tensor, Tensor]]:
        """Return for each place the cells that have one there, and those that are there; made once."""
        if self._pairs is None:
            across = self.near.T.contiguous()
            there = across < across.shape[1]
            counts = there.sum(dim=1).tolist()
            own, other = there.nonzero()[:, 1], across[there].long()
            self._pairs = list(zip(own.split(counts), other.split(counts), strict=True))
        return self._pairs


def convolve(values: Tensor, weight: Tensor, around: Around) -> Tensor:
    """Return the sums (M, D) over the places around each cell of the values there (M, C) times `weight` (K, C, D)."""
    if torch.compiler.is_exporting():  # a graph without chunks and gradients
        return _gathered(_with_nothing(values), around.near) @ weight.flatten(0, 1)
    way = _Pairwise if values.device.type == "cpu" else _Gathered
    result: Tensor = way.apply(values, weight, around)
    return result


class _Pairwise(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, weight: Tensor, around: Around) -> Tensor:
        ctx.save_for_backward(values, weight)
        ctx.around = around
        total = _sums(len(values), weight.shape[2], values)
        for (own, other), matrix in zip(around.pairs(), weight, strict=True):
            total.index_add_(0, own, (values.index_select(0, other) @ matrix).to(total.dtype))
        return total.to(values.dtype)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        values, weight = ctx.saved_tensors
        of_values = _sums(len(values), values.shape[1], values) if ctx.needs_input_grad[0] else None
        of_weight = torch.empty_like(weight) if ctx.needs_input_grad[1] else None
        for place, (own, other) in enumerate(ctx.around.pairs()):
            gradient = gradients[0].index_select(0, own)
            if of_values is not None:
                of_values.index_add_(0, other, (gradient @ weight[place].T).to(of_values.dtype))
            if of_weight is not None:
                of_weight[place] = values.index_select(0, other).T @ gradient
        return None if of_values is None else of_values.to(values.dtype), of_weight, None


class _Gathered(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, weight: Tensor, around: Around) -> Tensor:
        ctx.save_for_backward(values, weight, around.near)
        return _product(values, weight, around.near)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        values, weight, near = ctx.saved_tensors
        gradient = gradients[0].contiguous()
        of_values = of_weight = None
        if ctx.needs_input_grad[0]:  # who is to the left of one has it to the right: a convolution in reverse
            of_values = _product(gradient, weight.flip(0).transpose(1, 2), near)
        if ctx.needs_input_grad[1]:
            total = _sums(weight.shape[0] * weight.shape[1], weight.shape[2], weight)
            padded = _with_nothing(values)
            for rows in _chunks(near, values.shape[1]):
                total += _gathered(padded, near[rows]).T @ gradient[rows]
            of_weight = total.to(weight.dtype).view_as(weight)
        return of_values, of_weight, None


def _sums(rows: int, columns: int, like: Tensor) -> Tensor:
    """Return zeros to add to: in single precision in the place of bfloat16."""
    return like.new_zeros(rows, columns, dtype=torch.float32 if like.dtype == torch.bfloat16 else like.dtype)


def _product(values: Tensor, weight: Tensor, near: Tensor) -> Tensor:
    """Return the convolution (M, D) of values (M, C), gathered chunk by chunk."""
    padded, matrix = _with_nothing(values), weight.reshape(-1, weight.shape[2])
    parts = [_gathered(padded, near[rows]) @ matrix for rows in _chunks(near, values.shape[1])]
    return torch.cat(parts) if parts else values.new_empty(0, weight.shape[2])


def _with_nothing(values: Tensor) -> Tensor:
    """Return the values (M, C) with a row of zeros after them, for places where there is no cell."""
    return torch.cat([values, values.new_zeros(1, values.shape[1])])


def _gathered(padded: Tensor, near: Tensor) -> Tensor:
    """Return the values (M, K C) around each cell, place by place."""
    return padded.index_select(0, near.reshape(-1)).unflatten(0, near.shape).flatten(1)


def _chunks(near: Tensor, channels: int) -> Iterator[slice]:
    """Yield slices of the cells so short that what is gathered for them is no more than `_CHUNK`."""
    rows = max(_CHUNK // (near.shape[1] * channels), 1)
    for begin in range(0, len(near), rows):
        yield slice(begin, begin + rows)
