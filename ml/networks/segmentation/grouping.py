"""Convolutions over neighbours without their cost: computed once per support point, then gathered.

A convolution over the neighbours ``j`` of a point ``i`` sees their features and relative positions,
``x_ij = A f_j + B (p_j - p_i) / r``. It is linear, so ``x_ij = g_j - h_i`` with ``g = A f + B p / r`` once per support
point and ``h = B p / r`` once per query. What follows it, a batch norm and a ReLU, rises or falls as a whole with each
channel, so that the maximum over the neighbours can be taken first: of ``g_j``, or of ``-g_j`` where the norm's scale
is negative. Nothing of the size points x neighbours x channels is kept, not even for the gradient; the norm's mean and
variance over all pairs follow from how often each support point is a neighbour and from which directions it is seen.
"""

from collections.abc import Iterator
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812 (its name everywhere)
from torch import Tensor, nn

from ..base import full_precision

_CHUNK = {"cpu": 1 << 18}
"""Gathered numbers at once: what a CPU's cache holds, or what a GPU needs to be busy."""
_CHUNK_ELSEWHERE = 1 << 26
"""The same on a GPU. Chosen: 256 MiB in single precision."""


class Norm(nn.BatchNorm1d):
    """Batch norm over packed points (N, C) that also accepts batches of one point or none in training.

    A single value has no variance: it becomes the norm's bias, and the running statistics stay as they are.
    """

    def forward(self, values: Tensor) -> Tensor:
        """Return the normalised values (N, C)."""
        if self.training and len(values) < 2:
            return values * 0 + self.bias
        return super().forward(values)

    def observe(self, mean: Tensor, variance: Tensor, count: int) -> None:
        """Update the running statistics with mean and population variance (C,) of `count` values, in place."""
        if count < 2 or self.running_mean is None or self.running_var is None or self.num_batches_tracked is None:
            return
        with torch.no_grad():
            self.num_batches_tracked += 1
            share = 1.0 / float(self.num_batches_tracked) if self.momentum is None else self.momentum
            self.running_mean.lerp_(mean.detach(), share)
            self.running_var.lerp_(variance.detach() * (count / (count - 1)), share)

    def scale_sign(self) -> Tensor:
        """Return the sign of the norm's scale per channel (C,), +1 or -1, without gradient."""
        return torch.where(self.weight.detach() < 0, -1.0, 1.0).to(self.weight.dtype)


class Grouping:
    """Neighbourhood graph of M queries with K of N support points each, and the pairs' relative positions.

    Args:
        index: (M, K) integers below N.
        support: (N, 3) positions divided by the radius.
        queries: (M, 3) positions divided by the radius.
    """

    def __init__(self, index: Tensor, support: Tensor, queries: Tensor) -> None:
        self.index, self.support, self.queries = index, support, queries
        self._statistics: tuple[Tensor, Tensor, Tensor, Tensor] | None = None

    @property
    def pairs(self) -> int:
        """Return the number of pairs, M x K."""
        return self.index.numel()

    def relative(self) -> Tensor:
        """Return the position of each neighbour relative to its query, divided by the radius (M, K, 3)."""
        gathered = self.support.index_select(0, self.index.reshape(-1)).view(*self.index.shape, 3)
        return gathered - self.queries[:, None]

    def pair_statistics(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return pair shares (N,), centred sums (N, 3), mean (3,) and covariance (3, 3) of relative positions; cached.

        Per support point the share of all pairs that it is in (N,), and the sum of its relative positions less their
        overall mean, over the number of pairs (N, 3); then that mean (3,), and the relative positions' covariance (3,
        3).
        """
        if self._statistics is None:
            flat_index = self.index.reshape(-1).long()  # adding at 32-bit indices is slow
            relative = self.relative().reshape(-1, 3)
            mean = relative.mean(dim=0)
            centred = relative - mean
            share = torch.bincount(flat_index, minlength=len(self.support)).to(relative.dtype) / self.pairs
            sums = torch.zeros_like(self.support).index_add_(0, flat_index, centred) / self.pairs
            self._statistics = share, sums, mean, centred.T @ centred / self.pairs
        return self._statistics

    def moments(self, features: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
        """Return mean and population variance (C,) over all pairs of ``features_j + directions (p_j - p_i) / r``.

        Args:
            features: (N, C) features of the support points.
            directions: (C, 3) weights of the relative positions.
        """
        share, sums, mean, covariance = self.pair_statistics()
        feature_mean = share @ features
        # About a constant: as `share` and `sums` are centred, its value changes nothing, neither here nor in gradients.
        centred = features - feature_mean.detach()
        # Var(f + D r) = Var(f) + 2 Cov(f, D r) + D Cov(r) D', each over all pairs, from sums over points.
        variance = (
            share @ centred.square()
            + 2.0 * ((sums.T @ centred) * directions.T).sum(dim=0)
            + ((directions @ covariance) * directions).sum(dim=1)
        )
        return feature_mean + directions @ mean, variance.clamp(min=0.0)


class _GatherMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, index: Tensor) -> Tensor:
        """Return the maxima (M, C) over the rows of values (N, C) that index (M, K) names."""
        largest, largest_row = _largest(values, index, with_place=ctx.needs_input_grad[0])
        ctx.save_for_backward(largest_row)
        ctx.shape = values.shape
        return largest

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        """Return the gradient of the values (N, C): each maximum's goes to its row."""
        (largest_row,) = ctx.saved_tensors
        return gradients[0].new_zeros(ctx.shape).scatter_add_(0, largest_row.long(), gradients[0]), None


def gather_max(values: Tensor, index: Tensor) -> Tensor:
    """Return the maximum (M, C) over the rows of `values` (N, C) that each row of `index` (M, K) names, K up to 255.

    The gradient goes to the first of equal ones. Of the size M x K x C only a chunk is held at a time.
    """
    if torch.compiler.is_exporting():  # a graph without chunks and gradients
        return values.index_select(0, index.reshape(-1)).unflatten(0, index.shape).amax(dim=1)
    result: Tensor = _GatherMax.apply(values, index)
    return result


def _largest(values: Tensor, index: Tensor, *, with_place: bool) -> tuple[Tensor, Tensor]:
    """Return maxima (M, C) over the rows of each neighbourhood, and their rows (M, C), or (0,) unless `with_place`."""
    (queries, limit), channels = index.shape, values.shape[1]
    largest = values.new_empty(queries, channels)
    largest_row = index.new_empty((queries, channels) if with_place else 0)
    for rows in _chunks(queries, limit * channels, values.device):
        gathered = values.index_select(0, index[rows].reshape(-1)).view(-1, limit, channels)
        largest[rows] = gathered.amax(dim=1)
        if with_place:
            largest_row[rows] = index[rows].gather(1, _first_column(gathered, largest[rows]))
    return largest, largest_row


def _chunks(queries: int, size: int, device: torch.device) -> Iterator[slice]:
    """Yield slices of the queries so short that their results, `size` numbers each, fit into the device's cache."""
    rows = max(_CHUNK.get(device.type, _CHUNK_ELSEWHERE) // max(size, 1), 1)
    for begin in range(0, queries, rows):
        yield slice(begin, begin + rows)


def _first_column(values: Tensor, largest: Tensor) -> Tensor:
    """Return the index (M, C) of the first largest of K values (M, K, C), given the maxima; overwrites `values`."""
    limit = values.shape[1]
    # The first of equal ones gets the largest number. Not integers: comparing into floats is far quicker.
    countdown = torch.arange(limit, 0, -1, dtype=values.dtype, device=values.device)[:, None]
    countdown_of_largest = values.eq_(largest[:, None]).mul_(countdown).amax(dim=1)
    return (limit - countdown_of_largest.long()).clamp_(max=limit - 1)  # NaN equals nothing: any will do then


@full_precision
def normalised_max(features: Tensor, weight: Tensor, norm: Norm, grouping: Grouping) -> Tensor:
    """Return max over neighbours (M, C) of batch norm(convolution), without activation or M x K x C memory.

    Args:
        features: of the support points (N, C0).
        weight: (C, 3 + C0) weights of the convolution, relative positions first.
        norm: batch norm over the C channels; in training its statistics are those of all pairs.
        grouping: who looks at whom.
    """
    sign = norm.scale_sign()
    signed_weight = weight * sign[:, None]
    directions, weights = signed_weight[:, :3], signed_weight[:, 3:]
    values = features @ weights.T
    mean, variance = _statistics(norm, sign, grouping, values, directions)
    scale = norm.weight * sign * torch.rsqrt(variance + norm.eps)
    top = gather_max(torch.addmm(values, grouping.support, directions.T), grouping.index)
    offset = torch.addmm(norm.bias - mean * scale, grouping.queries, -(directions * scale[:, None]).T)
    return torch.addcmul(offset, top, scale)


@full_precision
def normalised_max_of_two(
    features: Tensor, weights: tuple[Tensor, Tensor], norms: tuple[Norm, Norm], grouping: Grouping
) -> Tensor:
    """Return max over neighbours (M, C2) of two layers with batch norm, the second without activation.

    Args:
        features: of the support points (N, C0).
        weights: those of the convolution (C1, 3 + C0), and of the layer that follows it on each pair (C2, C1).
        norms: batch norms of both layers; between them is a ReLU.
        grouping: who looks at whom.
    """
    inner_norm, outer_norm = norms
    directions, linear = weights[0][:, :3], weights[0][:, 3:]
    values = features @ linear.T
    mean, variance = _statistics(inner_norm, torch.ones_like(inner_norm.weight), grouping, values, directions)
    scale = inner_norm.weight * torch.rsqrt(variance + inner_norm.eps)
    support = torch.addmm(values, grouping.support, directions.T) * scale
    offset = torch.addmm(inner_norm.bias - mean * scale, grouping.queries, -(directions * scale[:, None]).T)
    sign = outer_norm.scale_sign()
    signed_weight = weights[1] * sign[:, None]
    top, total, product = pairs_max(support, offset, grouping.index, signed_weight, moments=outer_norm.training)
    mean, variance = _running_moments(outer_norm, sign)
    if outer_norm.training and grouping.pairs:
        mean_inner = total / grouping.pairs
        mean = signed_weight @ mean_inner
        covariance = product / grouping.pairs - torch.outer(mean_inner, mean_inner)
        variance = ((signed_weight @ covariance) * signed_weight).sum(dim=1).clamp(min=0.0)
        outer_norm.observe(mean * sign, variance, grouping.pairs)
    scale = outer_norm.weight * sign * torch.rsqrt(variance + outer_norm.eps)
    return torch.addcmul(outer_norm.bias - mean * scale, top, scale)


def _statistics(
    norm: Norm, sign: Tensor, grouping: Grouping, values: Tensor, directions: Tensor
) -> tuple[Tensor, Tensor]:
    """Return mean and variance (C,) for a norm: of all pairs in training, which updates it, else its running ones."""
    if not norm.training or not grouping.pairs:
        return _running_moments(norm, sign)
    mean, variance = grouping.moments(values, directions)
    norm.observe(mean * sign, variance, grouping.pairs)
    return mean, variance


def _running_moments(norm: Norm, sign: Tensor) -> tuple[Tensor, Tensor]:
    """Return a norm's running mean and variance (C,), the mean times a sign per channel."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    return norm.running_mean * sign, norm.running_var


class _PairsMax(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, support: Tensor, offset: Tensor, index: Tensor, weight: Tensor, moments: bool
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return maxima, sums and sums of products as `pairs_max` does, chunk by chunk."""
        (queries, limit), (out_channels, in_channels) = index.shape, weight.shape
        top = offset.new_empty(queries, out_channels)
        column = torch.empty(queries, out_channels, dtype=torch.uint8, device=offset.device)
        total, product = offset.new_zeros(in_channels), offset.new_zeros(in_channels, in_channels)
        for rows in _chunks(queries, limit * out_channels, offset.device):
            pairs = _pairs(support, offset[rows], index[rows])
            outputs = (pairs @ weight.T).view(-1, limit, out_channels)
            top[rows] = outputs.amax(dim=1)
            column[rows] = _first_column(outputs, top[rows]).to(torch.uint8)
            if moments:
                total += pairs.sum(dim=0)
                product.addmm_(pairs.T, pairs)
        ctx.save_for_backward(support, offset, index, weight, column)
        ctx.moments = moments
        return top, total, product

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, None, Tensor, None]:
        """Return the gradients of support, offset and weight; the pairs are made again chunk by chunk."""
        support, offset, index, weight, column = ctx.saved_tensors
        of_top, of_total, of_product = gradients
        limit, out_channels = index.shape[1], weight.shape[0]
        of_support, of_offset, of_weight = (torch.zeros_like(tensor) for tensor in (support, offset, weight))
        symmetric_product = of_product + of_product.T
        for rows in _chunks(len(index), limit * out_channels, offset.device):
            pairs = _pairs(support, offset[rows], index[rows])
            of_after = pairs.new_zeros(len(of_top[rows]), limit, out_channels)
            of_after.scatter_(1, column[rows, None].long(), of_top[rows, None])
            of_weight.addmm_(of_after.view(-1, out_channels).T, pairs)
            of_pairs = of_after.view(-1, out_channels) @ weight
            if ctx.moments:
                of_pairs.addmm_(pairs, symmetric_product).add_(of_total)
            of_pairs.mul_(pairs.sign())  # through the ReLU
            of_support.index_add_(0, index[rows].reshape(-1).long(), of_pairs)
            of_offset[rows] = of_pairs.view(-1, limit, pairs.shape[1]).sum(dim=1)
        return of_support, of_offset, None, of_weight, None


def pairs_max(
    support: Tensor, offset: Tensor, index: Tensor, weight: Tensor, *, moments: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """Return max over neighbours j of `weight` y_ij, y_ij = relu(support_j + offset_i), and sums of y and y y^T.

    The pairs are made chunk by chunk, and again for the gradient, so that a cache holds them.

    Args:
        support: (N, C1).
        offset: (M, C1).
        index: (M, K) rows of `support`, K up to 255.
        weight: (C2, C1) weights of the layer.
        moments: whether the sums are computed; they are 0 otherwise.

    Returns:
        Maxima (M, C2), the sum of ``y`` over all pairs (C1,), and the sum of its products ``y y^T`` (C1, C1).
    """
    if torch.compiler.is_exporting():
        pairs = support.index_select(0, index.reshape(-1)).unflatten(0, index.shape)
        in_channels = weight.shape[1]
        outputs = torch.relu(pairs + offset[:, None]) @ weight.T
        return outputs.amax(dim=1), offset.new_zeros(in_channels), offset.new_zeros(in_channels, in_channels)
    result: tuple[Tensor, Tensor, Tensor] = _PairsMax.apply(support, offset, index, weight, moments)
    return result


def _pairs(support: Tensor, offset: Tensor, index: Tensor) -> Tensor:
    """Return the values y_ij = relu(support_j + offset_i) of all pairs, (M K, C)."""
    gathered = support.index_select(0, index.reshape(-1)).view(*index.shape, support.shape[1])
    return F.relu_(gathered.add_(offset[:, None])).view(-1, support.shape[1])


@full_precision
def interpolate(values: Tensor, index: Tensor, weight: Tensor) -> Tensor:
    """Return weighted sums (N, C) of the rows of `values` (M, C) that `index` (N, 3) names."""
    if torch.compiler.is_exporting():
        rows = values.index_select(0, index.reshape(-1)).unflatten(0, index.shape)
        return (rows * weight.to(values.dtype)[..., None]).sum(dim=1)
    return F.embedding_bag(index, values, mode="sum", per_sample_weights=weight.to(values.dtype))
