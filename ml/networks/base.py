"""Base of the networks that give every point a class; and what networks compute in single precision always."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor, nn

from ..configuration import Part

Batch = dict[str, Tensor]
P = ParamSpec("P")
R = TypeVar("R")


def full_precision(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function of tensors compute in float32 where bfloat16 is chosen: places of 60 m would be 0.25 m wrong."""

    @wraps(function)
    def exact(*given: P.args, **named: P.kwargs) -> R:
        device = next(one.device.type for one in given if isinstance(one, Tensor))
        if not torch.is_autocast_enabled(device):
            return function(*given, **named)
        wide: Any = [one.float() if isinstance(one, Tensor) and one.dtype == torch.bfloat16 else one for one in given]
        with torch.autocast(device, enabled=False):
            return function(*wide, **named)

    return exact


class SegmentationNetwork(Part):
    """Base of a segmentation network's options: its name, its sizes, and how it is built."""

    name: str

    def build(self, features: int, classes: int) -> nn.Module:
        """Return the network with random weights.

        It is called with ``feat`` (N, features) and the whole batch, and returns the classes' scores (N, classes).
        """
        raise NotImplementedError

    def prepare(self, batch: Batch) -> Batch:
        """Return a batch with all that the network needs beside its points; called on the CPU, in workers."""
        return batch
