"""Layers of the centreline models: kernel points across the road, and layers over slices x kernel points.

A slice is a metre of road seen as a set of points. Kernel points lie on its orthogonal (x = 0) at equal spacing; a
token is what one of them gathers from the points around it. A painted line is a tenth of that spacing wide, so where it
lies within a token has to be kept. Fixed kernel points are therefore divided into cells, each with weights of its own,
as the kernel points of a KPConv (Thomas et al. 2019); deformable ones move to where something is and keep the first
moment of what they gather. A point belongs to the two nearest cells or kernel points with linear weights, which add up
to 1, and sums are divided by the number of points, so that density matters little.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from ..base import full_precision

FAR = 3.0
"""Heights of points beyond this, m, look alike to a model. Chosen: above barriers and kerbs, below what stands beside a
road."""
_FEW = 0.25
"""Mass of a cell, in points, against which what it gathers fades to zero. Chosen: a quarter of a point."""


@dataclass
class Tokens:
    """Features gathered by the K kernel points of N slices.

    Attributes:
        features: (N, K, C).
        places: (N, K) the kernel points' y in the slice's frame, m.
        heights: (N, K) mean height of the points around them, m; 0 where there are none.
    """

    features: Tensor
    places: Tensor
    heights: Tensor


class PointFeatures(nn.Module):
    """A small per-point MLP of x, height and attributes; not of y, so that it is the same across the road.

    Args:
        columns: indices of the columns of a batch's ``feat`` that are used.
        width: number of features per point.
    """

    def __init__(self, columns: tuple[int, ...], width: int) -> None:
        super().__init__()
        self.columns = list(columns)
        self.network = nn.Sequential(nn.Linear(2 + len(columns), width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())

    def forward(self, coord: Tensor, feat: Tensor) -> Tensor:
        """Return (N, P, width), all >= 0, of points (N, P, 3), m, with attributes (N, P, F)."""
        height = coord[..., 2:].clamp(-FAR, FAR)
        features: Tensor = self.network(torch.cat([2.0 * coord[..., :1], height, feat[..., self.columns]], dim=-1))
        return features


def cell_sums(coord: Tensor, mask: Tensor, features: Tensor, reach: float, number: int) -> Tensor:
    """Return the sums (N, number, C + 2) over the points in cells across the slices: features, heights, points.

    A point is shared by the two cells whose middles are nearest, in linear proportion.

    Args:
        coord: (N, P, 3) points, m; only y and z count.
        mask: (N, P) which of them exist.
        features: (N, P, C).
        reach: the cells divide -reach to reach, m.
        number: number of cells.
    """
    slices, _, channels = features.shape
    values = torch.cat([features, coord[..., 2:], torch.ones_like(coord[..., :1])], dim=-1).flatten(0, 1)
    cell_place = (coord[..., 1] + reach) * (number / (2.0 * reach)) - 0.5
    lower_cell = cell_place.floor()
    first_cell = number * torch.arange(slices, device=coord.device)[:, None]
    sums = values.new_zeros(slices * number, channels + 2)
    # Each point adds to the cell below its position and to the one above.
    for cell, weight in ((lower_cell, 1.0 - (cell_place - lower_cell)), (lower_cell + 1.0, cell_place - lower_cell)):
        in_grid = mask & (cell >= 0) & (cell < number)
        # A NaN of diverged weights can't be an index: cell 0 stands in, with a weight of 0.
        index = first_cell + torch.where(in_grid, cell, 0.0).long()
        sums = sums.index_add(0, index.flatten(), values * (weight * in_grid).flatten()[:, None])
    return sums.view(slices, number, channels + 2)


def cell_features(sums: Tensor) -> Tensor:
    """Return per cell the means of features and heights and log(1 + points), (N, number, C + 2), from `cell_sums`."""
    mass = sums[..., -1:]
    return torch.cat([sums[..., :-1] / (mass + _FEW), torch.log1p(mass)], dim=-1)


class FixedKernelPoints(nn.Module):
    """Layer that gathers points' features at fixed kernel points, each with a kernel of cells over twice the spacing.

    Args:
        count: kernel points of a slice.
        half_width: the outermost ones' distance from the frame's origin, m.
        cells: cells per spacing of the kernel points.
        inputs: features of a point.
        width: features of a token.
    """

    places: Tensor

    def __init__(self, count: int, half_width: float, cells: int, inputs: int, width: int) -> None:
        super().__init__()
        self.cells = cells
        self.spacing = 2.0 * half_width / (count - 1)
        self.number = (count + 1) * cells
        self.reach = half_width + self.spacing
        self.register_buffer("places", torch.linspace(-half_width, half_width, count), persistent=False)
        self.kernel = nn.Conv1d(inputs + 2, width, kernel_size=2 * cells, stride=cells)
        self.norm = nn.LayerNorm(width)

    def forward(self, coord: Tensor, mask: Tensor, features: Tensor) -> Tokens:
        """Return the K tokens of N slices from points (N, P, 3), m, their mask (N, P) and features (N, P, inputs)."""
        sums = cell_sums(coord, mask, features, self.reach, self.number)
        tokens = self.norm(self.kernel(cell_features(sums).transpose(1, 2)).transpose(1, 2))
        height, weight = sums[..., -2:].unfold(1, 2 * self.cells, self.cells).sum(-1).unbind(-1)
        return Tokens(tokens, self.places.expand(coord.shape[0], -1), height / (weight + _FEW))


class DeformableKernelPoints(nn.Module):
    """Layer that gathers points' features at kernel points which first move across the road by learned shifts.

    The shift of each is computed from the fixed kernel point's token, as in a deformable KPConv; at most one spacing.

    Args:
        count: kernel points of a slice.
        half_width: the outermost ones' distance from the frame's origin, m.
        inputs: features of a point, all >= 0.
        width: features of a token, those of the fixed kernel points as well.
    """

    places: Tensor

    def __init__(self, count: int, half_width: float, inputs: int, width: int) -> None:
        super().__init__()
        self.spacing = 2.0 * half_width / (count - 1)
        self.register_buffer("places", torch.linspace(-half_width, half_width, count), persistent=False)
        self.shift = nn.Linear(width, 1)
        self.mix = nn.Linear(3 * inputs + 2, width)
        self.norm = nn.LayerNorm(width)

    @full_precision
    def forward(self, coord: Tensor, mask: Tensor, features: Tensor, fixed_tokens: Tensor) -> Tokens:
        """Return the tokens of N slices gathered at the moved kernel points, from points and features.

        Args:
            coord: (N, P, 3) points, m.
            mask: (N, P) which of them exist.
            features: (N, P, inputs) features of the points.
            fixed_tokens: (N, K, width) tokens of the fixed kernel points at the same places.
        """
        kernel_offsets = self.places + self.spacing * torch.tanh(self.shift(fixed_tokens)[..., 0])
        # Linear weights h = max(0, 1 - |y - place| / spacing), as the influence of a KPConv's kernel points.
        relative_distance = (coord[:, None, :, 1] - kernel_offsets[..., None]) / self.spacing
        weight = (1.0 - relative_distance.abs()).clamp_min(0.0) * mask[:, None, :]
        mass = weight.sum(-1, keepdim=True)
        values = torch.cat([features, coord[..., 2:]], dim=-1)
        zeroth, first_moment = (torch.cat([weight, weight * relative_distance], dim=1) @ values).chunk(2, dim=1)
        mean_values, tilt = zeroth / (mass + _FEW), first_moment[..., :-1] / (mass + _FEW)
        # Where in the kernel point's reach a feature has its centre: the line's place if the feature is brightness.
        centre = first_moment[..., :-1] / (zeroth[..., :-1] + 0.2 * _FEW)
        tokens = self.norm(self.mix(torch.cat([mean_values, tilt, centre, torch.log1p(mass)], dim=-1)))
        return Tokens(tokens, kernel_offsets, mean_values[..., -1])


class GridConvolution(nn.Module):
    """A residual 2D convolution over slices x kernel points, dilated across the road.

    Args:
        width: features.
        slices: number of slices that the kernel spans, odd.
        kernel_points: number of kernel points that it spans, odd.
        dilation: distance from one of these to the next, in kernel points; 1 for neighbours.
    """

    def __init__(self, width: int, slices: int, kernel_points: int, dilation: int = 1) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        padding = (slices // 2, dilation * (kernel_points // 2))
        self.convolution = nn.Conv2d(width, width, (slices, kernel_points), padding=padding, dilation=(1, dilation))
        self.mix = nn.Linear(width, width)

    def forward(self, grid: Tensor) -> Tensor:
        """Return the grid (B, S, K, C) plus its convolution; the shape stays."""
        convolved = self.convolution(self.norm(grid).permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
        change: Tensor = self.mix(functional.gelu(convolved))
        return grid + change


class RelativeAttention(nn.Module):
    """A transformer layer whose only position encoding is a learned bias by relative position.

    Args:
        count: longest sequence.
        width: features.
        heads: of the attention.
        dropout: share of what is added that is left out in training.
    """

    relative_index: Tensor

    def __init__(self, count: int, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.bias = nn.Parameter(torch.zeros(heads, 2 * count - 1))
        steps = torch.arange(count)
        self.register_buffer("relative_index", steps[:, None] - steps[None, :] + count - 1, persistent=False)
        self.before = nn.LayerNorm(width)
        self.project = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        self.network = nn.Sequential(
            nn.LayerNorm(width), nn.Linear(width, 2 * width), nn.GELU(), nn.Linear(2 * width, width)
        )
        self.dropout = nn.Dropout(dropout)

    def forward(self, sequence: Tensor) -> Tensor:
        """Return the sequence (N, L, C) after self-attention and the feed-forward network; the shape stays."""
        number, length, width = sequence.shape
        head_width = width // self.heads
        parts = self.project(self.before(sequence)).view(number, length, 3, self.heads, head_width)
        query, key, value = parts.permute(2, 0, 3, 1, 4)
        score = query @ key.transpose(-1, -2) / head_width**0.5 + self.bias[:, self.relative_index[:length, :length]]
        attended = (score.softmax(-1) @ value).transpose(1, 2).reshape(number, length, width)
        sequence = sequence + self.dropout(self.out(attended))
        return sequence + self.dropout(self.network(sequence))


class AttentionPool(nn.Module):
    """Multi-head attention pooling: a linear map of the heads' weighted means of a slice's tokens."""

    def __init__(self, width: int, heads: int, outputs: int) -> None:
        super().__init__()
        self.score = nn.Linear(width, heads)
        self.out = nn.Linear(width * heads, outputs)

    def forward(self, tokens: Tensor) -> Tensor:
        """Return pooled vectors (N, outputs) of tokens (N, K, width)."""
        weights = self.score(tokens).softmax(1)
        pooled: Tensor = self.out((weights.transpose(1, 2) @ tokens).flatten(1))
        return pooled
