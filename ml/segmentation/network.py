"""The network that a configuration names: built, called, and adapted to other points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import TypeVar

import torch
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm

from synthroads_addon.base.errors import InputError

from ..data.classes import class_names
from ..data.crops import Item
from ..training_loop import move_to_device
from .recipes import SegmentationConfiguration


def build(configuration: SegmentationConfiguration) -> nn.Module:
    """Return a configuration's segmentation network with random weights of PyTorch's global generator."""
    return configuration.network.build(len(configuration.features), len(class_names(configuration.scheme())))


def scores_of(model: nn.Module, batch: Item) -> Tensor:
    """Return the network's class scores (logits, N, C) of a prepared batch."""
    scores: Tensor = model(batch["feat"], batch)
    return scores


def gpu_prepares(configuration: SegmentationConfiguration, device: torch.device) -> bool:
    """Return whether batches are prepared on the device, a GPU, and not by workers on the CPU."""
    automatic = configuration.prepare_on == "auto"
    return automatic and device.type != "cpu" and configuration.network.prepares_on_gpu


def prepare_on_gpu(configuration: SegmentationConfiguration, batch: Item) -> Item:
    """Return a batch prepared by the network if it lies on a GPU where the network can do that; else unchanged."""
    prepares_here = gpu_prepares(configuration, batch["coord"].device)
    return configuration.network.prepare(batch) if prepares_here else batch


def adapt_network(model: nn.Module, batches: Iterable[Item], configuration: SegmentationConfiguration) -> nn.Module:
    """Return a copy of a network whose batch norms have the statistics of other points (AdaBN).

    Raises:
        InputError: there are no points.
    """
    adapted = deepcopy(model)
    adapt_norms(
        adapted,
        batches,
        lambda batch: scores_of(adapted, prepare_on_gpu(configuration, move_to_device(adapted, batch))),
    )
    return adapted


Batch = dict[str, Tensor]
B = TypeVar("B")


def adapt_norms(model: nn.Module, batches: Iterable[B], scores: Callable[[B], Tensor]) -> int:
    """Replace the running statistics of a model's batch norms, in place, by those of other data: AdaBN.

    Li et al., "Revisiting batch normalization for practical domain adaptation" (2016). Each batch is normalised by its
    own statistics, as in training, and those of all batches are pooled, by their numbers of points. Weights stay.

    Args:
        model: network; its modes are restored, and after an error its statistics too.
        batches: batches of the other domain, without effects; crops as large as in training.
        scores: function that runs the model on a batch and returns one row per point.

    Returns:
        The number of points looked at.

    Raises:
        InputError: there are no points.
    """
    norms = [module for module in model.modules() if isinstance(module, _BatchNorm) and module.running_mean is not None]
    previous_states = [{name: value.clone() for name, value in norm.state_dict().items()} for norm in norms]
    modes, momenta = [(module, module.training) for module in model.modules()], [norm.momentum for norm in norms]
    pools = [_Pool(norm) for norm in norms]
    has_succeeded = False
    try:
        model.eval()  # no dropout
        for norm in norms:
            norm.train()
            norm.momentum = 1.0  # each batch leaves its own statistics
        points = sum(_pool_statistics(pools, scores, batch) for batch in batches)
        if not points:
            raise InputError("adaptation", 0, "needs points of the domain that the network is adapted to")
        has_succeeded = True
    finally:
        for norm, state, momentum in zip(norms, previous_states, momenta, strict=True):
            norm.load_state_dict(state)
            norm.momentum = momentum
        for module, training in modes:
            module.training = training
    if has_succeeded:
        for pool in pools:
            pool.store()
    return points


def _pool_statistics(pools: list[_Pool], scores: Callable[[B], Tensor], batch: B) -> int:
    """Run the model on a batch, add its norms' statistics to their pools, and return its points."""
    with torch.no_grad():
        points = len(scores(batch))
        for pool in pools:
            pool.add(points)
    return points


class _Pool:
    """Accumulator of one batch norm's statistics over batches, weighted by points, in double precision."""

    def __init__(self, norm: _BatchNorm) -> None:
        assert norm.running_mean is not None
        self.norm = norm
        self.seen = self._batches()
        self.weight = 0
        self.mean = torch.zeros_like(norm.running_mean, dtype=torch.float64)
        self.square = torch.zeros_like(self.mean)

    def _batches(self) -> int:
        """Return the number of batches that the norm has seen."""
        return 0 if self.norm.num_batches_tracked is None else int(self.norm.num_batches_tracked)

    def add(self, points: int) -> None:
        """Add the statistics of the norm's last batch of `points`, unless it updated none (a single point)."""
        previous_count, self.seen = self.seen, self._batches()
        if self.seen == previous_count or self.norm.running_mean is None or self.norm.running_var is None:
            return
        mean, variance = self.norm.running_mean.double(), self.norm.running_var.double()
        self.weight += points
        self.mean += points * mean
        self.square += points * (variance + mean.square())

    def store(self) -> None:
        """Write the pooled statistics to the norm, in place; nothing if it saw no batch."""
        if not self.weight or self.norm.running_mean is None or self.norm.running_var is None:
            return
        mean = self.mean / self.weight
        self.norm.running_mean.copy_(mean)
        self.norm.running_var.copy_((self.square / self.weight - mean.square()).clamp_(min=0.0))


def overlay_clouds(batch: Batch) -> Batch:
    """Return the batch with its clouds merged in pairs (Mix3D augmentation); an odd last one stays alone.

    Nekrasov et al., "Mix3D: out-of-context data augmentation for 3D scenes" (2021): things then appear where their
    surroundings don't announce them. Clouds must be centred; their points, labels and features stay as they are.

    Args:
        batch: packed clouds with ``coord`` (N, 3) and ``offset`` (B,), before neighbours are looked for.

    Raises:
        InputError: neighbours are already there: they would be those of the single clouds.
    """
    if "positions0" in batch:
        raise InputError("batch", "with neighbours", "must be mixed before its neighbours are computed")
    offset = batch["offset"]
    last_of_pair = torch.arange(len(offset), device=offset.device) % 2 == 1
    last_of_pair[-1:] = True
    return batch | {"offset": offset[last_of_pair]}
