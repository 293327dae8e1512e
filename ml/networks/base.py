"""Base of the networks that give every point a class; and what networks compute in single precision always."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError

from ..configuration import Part

Batch = dict[str, Tensor]
P = ParamSpec("P")
R = TypeVar("R")


def full_precision(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function of tensors to run in float32 even under bfloat16 autocast, in which 60 m would be 0.25 m off."""

    @wraps(function)
    def exact(*arguments: P.args, **keywords: P.kwargs) -> R:
        """Call the function without autocast, its bfloat16 tensors widened to float32."""
        device = next(argument.device.type for argument in arguments if isinstance(argument, Tensor))
        if not torch.is_autocast_enabled(device):
            return function(*arguments, **keywords)
        widened_arguments: Any = [
            argument.float() if isinstance(argument, Tensor) and argument.dtype == torch.bfloat16 else argument
            for argument in arguments
        ]
        with torch.autocast(device, enabled=False):
            return function(*widened_arguments, **keywords)

    return exact


@dataclass(frozen=True)
class OnnxInputs:
    """Tensors that a network's ONNX file takes beside the features.

    Attributes:
        inputs: example of each tensor by name.
        lengths: by tensor's name its axes of any length, with the length's name; ``points0`` is the features'.
    """

    inputs: Batch
    lengths: Mapping[str, Mapping[int, str]]


class SegmentationNetwork(Part):
    """Base of a segmentation network's options: name and sizes; builds the network."""

    name: str

    @property
    def prepares_on_gpu(self) -> bool:
        """Return whether `prepare` works on a GPU's tensors; else workers prepare batches on the CPU."""
        return False

    def build(self, features: int, classes: int) -> nn.Module:
        """Return the network with random weights.

        It is called with ``feat`` (N, features) and the whole batch, and returns the classes' scores (N, classes).
        """
        raise NotImplementedError

    def prepare(self, batch: Batch) -> Batch:
        """Return the batch with the geometry that the network needs added, on the batch's device; here unchanged."""
        return batch

    def onnx_inputs(self, batch: Batch) -> OnnxInputs:
        """Return the tensors that the network needs of a batch beside the features, for its ONNX file.

        Raises:
            InputError: the network can't be written as ONNX.
        """
        raise InputError(
            "network.name",
            self.name,
            "must be a network that can be written as ONNX; this one doesn't define its inputs",
        )

    def shift_scores(self, model: nn.Module, offsets: Tensor) -> None:
        """Add offsets (C,) to the class scores of a network, in place: to the bias of its last linear layer.

        Raises:
            InputError: the network's last linear layer hasn't as many outputs.
        """
        layers = [layer for layer in model.modules() if isinstance(layer, nn.Linear)]
        bias = layers[-1].bias if layers and layers[-1].out_features == len(offsets) else None
        if bias is None:
            raise InputError("fitted_offsets", True, f"needs a network with a last linear layer; {self.name} has none")
        with torch.no_grad():
            bias.add_(offsets.to(bias))
