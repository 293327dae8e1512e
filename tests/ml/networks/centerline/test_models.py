"""The models: what they return, and what must not change it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from ml.configuration import from_data
from ml.data.corridor import CORRIDOR
from ml.data.frames import displace_frames, frames_along
from ml.data.slices import mirror_batch
from ml.networks.centerline.layers import DeformableKernelPoints, PointFeatures, cell_features, cell_sums
from ml.networks.centerline.models import TARGETS, predict_both_ways
from ml.networks.centerline.refinement import parabola
from ml.registry import networks
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from tests.helpers.clouds.centerline_batches import MODELS, batch, moved, select, small


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> torch.nn.Module:
    return small(request.param).eval()


def test_shapes(model):
    output = model(batch(3))
    assert output["center"].shape == output["center_std"].shape == (3, 10)
    assert output["corridor"].shape == output["corridor_std"].shape == (3, 10, len(CORRIDOR))
    assert output["log_std"].shape == (3, 10, len(TARGETS))
    assert output["logits"].shape == (3, 10, 25, 3)
    assert all(torch.isfinite(values).all() for values in output.values())
    assert (output["center_std"] > 0).all()


@torch.no_grad()
def test_padding_does_not_matter(model):
    one = batch(2)
    one["mask"][:, ::2, 90:] = False
    noise = torch.where(one["mask"][..., None], 0.0, 50.0 * torch.randn(one["coord"].shape))
    other = dict(one, coord=one["coord"] + noise, feat=one["feat"] + noise[..., :1])
    torch.testing.assert_close(model(other)["center"], model(one)["center"])
    longer = {
        name: torch.nn.functional.pad(one[name], (0, 0) * (one[name].ndim - 3) + (0, 7))
        for name in ("coord", "feat", "mask")
    }
    torch.testing.assert_close(model(one | longer)["corridor"], model(one)["corridor"])


@torch.no_grad()
def test_order_of_points_does_not_matter(model):
    one = batch(2)
    order = torch.randperm(one["mask"].shape[2])
    other = dict(one, **{name: one[name][:, :, order] for name in ("coord", "feat", "mask")})
    torch.testing.assert_close(model(other)["center"], model(one)["center"], atol=1e-4, rtol=1e-4)


@torch.no_grad()
def test_sequences_of_a_batch_do_not_see_each_other(model):
    one = batch(3)
    together = model(one)["corridor"]
    alone = torch.cat([model(select(one, slice(number, number + 1)))["corridor"] for number in range(3)])
    torch.testing.assert_close(together, alone, atol=1e-4, rtol=1e-4)


@torch.no_grad()
def test_truth_is_not_seen(model):
    one = batch(2)
    blind = {name: one[name] for name in ("coord", "feat", "mask", "frame")}
    assert torch.equal(model(blind)["center"], model(one)["center"])


@torch.no_grad()
def test_slices_without_points(model):
    one = batch(2)
    empty = dict(one, mask=torch.zeros_like(one["mask"]), coord=torch.zeros_like(one["coord"]))
    assert all(torch.isfinite(values).all() for values in model(empty).values())


def test_only_single_sees_one_slice_alone(model):
    one = batch(1)
    one["coord"].requires_grad_()
    model(one)["center"][0, 0].backward()
    far = one["coord"].grad[0, 5:].abs().sum()
    assert (far == 0) == (type(model).__name__ == "Single")


@torch.no_grad()
def test_mirror_carries_over_exactly(model):
    one = batch(3)
    here, there = predict_both_ways(model, one), predict_both_ways(model, mirror_batch(one))
    assert torch.equal(there["center"], -here["center"])
    assert torch.equal(there["center_std"], here["center_std"])
    left, right, heading = (CORRIDOR.index(name) for name in ("left_edge", "right_edge", "heading"))
    assert torch.equal(there["corridor"][..., left], -here["corridor"][..., right])
    assert torch.equal(there["corridor_std"][..., left], here["corridor_std"][..., right])
    assert torch.equal(there["corridor"][..., heading], -here["corridor"][..., heading])
    for name in ("lanes", "lane_width", "height"):
        assert torch.equal(there["corridor"][..., CORRIDOR.index(name)], here["corridor"][..., CORRIDOR.index(name)])
    assert not torch.equal(model(mirror_batch(one))["center"], -model(one)["center"]), (
        "without averaging it isn't exact"
    )


def test_mirrored_twice_is_the_same():
    one = batch(2)
    back = mirror_batch(mirror_batch(one))
    assert all(torch.equal(back[name].nan_to_num(), one[name].nan_to_num()) for name in one)


@torch.no_grad()
def test_shift_by_a_kernel_point_carries_over(model):
    """Scores under the soft-argmax move by one kernel point, but for what layers see of the slice's ends."""
    one = batch(4)
    keep = one["coord"][..., 1].abs() < 6.0
    one = dict(one, mask=one["mask"] & keep, coord=one["coord"] * keep[..., None])
    before = model(one)["logits"][:, :, 8:17]
    after = model(moved(one, model.kernel_points.spacing))["logits"]
    here, there = after[:, :, 9:18] - before, after[:, :, 8:17] - before
    assert here.std() < 0.1 * before.std()
    assert there.std() > 0.5 * before.std(), "the test needs logits that differ from place to place"


@torch.no_grad()
def test_rotating_the_frames_changes_nothing(model):
    """Points are in the frames already; of the frames only how they lie to each other counts."""
    one = batch(3)
    angle = 1.1
    x, y, direction, height = one["frame"].unbind(-1)
    turned = torch.stack(
        [
            np.cos(angle) * x - np.sin(angle) * y + 700.0,
            np.sin(angle) * x + np.cos(angle) * y - 300.0,
            direction + angle,
            height,
        ],
        dim=-1,
    )
    torch.testing.assert_close(model(dict(one, frame=turned))["center"], model(one)["center"], atol=1e-4, rtol=0)


def test_weights_and_gradients_are_the_same_twice():
    one = batch(2)
    for name in MODELS:
        gradients = []
        for _ in range(2):
            model = small(name, dropout=0.1).train()
            torch.manual_seed(1)
            model(one)["corridor"].sum().backward()
            gradients.append([weights.grad for weights in model.parameters() if weights.grad is not None])
        assert all(torch.equal(a, b) for a, b in zip(*gradients, strict=True))


@pytest.mark.parametrize("towards", [0.0, np.pi - 0.05])
def test_parabola_finds_the_direction_in_frames_that_wander(towards: float):
    turn = towards + np.linspace(0.0, 0.1, 200)
    axis = MeasuredAxis(300.0 * np.column_stack([np.sin(turn), 1.0 - np.cos(turn)]))
    exact = frames_along(axis).select(slice(8, 18))
    frames = displace_frames(exact, np.random.default_rng(2), window=12.0, direction_deg=3.0, length=100.0)
    y, station = axis.crossing(frames.position, frames.direction)
    frame = torch.from_numpy(np.column_stack([frames.position, frames.direction, 0.0 * y]))[None]
    center = torch.from_numpy(y).float()[None]
    # One centre is far off and weighs nothing.
    center[0, 3] += 2.0
    weight = torch.ones(1, 10)
    weight[0, 3] = 1e-8
    found, heading = parabola(frame, center, weight, torch.full((3,), 1e-6))
    np.testing.assert_allclose(found[0].numpy(), y, atol=0.02)
    np.testing.assert_allclose(np.delete(found[0].numpy(), 3), np.delete(y, 3), atol=2e-3)
    true = np.angle(np.exp(1j * (axis.direction(station) - frames.direction)))
    np.testing.assert_allclose(heading[0].numpy(), true, atol=2e-3)


def test_parabola_of_coinciding_frames_is_finite():
    frame = torch.zeros(1, 10, 4, dtype=torch.float64)
    center = torch.full((1, 10), 3.0)
    found, heading = parabola(frame, center, torch.ones(1, 10), torch.full((3,), 1e-3))
    torch.testing.assert_close(found, center, atol=1e-4, rtol=0)
    assert torch.isfinite(heading).all()


def test_cells_share_every_point_among_two():
    y = torch.tensor([[-4.9, -1.3, 0.0, 0.1, 3.99, 30.0]])
    mask = torch.tensor([[True, True, True, True, False, True]])
    coord = torch.stack([0.0 * y, y, 2.0 * y], dim=-1)
    sums = cell_sums(coord, mask, torch.ones(1, 6, 1), reach=5.0, number=20)
    assert sums.shape == (1, 20, 3)
    assert sums[..., 2].sum() == sums[..., 0].sum() == pytest.approx(4.0 - 0.3)
    middles = torch.linspace(-4.75, 4.75, 20)
    assert (sums[0, 1:, 2] * middles[1:]).sum() == pytest.approx(-1.3 + 0.1, abs=1e-4)
    assert sums[..., 1].sum() == pytest.approx(2.0 * (-1.3 + 0.1 - 0.7 * 4.9), abs=1e-4)


def test_means_of_cells_hardly_hang_on_density():
    y = torch.linspace(-5.0, 5.0, 400)[None]
    means = []
    for some in (slice(None, None, 4), slice(None)):
        coord = torch.stack([0.0 * y, y, torch.sin(y)], dim=-1)[:, some]
        sums = cell_sums(coord, torch.ones(coord.shape[:2], dtype=torch.bool), torch.sin(y[:, some, None]), 5.0, 12)
        means.append(cell_features(sums)[:, 1:-1, :2])
    torch.testing.assert_close(*means, atol=0.05, rtol=0.0)


def test_cells_do_the_same_one_after_another_and_at_once():
    torch.manual_seed(0)
    coord, mask, features = torch.randn(5, 40, 3), torch.rand(5, 40) > 0.3, torch.rand(5, 40, 2)
    together = cell_sums(coord, mask, features, 2.0, 9)
    alone = [cell_sums(coord[i : i + 1], mask[i : i + 1], features[i : i + 1], 2.0, 9) for i in range(5)]
    torch.testing.assert_close(together, torch.cat(alone))


def test_deformable_kernel_points_learn_to_move():
    torch.manual_seed(0)
    points, layer = PointFeatures((0,), 4), DeformableKernelPoints(5, 4.0, 4, 8)
    coord, seen = torch.randn(2, 50, 3), torch.randn(2, 5, 8)
    tokens = layer(coord, torch.ones(2, 50, dtype=torch.bool), points(coord, torch.rand(2, 50, 5)), seen)
    tokens.features.square().sum().backward()
    assert layer.shift.weight.grad is not None
    assert layer.shift.weight.grad.abs().sum() > 0
    assert ((tokens.places - layer.places).abs() < layer.spacing).all()
    assert ((tokens.places - layer.places).abs() > 0).any()


def test_build_makes_what_is_named():
    for name in MODELS:
        assert type(networks("centerline")[name]().build(14.0, 10)).__name__.lower() == name


def test_odd_widths_are_refused():
    data = {"task": "centerline", "data": {"data_sets": ["x"]}, "network": {"width": 30, "heads": 4}}
    with pytest.raises(InputError, match=r"network.*width must be even and a multiple of heads, 4"):
        from_data(data, "test")
