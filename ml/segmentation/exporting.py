"""A trained segmentation network as ONNX takes it: features and prepared neighbourhoods in, class scores out."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ..data.classes import class_names
from ..onnx_export import Exportable, metadata_texts
from .recipes import SegmentationConfiguration

_CLOUDS = 3
"""Clouds of the example."""
_POINTS = 600
"""Points of each."""
_CUBE = 8.0
"""Edge of the flat box that they lie in, m. Chosen: enough to fill some cells of each stage."""


class _FromTensors(nn.Module):
    """A segmentation network whose batch comes as single tensors."""

    def __init__(self, model: nn.Module, names: tuple[str, ...]) -> None:
        super().__init__()
        self.model, self.names = model, names

    def forward(self, *tensors: Tensor) -> tuple[Tensor]:
        """Return the class scores (N, C) of N points from their features (N, F) and the prepared geometry, in order."""
        feat, *prepared = tensors
        return (self.model(feat, dict(zip(self.names, prepared, strict=True))),)


def exportable_network(model: nn.Module, configuration: SegmentationConfiguration) -> Exportable:
    """Return a trained network with an example, random points, to be written as ONNX.

    The geometry that the network needs (the stages' points, their neighbours) are inputs beside the features.

    Args:
        model: the trained network.
        configuration: configuration of its training.

    Raises:
        InputError: the network can't be written as ONNX.
    """
    generator = torch.Generator().manual_seed(configuration.seed)
    points = _CLOUDS * _POINTS
    coord = torch.rand(points, 3, generator=generator) * torch.tensor([_CUBE, _CUBE, 1.0])
    offset = torch.arange(_POINTS, points + 1, _POINTS)
    geometry = configuration.network.onnx_inputs({"coord": coord, "offset": offset})
    feat = torch.randn(points, len(configuration.features), generator=generator)
    names = tuple(geometry.inputs)
    dynamic = {"feat": {0: "points0"}, **geometry.lengths}
    metadata = metadata_texts(
        task="segmentation",
        classes=list(class_names(configuration.scheme())),
        features=list(configuration.features),
        voxel=configuration.voxel,
        intensity=configuration.intensity,
        network=configuration.network.to_dict(),
    )
    tensor_model = _FromTensors(model, names).eval()
    return Exportable(tensor_model, {"feat": feat, **geometry.inputs}, dynamic, ("scores",), metadata)
