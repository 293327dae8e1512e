"""Codes along space-filling curves: each cell has its own, and what follows each other is near."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from ml.networks.segmentation.curves import BITS, CURVES, Curve, curve_codes

EDGE = 16


def cube(corner: int = 0) -> Tensor:
    """Return all cells of a cube of 16 cells with its lowest corner at a multiple of 16 on each axis."""
    steps = torch.arange(corner, corner + EDGE)
    return torch.cartesian_prod(steps, steps, steps)


@pytest.mark.parametrize("corner", [0, 48, (1 << BITS) - EDGE])
@pytest.mark.parametrize("curve", CURVES)
def test_a_cube_is_filled_without_a_gap_and_no_code_is_another_cells(curve: Curve, corner: int) -> None:
    """An aligned cube is one piece of the curve, so that its codes are as many numbers in a row."""
    codes = curve_codes(cube(corner), curve).sort().values
    assert torch.equal(codes, torch.arange(EDGE**3) + codes[0])
    assert codes[0] >= 0
    assert codes[-1] < 1 << (3 * BITS)


@pytest.mark.parametrize("curve", CURVES)
def test_far_cells_have_codes_of_their_own(curve: Curve) -> None:
    draw = torch.Generator().manual_seed(1)
    cells = torch.randint(0, 1 << BITS, (20_000, 3), generator=draw).unique(dim=0)
    assert len(curve_codes(cells, curve).unique()) == len(cells)


@pytest.mark.parametrize("curve", ["hilbert", "hilbert-transposed"])
def test_cells_that_follow_each_other_along_hilberts_curve_share_a_face(curve: Curve) -> None:
    cells = cube()
    steps = cells[curve_codes(cells, curve).argsort()].diff(dim=0)
    assert torch.equal(steps.abs().sum(dim=1), torch.ones(EDGE**3 - 1, dtype=torch.int64))


def test_z_order_takes_the_bits_of_the_axes_in_turn() -> None:
    cells = torch.randint(0, 1 << BITS, (200, 3), generator=torch.Generator().manual_seed(2))
    texts = [[f"{number:0{BITS}b}" for number in cell] for cell in cells.tolist()]
    wanted = [int("".join(bit for bits in zip(*text, strict=True) for bit in bits), 2) for text in texts]
    assert curve_codes(cells, "z-order").tolist() == wanted


@pytest.mark.parametrize("curve", ["hilbert", "z-order"])
def test_transposed_curves_run_along_the_other_axis(curve: Curve) -> None:
    cells = cube()
    transposed: Curve = "hilbert-transposed" if curve == "hilbert" else "z-order-transposed"
    assert torch.equal(curve_codes(cells, transposed), curve_codes(cells[:, [1, 0, 2]], curve))
    assert not torch.equal(curve_codes(cells, transposed), curve_codes(cells, curve))
