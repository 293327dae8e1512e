"""The losses: Gaussian likelihood of what is known, and the cross-entropy of places."""

from __future__ import annotations

import pytest
import torch

from ml.networks.centerline.losses import OUTLIER, LossOptions, centerline_loss, cross_entropy, likelihood
from tests.helpers.clouds.centerline_batches import MODELS, SETTINGS, batch, small


def test_likelihood_is_the_gaussian_one():
    torch.manual_seed(0)
    log_std = 0.5 * torch.randn(4, 10, 3)
    error = (2.0 * torch.rand(4, 10, 3) - 1.0) * OUTLIER * torch.exp(log_std)
    known = torch.ones(4, 10, 3, dtype=torch.bool)
    reference = torch.nn.functional.gaussian_nll_loss(
        error, torch.zeros(4, 10, 3), torch.exp(2.0 * log_std), reduction="none", eps=1e-12
    )
    torch.testing.assert_close(likelihood(error, log_std, known, beta=0.0), reference.mean((0, 1)))


def test_outliers_have_a_gradient_of_their_own():
    error = torch.tensor([-100.0, 0.5, 7.0], requires_grad=True)
    known = torch.ones(1, 1, 3, dtype=torch.bool)
    likelihood(error.view(1, 1, 3), torch.zeros(1, 1, 3), known, beta=0.0).sum().backward()
    assert error.grad.tolist() == pytest.approx([-OUTLIER, 0.5, OUTLIER])


def test_beta_one_has_the_gradient_of_squared_errors():
    error = torch.rand(2, 3, 1, requires_grad=True)
    log_std = torch.rand(2, 3, 1)
    likelihood(error, log_std, torch.ones(2, 3, 1, dtype=torch.bool), beta=1.0).sum().backward()
    torch.testing.assert_close(error.grad, error.detach() / 6.0)


def test_deviation_that_fits_best_is_that_of_the_errors():
    torch.manual_seed(0)
    error = 0.3 * torch.randn(50, 100, 1)
    known = torch.ones(50, 100, 1, dtype=torch.bool)
    for beta in (0.0, 0.5):
        log_std = torch.zeros(1, requires_grad=True)
        optimizer = torch.optim.Adam([log_std], lr=0.05)
        for _ in range(200):
            optimizer.zero_grad()
            likelihood(error, log_std.expand(50, 100, 1), known, beta).sum().backward()
            optimizer.step()
        assert torch.exp(log_std).item() == pytest.approx(0.3, rel=0.05)


def test_unknown_truth_has_no_influence():
    one = batch(2)
    for name in MODELS:
        model = small(name)
        loss = centerline_loss(LossOptions(), SETTINGS.half_width)
        part = dict(one, center=one["center"].clone(), corridor=one["corridor"].clone())
        part["center"][0] = torch.nan
        part["corridor"][:, :, 2] = torch.nan
        value, figures = loss(model, part)
        value.backward()
        gradients = [weights.grad for weights in model.parameters() if weights.grad is not None]
        assert torch.isfinite(value)
        assert figures["center_mae"] > 0
        assert all(torch.isfinite(gradient).all() for gradient in gradients)
        nothing = dict(one, center=torch.full_like(one["center"], torch.nan))
        nothing["corridor"] = torch.full_like(one["corridor"], torch.nan)
        assert loss(model, nothing)[0].item() == 0.0


def test_cross_entropy_is_least_where_the_lines_are():
    places = torch.linspace(-4.0, 4.0, 5).expand(1, 1, 5)
    lines = torch.tensor([[[0.5, -3.0, 9.0]]])
    known = torch.ones(1, 1, 3, dtype=torch.bool)
    share = torch.tensor([[0, 0, 0.75, 0.25, 0], [0.5, 0.5, 0, 0, 0], [0, 0, 0, 0, 1.0]]).T[None, None]
    best = cross_entropy(torch.log(share + 1e-9), places, lines, known)
    entropy = -(share * torch.log(share + 1e-9)).sum((0, 1, 2))
    torch.testing.assert_close(best, entropy, atol=1e-5, rtol=0)
    moved = cross_entropy(torch.log(share.roll(1, 2) + 1e-9), places, lines, known)
    assert (moved > best + 0.1).all()
    known[..., 1] = False
    assert cross_entropy(torch.zeros(1, 1, 5, 3), places, lines, known)[1] == 0


def test_loss_falls():
    one = batch(4)
    for name in MODELS:
        model = small(name)
        loss = centerline_loss(LossOptions(), SETTINGS.half_width)
        optimizer = torch.optim.AdamW(model.parameters(), lr=3e-3)
        values = []
        for _ in range(20):
            optimizer.zero_grad()
            value, _ = loss(model, one)
            value.backward()
            optimizer.step()
            values.append(value.item())
        assert values[-1] < 0.7 * values[0], name
