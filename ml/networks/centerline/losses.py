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


def likelihood(error: Tensor, log_std: Tensor, known: Tensor, beta: float) -> Tensor:
    """Return the mean negative log-likelihood (T,) of each target, Gaussian with linear tails, up to a constant.

    It is a Gaussian's up to `OUTLIER` deviations, and beyond goes on as a straight line (Huber).

    Args:
        error: (B, S, T) in units of the target; anything where it isn't known.
        log_std: (B, S, T) of the predicted deviation in the same unit.
        known: (B, S, T) which of them count; a target that is known nowhere has the loss 0.
        beta: each term is multiplied by its variance to this power, which counts as a constant.
    """
    error = torch.where(known, error, torch.zeros_like(error))
    # -ln N(error; 0, sigma) = (error / sigma)^2 / 2 + ln sigma + constant, times sigma^(2 beta) (Seitzer et al. 2022).
    ratio = error * torch.exp(-log_std)
    cost = functional.huber_loss(ratio, torch.zeros_like(ratio), reduction="none", delta=OUTLIER)
    terms = (cost + log_std) * torch.exp(2.0 * beta * log_std.detach())
    count = known.sum((0, 1)).clamp_min(1)
    return (terms * known).sum((0, 1)) / count


def cross_entropy(logits: Tensor, places: Tensor, lines: Tensor, known: Tensor) -> Tensor:
    """Return the mean cross-entropy (L,) of softmax(logits) over kernel points against the lines' true places.

    The truth is shared linearly by the two kernel points around a line; one beyond the outermost belongs to that.

    Args:
        logits: (B, S, K, L).
        places: (B, S, K) where the kernel points are (or began), at equal spacing, m.
        lines: (B, S, L) y of the lines, m.
        known: (B, S, L) which count.
    """
    low, high = places[..., :1], places[..., -1:]
    spacing = (high - low) / (places.shape[-1] - 1)
    inside = torch.where(known, lines, low).clamp(low, high)
    share = 1.0 - (inside[:, :, None] - places[..., None]).abs() / spacing[..., None]
    entropy = -(share.clamp_min(0.0) * logits.log_softmax(2)).sum(2)
    return (entropy * known).sum((0, 1)) / known.sum((0, 1)).clamp_min(1)


def centerline_loss(options: LossOptions, half_width: float) -> Callable[[nn.Module, Batch], tuple[Tensor, Figures]]:
    """Return a function (model, batch) -> (loss, {"center_mae": m}) that adds up the terms by their weights.

    Args:
        options: what counts how much.
        half_width: where the outermost kernel points are, m.
    """

    def loss(model: nn.Module, batch: Batch) -> tuple[Tensor, Figures]:
        output: Output = model(batch)
        true, estimate = all_targets(batch), all_targets(output)
        known = ~torch.isnan(true)
        error = (estimate - torch.where(known, true, estimate.detach())) / estimate.new_tensor(SCALE)
        weight = estimate.new_tensor([1.0] + [options.corridor] * (len(TARGETS) - 1))
        value = (weight * likelihood(error, output["log_std"], known, options.beta)).sum()
        rough = output["rough"] - torch.where(known[..., 0], true[..., 0], output["rough"].detach())
        far = functional.huber_loss(rough, torch.zeros_like(rough), reduction="none", delta=_ROUGH)
        value = value + options.rough * far.sum() / known[..., 0].sum().clamp_min(1)
        if options.places:
            number = output["logits"].shape[2]
            places = torch.linspace(-half_width, half_width, number, device=estimate.device).expand(
                *estimate.shape[:2], -1
            )
            lines = [TARGETS.index(name) for name in LINES]
            entropy = cross_entropy(output["logits"], places, true[..., lines], known[..., lines])
            share = estimate.new_tensor([1.0] + [options.edges] * (len(LINES) - 1))
            value = value + options.places * (share * entropy).sum()
        if options.fine:
            logits, places = output["fine_logits"][..., None], output["fine_places"]
            value = value + options.fine * cross_entropy(logits, places, true[..., :1], known[..., :1]).sum()
        seen = known[..., 0]
        mae = float((error[..., 0].detach().abs() * seen).sum() / seen.sum().clamp_min(1))
        return value, {"center_mae": mae}

    return loss
