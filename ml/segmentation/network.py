"""PointNeXt as the recipes build it, and what its batches need beyond their points."""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy

import torch
from torch import Tensor, nn

from ..networks.neighbours import Neighbourhood, build_neighbours
from ..networks.pointnext import Architecture, PointNeXt, architecture
from .adaptation import adapt_norms
from .data.classes import class_names
from .data.crops import Item
from .recipes import SegmentationConfiguration


def plan_of(configuration: SegmentationConfiguration) -> Architecture:
    """Return what a configuration's network is made of."""
    chosen = configuration.network
    return architecture(
        chosen.preset,
        in_channels=len(configuration.features),
        num_classes=len(class_names(configuration.scheme())),
        width=chosen.width,
        dropout=chosen.dropout,
        radius=chosen.radius,
        neighbours=chosen.neighbours,
        sampling=chosen.sampling,
    )


def build(configuration: SegmentationConfiguration) -> PointNeXt:
    """Return the network of a configuration, with random weights."""
    return PointNeXt(plan_of(configuration))


def prepare_batch(batch: Item, neighbourhood: Neighbourhood) -> Item:
    """Return a batch with the indices of all stages' points and neighbours; runs on the CPU, in workers."""
    return batch | build_neighbours(batch["coord"], batch["offset"], neighbourhood)


def scores_of(model: nn.Module, batch: Item) -> Tensor:
    """Return the classes' scores (N, C) of a prepared batch."""
    scores: Tensor = model(batch["feat"], batch)
    return scores


def on_device(batch: Item, device: torch.device) -> Item:
    """Return a batch's tensors on a device."""
    return {name: value.to(device, non_blocking=True) for name, value in batch.items()}


def adapt_network(model: nn.Module, batches: Iterable[Item], device: torch.device) -> nn.Module:
    """Return a copy of a network whose norms have the statistics of other points (AdaBN).

    Raises:
        InputError: there are no points.
    """
    other = deepcopy(model)
    adapt_norms(other, batches, lambda batch: scores_of(other, on_device(batch, device)))
    return other
