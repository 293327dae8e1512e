"""Cells, what lies around them and patches of curves, against a plain computation cell by cell."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import pytest
import torch
from torch import Tensor

from ml.networks.segmentation.cells import LARGEST, Cells, Grid, build_cells
from ml.networks.segmentation.curves import CURVES, curve_codes
from synthroads_addon.base.errors import InputError

GRID = Grid(cell=0.25, stages=3, attention_from=1, cross=False, curves=CURVES, patch=16)
DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU"))]


def clouds(*counts: int, seed: int = 1) -> tuple[Tensor, Tensor]:
    """Return packed clouds of so many points in boxes of 3 m, here and there in the plane, and where they end."""
    draw = torch.Generator().manual_seed(seed)
    parts = [
        torch.rand(count, 3, generator=draw, dtype=torch.float64) * torch.tensor([3.0, 3.0, 0.8]) - 5.0 * number
        for number, count in enumerate(counts)
    ]
    ends = torch.tensor(counts, dtype=torch.int64).cumsum(0) if counts else torch.zeros(0, dtype=torch.int64)
    return torch.cat([torch.zeros(0, 3, dtype=torch.float64), *parts]), ends


def plain_places(coord: Tensor, offset: Tensor, stage: int) -> list[tuple[int, ...]]:
    """Return of each point its cloud and its cell of a stage, counted from its cloud's lowest cell."""
    found: list[tuple[int, ...]] = []
    begin = 0
    for cloud, end in enumerate(offset.tolist()):
        cells = [[int(value // 0.25) for value in point] for point in coord[begin:end].tolist()]
        low = [min(axis) for axis in zip(*cells, strict=True)]
        found += [(cloud, *((at - least) >> stage for at, least in zip(cell, low, strict=True))) for cell in cells]
        begin = end
    return found


def cell_of_points(cells: Cells, stage: int) -> Tensor:
    """Return the cell of a stage that each point lies in."""
    cell = cells["cell0"]
    for number in range(1, stage + 1):
        cell = cells[f"parent{number}"][cell]
    return cell


@pytest.mark.parametrize("stage", [0, 1, 2])
def test_points_lie_in_the_cells_of_a_grid_from_their_clouds_lowest_corner(stage: int) -> None:
    coord, offset = clouds(200, 1, 0, 300)
    cells = build_cells(coord, offset, GRID)
    places = plain_places(coord, offset, stage)
    known: dict[int, tuple[int, ...]] = dict(zip(cell_of_points(cells, stage).tolist(), places, strict=True))
    assert [known[cell] for cell in cell_of_points(cells, stage).tolist()] == places
    assert len(set(places)) == len(known) == max(known) + 1
    assert [known[cell] for cell in range(len(known))] == sorted(set(places))
    counts = [sum(place[0] == cloud for place in set(places)) for cloud in range(4)]
    assert cells[f"ends{stage}"].tolist() == torch.tensor(counts).cumsum(0).tolist()
    if stage:
        assert cells[f"grid{stage}"].tolist() == [list(known[cell][1:]) for cell in range(len(known))]
    else:
        together = [places.count(place) for place in places]
        assert cells["share0"].tolist() == pytest.approx([1 / number for number in together])
        within = [[value / 0.25 - value // 0.25 - 0.5 for value in point] for point in coord.tolist()]
        assert torch.allclose(cells["inside0"], torch.tensor(within, dtype=torch.float64))


@pytest.mark.parametrize("cross", [False, True])
@pytest.mark.parametrize("stage", [0, 1, 2])
def test_cells_around_are_those_of_the_same_cloud_a_step_away(stage: int, cross: bool) -> None:
    coord, offset = clouds(150, 200)
    cells = build_cells(coord, offset, replace(GRID, attention_from=3, cross=cross))
    number = dict(zip(plain_places(coord, offset, stage), cell_of_points(cells, stage).tolist(), strict=True))
    steps = [step for step in product((-1, 0, 1), repeat=3) if not cross or sum(map(abs, step)) < 2]
    near = cells[f"near{stage}"]
    assert near.shape == (len(number), len(steps))
    for (cloud, *place), cell in number.items():
        around = [(cloud, *(at + step for at, step in zip(place, one, strict=True))) for one in steps]
        assert near[cell].tolist() == [number.get(one, len(number)) for one in around]


@pytest.mark.parametrize("stage", [1, 2])
def test_children_are_the_cells_within(stage: int) -> None:
    coord, offset = clouds(150, 200)
    cells = build_cells(coord, offset, GRID)
    parent, children = cells[f"parent{stage}"], cells[f"children{stage}"]
    for cell, within in enumerate(children.tolist()):
        assert set(within) == set(torch.nonzero(parent == cell)[:, 0].tolist())


@pytest.mark.parametrize("counts", [(400, 30, 0, 1, 900), (7,), (5, 6), (1000,)])
def test_each_cell_is_asked_once_in_a_patch_of_its_own_cloud_and_curve(counts: tuple[int, ...]) -> None:
    cells = build_cells(*clouds(*counts), GRID, always_masked=True)
    for stage in (1, 2):
        patch, place, filled = (cells[f"{name}{stage}"] for name in ("patch", "place", "filled"))
        count, ends = len(cells[f"grid{stage}"]), cells[f"ends{stage}"]
        cloud = torch.searchsorted(ends, torch.arange(count), right=True)
        sizes = torch.bincount(cloud, minlength=len(counts))
        assert patch.shape[2] <= GRID.patch
        assert patch.shape[2] % 8 == 0
        assert len(filled) == sum(-(-int(size) // GRID.patch) for size in sizes)
        for number, curve in enumerate(CURVES):
            assert torch.equal(patch[number].flatten()[place[number]], torch.arange(count))
            assert bool(filled.flatten()[place[number]].all())
            codes = curve_codes(cells[f"grid{stage}"].long(), curve)
            rank = torch.empty(count, dtype=torch.int64)
            rank[torch.argsort(cloud << 48 | codes)] = torch.arange(count)
            for row, kept in zip(patch[number], filled, strict=True):
                assert len(cloud[row].unique()) == 1  # where nothing is filled in, too
                assert rank[row[kept]].diff().eq(1).all()  # a stretch of the curve
                assert kept.sum() == min(patch.shape[2], int(sizes[cloud[row[0]]]))


def test_a_mask_is_made_only_where_a_patch_is_not_full() -> None:
    large = Grid(cell=0.25, stages=1, attention_from=0, cross=False, curves=("hilbert",), patch=16)
    assert "filled0" not in build_cells(*clouds(500), large)
    assert "filled0" not in build_cells(*clouds(0, 500, 400), large)
    assert bool(build_cells(*clouds(500), large, always_masked=True)["filled0"].all())
    assert not bool(build_cells(*clouds(500, 3), large)["filled0"].all())


def test_the_order_of_the_points_does_not_matter() -> None:
    coord, offset = clouds(300)
    order = torch.randperm(300, generator=torch.Generator().manual_seed(4))
    one, other = build_cells(coord, offset, GRID), build_cells(coord[order], offset, GRID)
    for name, value in one.items():
        wanted = value[order] if name in ("cell0", "share0", "inside0") else value
        assert torch.equal(other[name], wanted), name


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("counts", [(), (0,), (1,), (0, 0), (0, 40, 0), (1, 1)])
def test_takes_clouds_of_any_size(counts: tuple[int, ...], device: str) -> None:
    coord, offset = clouds(*counts)
    wanted = build_cells(coord, offset, GRID)
    found = build_cells(coord.to(device), offset.to(device), GRID)
    assert all(value.device.type == device for value in found.values())
    assert {name: value.tolist() for name, value in found.items()} == {
        name: value.tolist() for name, value in wanted.items()
    }


@pytest.mark.parametrize(
    ("coord", "offset", "field"),
    [
        (torch.rand(4, 3), [3], "offset"),
        (torch.rand(4, 3), [5, 4], "offset"),
        (torch.rand(4, 3), [-1, 4], "offset"),
        (torch.rand(4, 3), [], "offset"),
        (torch.rand(4, 2), [4], "coord"),
        (torch.zeros(4, 3, dtype=torch.int64), [4], "coord"),
        (torch.full((4, 3), torch.nan), [4], "coord"),
        (torch.full((4, 3), torch.inf), [4], "coord"),
        (torch.zeros(0, 3), [0] * 20_000, "offset"),
    ],
)
def test_what_does_not_fit_is_refused(coord: Tensor, offset: list[int], field: str) -> None:
    with pytest.raises(InputError, match=field):
        build_cells(coord, torch.tensor(offset, dtype=torch.int64), GRID)


def test_a_cloud_may_be_as_wide_as_cells_have_numbers() -> None:
    ends = torch.tensor([2])
    coord = torch.tensor([[0.1, 0.1, 0.1], [0.1, 0.1 + 0.25 * (LARGEST - 1), 0.1]], dtype=torch.float64)
    found = build_cells(coord, ends, replace(GRID, attention_from=3))
    assert found["near0"].ne(2).sum() == 2
    coord[1, 1] += 0.25
    with pytest.raises(InputError, match=r"network.cell is 0.25: must be so large .* 65535 wide"):
        build_cells(coord, ends, GRID)
