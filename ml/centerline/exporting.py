"""A trained centreline network as ONNX takes it: slices in, centre and corridor with their deviations out."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from ..data.corridor import CORRIDOR
from ..data.slices import FEATURES
from ..networks.centerline.models import CenterlineModel
from ..onnx_export import Exportable, metadata_texts
from .predictor import CenterlinePredictor

INPUTS = ("coord", "feat", "mask", "frame")
"""Names of the exported network's inputs."""
OUTPUTS = ("center", "center_std", "corridor", "corridor_std")
"""Names of its outputs."""


class _FromTensors(nn.Module):
    """A centreline model whose batch comes as single tensors."""

    def __init__(self, model: CenterlineModel) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        """Return the model's `OUTPUTS` for `INPUTS` of B sequences of S slices: see `networks.centerline.models`."""
        outputs = self.model(dict(zip(INPUTS, tensors, strict=True)))
        return tuple(outputs[name] for name in OUTPUTS)


def exportable_network(predictor: CenterlinePredictor, seed: int) -> Exportable:
    """Return a trained network with an example, random points on a road seen in slices, to be written as ONNX.

    Args:
        predictor: the trained model.
        seed: seed of the random example.
    """
    settings = predictor.settings
    generator = torch.Generator().manual_seed(seed)
    shape = (2, settings.slices, min(settings.points_per_slice, 64))
    spread = torch.tensor([settings.thickness, 2.0 * settings.half_width, 0.5])
    frame = torch.zeros(*shape[:2], 4, dtype=torch.float64)
    frame[..., 0] = settings.spacing * torch.arange(settings.slices)
    inputs = {
        "coord": spread * (torch.rand(*shape, 3, generator=generator) - 0.5),
        "feat": torch.randn(*shape, len(FEATURES), generator=generator),
        "mask": torch.rand(*shape, generator=generator) < 0.9,
        "frame": frame,
    }
    points = {0: "sequences", 2: "points"}
    dynamic = {"coord": points, "feat": points, "mask": points, "frame": {0: "sequences"}}
    calibration: dict[str, Any] = {
        name: calibration_of_target.to_dict() for name, calibration_of_target in predictor.calibration.items()
    }
    metadata = metadata_texts(
        task="centerline",
        slices=settings.to_dict(),
        features=list(FEATURES),
        corridor=list(CORRIDOR),
        calibration=calibration,
    )
    return Exportable(_FromTensors(predictor.model).eval(), inputs, dynamic, OUTPUTS, metadata)
