"""Neighbours found by sorting, as on GPUs: the same as by k-d trees, for clouds of every size and shape."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from ml.networks.segmentation import gpu_neighbours, neighbours
from ml.networks.segmentation.neighbours import Neighbourhood
from synthroads_addon.base.errors import InputError

DEVICES = ["cpu", *(["cuda"] if torch.cuda.is_available() else [])]
HALF = Neighbourhood(radius=0.6, neighbours=4, inner=(True, False, True))


def cloud(sizes: list[int], dtype: torch.dtype = torch.float32, *, seed: int = 0) -> tuple[Tensor, Tensor]:
    """Return packed random clouds, each of an extent of its own, and where they end."""
    generator = torch.Generator().manual_seed(seed)
    size = torch.tensor([4.0, 3.0, 0.5], dtype=dtype)
    parts = [torch.rand(count, 3, generator=generator, dtype=dtype) * size * 2.0**k for k, count in enumerate(sizes)]
    return torch.cat([torch.zeros(0, 3, dtype=dtype), *parts]), torch.tensor(sizes, dtype=torch.long).cumsum(0)


def assert_same(coord: Tensor, offset: Tensor, neighbourhood: Neighbourhood, device: str = "cpu") -> None:
    wanted = neighbours.build_neighbours(coord, offset, neighbourhood)
    found = gpu_neighbours.build_neighbours(coord.to(device), offset.to(device), neighbourhood)
    assert found.keys() == wanted.keys()
    for name, value in wanted.items():
        here = found[name].cpu()
        assert here.dtype == value.dtype, name
        if name.startswith("weight"):
            assert torch.allclose(here, value, rtol=1e-6, atol=1e-12), name
        else:
            assert torch.equal(here, value), name


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("sizes", [[], [0], [1], [2, 0, 1, 3], [0, 400, 30, 0, 1, 250]])
@pytest.mark.parametrize("neighbourhood", [Neighbourhood(), HALF])
def test_finds_what_trees_find(sizes: list[int], dtype: torch.dtype, device: str, neighbourhood: Neighbourhood) -> None:
    assert_same(*cloud(sizes, dtype), neighbourhood, device)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 60), max_size=4), st.integers(0, 10**6), st.floats(0.05, 3.0))
def test_finds_what_trees_find_in_any_cloud(sizes: list[int], seed: int, radius: float) -> None:
    assert_same(*cloud(sizes, torch.float64, seed=seed), Neighbourhood(radius, 5, (True, True)))


def test_points_exactly_at_the_radius_and_equally_far_ones() -> None:
    steps = torch.arange(9, dtype=torch.float64) / 8
    lattice = torch.cartesian_prod(steps, steps, steps[:3])
    offset = torch.tensor([len(lattice)])
    wanted = neighbours.build_neighbours(lattice, offset, Neighbourhood(0.25, 16))
    found = gpu_neighbours.build_neighbours(lattice, offset, Neighbourhood(0.25, 16))
    for name in (each for each in wanted if each[:-1] in ("sample", "group", "inner", "positions")):
        assert torch.equal(found[name], wanted[name]), name
    for stage in (1, 2, 3, 4):  # of equally near ones either may be taken
        assert torch.allclose(found[f"weight{stage}"], wanted[f"weight{stage}"])


def test_the_nearest_three_are_found_however_far_they_are() -> None:
    coord = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [50.0, 0, 0], [0, 300.0, 0], [0, 0, 2.0]])
    assert_same(coord, torch.tensor([5]), Neighbourhood())
    assert_same(torch.cat([coord, coord + 7.0]), torch.tensor([5, 10]), Neighbourhood())


def test_many_queries_are_done_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    coord, offset = cloud([200, 0, 90])
    whole = gpu_neighbours.build_neighbours(coord, offset, Neighbourhood())
    monkeypatch.setattr(gpu_neighbours, "_PAIRS", {"cpu": 50})
    parts = gpu_neighbours.build_neighbours(coord, offset, Neighbourhood())
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


def test_what_it_cannot_search_is_refused() -> None:
    with pytest.raises(InputError, match=r"sampling is .farthest"):
        gpu_neighbours.build_neighbours(*cloud([5]), Neighbourhood(sampling="farthest"))
    far = torch.tensor([[0.0, 0, 0], [1e9, 1e9, 1e9]], dtype=torch.float64)
    with pytest.raises(InputError, match="2\\^62 cells"):
        gpu_neighbours.build_neighbours(far, torch.tensor([2]), Neighbourhood())
    with pytest.raises(InputError, match="offset"):
        gpu_neighbours.build_neighbours(torch.zeros(4, 3), torch.tensor([3]), Neighbourhood())
