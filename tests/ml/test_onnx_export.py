"""Networks as ONNX files say what PyTorch says, on the example and on other lengths; skipped without ONNX Runtime."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest
import torch
from pydantic import Field

from ml.centerline.exporting import exportable_network as exportable_centerline
from ml.centerline.predictor import CenterlinePredictor, UseOptions
from ml.centerline.task import _first_model
from ml.configuration import load_configuration
from ml.networks.base import SegmentationNetwork
from ml.onnx_export import TOLERANCE, Exportable, largest_difference, onnx_bytes, write_onnx
from ml.segmentation.exporting import exportable_network as exportable_segmentation
from ml.segmentation.network import build
from ml.segmentation.recipes import SegmentationConfiguration
from synthroads_addon.base.errors import InputError, OutputError

for _package in ("onnx", "onnxscript", "onnxruntime"):
    pytest.importorskip(_package, reason="needs onnx, onnxscript and onnxruntime: pip install '.[onnx]'")
pytestmark = pytest.mark.slow


def centerline() -> Exportable:
    small = ["network.width=16", "network.context=16", "network.heads=2", "network.layers=1", "network.cells=4"]
    configuration = load_configuration("centerline-transformer", small)
    model = _first_model(configuration).eval()
    return exportable_centerline(CenterlinePredictor(model, configuration.slices, UseOptions(), {}), 1)


def segmentation() -> Exportable:
    changes = ["network.width=8", 'data.synthetic=[{"path": "roads"}]']
    configuration = load_configuration("segmentation-any-scanner", changes)
    torch.manual_seed(1)
    return exportable_segmentation(build(configuration).eval(), configuration)


def transformer() -> SegmentationConfiguration:
    changes = ["network.channels=[12, 12, 24]", "network.blocks=[1, 1, 2]", "network.head_width=12", "network.patch=64"]
    found: SegmentationConfiguration = load_configuration(
        "segmentation-transformer", [*changes, 'data.synthetic=[{"path": "roads"}]']
    )
    return found


def segmentation_transformer() -> Exportable:
    configuration = transformer()
    torch.manual_seed(1)
    return exportable_segmentation(build(configuration).eval(), configuration)


@pytest.mark.parametrize("network", [centerline, segmentation, segmentation_transformer])
def test_onnx_runtime_says_what_pytorch_says(network: object, tmp_path: Path) -> None:
    made = network()  # type: ignore[operator]
    told = write_onnx(made, tmp_path / "model.onnx")
    assert told["difference"] < TOLERANCE
    assert told["bytes"] == (tmp_path / "model.onnx").stat().st_size
    with pytest.raises(OutputError, match="there already"):
        write_onnx(made, tmp_path / "model.onnx")


def test_lengths_are_free_and_another_network_is_told_apart() -> None:
    made = centerline()
    content = onnx_bytes(made)
    longer = {name: torch.cat([value, value, value]) for name, value in made.inputs.items()}
    difference = largest_difference(replace(made, inputs=longer), content)
    assert difference is not None
    assert difference < TOLERANCE
    other = centerline()
    with torch.no_grad():
        for weight in other.model.parameters():
            weight.add_(0.05)
    changed = largest_difference(replace(made, model=other.model), content)
    assert changed is not None
    assert changed > TOLERANCE


def test_clouds_of_a_transformer_may_be_of_any_size() -> None:
    """Fewer points and one cloud, then more and larger ones: other numbers of cells and patches, and longer patches."""
    configuration, made = transformer(), segmentation_transformer()
    content = onnx_bytes(made)
    draw = torch.Generator().manual_seed(7)
    for counts, edge in (([300], 5.0), ([4000, 70, 900, 2000, 10], 20.0)):
        coord = torch.rand(sum(counts), 3, generator=draw) * torch.tensor([edge, edge, 2.0])
        found = configuration.network.onnx_inputs({"coord": coord, "offset": torch.tensor(counts).cumsum(0)})
        feat = torch.randn(sum(counts), len(configuration.features), generator=draw)
        difference = largest_difference(replace(made, inputs={"feat": feat, **found.inputs}), content)
        assert difference is not None
        assert difference < TOLERANCE


def test_a_network_that_says_nothing_of_its_clouds_is_refused() -> None:
    class Silent(SegmentationNetwork):
        name: Literal["silent"] = Field("silent")

    configuration = transformer().model_copy(update={"network": Silent()})
    with pytest.raises(InputError, match=r"network.name is 'silent': must be a network that can be written as ONNX"):
        exportable_segmentation(torch.nn.Identity(), configuration)


def test_a_difference_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ml.onnx_export.onnx_bytes", lambda network: b"x")
    monkeypatch.setattr("ml.onnx_export.largest_difference", lambda network, content: 0.01)
    with pytest.raises(InputError, match=r"within 0\.0001"):
        write_onnx(centerline(), tmp_path / "model.onnx")
    assert not (tmp_path / "model.onnx").exists()
