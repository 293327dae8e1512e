"""The network that a configuration names: built, called, and adapted to other points."""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy

import torch
from torch import Tensor, nn

from .adaptation import adapt_norms
from .data.classes import class_names
from .data.crops import Item
from .recipes import SegmentationConfiguration


def build(configuration: SegmentationConfiguration) -> nn.Module:
    """Return the network of a configuration, with random weights."""
    return configuration.network.build(len(configuration.features), len(class_names(configuration.scheme())))


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
