"""Stages of clouds: sampling, neighbours, interpolation weights, packing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from torch import Tensor
from torch.utils.data import DataLoader

from ml.data.points import voxel_sample
from ml.networks.segmentation import neighbours
from ml.networks.segmentation.neighbours import (
    Neighbourhood,
    Neighbours,
    build_neighbours,
    farthest_sample,
    geometric_order,
)
from synthroads_addon.base.errors import InputError

FARTHEST = Neighbourhood(sampling="farthest")
SMALL = Neighbourhood(radius=0.3, neighbours=8, inner=(True,))


def cloud(count: int, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    size = torch.tensor([2.0, 2.0, 0.4], dtype=torch.float64)
    return torch.rand(count, 3, generator=generator, dtype=torch.float64) * size


def in_order(points: Tensor) -> Tensor:
    """Return points in the order of which the first ones in a ball are taken."""
    return points[torch.from_numpy(geometric_order(neighbours._centre_cloud(points.numpy())))]


def lattice() -> Tensor:
    """Points in steps of 1/8 m: many equal distances, and many exactly as long as a radius."""
    steps = torch.arange(9, dtype=torch.float64) / 8
    return torch.cartesian_prod(steps, steps, steps[:3])


def single(points: Tensor, neighbourhood: Neighbourhood) -> Neighbours:
    return build_neighbours(points, torch.tensor([len(points)]), neighbourhood)


def brute_force_ball(queries: Tensor, support: Tensor, radius: float, limit: int) -> list[list[int]]:
    """The first `limit` points nearer than the radius; where there are fewer, the first of them again."""
    rows = []
    for query in queries:
        near = [j for j, other in enumerate(support) if float((other - query).norm()) < radius][:limit]
        rows.append(near + [near[0]] * (limit - len(near)))
    return rows


@pytest.mark.parametrize("limit", [4, 32])
def test_neighbours_are_the_first_in_the_ball_and_few_are_padded_with_the_first(limit: int) -> None:
    found = single(in_order(cloud(300)), replace(FARTHEST, neighbours=limit))
    for stage in (1, 2, 3, 4):
        before, own = found[f"positions{stage - 1}"], found[f"positions{stage}"]
        radius = 0.3 * 2 ** (stage - 1)
        assert found[f"group{stage}"].tolist() == brute_force_ball(own, before, radius, limit)
        assert found[f"inner{stage}"].tolist() == brute_force_ball(own, own, 2 * radius, limit)


def test_three_points_fill_eight_places() -> None:
    points = in_order(torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]))
    found = single(points, replace(SMALL, sampling="farthest"))
    assert found["sample1"].tolist() == [0]
    assert found["group1"].tolist() == [[0, 1, 2, 0, 0, 0, 0, 0]]
    assert found["inner1"].tolist() == [[0] * 8]


def test_a_point_exactly_at_the_radius_is_no_neighbour() -> None:
    points = torch.tensor([[0.0, 0, 0], [0.25, 0, 0], [0.0, 0.125, 0]])
    for order in ([0, 1, 2], [1, 0, 2]):
        found = single(points[order], replace(SMALL, radius=0.25, neighbours=3, sampling="farthest"))
        first, near = found["sample1"][0], set(found["group1"][0].tolist())
        assert near == {int(first)} | {k for k in range(3) if (points[order][k] - points[order][first]).norm() < 0.25}


def test_neighbours_are_spread_over_the_ball() -> None:
    """Of 1,000 points in a ball 32 are taken from all of it, and not the nearest ones."""
    generator = torch.Generator().manual_seed(2)
    points = torch.rand(1500, 3, generator=generator, dtype=torch.float64) - 0.5
    found = single(points, Neighbourhood(radius=0.5, inner=(True,)))
    own = found["positions1"]
    middle = int(own.square().sum(dim=1).argmin())
    distance = (found["positions0"][found["group1"][middle].long()] - own[middle]).norm(dim=1)
    assert float(distance.mean()) == pytest.approx(0.375, abs=0.05)  # of a full ball: 3/4 of the radius
    assert float(distance.max()) > 0.4


def test_the_farthest_points_are_taken_and_of_equal_ones_the_first() -> None:
    points = cloud(80).numpy()
    chosen = [0]
    for _ in range(19):
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(distance.argmax()))
    assert farthest_sample(points, 20).tolist() == chosen
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert farthest_sample(corners, 4).tolist() == [0, 2, 1, 3]


@pytest.mark.parametrize(("count", "kept"), [(1, 1), (3, 1), (4, 1), (7, 1), (8, 2), (100, 25)])
def test_one_in_four_stays_and_at_least_one(count: int, kept: int) -> None:
    found = single(cloud(count), replace(SMALL, sampling="farthest"))
    assert found["positions1"].shape == (kept, 3)


def test_each_cell_keeps_the_point_nearest_to_its_middle() -> None:
    points = np.array([[0.0, 0, 0], [0.4, 0.4, 0.4], [0.9, 0.1, 0.1], [1.2, 0.5, 0.5], [1.3, 0.5, 0.5], [2.5, 0, 0]])
    assert voxel_sample(points, 1.0).tolist() == [1, 4, 5]
    equal = np.array([[0.0, 0, 0], [0.25, 0.5, 0.5], [0.75, 0.5, 0.5]])
    assert voxel_sample(equal, 1.0).tolist() == [1]


def test_about_a_fourth_of_a_surface_stays() -> None:
    plane = cloud(40_000, 3) * torch.tensor([2.0, 2.0, 0.0], dtype=torch.float64)
    plane = plane[torch.from_numpy(voxel_sample(plane.numpy(), 0.1))]  # a training voxel of 0.1 m
    sizes = single(plane, Neighbourhood())["positions1"].shape[0], len(plane)
    assert sizes[0] / sizes[1] == pytest.approx(0.25, abs=0.03)


def test_weights_go_by_inverse_distance_to_the_nearest_three() -> None:
    found = single(cloud(200), FARTHEST)
    here, thin = found["positions0"], found["positions1"]
    distance, index = torch.cdist(here, thin).topk(3, largest=False)
    weight = 1 / (distance + 1e-8)
    assert torch.equal(found["nearest1"].long(), index)
    assert torch.allclose(found["weight1"], weight / weight.sum(dim=1, keepdim=True), atol=1e-7)
    at_itself = found["weight1"][found["sample1"]]
    assert torch.allclose(at_itself, torch.tensor([1.0, 0, 0], dtype=torch.float64).expand_as(at_itself), atol=1e-6)


@pytest.mark.parametrize(("kept", "expected"), [([0.0], [1.0, 0, 0]), ([0.0, 1.0], [0.5, 0.5, 0])])
def test_fewer_than_three_points_share_the_weight(kept: list[float], expected: list[float]) -> None:
    tree = cKDTree(np.column_stack([kept, np.zeros((len(kept), 2))]))
    nearest, weight = neighbours.nearest_three(np.array([[0.5, 0, 0]]), tree)
    assert weight[0].tolist() == pytest.approx(expected)
    assert int(nearest.max()) < len(kept)


def test_the_order_of_the_points_changes_nothing_but_the_order() -> None:
    """Also where distances are equal."""
    for points in (cloud(400), lattice()):
        order = torch.randperm(len(points), generator=torch.Generator().manual_seed(1))
        for sampling in ("grid", "farthest"):
            neighbourhood = Neighbourhood(sampling=sampling)
            plain, turned = single(points, neighbourhood), single(points[order], neighbourhood)
            for name in ("sample1", "group1"):
                assert torch.equal(plain[name].long(), order[turned[name].long()]), name
            for name in ("nearest1", "weight1", "positions0"):
                assert torch.equal(plain[name][order], turned[name]), name
            rest = set(plain) - {"sample1", "group1", "nearest1", "weight1", "positions0"}
            assert all(torch.equal(plain[name], turned[name]) for name in rest)


def test_a_batch_holds_what_its_clouds_hold() -> None:
    clouds = [cloud(150, 1), cloud(0), cloud(1, 2), cloud(90, 3)]
    offset = torch.tensor([150, 150, 151, 241])
    packed = build_neighbours(torch.cat(clouds), offset, Neighbourhood())
    into = {"sample": -1, "group": -1, "inner": 0, "nearest": 0}
    for number, points in enumerate(clouds):
        alone = single(points, Neighbourhood())
        for name, value in alone.items():
            kind, stage = name[:-1], int(name[-1])
            if kind == "offset":
                continue
            rows_of = stage - 1 if kind in ("nearest", "weight") else stage
            begin, end = torch.cat([torch.zeros(1).long(), packed[f"offset{rows_of}"]])[number : number + 2].tolist()
            shift = 0
            if kind in into:
                target = stage + into[kind]
                shift = int(torch.cat([torch.zeros(1).long(), packed[f"offset{target}"]])[number])
            assert torch.equal(packed[name][begin:end], value + shift), name


def test_nothing_but_empty_clouds() -> None:
    for offset in ([], [0], [0, 0]):
        found = build_neighbours(torch.zeros(0, 3), torch.tensor(offset, dtype=torch.long), Neighbourhood())
        assert found["group1"].shape == (0, 32)
        assert found["weight4"].shape == (0, 3)
        assert found["sample2"].shape == (0,)
        assert found["offset3"].tolist() == offset


def test_dtypes_follow_the_coordinates() -> None:
    found = single(cloud(50).float(), Neighbourhood())
    assert found["positions0"].dtype == found["weight1"].dtype == torch.float32
    assert found["group1"].dtype == found["inner1"].dtype == found["nearest1"].dtype == torch.int32
    assert found["sample1"].dtype == torch.int64
    assert not any(name.startswith("inner") for name in single(cloud(50), replace(SMALL, inner=(False,))))


def test_positions_are_counted_from_the_middle_of_the_extent() -> None:
    far = cloud(100) + torch.tensor([4.5e5, 5.6e6, 300.0], dtype=torch.float64)
    positions = single(far, Neighbourhood())["positions0"]
    assert torch.allclose(positions.amax(dim=0), -positions.amin(dim=0), atol=1e-9)
    assert float(positions.abs().max()) < 1.01


def test_many_queries_are_done_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = single(cloud(300), FARTHEST)
    monkeypatch.setattr(neighbours, "_CHUNK", 7)
    parts = single(cloud(300), FARTHEST)
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


def collate(clouds: list[Tensor]) -> Neighbours:
    ends = torch.tensor([len(points) for points in clouds]).cumsum(0)
    return build_neighbours(torch.cat(clouds), ends, Neighbourhood())


def test_workers_build_the_same() -> None:
    clouds = [cloud(60, seed) for seed in range(4)]
    here = [collate(clouds[:2]), collate(clouds[2:])]
    there = list(DataLoader(clouds, batch_size=2, num_workers=1, collate_fn=collate))
    assert all(torch.equal(a[name], b[name]) for a, b in zip(here, there, strict=True) for name in a)


@pytest.mark.parametrize(
    ("coord", "offset", "field"),
    [
        (torch.zeros(4, 2), [4], "coord"),
        (torch.zeros(4, 3, dtype=torch.long), [4], "coord"),
        (torch.full((4, 3), torch.nan), [4], "coord"),
        (torch.zeros(4, 3), [3], "offset"),
        (torch.zeros(4, 3), [5, 4], "offset"),
        (torch.zeros(4, 3), [-1, 4], "offset"),
        (torch.zeros(4, 3), [], "offset"),
        (torch.tensor([[0.0, 0, 0], [1e9, 1e9, 1e9]]), [2], "coord"),
    ],
)
def test_wrong_clouds_are_refused(coord: Tensor, offset: list[int], field: str) -> None:
    with pytest.raises(InputError, match=field):
        build_neighbours(coord, torch.tensor(offset, dtype=torch.long), Neighbourhood())
