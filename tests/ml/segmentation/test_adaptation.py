"""AdaBN and Mix3D."""

from __future__ import annotations

import copy
from collections.abc import Iterator

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from ml.networks.segmentation.grouping import Norm
from ml.networks.segmentation.neighbours import Neighbours, build_neighbours
from ml.networks.segmentation.pointnext import PointNeXtOptions
from ml.segmentation.network import adapt_norms, overlay_clouds
from synthroads_addon.base.errors import InputError

OPTIONS = PointNeXtOptions(preset="S", width=8, dropout=0.3)


def draw(count: int, seed: int) -> Tensor:
    return torch.randn(count, 3, generator=torch.Generator().manual_seed(seed)) * 2 + torch.tensor([5.0, 0.0, -3.0])


def small_network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(3, 4), nn.BatchNorm1d(4), nn.ReLU(), nn.Dropout(0.5), nn.Linear(4, 2))


def statistics(model: nn.Module) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in model.named_buffers()}


def same(one: dict[str, Tensor], other: dict[str, Tensor]) -> bool:
    return all(torch.equal(one[name], other[name]) for name in one)


def test_statistics_are_pooled_over_batches_of_different_sizes() -> None:
    model = small_network()
    batches = [draw(1000, 1), draw(300, 2) + 4.0]
    assert adapt_norms(model, batches, model) == 1300
    inner = model[0](torch.cat(batches)).detach()
    assert torch.allclose(model[1].running_mean, inner.mean(dim=0), atol=1e-5)
    assert torch.allclose(model[1].running_var, inner.var(dim=0), rtol=5e-3)


@pytest.mark.parametrize("training", [True, False])
def test_nothing_else_changes(training: bool) -> None:
    model = small_network().train(training)
    model[1].eval()
    weights = copy.deepcopy(dict(model.named_parameters()))
    adapt_norms(model, [draw(50, 1)], model)
    assert [each.training for each in model] == [training, False, training, training, training]
    assert model[1].momentum == 0.1
    assert model[1].num_batches_tracked == 0
    assert same(weights, dict(model.named_parameters()))


def test_dropout_has_no_say() -> None:
    model = nn.Sequential(nn.Dropout(0.5), nn.BatchNorm1d(3))
    adapt_norms(model, [draw(500, 1)], model)
    assert torch.allclose(model[1].running_mean, draw(500, 1).mean(dim=0), atol=1e-5)


def test_batches_without_statistics_have_no_say() -> None:
    """Of one point alone there is no variance."""
    norm = Norm(3)
    assert adapt_norms(norm, [draw(1, 2), draw(500, 1)], norm) == 501
    assert torch.allclose(norm.running_mean, draw(500, 1).mean(dim=0), atol=1e-5)


def test_no_gradient_is_kept() -> None:
    model, kept = small_network(), []
    adapt_norms(model, [draw(50, 1)], lambda batch: kept.append(model(batch)) or kept[-1])
    assert not kept[0].requires_grad


def test_an_error_leaves_the_old_statistics() -> None:
    model = small_network()

    def broken() -> Iterator[Tensor]:
        yield draw(50, 1)
        raise InputError("cloud", None, "is broken")

    old = statistics(model)
    with pytest.raises(InputError, match="broken"):
        adapt_norms(model, broken(), model)
    assert same(statistics(model), old)
    assert model.training


def test_no_points_are_refused() -> None:
    model = small_network()
    old = statistics(model)
    for batches in ([], [torch.zeros(0, 3)]):
        with pytest.raises(InputError, match="adaptation"):
            adapt_norms(model, batches, lambda batch: model(batch) if len(batch) else batch)
    assert same(statistics(model), old)


def domain(seed: int, scale: float, shift: float) -> tuple[Tensor, Neighbours, Tensor]:
    """Two classes that differ in a noisy intensity, which another scanner reports on another scale."""
    generator = torch.Generator().manual_seed(seed)
    coord = torch.rand(300, 3, generator=generator) * torch.tensor([4.0, 4.0, 0.3])
    label = (torch.rand(300, generator=generator) < 0.5).long()
    intensity = label + 0.1 * torch.randn(300, generator=generator)
    feat = torch.stack([intensity * scale + shift, 0.05 * torch.randn(300, generator=generator)], dim=1)
    return feat, build_neighbours(coord, torch.tensor([300]), OPTIONS.neighbourhood), label


def accuracy(model: nn.Module, cloud: tuple[Tensor, Neighbours, Tensor]) -> float:
    with torch.inference_mode():
        return float((model.eval()(cloud[0], cloud[1]).argmax(dim=1) == cloud[2]).float().mean())


def test_a_shifted_domain_is_recognised_again() -> None:
    torch.manual_seed(1)
    model = OPTIONS.build(2, 2)
    optimizer = torch.optim.AdamW(model.parameters(), lr=0.01)
    for step in range(50):
        feat, neighbours, label = domain(step, 1.0, 0.0)
        optimizer.zero_grad()
        F.cross_entropy(model.train()(feat, neighbours), label).backward()
        optimizer.step()
    own, other = domain(100, 1.0, 0.0), domain(101, 0.3, 2.0)
    assert accuracy(model, own) > 0.95
    assert accuracy(model, other) < 0.7
    batches = [domain(seed, 0.3, 2.0) for seed in (102, 103)]
    assert adapt_norms(model, batches, lambda batch: model(batch[0], batch[1])) == 600
    assert accuracy(model, other) > 0.9


@pytest.mark.parametrize(
    ("offset", "expected"),
    [([3, 5, 9, 12], [5, 12]), ([3, 5, 9], [5, 9]), ([3], [3]), ([], []), ([0, 4], [4])],
)
def test_clouds_are_laid_over_one_another_in_pairs(offset: list[int], expected: list[int]) -> None:
    count = offset[-1] if offset else 0
    batch = {"coord": torch.rand(count, 3), "segment": torch.arange(count), "offset": torch.tensor(offset).long()}
    mixed = overlay_clouds(batch)
    assert mixed["offset"].tolist() == expected
    assert mixed["coord"] is batch["coord"]
    assert mixed["segment"] is batch["segment"]
    assert batch["offset"].tolist() == offset


def test_neighbours_are_found_across_what_was_laid_over() -> None:
    coord = torch.rand(40, 3) - 0.5
    batch = {"coord": coord, "offset": torch.tensor([20, 40])}
    mixed = overlay_clouds(batch)
    apart, together = (OPTIONS.prepare(each) for each in (batch, mixed))
    first_own = apart["offset1"][0]
    assert bool((apart["group1"][:first_own] < 20).all())
    assert bool(((together["group1"] < 20).any(dim=1) & (together["group1"] >= 20).any(dim=1)).any())


def test_mixing_comes_before_neighbours() -> None:
    coord, offset = torch.rand(8, 3), torch.tensor([4, 8])
    batch = {"coord": coord, "offset": offset}
    with pytest.raises(InputError, match="before its neighbours"):
        overlay_clouds(batch | build_neighbours(coord, offset, OPTIONS.neighbourhood))
