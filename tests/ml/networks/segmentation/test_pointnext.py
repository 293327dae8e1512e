"""PointNeXt against a plain computation from its definition, and what must hold of it on any cloud."""

from __future__ import annotations

import copy

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from ml.networks.segmentation import grouping
from ml.networks.segmentation.grouping import Norm, gather_max, pairs_max
from ml.networks.segmentation.neighbours import Neighbours, _centre_cloud, build_neighbours, geometric_order
from ml.networks.segmentation.pointnext import PointNeXt, PointNeXtOptions, SetAbstraction
from synthroads_addon.base.errors import InputError

INPUTS, CLASSES = 4, 13
PUBLISHED = {"S": 792_237, "B": 3_827_853, "L": 7_125_069, "XL": 41_576_461}
SIZE = torch.tensor([2.5, 2.5, 0.6], dtype=torch.float64)
DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU"))]


def small(name: str, **changes: object) -> PointNeXtOptions:
    """One of the sizes, narrow so that tests are quick; without dropout, so that two runs can be compared."""
    return PointNeXtOptions(**({"preset": name, "width": 8, "dropout": 0.0} | changes))


def network(options: PointNeXtOptions, seed: int = 5) -> PointNeXt:
    """A network in double precision as if trained: scales of either sign, any statistics."""
    torch.manual_seed(seed)
    model = PointNeXt(options, INPUTS, CLASSES).double()
    for norm in model.modules():
        if isinstance(norm, nn.BatchNorm1d):
            norm.weight.data = torch.randn_like(norm.weight).sign() * (0.8 + 0.4 * torch.rand_like(norm.weight))
            nn.init.normal_(norm.bias, 0.2, 0.2)
            nn.init.normal_(norm.running_mean, 0.0, 0.3)
            nn.init.uniform_(norm.running_var, 0.5, 2.0)
    return model


def random_cloud(count: int, seed: int = 1) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    coord = torch.rand(count, 3, generator=generator, dtype=torch.float64) * SIZE
    return coord, torch.randn(count, INPUTS, generator=generator, dtype=torch.float64)


def in_order(cloud: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Return a cloud in the order of which the first neighbours are taken."""
    order = torch.from_numpy(geometric_order(_centre_cloud(cloud[0].numpy())))
    return cloud[0][order], cloud[1][order]


def run(model: PointNeXt, *clouds: tuple[Tensor, Tensor]) -> Tensor:
    ends = torch.tensor([len(coord) for coord, _ in clouds]).cumsum(0)
    coord, feat = (torch.cat(each) for each in zip(*clouds, strict=True))
    return model(feat, build_neighbours(coord, ends, model.options.neighbourhood))


class Plain:
    """The network's definition written down directly, pair by pair, on a list of clouds; weights are another's."""

    def __init__(self, model: PointNeXt) -> None:
        self.model = copy.deepcopy(model)

    def __call__(self, clouds: list[tuple[Tensor, Tensor]]) -> Tensor:
        levels = [[(coord, self.model.stem(feat)) for coord, feat in clouds]]
        for number, stage in enumerate(self.model.stages):
            radius = 0.3 * 2**number
            thinned = self.abstraction(stage.abstraction, levels[-1], radius)
            for block in stage.blocks:
                thinned = self.block(block, thinned, 2 * radius)
            levels.append(thinned)
        result = levels[-1]
        for layer, finer in zip(reversed(self.model.propagations), reversed(levels[:-1]), strict=True):
            joined = torch.cat(
                [
                    torch.cat([own[1], self.interpolated(own[0], *thin)], 1)
                    for own, thin in zip(finer, result, strict=True)
                ]
            )
            values = F.relu(layer.join_norm(layer.join(joined)))
            values = F.relu(layer.second.norm(layer.second.linear(values)))
            result = self.split(values, [own[0] for own in finer])
        return self.model.head(torch.cat([values for _, values in result]))

    @staticmethod
    def split(values: Tensor, positions: list[Tensor]) -> list[tuple[Tensor, Tensor]]:
        return list(zip(positions, values.split([len(each) for each in positions]), strict=True))

    def pairs(self, queries: list[Tensor], level: list[tuple[Tensor, Tensor]], radius: float) -> Tensor:
        """Relative position and features of every neighbour of every query (M, K, 3 + C)."""
        rows = []
        for points, (support, values) in zip(queries, level, strict=True):
            for query in points:
                near = torch.nonzero((support - query).norm(dim=1) < radius)[: self.model.options.neighbours, 0]
                near = torch.cat([near, near[:1].expand(self.model.options.neighbours - len(near))])
                rows.append(torch.cat([(support[near] - query) / radius, values[near]], dim=1))
        return torch.stack(rows)

    @staticmethod
    def normed(norm: nn.BatchNorm1d, values: Tensor) -> Tensor:
        """Batch norm over all pairs."""
        return F.batch_norm(
            values.flatten(0, 1), norm.running_mean, norm.running_var, norm.weight, norm.bias, norm.training, 0.1
        ).view(values.shape)

    def abstraction(
        self, layer: SetAbstraction, level: list[tuple[Tensor, Tensor]], radius: float
    ) -> list[tuple[Tensor, Tensor]]:
        chosen = [self.farthest(points) for points, _ in level]
        kept = [points[rows] for rows, (points, _) in zip(chosen, level, strict=True)]
        values = self.normed(layer.first_norm, layer.first(self.pairs(kept, level, radius)))
        if layer.second is not None:
            values = self.normed(layer.second_norm, layer.second(F.relu(values)))
            own = torch.cat([values[rows] for rows, (_, values) in zip(chosen, level, strict=True)])
            pooled = F.relu(values.max(dim=1).values + layer.skip(own))
        else:
            pooled = F.relu(values).max(dim=1).values
        return self.split(pooled, kept)

    def block(self, layer: nn.Module, level: list[tuple[Tensor, Tensor]], radius: float) -> list[tuple[Tensor, Tensor]]:
        positions = [points for points, _ in level]
        values = (
            F.relu(self.normed(layer.look_norm, layer.look(self.pairs(positions, level, radius)))).max(dim=1).values
        )
        values = F.relu(layer.widen.norm(layer.widen.linear(values)))
        values = layer.narrow.norm(layer.narrow.linear(values))
        return self.split(F.relu(values + torch.cat([before for _, before in level])), positions)

    @staticmethod
    def farthest(points: Tensor) -> Tensor:
        chosen = [0]
        for _ in range(len(points) // 4 - 1):
            chosen.append(int(torch.cdist(points, points[chosen]).min(dim=1).values.argmax()))
        return torch.tensor(chosen)

    @staticmethod
    def interpolated(here: Tensor, thin: Tensor, values: Tensor) -> Tensor:
        distance, index = torch.cdist(here, thin, compute_mode="donot_use_mm_for_euclid_dist").topk(3, largest=False)
        weight = 1 / (distance + 1e-8)
        return (values[index] * (weight / weight.sum(dim=1, keepdim=True))[..., None]).sum(dim=1)


def largest_difference(mine: dict[str, Tensor], other: dict[str, Tensor]) -> float:
    """Largest difference relative to the largest value of each, or to a thousandth of the largest of all."""
    with torch.no_grad():
        largest = {name: float(value.abs().max()) for name, value in other.items()}
        least = 1e-3 * max(largest.values())
        return max(float((mine[name] - other[name]).abs().max()) / max(largest[name], least) for name in mine)


@pytest.mark.parametrize(("name", "count"), PUBLISHED.items())
def test_has_as_many_parameters_as_published(name: str, count: int) -> None:
    model = PointNeXtOptions(preset=name).build(INPUTS, CLASSES)
    assert sum(weight.numel() for weight in model.parameters()) == count


def test_what_is_linear_is_done_where_points_are_few() -> None:
    """B at 15,000 points: 8.82 GFLOP pair by pair, 2.36 with the neighbours' convolutions once per support point."""
    model = PointNeXt(PointNeXtOptions(sampling="farthest"), INPUTS, CLASSES)
    coord, feat = random_cloud(15_000)
    neighbours = build_neighbours(coord.float() * 4, torch.tensor([15_000]), model.options.neighbourhood)
    with FlopCounterMode(display=False) as counter:
        model(feat.float(), neighbours)
    assert counter.get_total_flops() < 2.05e9


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("name", ["S", "B"])
def test_equals_a_plain_computation(name: str, training: bool) -> None:
    """Outputs, all gradients and running statistics; clouds of different sizes, most balls with fewer than 32."""
    model = network(small(name, sampling="farthest")).train(training)
    plain = Plain(model)
    mine, other = ([in_order(random_cloud(900, 1)), in_order(random_cloud(800, 2))] for _ in range(2))
    for _, feat in mine + other:
        feat.requires_grad_()
    target = torch.randn(1700, CLASSES, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    outputs = run(model, *mine), plain(other)
    for output in outputs:
        (output * target).mean().backward()
    assert largest_difference({"output": outputs[0]}, {"output": outputs[1]}) < 1e-9
    gradients = [
        {str(number): feat.grad for number, (_, feat) in enumerate(clouds)}
        | {key: weight.grad for key, weight in each.named_parameters()}
        for clouds, each in ((mine, model), (other, plain.model))
    ]
    assert largest_difference(*gradients) < 1e-6
    buffers = [
        {key: value for key, value in each.named_buffers() if value.is_floating_point()}
        for each in (model, plain.model)
    ]
    assert largest_difference(*buffers) < 1e-9


@pytest.mark.parametrize("name", ["S", "B"])
def test_a_batch_gives_what_its_clouds_give(name: str) -> None:
    model = network(small(name)).eval()
    clouds = [random_cloud(500, 1), random_cloud(300, 2)]
    with torch.inference_mode():
        together = run(model, *clouds)
        apart = torch.cat([run(model, cloud) for cloud in clouds])
    assert torch.allclose(together, apart, rtol=0, atol=1e-12)


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("sampling", ["grid", "farthest"])
@pytest.mark.parametrize("name", ["S", "B"])
def test_the_order_of_the_points_does_not_matter(name: str, sampling: str, training: bool) -> None:
    """On a lattice, where many distances are equal."""
    model = network(small(name, sampling=sampling)).train(training)
    steps = torch.arange(12, dtype=torch.float64) / 8
    coord = torch.cartesian_prod(steps, steps, steps[:3])
    feat = random_cloud(len(coord))[1]
    order = torch.randperm(len(coord), generator=torch.Generator().manual_seed(4))
    turned = run(model, (coord[order], feat[order]))
    assert torch.allclose(turned, run(model, (coord, feat))[order], rtol=0, atol=1e-9)


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("name", ["S", "B"])
@pytest.mark.parametrize("sizes", [(0,), (1,), (0, 0), (1, 1), (2, 0, 1), (0, 200, 1), (5, 3)])
def test_takes_clouds_of_any_size(name: str, training: bool, sizes: tuple[int, ...]) -> None:
    model = network(small(name)).train(training)
    output = run(model, *[random_cloud(size, seed) for seed, size in enumerate(sizes)])
    assert output.shape == (sum(sizes), CLASSES)
    output.sum().backward()
    assert bool(torch.isfinite(output).all())
    assert all(bool(torch.isfinite(weight.grad).all()) for weight in model.parameters() if weight.grad is not None)
    assert all(bool(torch.isfinite(buffer).all()) for buffer in model.buffers())


def test_empty_clouds_change_nothing() -> None:
    model = network(small("B")).train()
    cloud, empty = random_cloud(300), random_cloud(0)
    assert torch.equal(run(model, empty, cloud, empty), run(model, cloud))


def test_a_wide_crop_in_single_precision() -> None:
    """A crop of 60 m, far from the origin: positions cancel, and may not cost accuracy."""
    coord, feat = random_cloud(4000)
    coord = coord * 24
    coord[:, 2] = 0
    options = small("B", radius=1.5)
    double = network(options).train()
    single = network(options).float().train()
    exact = build_neighbours(coord, torch.tensor([4000]), options.neighbourhood)
    rounded = {name: value.float() if value.is_floating_point() else value for name, value in exact.items()}
    outputs = double(feat, exact), single(feat.float(), rounded)
    assert float((outputs[0] - outputs[1]).abs().max()) < 2e-3 * float(outputs[0].abs().max())


@pytest.mark.parametrize("device", DEVICES)
def test_learns_on_each_device(device: str) -> None:
    """Which side of a plane points are on, from constant features: only neighbours' positions tell."""
    options = small("B")
    torch.manual_seed(0)
    model = PointNeXt(options, 1, 2).to(device)
    coord = random_cloud(600)[0].float()
    neighbours = {
        name: value.to(device)
        for name, value in build_neighbours(coord, torch.tensor([600]), options.neighbourhood).items()
    }
    label = (coord[:, 0] > 1.25).long().to(device)
    optimizer = torch.optim.AdamW(model.parameters(), lr=0.01)
    for _ in range(30):
        optimizer.zero_grad()
        F.cross_entropy(model(torch.ones(600, 1, device=device), neighbours), label).backward()
        optimizer.step()
    right = model(torch.ones(600, 1, device=device), neighbours).argmax(dim=1) == label
    assert float(right.float().mean()) > 0.95


def test_two_runs_are_identical() -> None:
    outputs = []
    for _ in range(2):
        model = network(small("B", dropout=0.5)).train()
        torch.manual_seed(9)
        output = run(model, random_cloud(300))
        output.sum().backward()
        outputs.append([output, *[weight.grad for weight in model.parameters()]])
    assert all(torch.equal(a, b) for a, b in zip(*outputs, strict=True))


def test_the_head_drops_out_in_training_only() -> None:
    model = network(small("S", dropout=0.5))
    cloud = random_cloud(200)
    assert not torch.equal(run(model.train(), cloud), run(model, cloud))
    assert torch.equal(run(model.eval(), cloud), run(model, cloud))


@pytest.mark.parametrize("chunk", [1, 1 << 18])
def test_gather_max_and_its_gradient(monkeypatch: pytest.MonkeyPatch, chunk: int) -> None:
    monkeypatch.setattr(grouping, "_CHUNK", {"cpu": chunk})
    torch.manual_seed(0)
    values = torch.randn(20, 5, dtype=torch.float64, requires_grad=True)
    index = torch.randint(0, 20, (7, 6), dtype=torch.int32)
    assert torch.equal(gather_max(values, index), values[index.long()].amax(dim=1))
    assert torch.autograd.gradcheck(lambda each: gather_max(each, index), values)


def test_of_equal_neighbours_the_first_gets_the_gradient() -> None:
    values = torch.tensor([[1.0], [3.0], [3.0], [2.0]], requires_grad=True)
    gather_max(values, torch.tensor([[0, 2, 1], [3, 0, 0]])).sum().backward()
    assert values.grad.tolist() == [[0.0], [0.0], [1.0], [1.0]]


@pytest.mark.parametrize("chunk", [1, 1 << 18])
def test_pairs_max_and_its_gradients(monkeypatch: pytest.MonkeyPatch, chunk: int) -> None:
    monkeypatch.setattr(grouping, "_CHUNK", {"cpu": chunk})
    torch.manual_seed(0)
    support, offset = torch.randn(9, 3, dtype=torch.float64), torch.randn(5, 3, dtype=torch.float64)
    weight, index = torch.randn(4, 3, dtype=torch.float64), torch.randint(0, 9, (5, 6), dtype=torch.int32)
    inputs = tuple(each.requires_grad_() for each in (support, offset, weight))
    pairs = F.relu(support[index.long()] + offset[:, None])
    top, total, product = pairs_max(support, offset, index, weight, moments=True)
    assert torch.allclose(top, (pairs @ weight.T).amax(dim=1))
    assert torch.allclose(total, pairs.sum(dim=(0, 1)))
    assert torch.allclose(product, pairs.flatten(0, 1).T @ pairs.flatten(0, 1))
    for moments in (True, False):
        assert torch.autograd.gradcheck(
            lambda a, b, c, moments=moments: pairs_max(a, b, index, c, moments=moments)[: 3 if moments else 1], inputs
        )


def test_not_a_number_passes_through() -> None:
    model = network(small("B")).train()
    coord, feat = random_cloud(100)
    output = run(model, (coord, feat * torch.nan))
    output.sum().backward()
    assert bool(output.isnan().all())


@pytest.mark.parametrize("momentum", [0.1, None])
def test_running_statistics_are_those_of_a_batch_norm(momentum: float | None) -> None:
    ours, theirs = Norm(3, momentum=momentum).double(), nn.BatchNorm1d(3, momentum=momentum).double()
    for seed in range(3):
        values = torch.randn(20, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) * 2 + 1
        theirs(values)
        ours.observe(values.mean(dim=0), values.var(dim=0, unbiased=False), 20)
    assert torch.allclose(ours.running_mean, theirs.running_mean)
    assert torch.allclose(ours.running_var, theirs.running_var)
    assert ours.num_batches_tracked == 3


def test_a_single_value_leaves_the_statistics() -> None:
    norm = Norm(3).train()
    assert torch.equal(norm(torch.randn(1, 3)), norm.bias.expand(1, 3))
    assert norm(torch.zeros(0, 3)).shape == (0, 3)
    norm.observe(torch.ones(3), torch.zeros(3), 1)
    assert norm.running_mean.tolist() == [0, 0, 0]
    assert norm.num_batches_tracked == 0


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("preset", "M"),
        ("preset", "b"),
        ("width", 0),
        ("dropout", 1.0),
        ("radius", -1.0),
        ("radius", float("nan")),
        ("neighbours", 0),
        ("neighbours", 256),
        ("sampling", "random"),
    ],
)
def test_wrong_values_are_refused(field: str, value: object) -> None:
    with pytest.raises(InputError, match=field):
        PointNeXtOptions.from_dict({field: value})


@pytest.mark.parametrize("shape", [(9, 4), (10, 3), (10,)])
def test_features_must_fit(shape: tuple[int, ...]) -> None:
    model = network(small("S"))
    neighbours: Neighbours = build_neighbours(torch.rand(10, 3), torch.tensor([10]), model.options.neighbourhood)
    with pytest.raises(InputError, match="feat"):
        model(torch.zeros(shape, dtype=torch.float64), neighbours)
