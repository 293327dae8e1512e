"""Base of the models that find a road's centreline and corridor in sequences of slices; each is a file beside this one.

All take a batch (see `slices.collate`) of B sequences of S slices with P points, use its ``coord``, ``feat``, ``mask``
and ``frame``, and return a dictionary:

- ``center``, ``center_std`` (B, S), m; ``corridor``, ``corridor_std`` (B, S, K), columns `CORRIDOR`;
- ``rough`` (B, S): the centre at first look, m;
- ``log_std`` (B, S, 1 + K): logarithms of the deviations divided by `SCALE`, of the centre and the corridor;
- ``logits`` (B, S, 25, 3): what the soft-argmax of centre, left and right edge is taken of; ``places`` (B, S, 25), m;
- ``fine_logits``, ``fine_places`` (B, S, 64): the same of the second look's centre.

No model knows where it is but by kernel points, all of which have the same weights: a road moved by a kernel point's
spacing is the same road moved. Frames are only used relative to each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import torch
from pydantic import Field, model_validator
from torch import Tensor, nn

from synthroads_addon.base.schema import quantity

from ...configuration import Part
from ...data.corridor import CORRIDOR
from ...data.slices import FEATURES, Batch, mirror_batch, mirrored_corridor, with_sides_swapped
from .layers import AttentionPool, FixedKernelPoints, PointFeatures, Tokens
from .refinement import Refinement, parabola

Output = dict[str, Tensor]

LINES = ("center", "left_edge", "right_edge")
"""Targets found by soft-argmax over the kernel points."""
TARGETS = ("center", *CORRIDOR)
"""Columns of what is regressed: the centre, then the corridor."""
Encoding = tuple[Tokens, Tensor]
"""Tokens that have seen their surroundings, and the context (N, D) of each of N slices."""
SCALE = (1.0, 1.0, 1.0, 0.5, 0.2, 0.05, 0.1)
"""Of `TARGETS`: errors of this size weigh alike; m, and what lanes and headings are measured in."""
_MIDDLE = {"lanes": 4.0, "lane_width": 3.5, "heading": 0.0}
"""Values of the scalars without any evidence. Chosen: about the middle of the roads that are sampled."""
_NATURAL = {"lanes": 2.0, "lane_width": 0.3, "heading": 0.05}
"""Size of their deviations from it. Chosen: about their deviation over the roads that are sampled."""
_LARGEST_LOG = 5.0
"""Largest absolute logarithm of a deviation. Chosen: exp(5) m is beyond any error, and finite in half precision."""


class ModelOptions(Part):
    """Base of a centreline model's options: name and sizes; builds the model."""

    name: str
    features: tuple[Literal["intensity", "contrast", "red", "green", "blue", "has_color"], ...] = Field(
        ("intensity", "contrast"), description="Number of attributes of a point, without its position."
    )
    kernel_points: int = quantity(25, ge=3, le=1000, unit="1", description="Number of kernel points across a slice.")
    cells: int = quantity(
        4, ge=1, le=100, unit="1", description="Number of cells per spacing of the fixed kernel points."
    )
    point_width: int = quantity(16, ge=1, le=1024, unit="1", description="Number of features of a point.")
    width: int = quantity(48, ge=2, le=1024, unit="1", description="Number of features of a token.")
    context: int = quantity(96, ge=2, le=4096, unit="1", description="Number of features of a slice.")
    fine_cells: int = quantity(64, ge=2, le=1000, unit="1", description="Number of cells of the second stage.")
    fine_reach: float = quantity(6.4, gt=0, le=45, unit="m", description="Half-width of the second stage.")
    fine_width: int = quantity(
        24, ge=1, le=1024, unit="1", description="Number of features of a cell of the second stage."
    )
    layers: int = quantity(3, ge=0, le=50, unit="1", description="Number of layers over the tokens.")
    heads: int = quantity(4, ge=1, le=64, unit="1", description="Number of heads of each attention layer.")
    dropout: float = quantity(0.0, ge=0, lt=1, unit="1", description="Dropout of the attention layers.")

    def build(self, half_width: float, slices: int) -> CenterlineModel:
        """Return the centreline model with random weights from PyTorch's global generator.

        Args:
            half_width: reach of a slice to either side, m.
            slices: number of slices of a sequence.
        """
        raise NotImplementedError

    @model_validator(mode="after")
    def _check_widths(self) -> ModelOptions:
        """Refuse widths that the attention's heads don't divide evenly, or odd ones."""
        for name in ("width", "context"):
            if getattr(self, name) % self.heads or getattr(self, name) % 2:
                raise ValueError(f"{name} must be even and a multiple of heads, {self.heads}")
        return self


class Heads(nn.Module):
    """Output heads: lines by soft-argmax over a slice's tokens, scalars and deviations from the slice's context."""

    def __init__(self, width: int, context: int, spacing: float) -> None:
        super().__init__()
        self.spacing = spacing
        self.local = nn.Linear(width, context)
        self.context = nn.Linear(context, context)
        self.maps = nn.Sequential(nn.GELU(), nn.Linear(context, 2 * len(LINES) + 1))
        self.scalars = nn.Sequential(nn.Linear(context, context), nn.GELU(), nn.Linear(context, len(_MIDDLE)))
        self.spread = nn.Sequential(nn.Linear(context, context), nn.GELU(), nn.Linear(context, len(CORRIDOR)))

    def forward(self, tokens: Tokens, context: Tensor) -> Output:
        """Return center (N,), corridor (N, K), its log_std (N, K) and logits of N slices with context (N, D)."""
        maps = self.maps(self.local(tokens.features) + self.context(context)[:, None])
        logits, residual, lift = maps.split([len(LINES), len(LINES), 1], dim=-1)
        share = logits.softmax(1)
        lines = (share * (tokens.places[..., None] + self.spacing * residual)).sum(1)
        height = (share[..., 0] * (tokens.heights + lift[..., 0])).sum(1)
        middle, natural = context.new_tensor(list(_MIDDLE.values())), context.new_tensor(list(_NATURAL.values()))
        scalars = middle + natural * self.scalars(context)
        return {
            "center": lines[:, 0],
            "corridor": torch.cat([lines[:, 1:], scalars, height[:, None]], dim=1),
            "log_std": self.spread(context) - 1.0,
            "logits": logits,
        }


class CenterlineModel(nn.Module):
    """Base of the centreline models: point features, fixed kernel points, heads and refinement; subclasses encode."""

    def __init__(self, options: ModelOptions, half_width: float, slices: int) -> None:
        super().__init__()
        self.options = options
        width, count = options.width, options.kernel_points
        columns = tuple(FEATURES.index(name) for name in options.features)
        self.points = PointFeatures(columns, options.point_width)
        self.kernel_points = FixedKernelPoints(count, half_width, options.cells, options.point_width, width)
        self.pool = AttentionPool(width, options.heads, options.context)
        self.heads = Heads(width, options.context, self.kernel_points.spacing)
        refinement_size = (options.fine_reach, options.fine_cells)
        self.again = Refinement(
            options.point_width, options.fine_width, options.context, slices, *refinement_size, options.heads
        )

    def forward(self, batch: Batch) -> Output:
        """Return centreline, corridor, deviations and logits of a batch's slices, see the module."""
        shape = batch["mask"].shape[:2]
        coord, feat, mask = (batch[name].flatten(0, 1) for name in ("coord", "feat", "mask"))
        features = self.points(coord, feat)
        tokens, context = self.encode(self.kernel_points(coord, mask, features), coord, mask, features, shape[1])
        outputs = {name: values.unflatten(0, shape) for name, values in self.heads(tokens, context).items()}
        context = context.unflatten(0, shape)
        # Detached: gradients of the second look must not reach the first one through the place of the second look.
        guess, heading = self.line(outputs["center"].detach(), outputs, context, batch["frame"])
        guess, heading = guess.detach(), heading.detach()
        step, log_std, outputs["fine_logits"] = self.again(
            batch["coord"], batch["mask"], features.unflatten(0, shape), guess, heading, context
        )
        outputs["rough"], outputs["center"] = outputs["center"], guess + step
        outputs["fine_places"] = guess[..., None] + self.again.places
        outputs["log_std"] = _bound_values(torch.cat([log_std[..., None], outputs["log_std"]], dim=-1))
        _, heading = self.line(outputs["center"].detach(), outputs, context, batch["frame"])
        heading_column = CORRIDOR.index("heading")
        outputs["corridor"] = torch.cat(
            [
                outputs["corridor"][..., :heading_column],
                heading[..., None],
                outputs["corridor"][..., heading_column + 1 :],
            ],
            dim=-1,
        )
        std = torch.exp(outputs["log_std"]) * outputs["log_std"].new_tensor(SCALE)
        return outputs | {"center_std": std[..., 0], "corridor_std": std[..., 1:]}

    def encode(self, tokens: Tokens, coord: Tensor, mask: Tensor, features: Tensor, slices: int) -> Encoding:
        """Return the tokens encoded with their surroundings, and the context (N, D) of each of the N slices."""
        raise NotImplementedError

    def line(self, center: Tensor, outputs: Output, context: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Return y (m) and direction (rad), both (B, S) in the slices' frames, of a line through regressed centres.

        Args:
            center: (B, S) y of the centres, m, without gradient.
            outputs: the heads' other outputs.
            context: (B, S, D) context of the slices.
            frame: (B, S, 4) x, y, direction and z origin of the slices' frames.
        """
        raise NotImplementedError


class SequenceModel(CenterlineModel):
    """Base of the models whose slices see each other: the line is a parabola fitted through all centres."""

    def __init__(self, options: ModelOptions, half_width: float, slices: int) -> None:
        super().__init__(options, half_width, slices)
        self.trust = nn.Linear(options.context, 1)
        self.stiffness = nn.Parameter(torch.tensor([-6.0, -4.0, -2.0]))

    def line(self, center: Tensor, outputs: Output, context: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Return y (m) and direction (rad), both (B, S), of a parabola through the centres, weighted by context."""
        weight = torch.exp(2.0 * torch.tanh(0.5 * self.trust(context)[..., 0]))
        guess, heading = parabola(frame, center, weight, torch.exp(self.stiffness))
        return guess, heading + outputs["corridor"][..., CORRIDOR.index("heading")]


def all_targets(values: Mapping[str, Tensor], kind: str = "") -> Tensor:
    """Concatenate centre and corridor to (..., T), columns `TARGETS`; with ``kind`` = "_std" their deviations."""
    return torch.cat([values[f"center{kind}"][..., None], values[f"corridor{kind}"]], dim=-1)


def predict_both_ways(model: nn.Module, batch: Batch) -> Output:
    """Return centre, corridor and deviations averaged over a batch and its mirror image, mirrored back.

    Mirroring the batch mirrors the result exactly. Variances are averaged; the difference of the two results isn't
    added, as the calibration accounts for it.
    """
    output, mirrored_output = model(batch), model(mirror_batch(batch))
    corridor_back = mirrored_corridor(mirrored_output["corridor"])
    variance = with_sides_swapped(mirrored_output["corridor_std"]) ** 2
    return {
        "center": 0.5 * (output["center"] - mirrored_output["center"]),
        "center_std": (0.5 * (output["center_std"] ** 2 + mirrored_output["center_std"] ** 2)).sqrt(),
        "corridor": 0.5 * (output["corridor"] + corridor_back),
        "corridor_std": (0.5 * (output["corridor_std"] ** 2 + variance)).sqrt(),
    }


def _bound_values(logarithm: Tensor) -> Tensor:
    """Return logarithms softly limited to `_LARGEST_LOG`, nearly unchanged when small."""
    return _LARGEST_LOG * torch.tanh(logarithm / _LARGEST_LOG)
