"""The point transformer: what must hold of it on any cloud, and that it learns."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from ml.configuration import load_configuration
from ml.networks.segmentation.cells import build_cells
from ml.networks.segmentation.grouping import Norm
from ml.networks.segmentation.point_transformer import (
    AttentionBlock,
    PointTransformer,
    PointTransformerOptions,
    drop_clouds,
    rotate_pairs,
    rotations,
)
from ml.segmentation.network import adapt_norms, overlay_clouds
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_points

INPUTS, CLASSES = 4, 5
torch.set_num_threads(1)
DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU"))]
Cloud = tuple[Tensor, Tensor]


def small(**changes: object) -> PointTransformerOptions:
    """A narrow network with short patches; nothing at random, so that two runs can be compared."""
    plain = {"cell": 0.25, "channels": (8, 12, 24), "blocks": (1, 1, 4), "head_width": 12, "patch": 16}
    still = {"dropout": 0.0, "drop_path": 0.0, "shuffle": False}
    return PointTransformerOptions(**(plain | still | changes))


def network(options: PointTransformerOptions, seed: int = 5) -> PointTransformer:
    """A network in double precision as if trained: norms with any scales and statistics."""
    torch.manual_seed(seed)
    model = PointTransformer(options, INPUTS, CLASSES).double()
    for norm in model.modules():
        if isinstance(norm, nn.BatchNorm1d | nn.LayerNorm):
            nn.init.uniform_(norm.weight, 0.8, 1.2)
            nn.init.normal_(norm.bias, 0.2, 0.2)
        if isinstance(norm, nn.BatchNorm1d):
            nn.init.normal_(norm.running_mean, 0.0, 0.3)
            nn.init.uniform_(norm.running_var, 0.5, 2.0)
    return model


def random_cloud(count: int, seed: int = 1) -> Cloud:
    draw = torch.Generator().manual_seed(seed)
    coord = torch.rand(count, 3, generator=draw, dtype=torch.float64) * torch.tensor([5.0, 5.0, 0.8])
    return coord, torch.randn(count, INPUTS, generator=draw, dtype=torch.float64)


def batch_of(*clouds: Cloud) -> dict[str, Tensor]:
    coord, feat = (torch.cat(each) for each in zip(*clouds, strict=True))
    return {"coord": coord, "feat": feat, "offset": torch.tensor([len(one) for one, _ in clouds]).cumsum(0)}


def run(model: nn.Module, *clouds: Cloud) -> Tensor:
    batch = batch_of(*clouds)
    return model(batch["feat"], batch)


@pytest.mark.parametrize("attention_from", [0, 1, 3])
def test_a_batch_gives_what_its_clouds_give(attention_from: int) -> None:
    """Of such sizes that patches are longer in the batch than alone, and begin elsewhere."""
    model = network(small(attention_from=attention_from, channels=(12, 12, 24), decoder_blocks=1)).eval()
    clouds = [random_cloud(500, 1), random_cloud(20, 2), random_cloud(1, 3), random_cloud(300, 4)]
    with torch.inference_mode():
        together = run(model, *clouds)
        apart = torch.cat([run(model, cloud) for cloud in clouds])
    assert torch.allclose(together, apart, rtol=0, atol=1e-12)


@pytest.mark.parametrize("training", [True, False])
def test_the_order_of_the_points_does_not_matter(training: bool) -> None:
    """On a lattice too, where several points share a cell, some at one place."""
    steps = torch.arange(12, dtype=torch.float64) / 8
    lattice = torch.cartesian_prod(steps, steps, steps[:3])
    for coord in (random_cloud(400)[0], torch.cat([lattice, lattice[:20]])):
        model = network(small()).train(training)
        feat = random_cloud(len(coord))[1]
        order = torch.randperm(len(coord), generator=torch.Generator().manual_seed(4))
        turned_round = run(model, (coord[order], feat[order]))
        assert torch.allclose(turned_round, run(model, (coord, feat))[order], rtol=0, atol=1e-9)


def test_a_cloud_may_lie_anywhere() -> None:
    model = network(small()).eval()
    coord, feat = random_cloud(400)
    moved = coord + torch.tensor([1.25, -0.75, 40.5], dtype=torch.float64)
    assert torch.allclose(run(model, (moved, feat)), run(model, (coord, feat)), rtol=0, atol=1e-9)


def test_points_twice_are_as_good_as_once() -> None:
    model = network(small()).eval()
    coord, feat = random_cloud(300)
    twice = run(model, (torch.cat([coord, coord]), torch.cat([feat, feat])))
    assert torch.allclose(twice, run(model, (coord, feat)).repeat(2, 1), rtol=0, atol=1e-12)


def test_attention_knows_where_cells_are() -> None:
    model = network(small()).eval()
    batch = batch_of(random_cloud(300))
    cells = build_cells(batch["coord"], batch["offset"], model.options.grid)
    assert torch.allclose(model(batch["feat"], cells | {"grid2": cells["grid2"] + 3}), model(batch["feat"], cells))
    elsewhere = cells | {"grid2": cells["grid2"] * 2}
    assert not torch.allclose(model(batch["feat"], elsewhere), model(batch["feat"], cells))


def test_what_fills_a_patch_up_is_not_seen() -> None:
    model = network(small()).eval()
    batch = batch_of(random_cloud(10, 1), random_cloud(400, 2), random_cloud(5, 3))
    cells = build_cells(batch["coord"], batch["offset"], model.options.grid)
    filled, patch = cells["filled2"], cells["patch2"]
    assert 0 < int((~filled).sum()) < filled.numel()
    other = torch.randint_like(patch, len(cells["grid2"]))
    changed = cells | {"patch2": torch.where(filled, patch, other)}
    with torch.inference_mode():
        usual = model(batch["feat"], cells)
        assert torch.equal(model(batch["feat"], changed), usual)
        assert not torch.allclose(model(batch["feat"], changed | {"filled2": torch.ones_like(filled)}), usual)


def test_attention_reaches_across_a_patch_and_convolutions_around_a_cell() -> None:
    """The point farthest from another one feels it through attention alone: that of the whole cloud is one patch."""
    coord, feat = random_cloud(400)
    far = int((coord - coord[0]).norm(dim=1).argmax())
    felt = {}
    for attention_from in (2, 3):
        model = network(small(attention_from=attention_from, blocks=(1, 1, 1), patch=512)).eval()
        given = feat.clone().requires_grad_()
        run(model, (coord, given))[far].sum().backward()
        felt[attention_from] = float(given.grad[0].abs().sum())
    assert felt[2] > 0
    assert felt[3] == 0


def test_blocks_follow_the_curves_in_turn() -> None:
    """With short patches each curve has its own, so that other curves give other scores."""
    cloud = random_cloud(600)
    model, other = network(small()).eval(), network(small(curves=("hilbert",))).eval()
    shorter = network(small(blocks=(1, 1, 1))).eval()
    only = network(small(blocks=(1, 1, 1), curves=("hilbert",))).eval()
    assert not torch.allclose(run(model, cloud), run(other, cloud))
    assert torch.equal(run(shorter, cloud), run(only, cloud))  # the first block follows the first curve


def test_curves_are_shuffled_in_training_only_and_by_the_seed() -> None:
    model = network(small(shuffle=True))
    cloud = random_cloud(600)
    outputs = []
    for seed in (1, 1, 2, 3):
        torch.manual_seed(seed)
        outputs.append(run(model.train(), cloud))
    assert torch.equal(outputs[0], outputs[1])
    assert any(not torch.allclose(outputs[0], other) for other in outputs[2:])
    assert torch.equal(run(model.eval(), cloud), run(model, cloud))


def test_turned_queries_and_keys_tell_how_far_apart_they_are() -> None:
    """Of two vectors that are the same everywhere the product depends on the step between their places alone."""
    torch.manual_seed(1)
    query, key = torch.randn(2, 1, 1, 24, dtype=torch.float64).expand(2, 50, 1, 24)
    places = torch.randint(0, 200, (50, 3)).double()
    step = torch.tensor([3.0, -7.0, 2.0], dtype=torch.float64)
    turned_query = rotate_pairs(query, *rotations(places, 24))
    same = (turned_query * rotate_pairs(key, *rotations(places + step, 24))).sum(dim=-1)
    assert torch.allclose(same, same[:1].expand_as(same))
    assert torch.allclose(turned_query.norm(dim=-1), query.norm(dim=-1))
    for axis in range(3):
        other = step.clone()
        other[axis] += 1
        assert not torch.allclose((turned_query * rotate_pairs(key, *rotations(places + other, 24))).sum(dim=-1), same)


@pytest.mark.parametrize("kernel", ["cube", "cross"])
def test_gradients_reach_all_weights(kernel: str) -> None:
    model = network(small(kernel=kernel, decoder_blocks=1)).train()
    clouds = [(random_cloud(500, seed)[0], random_cloud(500, seed)[1].requires_grad_()) for seed in (1, 2)]
    (run(model, *clouds) * torch.randn(1000, CLASSES, dtype=torch.float64)).sum().backward()
    untouched = [name for name, weight in model.named_parameters() if weight.grad is None or not weight.grad.any()]
    assert untouched == []
    assert all(bool((feat.grad.abs().sum(dim=1) > 0).all()) for _, feat in clouds)


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("sizes", [(), (0,), (1,), (0, 0), (1, 1), (2, 0, 1), (0, 200, 1), (5, 3)])
def test_takes_clouds_of_any_size(training: bool, sizes: tuple[int, ...]) -> None:
    model = network(small(dropout=0.2, drop_path=0.2, shuffle=True)).train(training)
    clouds = [random_cloud(size, seed) for seed, size in enumerate(sizes)] or [random_cloud(0)]
    output = run(model, *clouds)
    assert output.shape == (sum(sizes), CLASSES)
    output.sum().backward()
    assert bool(torch.isfinite(output).all())
    assert all(bool(torch.isfinite(weight.grad).all()) for weight in model.parameters() if weight.grad is not None)
    assert all(bool(torch.isfinite(buffer).all()) for buffer in model.buffers())


def test_coordinates_may_be_more_exact_than_the_network() -> None:
    model = network(small()).float().eval()
    coord, feat = random_cloud(200)
    with torch.inference_mode():
        exact = run(model, (coord, feat.float()))
        single = run(model, (coord.float(), feat.float()))
    assert exact.dtype == torch.float32
    assert torch.allclose(exact, single, atol=1e-4)


def road(count: int, seed: int) -> tuple[dict[str, Tensor], Tensor]:
    """Return a batch of one crop of a road, and its labels."""
    xyz, _, intensity, label = road_points(count, seed, length=12.0)
    coord = torch.from_numpy(xyz - xyz.mean(axis=0)).float()
    feat = torch.cat([coord / 10.0, torch.from_numpy(intensity).float()[:, None]], dim=1)
    return {"coord": coord, "feat": feat, "offset": torch.tensor([count])}, torch.from_numpy(label).long()


@pytest.mark.parametrize("device", DEVICES)
def test_learns_a_crop_by_heart(device: str) -> None:
    """All five classes of a small piece of road; its markings differ from the road in intensity alone."""
    batch, label = road(600, 1)
    on_device, truth = {name: value.to(device) for name, value in batch.items()}, label.to(device)
    weight = 1.0 / torch.bincount(truth)
    torch.manual_seed(0)
    options = small(channels=(12, 24), blocks=(1, 1), attention_from=1)
    model = PointTransformer(options, INPUTS, CLASSES).to(device)
    optimizer = torch.optim.AdamW(model.parameters(), lr=0.02)
    for _ in range(60):
        optimizer.zero_grad()
        F.cross_entropy(model(on_device["feat"], on_device), truth, weight).backward()
        optimizer.step()
    right = model(on_device["feat"], on_device).argmax(dim=1) == truth
    assert all(float(right[truth == each].float().mean()) > 0.9 for each in range(CLASSES))
    assert float(right.float().mean()) > 0.98


@pytest.mark.parametrize("device", DEVICES)
def test_two_runs_are_identical(device: str) -> None:
    outputs = []
    for _ in range(2):
        model = network(small(dropout=0.5, drop_path=0.5, shuffle=True)).train().to(device)
        torch.manual_seed(9)
        batch = {name: value.to(device) for name, value in batch_of(random_cloud(300), random_cloud(200, 2)).items()}
        output = model(batch["feat"], batch)
        output.sum().backward()
        outputs.append([output, *[weight.grad for weight in model.parameters()]])
    if device == "cpu":
        assert all(torch.equal(a, b) for a, b in zip(*outputs, strict=True))
    assert all(torch.allclose(a, b, rtol=0, atol=1e-9) for a, b in zip(*outputs, strict=True))


@pytest.mark.parametrize("changes", [{"dropout": 0.5}, {"drop_path": 0.9}])
def test_is_dropped_in_training_only(changes: dict[str, float]) -> None:
    model = network(small(**changes))
    clouds = [random_cloud(100, seed) for seed in range(8)]
    assert not torch.equal(run(model.train(), *clouds), run(model, *clouds))
    assert torch.equal(run(model.eval(), *clouds), run(model, *clouds))


def test_a_skipped_block_is_skipped_by_whole_clouds_and_the_mean_stays() -> None:
    torch.manual_seed(2)
    ends = torch.arange(0, 3 * 4000 + 1, 3)[1:]
    change = torch.ones(3 * 4000, 2)
    kept = drop_clouds(change, ends, 0.25, True)
    assert {round(value, 4) for value in kept.unique().tolist()} == {0.0, 1.3333}
    by_cloud = kept.view(4000, 6)
    assert torch.equal(by_cloud, by_cloud[:, :1].expand_as(by_cloud))
    assert float(kept.mean()) == pytest.approx(1.0, abs=0.03)
    assert drop_clouds(change, ends, 0.25, False) is change
    assert drop_clouds(change, ends, 0.0, True) is change


def test_the_last_block_is_skipped_most_often_and_the_first_never() -> None:
    model = network(small(drop_path=0.4, blocks=(1, 2, 2)))
    drops = [block.drop for stage in model.stages for block in stage]
    assert drops == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_mixed_crops_see_each_other() -> None:
    model = network(small()).eval()
    batch = batch_of(random_cloud(200, 1), random_cloud(200, 2))
    mixed = overlay_clouds(batch)
    with torch.inference_mode():
        assert not torch.allclose(model(batch["feat"], batch), model(mixed["feat"], mixed))


def test_norms_take_the_statistics_of_other_clouds() -> None:
    model = network(small())
    clouds = [random_cloud(400, seed) for seed in (1, 2)]
    before = {name: value.clone() for name, value in model.named_buffers()}
    adapt_norms(model, [batch_of(cloud) for cloud in clouds], lambda batch: model(batch["feat"], batch))
    norms = [name for name, module in model.named_modules() if isinstance(module, Norm)]
    assert len(norms) > 5
    for name in norms:
        assert not torch.allclose(before[f"{name}.running_mean"], model.get_buffer(f"{name}.running_mean")), name


@pytest.mark.parametrize("attention", [False, True])
def test_a_blocks_steps_are_nearly_the_same_in_bfloat16(attention: bool) -> None:
    model = network(small(attention_from=0 if attention else 3, channels=(12, 12, 24))).float().train()
    batch = batch_of(random_cloud(300))
    batch = {name: value.float() if value.is_floating_point() else value for name, value in batch.items()}
    exact = model(batch["feat"], batch)
    with torch.autocast("cpu", torch.bfloat16):
        near = model(batch["feat"], batch)
    assert near.dtype == torch.bfloat16
    near.float().square().sum().backward()
    assert all(weight.grad.dtype == torch.float32 for weight in model.parameters())
    assert (near - exact).abs().mean() < 0.05 * exact.abs().mean()


def test_the_shipped_configuration_is_as_large_as_the_others() -> None:
    given = load_configuration("segmentation-transformer").network
    model = given.build(INPUTS, CLASSES)
    assert isinstance(model, PointTransformer)
    assert 0.5e6 < sum(weight.numel() for weight in model.parameters()) < 1.5e6
    kinds = [isinstance(block, AttentionBlock) for stage in model.stages for block in stage]
    assert kinds == sorted(kinds)  # convolutions first, then attention
    assert any(kinds)
    assert not all(kinds)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cell": 0}, "cell is 0"),
        ({"patch": 100}, "patch: must be a multiple of 8, not 100"),
        ({"patch": 0}, "patch is 0"),
        ({"head_width": 20}, "head_width: must be a multiple of 6, not 20"),
        ({"curves": []}, "curves"),
        ({"curves": ["hilbert", "hilbert"]}, "curves must not name a curve twice"),
        ({"curves": ["peano"]}, "curves"),
        ({"kernel": "ball"}, "kernel is 'ball'"),
        ({"drop_path": 1.0}, "drop_path is 1"),
        ({"dropout": -0.1}, "dropout is -0.1"),
        ({"channels": []}, "channels"),
        ({"channels": [24, 48]}, "blocks must be as many as channels, 2"),
        ({"channels": [24, 48, 96, 100]}, "channels of stages with attention must be multiples of head_width, 24"),
        ({"channels": [0, 48, 96, 144]}, "channels must be numbers from 1 to 2048"),
        ({"blocks": [-1, 2, 2, 2]}, "blocks must be numbers from 0 to 64"),
        ({"preset": "S"}, "preset"),
    ],
)
def test_wrong_values_are_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        PointTransformerOptions.from_dict(changes)


@pytest.mark.parametrize("shape", [(9, 4), (10, 3), (10,)])
def test_features_must_fit(shape: tuple[int, ...]) -> None:
    model = network(small())
    with pytest.raises(InputError, match="feat"):
        model(torch.zeros(shape, dtype=torch.float64), batch_of(random_cloud(10)))
