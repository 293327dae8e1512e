"""The two-sample test: it can't tell what is alike, and tells by the right statistics what isn't."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.selection.patches import make_patches
from synthroads_addon.comparison import classifier
from synthroads_addon.comparison.classifier import distinguish, squared_discrepancy
from tests.helpers.clouds.pavement_points import pavement


@pytest.fixture(autouse=True)
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classifier, "_TREES", 20)


def told(changes: dict[str, object]) -> classifier.Distinction:
    """Return how well a changed pavement is told from another draw of the usual one."""
    one, other = (make_patches(road, "x") for road in (pavement(seed=2, **changes), pavement()))  # type: ignore[arg-type]
    return distinguish(one, other, 1, "changed.laz")


def test_two_draws_of_the_same_are_not_told_apart() -> None:
    alike = told({})
    assert all(abs(auc - 0.5) < 0.09 for auc in alike.auc.values()), alike.auc
    assert max(alike.features.values()) < 0.6
    assert abs(alike.mmd) < 0.005


@pytest.mark.parametrize(
    ("changes", "group", "feature"),
    [
        ({"pattern": "lattice"}, "pattern", "spacing_variation"),
        ({"height_noise": 0.01}, "geometry", "residual_mm"),
        ({"spread_db": 0.2}, "intensity", "intensity_iqr_db"),
    ],
)
def test_what_differs_is_named(changes: dict[str, object], group: str, feature: str) -> None:
    different = told(changes)
    assert different.auc["all"] > 0.97
    assert different.auc[group] > 0.97
    others = {name: auc for name, auc in different.auc.items() if name not in ("all", group)}
    assert max(others.values()) < 0.8, others
    assert different.features[feature] > 0.97
    assert different.mmd > 0.02


def test_clouds_of_other_densities_are_refused() -> None:
    one, other = (make_patches(pavement(density=density), "x") for density in (30.0, 120.0))
    with pytest.raises(InputError, match=r"thin.laz is \d+: at least 60 patches .*, 1\d\d to 1\d\d points/m2"):
        distinguish(one, other, 1, "thin.laz")


def test_a_statistic_alone_tells_as_scikit_learn_says() -> None:
    random = np.random.default_rng(3)
    truth = random.random(300) < 0.4
    for values in (random.normal(size=300) + truth, random.integers(0, 4, 300) - 1.0 * truth):
        auc = roc_auc_score(truth, values)
        assert classifier._auc_alone(values, truth) == pytest.approx(max(auc, 1.0 - auc), abs=1e-12)


def test_the_discrepancy_grows_with_the_difference() -> None:
    random = np.random.default_rng(1)
    usual = random.normal(size=(400, 4))
    values = [squared_discrepancy(random.normal(shift, 1.0, (400, 4)), usual) for shift in (0.0, 0.5, 1.0)]
    assert abs(values[0]) < 0.003
    assert values[0] < values[1] < values[2]
