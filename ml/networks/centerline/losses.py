"""Losses of the centreline models: a Gaussian likelihood of what is known, and where the lines lie."""

from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional

from synthroads_addon.base.schema import quantity

from ...configuration import Part
from ...data.slices import Batch
from .models import LINES, SCALE, TARGETS, Output, all_targets

Figures = dict[str, float]


class LossOptions(Part):
    """Weights of the terms of the centreline models' loss."""

    beta: float = quantity(
        0.5,
        ge=0,
        le=1,
        unit="1",
        description="Power of the variance by which the likelihood is weighted (Seitzer et al. 2022): 0 is the plain "
        "likelihood, which stops learning where the variance is large; 1 has the gradients of squared errors.",
    )
    corridor: float = quantity(
        0.2, ge=0, le=100, unit="1", description="Weight of each corridor target, relative to the centre."
    )
    rough: float = quantity(0.3, ge=0, le=100, unit="1", description="Weight of the centre by the first stage.")
    places: float = quantity(0.1, ge=0, le=100, unit="1", description="Weight of the soft-argmax's cross-entropy.")
    fine: float = quantity(0.2, ge=0, le=100, unit="1", description="Weight of the cross-entropy of the second stage.")
    edges: float = quantity(
        0.3, ge=0, le=100, unit="1", description="Weight of an edge in this cross-entropy, relative to the centre."
    )


_ROUGH = 0.5
"""Errors of the first look beyond this, m, count linearly. Chosen: the second look mends smaller ones."""
OUTLIER = 3.0
"""Deviations beyond which the likelihood's tails are exponential: one wrong slice may not outweigh all others."""


def likelihood(error: Tensor, log_std: Tensor, mask: Tensor, beta: float) -> Tensor:
    """Return the mean negative log-likelihood (T,) of each target, Gaussian with linear tails, up to a constant.

    It is a Gaussian's up to `OUTLIER` deviations, and beyond goes on as a straight line (Huber).

    Args:
        error: (B, S, T) errors in units of the target; any number where unknown.
        log_std: (B, S, T) logarithm of the predicted deviation in the same unit.
        mask: (B, S, T) targets that are known; one that is known nowhere has the loss 0.
        beta: power of the variance by which each term is multiplied, as a constant without gradient.
    """
    error = torch.where(mask, error, torch.zeros_like(error))
    # -ln N(error; 0, sigma) = (error / sigma)^2 / 2 + ln sigma + constant, times sigma^(2 beta) (Seitzer et al. 2022).
    ratio = error * torch.exp(-log_std)
    cost = functional.huber_loss(ratio, torch.zeros_like(ratio), reduction="none", delta=OUTLIER)
    terms = (cost + log_std) * torch.exp(2.0 * beta * log_std.detach())
    count = mask.sum((0, 1)).clamp_min(1)
    return (terms * mask).sum((0, 1)) / count


def cross_entropy(logits: Tensor, kernel_offsets: Tensor, lines: Tensor, mask: Tensor) -> Tensor:
    """Return the mean cross-entropy (L,) of softmax(logits) over kernel points against the lines' true places.

    The truth is shared linearly by the two kernel points around a line; one beyond the outermost belongs to that.

    Args:
        logits: (B, S, K, L).
        kernel_offsets: (B, S, K) y of the kernel points (before they move), at equal spacing, m.
        lines: (B, S, L) y of the lines, m.
        mask: (B, S, L) lines that are known.
    """
    first_offset, last_offset = kernel_offsets[..., :1], kernel_offsets[..., -1:]
    spacing = (last_offset - first_offset) / (kernel_offsets.shape[-1] - 1)
    line_offsets = torch.where(mask, lines, first_offset).clamp(first_offset, last_offset)
    share = 1.0 - (line_offsets[:, :, None] - kernel_offsets[..., None]).abs() / spacing[..., None]
    entropy = -(share.clamp_min(0.0) * logits.log_softmax(2)).sum(2)
    return (entropy * mask).sum((0, 1)) / mask.sum((0, 1)).clamp_min(1)


def centerline_loss(options: LossOptions, half_width: float) -> Callable[[nn.Module, Batch], tuple[Tensor, Figures]]:
    """Return a function (model, batch) -> (loss, {"center_mae": m}) that adds up the terms by their weights.

    Args:
        options: weights of the terms.
        half_width: distance of the outermost kernel points from the frame's origin, m.
    """

    def loss(model: nn.Module, batch: Batch) -> tuple[Tensor, Figures]:
        """Return the loss of a batch's predictions, and the centre's mean absolute error, m."""
        output: Output = model(batch)
        truth, estimate = all_targets(batch), all_targets(output)
        known_mask = ~torch.isnan(truth)
        error = (estimate - torch.where(known_mask, truth, estimate.detach())) / estimate.new_tensor(SCALE)
        weight = estimate.new_tensor([1.0] + [options.corridor] * (len(TARGETS) - 1))
        value = (weight * likelihood(error, output["log_std"], known_mask, options.beta)).sum()
        # The centre's first look: Huber's loss of the offsets before refinement.
        first_look_error = output["rough"] - torch.where(known_mask[..., 0], truth[..., 0], output["rough"].detach())
        first_look_cost = functional.huber_loss(
            first_look_error, torch.zeros_like(first_look_error), reduction="none", delta=_ROUGH
        )
        value = value + options.rough * first_look_cost.sum() / known_mask[..., 0].sum().clamp_min(1)
        # The lines' places by the logits of the kernel points.
        if options.places:
            number = output["logits"].shape[2]
            kernel_offsets = torch.linspace(-half_width, half_width, number, device=estimate.device).expand(
                *estimate.shape[:2], -1
            )
            lines = [TARGETS.index(name) for name in LINES]
            entropy = cross_entropy(output["logits"], kernel_offsets, truth[..., lines], known_mask[..., lines])
            share = estimate.new_tensor([1.0] + [options.edges] * (len(LINES) - 1))
            value = value + options.places * (share * entropy).sum()
        # The centre's place by the logits of the second look, around the first one's centre.
        if options.fine:
            logits, kernel_offsets = output["fine_logits"][..., None], output["fine_places"]
            value = (
                value + options.fine * cross_entropy(logits, kernel_offsets, truth[..., :1], known_mask[..., :1]).sum()
            )
        center_mask = known_mask[..., 0]
        mae = float((error[..., 0].detach().abs() * center_mask).sum() / center_mask.sum().clamp_min(1))
        return value, {"center_mae": mae}

    return loss
