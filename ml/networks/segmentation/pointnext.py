"""PointNeXt for semantic segmentation, in plain PyTorch, on packed clouds of any size.

After Qian et al., "PointNeXt: Revisiting PointNet++ with improved training and scaling strategies" (2022), in the sizes
and settings that the authors use for S3DIS: a first layer on each point, four stages that thin the cloud out to a
fourth each, with set abstraction and blocks of inverted residual layers, a decoder that interpolates from the three
nearest points, and a head. Its outputs and gradients are those of the authors' implementation; the work is less, as
what is linear is done where there are fewer points (see `grouping`).
"""

from itertools import pairwise
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812 (its name everywhere)
from pydantic import Field
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import quantity

from ...registry import network
from ..base import Batch, OnnxInputs, SegmentationNetwork
from . import gpu_neighbours
from .grouping import Grouping, Norm, interpolate, normalised_max, normalised_max_of_two
from .neighbours import Neighbourhood, Neighbours, Sampling, build_neighbours

_SIZES: dict[str, tuple[int, tuple[int, ...]]] = {
    "S": (32, (1, 1, 1, 1)),
    "B": (32, (2, 3, 2, 2)),
    "L": (32, (3, 5, 3, 3)),
    "XL": (64, (4, 7, 4, 4)),
}
"""Channels of the first stage, and of each further one its set abstraction and the blocks that follow.

S has two layers with a residual in its set abstractions, the others one without.
"""
_EXPANSION = 4
"""Channels within a block, as a multiple of those outside. As Qian et al. 2022 have it."""


@network("segmentation")
class PointNeXtOptions(SegmentationNetwork):
    """Options of the network `pointnext`: its size, neighbourhoods and dropout."""

    name: Literal["pointnext"] = Field("pointnext", description="Name of the network.")
    preset: Literal["S", "B", "L", "XL"] = Field("B", description="Size of the network.")
    width: int | None = quantity(
        None,
        ge=4,
        le=512,
        unit="1",
        description="Number of channels of the first stage; if not given, that of the size.",
    )
    radius: float = quantity(0.3, gt=0, le=100, unit="m", description="Radius of the first neighbourhoods.")
    neighbours: int = quantity(32, ge=2, le=128, unit="1", description="Number of neighbours of a point.")
    dropout: float = quantity(0.5, ge=0, lt=1, unit="1", description="Dropout of the head.")
    sampling: Sampling = Field("grid", description="Method that chooses the points of each stage.")

    @property
    def blocks(self) -> tuple[int, ...]:
        """Return the number of layers (set abstraction and residual blocks) of each stage after the first."""
        return _SIZES[self.preset][1]

    @property
    def channels(self) -> list[int]:
        """Return the number of channels of each stage, doubling from stage to stage."""
        return [(self.width or _SIZES[self.preset][0]) << stage for stage in range(len(self.blocks) + 1)]

    @property
    def neighbourhood(self) -> Neighbourhood:
        """Return the options by which the stages' points and neighbours are found."""
        return Neighbourhood(self.radius, self.neighbours, tuple(count > 1 for count in self.blocks), self.sampling)

    def build(self, features: int, classes: int) -> nn.Module:
        """Return a PointNeXt with random weights for points of `features` numbers and `classes` scores."""
        return PointNeXt(self, features, classes)

    def prepare(self, batch: Batch) -> Batch:
        """Return the batch with all stages' sampled points and neighbour indices added."""
        search = build_neighbours if batch["coord"].device.type == "cpu" else gpu_neighbours.build_neighbours
        return batch | search(batch["coord"], batch["offset"], self.neighbourhood)

    @property
    def prepares_on_gpu(self) -> bool:
        """Return whether neighbours are found on a GPU: not with farthest points, one after the other."""
        return self.sampling == "grid"

    def onnx_inputs(self, batch: Batch) -> OnnxInputs:
        """Return the tensors of the stages' points and neighbours, and the names of their lengths."""
        neighbours = build_neighbours(batch["coord"], batch["offset"], self.neighbourhood)
        inputs = {name: value for name, value in neighbours.items() if not name.startswith("offset")}
        return OnnxInputs(inputs, {name: {0: f"points{_rows_of(name)}"} for name in inputs})


def _rows_of(name: str) -> int:
    """Return the stage whose points are the rows of an array of `Neighbours`, by the array's name."""
    stage = int(name[-1])
    return stage - 1 if name[:-1] in ("nearest", "weight") else stage


class PointNeXt(nn.Module):
    """PointNeXt (Qian et al. 2022) for semantic segmentation of packed clouds.

    Args:
        options: size and neighbourhoods.
        features: number of features of a point.
        classes: number of classes.
    """

    def __init__(self, options: PointNeXtOptions, features: int, classes: int) -> None:
        super().__init__()
        self.options = options
        channels, is_small = options.channels, options.preset == "S"
        pairs = list(pairwise(channels))
        self.stem = nn.Linear(features, channels[0])
        self.stages = nn.ModuleList(
            Stage(*pair, count, is_small) for pair, count in zip(pairs, options.blocks, strict=True)
        )
        self.propagations = nn.ModuleList(FeaturePropagation(*pair) for pair in pairs)
        self.head = nn.Sequential(
            Pointwise(channels[0], channels[0]), nn.Dropout(options.dropout), nn.Linear(channels[0], classes)
        )

    def forward(self, feat: Tensor, neighbours: Neighbours) -> Tensor:
        """Return the class scores (logits) of each point, (N, classes).

        Args:
            feat: (N, features), in the order of the coordinates that `neighbours` was built from.
            neighbours: of `build_neighbours` with this network's ``options.neighbourhood``.

        Raises:
            InputError: features and neighbours don't fit each other or the network.
        """
        shape = (neighbours["positions0"].shape[0], self.stem.in_features)
        if tuple(feat.shape) != shape:
            raise InputError("feat", tuple(feat.shape), f"must have the shape {shape}")
        levels = [self.stem(feat)]
        for number, stage in enumerate(self.stages, start=1):
            group, inner_group = self._groupings(neighbours, number, feat.dtype)
            levels.append(stage(levels[-1], neighbours[f"sample{number}"], group, inner_group))
        values = levels[-1]
        for number in range(len(levels) - 1, 0, -1):
            nearest_index, weight = neighbours[f"nearest{number}"], neighbours[f"weight{number}"]
            values = self.propagations[number - 1](levels[number - 1], values, nearest_index, weight)
        scores: Tensor = self.head(values)
        return scores

    def _groupings(self, neighbours: Neighbours, number: int, dtype: torch.dtype) -> tuple[Grouping, Grouping | None]:
        """Return the neighbourhoods of a stage's points in the stage before, and in their own (None without blocks)."""
        radius = self.options.neighbourhood.stage_radius(number)
        previous_points, points = (neighbours[f"positions{stage}"].to(dtype) / radius for stage in (number - 1, number))
        group = Grouping(neighbours[f"group{number}"], previous_points, points)
        if self.options.blocks[number - 1] == 1:
            return group, None
        return group, Grouping(neighbours[f"inner{number}"], points / 2, points / 2)


class Stage(nn.Module):
    """One encoder stage: a set abstraction that thins the points out, and the residual blocks that follow it."""

    def __init__(self, in_channels: int, out_channels: int, count: int, is_small: bool) -> None:
        super().__init__()
        self.abstraction = SetAbstraction(in_channels, out_channels, is_small)
        self.blocks = nn.ModuleList(InvertedResidual(out_channels) for _ in range(count - 1))

    def forward(self, values: Tensor, sample: Tensor, group: Grouping, inner_group: Grouping | None) -> Tensor:
        """Return features (M, out_channels) of the stage's points from those of the stage before, (N, in_channels)."""
        stage_values: Tensor = self.abstraction(values, sample, group)
        for block in self.blocks:
            stage_values = block(stage_values, inner_group)
        return stage_values


class Pointwise(nn.Module):
    """A pointwise layer: linear, batch norm and, if active, ReLU."""

    def __init__(self, in_channels: int, out_channels: int, *, active: bool = True) -> None:
        super().__init__()
        self.linear = nn.Linear(in_channels, out_channels, bias=False)
        self.norm = Norm(out_channels)
        self.active = active

    def forward(self, values: Tensor) -> Tensor:
        """Return features (N, out_channels) of points with features (N, in_channels)."""
        normed: Tensor = self.norm(self.linear(values))
        return F.relu_(normed) if self.active else normed


class SetAbstraction(nn.Module):
    """Layer that downsamples a cloud: each remaining point takes the maximum over its neighbours of one linear layer.

    In a small network there are two layers, and what each remaining point had is added.
    """

    def __init__(self, in_channels: int, out_channels: int, is_small: bool) -> None:
        super().__init__()
        inner_channels = out_channels // 2 if is_small else out_channels
        self.first = nn.Linear(3 + in_channels, inner_channels, bias=False)
        self.first_norm = Norm(inner_channels)
        self.second = nn.Linear(inner_channels, out_channels, bias=False) if is_small else None
        self.second_norm = Norm(out_channels) if is_small else None
        self.skip = nn.Linear(in_channels, out_channels) if is_small else None

    def forward(self, values: Tensor, sample: Tensor, grouping: Grouping) -> Tensor:
        """Return features (M, out_channels) of the remaining points.

        Args:
            values: (N, in_channels) features of all points.
            sample: (M,) indices of the remaining points.
            grouping: neighbours of the remaining points.
        """
        if self.second is None or self.second_norm is None:
            pooled = normalised_max(values, self.first.weight, self.first_norm, grouping)
        else:
            weights, norms = (self.first.weight, self.second.weight), (self.first_norm, self.second_norm)
            pooled = normalised_max_of_two(values, weights, norms, grouping)
        if self.skip is not None:
            pooled = pooled + self.skip(values.index_select(0, sample))
        return F.relu_(pooled)


class InvertedResidual(nn.Module):
    """Inverted residual block: max over neighbours, pointwise expansion by 4 and reduction, and a skip connection."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.look = nn.Linear(3 + channels, channels, bias=False)
        self.look_norm = Norm(channels)
        self.widen = Pointwise(channels, channels * _EXPANSION)
        self.narrow = Pointwise(channels * _EXPANSION, channels, active=False)

    def forward(self, values: Tensor, grouping: Grouping) -> Tensor:
        """Return the points' features (N, channels) after the block; the shape stays."""
        pooled = F.relu_(normalised_max(values, self.look.weight, self.look_norm, grouping))
        return F.relu_(self.narrow(self.widen(pooled)) + values)


class FeaturePropagation(nn.Module):
    """Decoder layer that interpolates a stage's features to the stage before and fuses them with that one's."""

    def __init__(self, skip_channels: int, in_channels: int) -> None:
        super().__init__()
        self.join = nn.Linear(skip_channels + in_channels, skip_channels, bias=False)
        self.join_norm = Norm(skip_channels)
        self.second = Pointwise(skip_channels, skip_channels)

    def forward(self, skip: Tensor, coarse: Tensor, nearest_index: Tensor, weight: Tensor) -> Tensor:
        """Return decoded features (N, skip_channels) of the points of the stage before.

        Args:
            skip: features of the stage before (N, skip_channels).
            coarse: (M, in_channels) features of the coarser stage.
            nearest_index: (N, 3) indices of the three nearest points of the coarser stage.
            weight: (N, 3) weights of these points.
        """
        skip_weight, coarse_weight = self.join.weight.split([skip.shape[1], coarse.shape[1]], dim=1)
        fused = torch.addmm(interpolate(coarse @ coarse_weight.T, nearest_index, weight), skip, skip_weight.T)
        refined: Tensor = self.second(F.relu_(self.join_norm(fused)))
        return refined
