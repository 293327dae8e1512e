"""A transformer for points in plain PyTorch: convolutions in early stages, attention along curves in late ones.

After two papers. Wu et al., "Point Transformer V3: simpler, faster, stronger" (2024): points are sorted along several
space-filling curves, and attention works in patches of a curve; stages pool the cells of a grid, and are unpooled with
what the stage before knew. Yue et al., "LitePT: lighter yet stronger point transformer" (2025): early stages with many
cells need convolutions alone, late ones attention alone, where rotations of queries and keys by the place of a cell
(Su et al., "RoFormer", 2021) say where it is; a decoder needs no blocks.

All blocks are pre-norm with stochastic depth (Huang et al. 2016). Around points and in convolutions norms are batch
norms, so that they can be adapted to other clouds; in attention they are layer norms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, pairwise, repeat
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812 (its name everywhere)
from pydantic import Field, ValidationInfo, field_validator, model_validator
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import quantity

from ...registry import network
from ..base import Batch, OnnxInputs, SegmentationNetwork, full_precision
from .cell_convolution import Around, CellConvolution
from .cells import Cells, Grid, build_cells
from .curves import CURVES, Curve
from .grouping import Norm, gather_max
from .pointnext import Pointwise

_LARGEST_WIDTH = 2048
"""Channels of a stage at most. Chosen: more than any network of that kind has; a slip would fill the memory."""
_LONGEST_WAVE = 100.0
"""Base of the rotations' frequencies, which fall from one by equal ratios towards one over this. Chosen: patches are
some hundred cells long."""


@network("segmentation")
class PointTransformerOptions(SegmentationNetwork):
    """Options of the network `point-transformer`: its stages, what cells look at, and what is dropped in training."""

    name: Literal["point-transformer"] = Field("point-transformer", description="Name of the network.")
    cell: float = quantity(
        0.2, gt=0, le=100, unit="m", description="Edge of the cells of the first stage; it doubles with each stage."
    )
    channels: tuple[int, ...] = Field((24, 48, 96, 144), min_length=1, max_length=8, description="Of each stage.")
    blocks: tuple[int, ...] = Field((2, 2, 3, 1), min_length=1, max_length=8, description="Of each stage.")
    attention_from: int = quantity(
        2,
        ge=0,
        le=8,
        unit="1",
        description="First stage, counted from 0, with blocks of attention; earlier stages have convolutions.",
    )
    decoder_blocks: int = quantity(0, ge=0, le=8, unit="1", description="Number of blocks of each decoder stage.")
    kernel: Literal["cube", "cross"] = Field(
        "cube", description="Neighbours of a cell: all 26 around it, or the 6 that share a face."
    )
    curves: tuple[Curve, ...] = Field(
        CURVES, min_length=1, description="Curves that blocks of attention follow in turn."
    )
    shuffle: bool = Field(True, description="In the training, draw the curve of each block again in each step.")
    patch: int = quantity(256, ge=8, le=4096, unit="1", description="Number of cells that attend to each other.")
    head_width: int = quantity(24, ge=6, le=384, unit="1", description="Number of channels of an attention head.")
    expansion: int = quantity(
        4,
        ge=1,
        le=16,
        unit="1",
        description="Width of the layers of a block, as a multiple of the channels of its stage.",
    )
    drop_path: float = quantity(
        0.1, ge=0, lt=1, unit="1", description="Share of clouds that skip the last block in the training."
    )
    dropout: float = quantity(0.5, ge=0, lt=1, unit="1", description="Dropout of the head.")

    @field_validator("curves")
    @classmethod
    def _refuse_repetitions(cls, curves: tuple[Curve, ...]) -> tuple[Curve, ...]:
        """Refuse a curve that is named twice."""
        if len(set(curves)) < len(curves):
            raise ValueError("curves must not name a curve twice")
        return curves

    @field_validator("patch", "head_width")
    @classmethod
    def _require_multiples(cls, number: int, field: ValidationInfo) -> int:
        """Refuse patches that aren't multiples of 8, and heads that aren't multiples of 6 channels."""
        step = 8 if field.field_name == "patch" else 6
        if number % step:
            raise ValueError(f"must be a multiple of {step}, not {number}")
        return number

    @model_validator(mode="after")
    def _check_stages(self) -> PointTransformerOptions:
        """Refuse stages whose numbers of channels and blocks don't fit each other or the heads."""
        if len(self.channels) != len(self.blocks):
            raise ValueError(f"blocks must be as many as channels, {len(self.channels)}")
        if min(self.blocks) < 0 or max(self.blocks) > 64:
            raise ValueError("blocks must be numbers from 0 to 64")
        if min(self.channels) < 1 or max(self.channels) > _LARGEST_WIDTH:
            raise ValueError(f"channels must be numbers from 1 to {_LARGEST_WIDTH}")
        for stage, width in enumerate(self.channels):
            if stage >= self.attention_from and width % self.head_width:
                raise ValueError(
                    f"channels of stages with attention must be multiples of head_width, {self.head_width}"
                )
        return self

    @property
    def grid(self) -> Grid:
        """Return the options by which cells and patches are found."""
        stages, cross = len(self.channels), self.kernel == "cross"
        return Grid(self.cell, stages, self.attention_from, cross, self.curves, self.patch)

    def build(self, features: int, classes: int) -> nn.Module:
        """Return a network with random weights for points of `features` numbers and `classes` scores."""
        return PointTransformer(self, features, classes)

    def onnx_inputs(self, batch: Batch) -> OnnxInputs:
        """Return the tensors of a batch's cells, and the names of their lengths."""
        cells = build_cells(batch["coord"], batch["offset"], self.grid, always_masked=True)
        inputs = {name: value for name, value in cells.items() if not name.startswith("ends")}
        return OnnxInputs(inputs, {name: _lengths(name) for name in inputs})


def _lengths(name: str) -> dict[int, str]:
    """Return the axes of any length of one of the tensors `Cells`, with the lengths' names."""
    kind, stage = name[:-1], int(name[-1])
    if kind in ("cell", "share", "inside"):
        return {0: "points0"}
    if kind == "patch":
        return {1: f"patches{stage}", 2: f"width{stage}"}
    if kind == "filled":
        return {0: f"patches{stage}", 1: f"width{stage}"}
    return {1 if kind == "place" else 0: f"cells{stage - 1 if kind == 'parent' else stage}"}


class Blocks(nn.ModuleList):
    """Blocks of a stage, one after the other."""

    def forward(self, values: Tensor, views: Iterator[View]) -> Tensor:
        """Return the cells' features (M, width) after all blocks, each of which has the next view."""
        for block in self:
            values = block(values, next(views))
        return values


class PointTransformer(nn.Module):
    """Convolutions and attention on the cells of packed clouds, and a class for every point.

    Args:
        options: options of the network.
        features: number of features of a point.
        classes: number of classes.
    """

    def __init__(self, options: PointTransformerOptions, features: int, classes: int) -> None:
        super().__init__()
        self.options, self.features = options, features
        channels = options.channels
        drops = iter(torch.linspace(0.0, options.drop_path, sum(options.blocks)).tolist())
        self.stem = Pointwise(features + 3, channels[0])
        self.pools = nn.ModuleList(Pool(*pair) for pair in pairwise(channels))
        self.stages = nn.ModuleList(
            Blocks(_block(options, stage, next(drops)) for _ in range(count))
            for stage, count in enumerate(options.blocks)
        )
        self.unpools = nn.ModuleList(Unpool(*pair) for pair in pairwise((channels[0], *channels)))
        self.decoder = nn.ModuleList(
            Blocks(_block(options, stage, 0.0) for _ in range(options.decoder_blocks))
            for stage in range(len(channels) - 1)
        )
        self.head = nn.Sequential(
            Pointwise(channels[0], channels[0]), nn.Dropout(options.dropout), nn.Linear(channels[0], classes)
        )

    def forward(self, feat: Tensor, batch: Batch) -> Tensor:
        """Return the class scores (logits) of each point, (N, classes).

        Args:
            feat: (N, features).
            batch: batch with ``coord`` (N, 3) and ``offset`` (B,), or with the tensors of `build_cells`.

        Raises:
            InputError: features and coordinates don't fit each other or the network, or there is no grid for them.
        """
        cells = batch if "cell0" in batch else build_cells(batch["coord"], batch["offset"], self.options.grid)
        shape = (cells["cell0"].shape[0], self.features)  # an export would take `len` for a constant
        if tuple(feat.shape) != shape:
            raise InputError("feat", tuple(feat.shape), f"must have the shape {shape}")
        views = [self._views(cells, stage) for stage in range(len(self.stages))]
        stage_table = cells["near0"] if "near0" in cells else cells["grid0"]
        points = self.stem(torch.cat([feat, cells["inside0"].to(feat.dtype)], dim=1))
        # In single precision at least: cells of many points sum many small shares.
        share = cells["share0"].to(torch.promote_types(feat.dtype, torch.float32))
        values = points.new_zeros(stage_table.shape[0], points.shape[1], dtype=share.dtype)
        values = values.index_add(0, cells["cell0"], points * share[:, None])
        levels = [points]
        for stage, blocks in enumerate(self.stages):
            if stage:
                values = self.pools[stage - 1](values, cells[f"children{stage}"])
            values = blocks(values, views[stage])
            levels.append(values)
        for stage in range(len(self.stages) - 1, -1, -1):
            parent = cells[f"parent{stage}"] if stage else cells["cell0"]
            values = self.unpools[stage](levels[stage], values, parent)
            if stage:
                values = self.decoder[stage - 1](values, views[stage - 1])
        scores: Tensor = self.head(values)
        return scores

    def _views(self, cells: Cells, stage: int) -> Iterator[View]:
        """Yield the view of each further block of a stage, without end: its neighbours or the patches of a curve."""
        ends = cells.get(f"ends{stage}")
        if stage < self.options.attention_from:
            yield from repeat(View(ends, around=Around(cells[f"near{stage}"])))
        curves = list(range(len(self.options.curves)))
        if self.training and self.options.shuffle:
            curves = torch.randperm(len(curves)).tolist()
        turns = rotations(cells[f"grid{stage}"], self.options.head_width)
        for curve in cycle(curves):
            patch, place = cells[f"patch{stage}"][curve], cells[f"place{stage}"][curve]
            yield View(ends, patch=patch, place=place, filled=cells.get(f"filled{stage}"), turns=turns)


@dataclass(frozen=True)
class View:
    """Cells of a stage that look at each other in a block: around each, or along a curve.

    Attributes:
        ends: where each cloud's cells end (B,); None where nothing is dropped.
        around: the cells around each, for convolutions.
        patch, place, filled: tensors of one curve (`Cells`), for attention.
        turns: cosines and sines of `rotations`, for attention.
    """

    ends: Tensor | None
    around: Around | None = None
    patch: Tensor | None = None
    place: Tensor | None = None
    filled: Tensor | None = None
    turns: tuple[Tensor, Tensor] | None = None


def rotations(positions: Tensor, width: int) -> tuple[Tensor, Tensor]:
    """Return cosines and sines (M, 1, width / 2) of the angles by which positions (M, 3) turn pairs of channels.

    A third of the pairs turns with each axis: pair k of K by the frequency ``_LONGEST_WAVE ** (-k / K)``.
    """
    # Su et al. 2021 (RoPE), in three dimensions: the product of a turned query and a turned key depends on the
    # difference of their positions alone.
    pairs = width // 6
    frequency = _LONGEST_WAVE ** -(torch.arange(pairs, dtype=positions.dtype, device=positions.device) / pairs)
    angle = (positions[:, :, None] * frequency).flatten(1)[:, None]
    return angle.cos(), angle.sin()


@full_precision
def rotate_pairs(values: Tensor, cosine: Tensor, sine: Tensor) -> Tensor:
    """Return values (M, heads, width) with pairs of channels, half the width apart, rotated by angles (RoPE)."""
    first_half, second_half = values.chunk(2, dim=-1)
    return torch.cat([first_half * cosine - second_half * sine, first_half * sine + second_half * cosine], dim=-1)


def drop_clouds(change: Tensor, ends: Tensor | None, share: float, training: bool) -> Tensor:
    """Return a block's change of features (M, C), in training 0 for a random share of the clouds (stochastic depth).

    The other clouds' change is scaled up, so that the expected value stays.

    Args:
        change: (M, C) change of the cells' features.
        ends: where each cloud's cells end (B,).
        share: probability of dropping a cloud's change.
        training: whether the network is in training; nothing is dropped otherwise.
    """
    if not training or not share or ends is None:
        return change
    cloud_factor = (torch.rand(len(ends), device=change.device) >= share).to(change.dtype) / (1.0 - share)
    counts = torch.diff(ends, prepend=ends.new_zeros(1))
    return change * torch.repeat_interleave(cloud_factor, counts, output_size=len(change))[:, None]


def _block(options: PointTransformerOptions, stage: int, drop: float) -> nn.Module:
    """Return a new block of a stage."""
    width = options.channels[stage]
    if stage < options.attention_from:
        return ConvolutionBlock(width, 7 if options.kernel == "cross" else 27, drop)
    return AttentionBlock(width, options.head_width, options.expansion, drop)


class ConvolutionBlock(nn.Module):
    """Convolution over the cells around each, a pointwise layer, and what there was."""

    def __init__(self, width: int, kernel_cells: int, drop: float) -> None:
        super().__init__()
        self.norm = Norm(width)
        self.look = CellConvolution(kernel_cells, width, width)
        self.look_norm = Norm(width)
        self.mix = nn.Linear(width, width)
        self.drop = drop

    def forward(self, values: Tensor, view: View) -> Tensor:
        """Return the cells' features (M, width) after the block; the shape stays."""
        assert view.around is not None
        convolved = F.relu_(self.look_norm(self.look(self.norm(values), view.around)))
        return values + drop_clouds(self.mix(convolved), view.ends, self.drop, self.training)


class AttentionBlock(nn.Module):
    """Attention among the cells of each patch of a curve, then two pointwise layers; both added to what there was."""

    def __init__(self, width: int, head_width: int, expansion: int, drop: float) -> None:
        super().__init__()
        self.head_width = head_width
        self.norm = nn.LayerNorm(width)
        self.look = nn.Linear(width, 3 * width)
        self.join = nn.Linear(width, width)
        self.wide_norm = nn.LayerNorm(width)
        self.widen = nn.Linear(width, width * expansion)
        self.narrow = nn.Linear(width * expansion, width)
        self.drop = drop

    def forward(self, values: Tensor, view: View) -> Tensor:
        """Return the cells' features (M, width) after the block; the shape stays."""
        values = values + drop_clouds(self._attention(self.norm(values), view), view.ends, self.drop, self.training)
        expanded = F.gelu(self.widen(self.wide_norm(values)))
        return values + drop_clouds(self.narrow(expanded), view.ends, self.drop, self.training)

    def _attention(self, values: Tensor, view: View) -> Tensor:
        """Return the attention's output (M, width) for each cell from the cells of its patch."""
        assert view.patch is not None
        assert view.place is not None
        assert view.turns is not None
        # Vaswani et al. 2017: softmax(Q K^T / sqrt(d)) V. Queries and keys are turned before cells are gathered, once
        # for each cell and not once for each of the patches that it is in.
        q, k, v = self.look(values).unflatten(1, (3, -1, self.head_width)).unbind(1)
        q, k = (rotate_pairs(tensor, *view.turns).to(v.dtype) for tensor in (q, k))
        qkv = torch.stack([q, k, v], dim=1)
        patches = qkv.index_select(0, view.patch.reshape(-1)).unflatten(0, view.patch.shape)
        q, k, v = patches.transpose(1, 3).unbind(2)  # (P, heads, K, width of a head)
        mask = None if view.filled is None else view.filled[:, None, None]
        attention = F.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        # Of the patches that a cell is in only one is asked for it: that in whose middle it lies.
        by_cell = attention.transpose(1, 2).flatten(2).flatten(0, 1).index_select(0, view.place)
        result: Tensor = self.join(by_cell)
        return result


class Pool(nn.Module):
    """Layer to the cells of the next stage: of each channel the largest among a cell's up to eight."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(in_channels, out_channels, bias=False)
        self.norm = Norm(out_channels)

    def forward(self, values: Tensor, children: Tensor) -> Tensor:
        """Return features (M, out_channels) of the wider cells from those of the cells within, (N, in_channels)."""
        return F.relu_(self.norm(gather_max(self.linear(values), children)))


class Unpool(nn.Module):
    """Layer back to the stage before: what its cells had, and what the cell has that each lies in."""

    def __init__(self, skip_channels: int, in_channels: int) -> None:
        super().__init__()
        self.own = Pointwise(skip_channels, skip_channels)
        self.wide = Pointwise(in_channels, skip_channels)

    def forward(self, skip: Tensor, coarse: Tensor, parent: Tensor) -> Tensor:
        """Return features (N, skip channels) of cells from theirs before and those of the wider cells around them.

        Args:
            skip: (N, skip channels) features of the stage before.
            coarse: (M, in channels) features of the wider cells.
            parent: (N,) index of the wider cell that each cell lies in.
        """
        result: Tensor = self.own(skip) + self.wide(coarse).index_select(0, parent)
        return result
