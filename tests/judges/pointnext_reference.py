"""PointNeXt, judged by its authors' implementation, openpoints.

Only the modules that the network needs are loaded, without the package's other dependencies, and its CUDA functions
are replaced by plain ones, written here from what they are documented to do.
"""

from __future__ import annotations

import importlib
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from ml.networks.segmentation.neighbours import _centre_cloud, build_neighbours, geometric_order
from ml.networks.segmentation.pointnext import PointNeXt, PointNeXtOptions

RADIUS, NEIGHBOURS, CLASSES, INPUTS = 0.3, 32, 13, 4
PUBLISHED = {"S": 792_237, "B": 3_827_853, "L": 7_125_069, "XL": 41_576_461}


class Attributes(dict):
    """A dictionary whose items are attributes too."""

    __setattr__ = dict.__setitem__

    def __getattr__(self, name: str) -> object:
        if name not in self:
            raise AttributeError(name)
        return self[name]


def ball_query(radius: float, limit: int, support: Tensor, queries: Tensor) -> Tensor:
    count = support.shape[1]
    near = torch.cdist(queries, support, compute_mode="donot_use_mm_for_euclid_dist") < radius
    rank = torch.where(near, torch.arange(count), count).sort(dim=-1).values
    rank = nn.functional.pad(rank, (0, max(limit - count, 0)), value=count)[..., :limit]
    return torch.where(rank < count, rank, rank[..., :1])


def group(features: Tensor, index: Tensor) -> Tensor:
    return torch.stack([each[:, rows] for each, rows in zip(features, index, strict=True)])


def farthest(points: Tensor, count: int) -> Tensor:
    chosen = torch.zeros(len(points), count, dtype=torch.long)
    for cloud, rows in zip(points, chosen, strict=True):
        distance = torch.full((len(cloud),), torch.inf, dtype=points.dtype)
        for step in range(1, count):
            distance = torch.minimum(distance, (cloud - cloud[rows[step - 1]]).square().sum(dim=1))
            rows[step] = distance.argmax()
    return chosen


def three_nn(unknown: Tensor, known: Tensor) -> tuple[Tensor, Tensor]:
    distance = torch.cdist(unknown, known, compute_mode="donot_use_mm_for_euclid_dist")
    return distance.topk(3, largest=False)


def three_interpolate(features: Tensor, index: Tensor, weight: Tensor) -> Tensor:
    return (group(features, index) * weight[:, None]).sum(dim=-1)


@contextmanager
def openpoints_modules(folder: Path) -> Iterator[types.SimpleNamespace]:
    """Yield their modules from the package's folder, with plain functions in place of CUDA's; then forget them."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        yield from _loaded(folder, monkeypatch)


def _loaded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[types.SimpleNamespace]:
    before = set(sys.modules)
    for name in ("", ".utils", ".models", ".models.backbone", ".models.segmentation"):
        package = types.ModuleType("openpoints" + name)
        package.__path__ = [str(folder.joinpath(*name.split(".")))]
        monkeypatch.setitem(sys.modules, package.__name__, package)
    for name, content in {
        "easydict": {"EasyDict": Attributes},
        "sklearn": {},
        "sklearn.decomposition": {"FactorAnalysis": None},
    }.items():
        stub = types.ModuleType(name)
        stub.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, stub)
    utils = sys.modules["openpoints.utils"]
    utils.registry = importlib.import_module("openpoints.utils.registry")
    utils.get_missing_parameters_message = utils.get_unexpected_parameters_message = None
    layers = importlib.import_module("openpoints.models.layers")
    backbone = importlib.import_module("openpoints.models.backbone.pointnext")
    segmentation = importlib.import_module("openpoints.models.segmentation.base_seg")
    monkeypatch.setattr(layers.group, "ball_query", ball_query)
    monkeypatch.setattr(layers.group, "grouping_operation", group)
    monkeypatch.setattr(layers.upsampling, "three_nn", three_nn)
    monkeypatch.setattr(layers.upsampling, "three_interpolate", three_interpolate)
    monkeypatch.setattr(backbone, "furthest_point_sample", farthest)
    yield types.SimpleNamespace(backbone=backbone, segmentation=segmentation)
    for name in set(sys.modules) - before:
        if name.startswith("openpoints"):
            del sys.modules[name]


class Theirs(nn.Module):
    """Their network in the settings for S3DIS: batches (B, N, C) of clouds of one size."""

    def __init__(self, modules: types.SimpleNamespace, options: PointNeXtOptions) -> None:
        super().__init__()
        common = {"norm_args": {"norm": "bn"}, "act_args": {"act": "relu"}, "conv_args": {"order": "conv-norm-act"}}
        self.encoder = modules.backbone.PointNextEncoder(
            in_channels=INPUTS,
            width=options.channels[0],
            blocks=[1, *options.blocks],
            strides=[1, 4, 4, 4, 4],
            nsample=NEIGHBOURS,
            radius=RADIUS,
            sa_layers=2 if options.preset == "S" else 1,
            sa_use_res=options.preset == "S",
            group_args=Attributes(NAME="ballquery", normalize_dp=True),
            **common,
        )
        self.decoder = modules.backbone.PointNextDecoder(self.encoder.channel_list)
        self.head = modules.segmentation.SegHead(
            CLASSES, self.decoder.out_channels, norm_args={"norm": "bn"}, dropout=options.dropout
        )

    def forward(self, coord: Tensor, feat: Tensor) -> Tensor:
        positions, features = self.encoder(coord, feat.transpose(1, 2).contiguous())
        return self.head(self.decoder(positions, features)).transpose(1, 2)


def parts(module: nn.Module) -> list[nn.Module]:
    """A module's layers with weights, in the order in which data pass them."""
    return [
        each
        for each in module.modules()
        if isinstance(each, (nn.Conv1d, nn.Conv2d, nn.Linear, nn.BatchNorm1d, nn.BatchNorm2d))
    ]


def matched(ours: PointNeXt, theirs: Theirs) -> Iterator[tuple[nn.Module, nn.Module]]:
    """Pairs of layers of ours and theirs."""
    mine = parts(ours.stem)
    for stage in ours.stages:
        each = stage.abstraction
        optional = [each.skip, each.first, each.first_norm, each.second, each.second_norm]
        mine += [layer for layer in optional if layer is not None] + parts(stage.blocks)
    mine += [*parts(ours.propagations), *parts(ours.head)]
    yield from zip(mine, parts(theirs), strict=True)


def copy_weights(ours: PointNeXt, theirs: Theirs) -> None:
    for mine, its in matched(ours, theirs):
        state = {name: value.reshape(mine.state_dict()[name].shape) for name, value in its.state_dict().items()}
        mine.load_state_dict(state)


def compared(
    modules: types.SimpleNamespace, options: PointNeXtOptions, points: int, *, training: bool
) -> dict[str, float]:
    """Largest differences of outputs, gradients and running statistics, each relative."""
    torch.manual_seed(5)
    its = Theirs(modules, options).double()
    for name, norm in its.named_modules():
        if isinstance(norm, (nn.BatchNorm1d, nn.BatchNorm2d)):  # as if trained: scales of either sign, any statistics
            norm.weight.data = torch.randn_like(norm.weight).sign() * (0.8 + 0.4 * torch.rand_like(norm.weight))
            if "pwconv.1" in name:
                norm.weight.data *= 0.2  # or the 15 blocks of XL make a rounding error larger than what is tested
            nn.init.normal_(norm.bias, 0.2, 0.2)
            nn.init.normal_(norm.running_mean, 0.0, 0.3)
            nn.init.uniform_(norm.running_var, 0.5, 2.0)
    ours = PointNeXt(options, INPUTS, CLASSES).double()
    copy_weights(ours, its)
    ours.train(training)
    its.train(training)
    clouds = 2
    coord = torch.rand(clouds, points, 3, dtype=torch.float64) * torch.tensor([2.5, 2.5, 0.6])
    coord = torch.stack([cloud[geometric_order(_centre_cloud(cloud.numpy()))] for cloud in coord])
    feat = torch.randn(clouds, points, INPUTS, dtype=torch.float64)
    target = torch.randn(clouds, points, CLASSES, dtype=torch.float64)
    packed = build_neighbours(coord.reshape(-1, 3), torch.arange(1, clouds + 1) * points, options.neighbourhood)
    mine_in = feat.reshape(-1, INPUTS).requires_grad_()
    its_in = feat.clone().requires_grad_()
    mine_out = ours(mine_in, packed)
    its_out = its(coord, its_in)
    (mine_out * target.reshape(mine_out.shape)).mean().backward()
    (its_out * target).mean().backward()
    layers = list(matched(ours, its))
    gradients = {"input": (mine_in.grad, its_in.grad)}
    for number, (mine, other) in enumerate(layers):
        for (name, weight), weight_of in zip(mine.named_parameters(), other.parameters(), strict=True):
            gradients[f"{number} {name}"] = (weight.grad, weight_of.grad)
    buffers = {"output": (mine_out.detach(), its_out.detach())}
    for number, (mine, other) in enumerate(layers):
        for (name, buffer), buffer_of in zip(mine.named_buffers(), other.buffers(), strict=True):
            buffers[f"{number} {name}"] = (buffer, buffer_of)
    return differences(gradients, "gradient") | differences(buffers, "")


def differences(pairs: dict[str, tuple[Tensor | None, Tensor | None]], what: str) -> dict[str, float]:
    """Largest difference of each pair, relative to its largest value or to a thousandth of the largest of all.

    The latter for gradients that are zero but for rounding, as that of a bias before a norm.
    """
    largest = {name: float(other.abs().max()) for name, (_, other) in pairs.items() if other is not None}
    least = 1e-3 * max(largest.values())
    return {
        f"{what} {name}".strip(): float((mine - other.reshape(mine.shape)).abs().max()) / max(largest[name], least)
        for name, (mine, other) in pairs.items()
        if mine is not None and other is not None
    }


def same_as_theirs(name: str) -> PointNeXtOptions:
    """One of the sizes with the authors' sampling, and without dropout, which draws differently."""
    return PointNeXtOptions(preset=name, sampling="farthest", dropout=0.0)
