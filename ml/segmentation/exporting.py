"""A trained segmentation network as ONNX takes it: features and prepared neighbourhoods in, class scores out."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError

from ..data.classes import class_names
from ..onnx_export import Exportable, described
from .recipes import SegmentationConfiguration

_POINTS = 600
_CUBE = 8.0
"""Points of the example, and the edge of the flat box that they lie in, m."""


class _FromTensors(nn.Module):
    """A segmentation network whose batch comes as single tensors."""

    def __init__(self, model: nn.Module, names: tuple[str, ...]) -> None:
        super().__init__()
        self.model, self.names = model, names

    def forward(self, *tensors: Tensor) -> tuple[Tensor]:
        """Return the class scores (N, C) of N points, of their features (N, F) and what was prepared, in order."""
        feat, *prepared = tensors
        return (self.model(feat, dict(zip(self.names, prepared, strict=True))),)


def exportable_network(model: nn.Module, configuration: SegmentationConfiguration) -> Exportable:
    """Return a trained network with an example, random points, to be written as ONNX.

    What `prepare` finds on the CPU (the stages' points and who looks at whom) are inputs beside the features.

    Args:
        model: the trained network.
        configuration: that it was trained by.

    Raises:
        InputError: the network prepares something else than PointNeXt does.
    """
    draw = torch.Generator().manual_seed(configuration.seed)
    coord = torch.rand(_POINTS, 3, generator=draw) * torch.tensor([_CUBE, _CUBE, 1.0])
    batch = configuration.network.prepare({"coord": coord, "offset": torch.tensor([_POINTS])})
    prepared = {name: value for name, value in batch.items() if name not in ("coord", "offset")}
    prepared = {name: value for name, value in prepared.items() if not name.startswith("offset")}
    if "positions0" not in prepared:
        raise InputError("network.name", configuration.network.name, "can't be written as ONNX; pointnext can")
    feat = torch.randn(_POINTS, len(configuration.features), generator=draw)
    names = tuple(prepared)
    dynamic = {"feat": {0: "points0"}, **{name: {0: f"points{_level(name)}"} for name in names}}
    metadata = described(
        task="segmentation",
        classes=list(class_names(configuration.scheme())),
        features=list(configuration.features),
        voxel=configuration.voxel,
        intensity=configuration.intensity,
        network=configuration.network.to_dict(),
    )
    wrapped = _FromTensors(model, names).eval()
    return Exportable(wrapped, {"feat": feat, **prepared}, dynamic, ("scores",), metadata)


def _level(name: str) -> int:
    """Return the stage whose points an array of `Neighbours` has rows for."""
    stage = int(name[-1])
    return stage - 1 if name[:-1] in ("nearest", "weight") else stage
