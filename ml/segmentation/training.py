"""How a network is trained: what it sees, what is minimised, and the two parts of fine-tuning."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from synthroads_addon.base.progress import Progress, silent

from ..runs import PRETRAINING, Run
from ..training_loop import Figures, chosen_device, fit
from .data.classes import IGNORED, class_names
from .data.crops import Item, Seeds
from .data.tiles import CloudTile, scalings
from .loading import epoch_batches, read_domains, thin_tiles, watched_workers
from .network import build, scores_of
from .recipes import SegmentationConfiguration, class_shares, class_weights
from .scores.evaluation import classifier
from .scores.metrics import Confusion, mean
from .scores.scoring import label_tile

Domains = dict[str, list[CloudTile]]


def train_network(run: Run[SegmentationConfiguration], progress: Progress = silent) -> tuple[nn.Module, Domains]:
    """Train a run; return the network with its last weights, and what it was trained on.

    Raises:
        InputError: data are missing, or don't fit the configuration.
    """
    configuration = run.configuration
    device = chosen_device(configuration)
    domains = read_domains(configuration)
    validation = list(thin_tiles(configuration.data.validation, configuration, "validation"))
    torch.manual_seed(configuration.seed)
    model = build(configuration).to(device)
    if configuration.set_up == "fine_tuned":
        _fit(model, _pretraining(run), {"synthetic": domains["synthetic"]}, validation, progress)
        second = configuration.model_copy(update={"schedule": configuration.fine_tuning})
        _fit(model, replace(run, configuration=second), {"real": domains["real"]}, validation, progress)
    else:
        _fit(model, run, domains, validation, progress)
    return model.eval(), domains


def _pretraining(run: Run[SegmentationConfiguration]) -> Run[SegmentationConfiguration]:
    """Return the run of the first part of fine-tuning, begun or to be gone on with."""
    configuration = run.configuration.model_copy(update={"set_up": "synthetic"})
    return Run.start(run.folder / PRETRAINING, configuration, resume=True)


def _fit(
    model: nn.Module,
    run: Run[SegmentationConfiguration],
    domains: Domains,
    validation: list[CloudTile],
    progress: Progress,
) -> None:
    """Train on given domains by the run's schedule; afterwards the model has the run's last weights."""
    configuration = run.configuration
    tiles = [tile for found in domains.values() for tile in found]
    device = next(model.parameters()).device
    classes = len(class_names(configuration.scheme()))
    batches = partial(
        epoch_batches,
        configuration,
        tiles,
        [len(found) for found in domains.values()],
        scalings(tiles, configuration.intensity),
        Seeds(tiles, classes, configuration.balanced),
        device,
    )
    with watched_workers(configuration):
        fit(
            model,
            run,
            batches,
            math.ceil(configuration.crops_per_tile * len(tiles) / configuration.batch),
            objective(configuration, tiles, device),
            validate=_validation(configuration, validation, device) if validation else None,
            progress=progress,
        )


def smoothed_loss(scores: Tensor, truth: Tensor, weights: Tensor, smoothing: float) -> Tensor:
    """Return the cross-entropy with smoothed labels, a mean weighed by each point's own class; 0 without any label.

    The share ``smoothing`` of a label goes to all classes alike. (PyTorch's own weights weigh these shares too: with
    weights as far apart as a road's, the best answer to a point of a frequent class would then be a rare one.)

    Args:
        scores: (N, C).
        truth: (N,) int64 classes, or `IGNORED`.
        weights: (C,).
        smoothing: from 0 to below 1.
    """
    known = truth != IGNORED
    losses = functional.cross_entropy(scores[known], truth[known], reduction="none", label_smoothing=smoothing)
    weight = weights[truth[known]]
    return (losses * weight).sum() / weight.sum().clamp_min(1e-12)


def objective(
    configuration: SegmentationConfiguration, tiles: Sequence[CloudTile], device: torch.device
) -> Callable[[nn.Module, Item], tuple[Tensor, Figures]]:
    """Return what is minimised, its classes weighed by their shares of the training tiles.

    Raises:
        InputError: no point has a label.
    """
    shares = class_shares(tiles, len(class_names(configuration.scheme())))
    shares = class_weights(shares) if configuration.class_weights else np.ones_like(shares)
    weights = torch.from_numpy(shares.astype(np.float32)).to(device)

    def loss(model: nn.Module, batch: Item) -> tuple[Tensor, Figures]:
        scores, truth = scores_of(model, batch), batch["segment"]
        value = smoothed_loss(scores, truth, weights, configuration.label_smoothing)
        known = truth != IGNORED
        right = (scores.detach().argmax(dim=1) == truth) & known
        return value, {"accuracy": float(right.sum() / known.sum().clamp_min(1))}

    return loss


def _validation(
    configuration: SegmentationConfiguration, tiles: list[CloudTile], device: torch.device
) -> Callable[[nn.Module, int], Figures]:
    scaling = scalings(tiles, configuration.intensity)

    def validate(model: nn.Module, epoch: int) -> Figures:
        confusion = Confusion(class_names(configuration.scheme()))
        scores = classifier(model, configuration, device)
        for tile in tiles:
            labels = label_tile(tile, scaling[tile.scene], scores, configuration.crop_settings())
            confusion.add(tile.segment, labels)
        return {"validation_mean_iou": mean(confusion.iou)}

    return validate
