"""Running means of a network's weights over the steps of a training, and the statistics of norms that belong to them.

Polyak and Juditsky, "Acceleration of stochastic approximation by averaging" (1992); Izmailov et al., "Averaging weights
leads to wider optima and better generalization" (2018).
"""

from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import Any, TypeVar

import torch
from torch import nn
from torch.nn.modules.batchnorm import _BatchNorm

M = TypeVar("M", bound=nn.Module)
_WARM_UP = 10.0
"""Steps after which the mean reaches back over about as many steps as there were. Chosen: as TensorFlow's moving means;
without it, a short training's mean would consist of random initial weights."""


class RunningMean:
    """Exponential running mean of a network's weights.

    Args:
        model: network; its present weights are the mean's first value.
        decay: share of the mean that each step keeps, from 0 to below 1.

    Attributes:
        network: copy of the network with the mean of the weights; its buffers, e.g. norms' statistics, are the first
            ones.
    """

    def __init__(self, model: nn.Module, decay: float) -> None:
        self.network = deepcopy(model).requires_grad_(False)
        self.decay = decay

    @torch.no_grad()
    def add(self, model: nn.Module, step: int) -> None:
        """Add the weights of the network after a step from 0; the first steps' mean keeps less than the decay."""
        decay = min(self.decay, (1.0 + step) / (_WARM_UP + step))
        for mean, weight in zip(self.network.parameters(), model.parameters(), strict=True):
            mean.lerp_(weight, 1.0 - decay)

    @torch.no_grad()
    def copy_to(self, model: nn.Module) -> None:
        """Set the weights of a network to the mean, in place; its buffers stay."""
        for mean, weight in zip(self.network.parameters(), model.parameters(), strict=True):
            weight.copy_(mean)


@torch.no_grad()
def renew_statistics(model: M, batches: Iterable[Any], forward: Callable[[M, Any], Any]) -> None:
    """Compute the statistics of a network's batch norms anew, in place: their plain means over some batches.

    Each batch is normalised by its own statistics, as in training, but without dropout.

    Args:
        model: network; without such norms nothing is done, and no batch is drawn.
        batches: batches of the training.
        forward: function that sends a batch through the network.
    """
    norms = [module for module in model.modules() if isinstance(module, _BatchNorm) and module.track_running_stats]
    if not norms:
        return
    modes, momenta = [(module, module.training) for module in model.modules()], [norm.momentum for norm in norms]
    model.eval()  # no dropout
    for norm in norms:
        norm.train()
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean of all batches
    for batch in batches:
        forward(model, batch)
    for norm, momentum in zip(norms, momenta, strict=True):
        norm.momentum = momentum
    for module, training in modes:
        module.training = training
