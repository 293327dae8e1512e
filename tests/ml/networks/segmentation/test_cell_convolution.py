"""Convolution over filled cells against PyTorch's own on the whole box, in both ways in which it is computed."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from ml.networks.segmentation import cell_convolution
from ml.networks.segmentation.cell_convolution import Around, CellConvolution, _Gathered, _Pairwise
from ml.networks.segmentation.cells import Grid, build_cells

FEW, MANY = 3, 5
WAYS = [_Pairwise, _Gathered]


def filled(cross: bool = False) -> tuple[Tensor, Tensor]:
    """Return the cells (M, 3) of a box of 6 x 5 x 4 that are filled, and which lie around each."""
    box = torch.cartesian_prod(torch.arange(6), torch.arange(5), torch.arange(4))
    chosen = torch.rand(len(box), generator=torch.Generator().manual_seed(1)) < 0.4
    chosen[0] = True
    coord = (box[chosen].double() + 0.5) * 0.5
    grid = Grid(cell=0.5, stages=1, attention_from=1, cross=cross, curves=("hilbert",), patch=8)
    cells = build_cells(coord, torch.tensor([len(coord)]), grid)
    assert torch.equal(cells["cell0"], torch.arange(len(coord)))
    return box[chosen], cells["near0"]


@pytest.mark.parametrize("chunk", [1, 1 << 26])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cross", [False, True])
def test_equals_a_convolution_of_the_whole_box(
    way: type, cross: bool, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cell_convolution, "_CHUNK", chunk)
    cells, near = filled(cross)
    torch.manual_seed(2)
    values = torch.randn(len(cells), FEW, dtype=torch.float64)
    weight = torch.randn(near.shape[1], FEW, MANY, dtype=torch.float64)
    whole = torch.zeros(27, FEW, MANY, dtype=torch.float64)
    whole[[4, 10, 12, 13, 14, 16, 22] if cross else slice(None)] = weight
    box = torch.zeros(1, FEW, 6, 5, 4, dtype=torch.float64)
    box[0, :, cells[:, 0], cells[:, 1], cells[:, 2]] = values.T
    wanted = F.conv3d(box, whole.permute(2, 1, 0).reshape(MANY, FEW, 3, 3, 3), padding=1)
    assert torch.allclose(
        way.apply(values, weight, Around(near)), wanted[0][:, cells[:, 0], cells[:, 1], cells[:, 2]].T
    )


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cross", [False, True])
def test_gradients(way: type, cross: bool) -> None:
    cells, near = filled(cross)
    values = torch.randn(len(cells), FEW, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(near.shape[1], FEW, MANY, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda a, b: way.apply(a, b, Around(near)), (values, weight))


@pytest.mark.parametrize("way", WAYS)
def test_no_cells(way: type) -> None:
    near, values = torch.zeros(0, 27, dtype=torch.int32), torch.zeros(0, FEW, requires_grad=True)
    weight = torch.ones(27, FEW, MANY, requires_grad=True)
    result = way.apply(values, weight, Around(near))
    result.sum().backward()
    assert result.shape == (0, MANY)
    assert not weight.grad.any()


@pytest.mark.parametrize("way", WAYS)
def test_sums_of_bfloat16_are_as_good_as_its_numbers(way: type, monkeypatch: pytest.MonkeyPatch) -> None:
    """Products have errors of 0.2 %; added up in bfloat16 results or weights' gradients would have 0.35 to 0.4 %."""
    monkeypatch.setattr(cell_convolution, "_CHUNK", 1)
    cells, near = filled()
    torch.manual_seed(3)
    half = [torch.randn(len(cells), 32).bfloat16(), (torch.randn(27, 32, MANY) * 0.1).bfloat16()]
    gradient = torch.randn(len(cells), MANY).bfloat16()
    found = []
    for dtype in (torch.bfloat16, torch.float64):
        values, weight = (each.detach().to(dtype).requires_grad_() for each in half)
        result = way.apply(values, weight, Around(near))
        result.backward(gradient.to(dtype))
        found.append([result.detach(), values.grad, weight.grad])
    for near_it, exact in zip(*found, strict=True):
        assert near_it.dtype == torch.bfloat16
        assert (near_it.double() - exact).abs().mean() < 0.0028 * exact.abs().mean()


def test_a_layer_computes_in_bfloat16_where_the_rest_does() -> None:
    cells, near = filled()
    layer, values = CellConvolution(27, 32, MANY), torch.randn(len(cells), 32)
    with torch.autocast("cpu", torch.bfloat16):
        half = layer(values, Around(near))
    half.float().square().sum().backward()
    assert half.dtype == torch.bfloat16
    assert layer.weight.grad.dtype == torch.float32
    assert (half - layer(values, Around(near))).abs().max() < 0.05
