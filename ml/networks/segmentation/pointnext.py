"""PointNeXt for semantic segmentation, in plain PyTorch, on packed clouds of any size.

After Qian et al., "PointNeXt: Revisiting PointNet++ with improved training and scaling strategies" (2022), in the sizes
and settings that the authors use for S3DIS: a first layer on each point, four stages that thin the cloud out to a
fourth each, with set abstraction and blocks of inverted residual layers, a decoder that interpolates from the three
nearest points, and a head. Its outputs and gradients are those of the authors' implementation; the work is less, as
what is linear is done where there are fewer points (see `grouping`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812 (its name everywhere)
from pydantic import Field
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.schema import quantity

from ...registry import network
from ..base import Batch, SegmentationNetwork
from .grouping import Grouping, Norm, interpolate, normalised_max, normalised_max_of_two
from .neighbours import Neighbourhood, Neighbours, build_neighbours


@dataclass(frozen=True)
class Architecture:
    """Architecture of a network.

    Attributes:
        in_channels: features of a point.
        num_classes: of the output.
        width: channels of the first stage; each further stage has twice as many.
        blocks: of each stage after the first: its set abstraction and the blocks that follow.
        layers: of each set abstraction, 1 or 2.
        residual: whether set abstractions add what they got.
        expansion: channels within a block, as a multiple of those outside.
        dropout: of the head.
        neighbourhood: how the stages' points are found.
    """

    in_channels: int
    num_classes: int
    width: int
    blocks: tuple[int, ...]
    layers: int = 1
    residual: bool = False
    expansion: int = 4
    dropout: float = 0.5
    neighbourhood: Neighbourhood = field(default_factory=Neighbourhood)

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("in_channels", "num_classes", "width", "expansion"):
            if getattr(self, name) < 1:
                raise InputError(name, getattr(self, name), "must be 1 or more")
        if not 0 <= self.dropout < 1:
            raise InputError("dropout", self.dropout, "must be from 0 to less than 1")
        if self.layers not in (1, 2):
            raise InputError("layers", self.layers, "must be 1 or 2")
        if len(self.blocks) != len(self.neighbourhood.strides) or min(self.blocks) < 1:
            raise InputError("blocks", self.blocks, "must be 1 or more for each stride")
        if any(count > 1 and not inner for count, inner in zip(self.blocks, self.neighbourhood.inner, strict=True)):
            raise InputError("blocks", self.blocks, "more than 1 needs the stage's inner neighbours")

    def channels(self) -> list[int]:
        """Return the channels of all stages, the first one's first."""
        return [self.width << stage for stage in range(len(self.blocks) + 1)]


_SIZES: dict[str, tuple[int, tuple[int, ...]]] = {
    "S": (32, (1, 1, 1, 1)),
    "B": (32, (2, 3, 2, 2)),
    "L": (32, (3, 5, 3, 3)),
    "XL": (64, (4, 7, 4, 4)),
}
"""Width and blocks; S has two layers with a residual in its set abstractions, the others one without."""


def architecture(
    name: str,
    *,
    in_channels: int,
    num_classes: int,
    width: int | None = None,
    dropout: float = 0.5,
    radius: float = 0.3,
    neighbours: int = 32,
    sampling: Literal["grid", "farthest"] = "grid",
) -> Architecture:
    """Return one of the published sizes.

    Args:
        name: S, B, L or XL.
        in_channels, num_classes: of input and output.
        width: channels of the first stage if not the size's own.
        dropout: of the head.
        radius: of the first neighbourhoods, m.
        neighbours: of each neighbourhood.
        sampling: how clouds are thinned out (`Neighbourhood`).

    Raises:
        InputError: there is no such size, or a value is outside of what is possible.
    """
    if name not in _SIZES:
        raise InputError("preset", name, f"must be one of {', '.join(_SIZES)}{nearest_name(name, _SIZES)}")
    own_width, blocks = _SIZES[name]
    small = name == "S"
    return Architecture(
        in_channels=in_channels,
        num_classes=num_classes,
        width=own_width if width is None else width,
        blocks=blocks,
        layers=2 if small else 1,
        residual=small,
        dropout=dropout,
        neighbourhood=Neighbourhood(
            radius=radius, neighbours=neighbours, inner=tuple(count > 1 for count in blocks), sampling=sampling
        ),
    )


class PointNeXt(nn.Module):
    """The network; `architecture` gives the published sizes."""

    def __init__(self, plan: Architecture) -> None:
        super().__init__()
        self.plan = plan
        channels = plan.channels()
        pairs = list(pairwise(channels))
        self.stem = nn.Linear(plan.in_channels, channels[0])
        self.stages = nn.ModuleList(
            Stage(few, many, count, plan) for (few, many), count in zip(pairs, plan.blocks, strict=True)
        )
        self.propagations = nn.ModuleList(FeaturePropagation(few, many) for few, many in pairs)
        self.head = nn.Sequential(
            Pointwise(channels[0], channels[0]),
            nn.Dropout(plan.dropout),
            nn.Linear(channels[0], plan.num_classes),
        )

    def forward(self, feat: Tensor, neighbours: Neighbours) -> Tensor:
        """Return the classes' scores of each point (N, classes), before the softmax.

        Args:
            feat: (N, in_channels), in the order of the coordinates that `neighbours` was built from.
            neighbours: of `build_neighbours` with this network's ``plan.neighbourhood``.

        Raises:
            InputError: features and neighbours don't fit each other or the network.
        """
        points = neighbours["positions0"].shape[0]
        if feat.ndim != 2 or tuple(feat.shape) != (points, self.plan.in_channels):
            raise InputError("feat", tuple(feat.shape), f"must have the shape {(points, self.plan.in_channels)}")
        levels = [self.stem(feat)]
        for number, stage in enumerate(self.stages, start=1):
            group, inner = self._groupings(neighbours, number, feat.dtype)
            levels.append(stage(levels[-1], neighbours[f"sample{number}"], group, inner))
        values = levels[-1]
        for number in range(len(levels) - 1, 0, -1):
            nearest, weight = neighbours[f"nearest{number}"], neighbours[f"weight{number}"]
            values = self.propagations[number - 1](levels[number - 1], values, nearest, weight)
        scores: Tensor = self.head(values)
        return scores

    def _groupings(self, neighbours: Neighbours, number: int, dtype: torch.dtype) -> tuple[Grouping, Grouping | None]:
        """Return whom a stage's points look at in the stage before, and in their own if there are blocks that do."""
        radius = self.plan.neighbourhood.stage_radius(number)
        before, own = (neighbours[f"positions{each}"].to(dtype) / radius for each in (number - 1, number))
        group = Grouping(neighbours[f"group{number}"], before, own)
        if self.plan.blocks[number - 1] == 1:
            return group, None
        return group, Grouping(neighbours[f"inner{number}"], own / 2, own / 2)


@network("segmentation")
class PointNeXtOptions(SegmentationNetwork):
    """PointNeXt in one of its sizes."""

    name: Literal["pointnext"] = Field("pointnext", description="Network.")
    preset: Literal["S", "B", "L", "XL"] = Field("B", description="Size.")
    width: int | None = quantity(None, ge=4, le=512, unit="1", description="Channels of the first stage; the size's.")
    radius: float = quantity(0.3, gt=0, le=100, unit="m", description="Radius of the first neighbourhoods.")
    neighbours: int = quantity(32, ge=2, le=128, unit="1", description="Neighbours that are looked at.")
    dropout: float = quantity(0.5, ge=0, lt=1, unit="1", description="Dropout of the head.")
    sampling: Literal["grid", "farthest"] = Field("grid", description="How each stage's points are chosen.")

    def plan(self, features: int, classes: int) -> Architecture:
        """Return what the network is made of."""
        sizes = self.model_dump(exclude={"name", "preset"})
        return architecture(self.preset, in_channels=features, num_classes=classes, **sizes)

    def build(self, features: int, classes: int) -> nn.Module:
        """See `SegmentationNetwork.build`."""
        return PointNeXt(self.plan(features, classes))

    def prepare(self, batch: Batch) -> Batch:
        """Return a batch with the indices of all stages' points and neighbours."""
        return batch | build_neighbours(batch["coord"], batch["offset"], self.plan(1, 1).neighbourhood)


class Stage(nn.Module):
    """Set abstraction, and the blocks that follow it."""

    def __init__(self, few: int, many: int, count: int, plan: Architecture) -> None:
        super().__init__()
        self.abstraction = SetAbstraction(few, many, plan.layers, plan.residual)
        self.blocks = nn.ModuleList(InvertedResidual(many, plan.expansion) for _ in range(count - 1))

    def forward(self, values: Tensor, sample: Tensor, group: Grouping, inner: Grouping | None) -> Tensor:
        """Return (M, many) from (N, few); see `SetAbstraction` and `InvertedResidual`."""
        thinned: Tensor = self.abstraction(values, sample, group)
        for block in self.blocks:
            thinned = block(thinned, inner)
        return thinned


class Pointwise(nn.Module):
    """A layer on each point by itself: linear, norm and, if wanted, ReLU."""

    def __init__(self, few: int, many: int, *, active: bool = True) -> None:
        super().__init__()
        self.linear = nn.Linear(few, many, bias=False)
        self.norm = Norm(many)
        self.active = active

    def forward(self, values: Tensor) -> Tensor:
        """Return (N, many) from (N, few)."""
        normed: Tensor = self.norm(self.linear(values))
        return F.relu_(normed) if self.active else normed


class SetAbstraction(nn.Module):
    """Thins out: each remaining point takes the maximum over its neighbours of one or two layers."""

    def __init__(self, few: int, many: int, layers: int, residual: bool) -> None:
        super().__init__()
        between = many // 2 if layers > 1 else many
        self.first = nn.Linear(3 + few, between, bias=False)
        self.first_norm = Norm(between)
        self.second = nn.Linear(between, many, bias=False) if layers > 1 else None
        self.second_norm = Norm(many) if layers > 1 else None
        self.skip = nn.Linear(few, many) if residual else None

    def forward(self, values: Tensor, sample: Tensor, grouping: Grouping) -> Tensor:
        """Return (M, many).

        Args:
            values: of all points (N, few).
            sample: the remaining ones among them (M,).
            grouping: whom the remaining look at.
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
    """Looks at neighbours, then widens and narrows each point's features, and adds what it got."""

    def __init__(self, channels: int, expansion: int) -> None:
        super().__init__()
        self.look = nn.Linear(3 + channels, channels, bias=False)
        self.look_norm = Norm(channels)
        self.widen = Pointwise(channels, channels * expansion)
        self.narrow = Pointwise(channels * expansion, channels, active=False)

    def forward(self, values: Tensor, grouping: Grouping) -> Tensor:
        """Return (N, channels) from (N, channels)."""
        seen = F.relu_(normalised_max(values, self.look.weight, self.look_norm, grouping))
        return F.relu_(self.narrow(self.widen(seen)) + values)


class FeaturePropagation(nn.Module):
    """Brings a thin stage's features back to the stage before, by interpolation, and joins them with that one's."""

    def __init__(self, few: int, many: int) -> None:
        super().__init__()
        self.join = nn.Linear(few + many, few, bias=False)
        self.join_norm = Norm(few)
        self.second = Pointwise(few, few)

    def forward(self, own: Tensor, thin: Tensor, nearest: Tensor, weight: Tensor) -> Tensor:
        """Return (N, few).

        Args:
            own: features of the stage before (N, few).
            thin: of the thin stage (M, many).
            nearest: (N, 3) three points of the thin stage.
            weight: (N, 3) their weights.
        """
        here, there = self.join.weight.split([own.shape[1], thin.shape[1]], dim=1)
        joined = torch.addmm(interpolate(thin @ there.T, nearest, weight), own, here.T)
        refined: Tensor = self.second(F.relu_(self.join_norm(joined)))
        return refined
