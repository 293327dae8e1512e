"""The plans of the models in the package: configurations, splits and mappings exist, and figures are those measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ml.centerline.task import CenterlineConfiguration
from ml.configuration import load_configuration
from ml.data.classes import load_mapping
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from tools.make_weights import PLANS, RECIPE, data_changes, figures_of

DATA = Path("out/weights") / RECIPE


@pytest.mark.parametrize("name", PLANS)
def test_a_plan_fits_its_configuration_and_the_recipe(name: str) -> None:
    plan = PLANS[name]
    configuration = load_configuration(plan.configuration, [*plan.changes, *data_changes(plan, DATA)])
    assert configuration.task == plan.task
    splits = {job.split for job in scene_jobs(load_recipe(RECIPE))}
    assert {*plan.inside, *plan.outside} <= splits
    assert "train" in splits
    if isinstance(configuration, CenterlineConfiguration):
        assert {configuration.data.validation_split, configuration.data.calibration_split} <= splits
        assert not any(plan.mapping.values())
    else:
        assert all(mapping and load_mapping(mapping) for mapping in plan.mapping.values())


def means(mae: float | None, share: float = 0.5) -> dict[str, Any]:
    """Return a predictor's row of `synthroads evaluate`, all roads together."""
    figures = {"mae": mae, "coverage_68": share, "coverage_95": 0.9}
    return {"all": {name: {"mean": value} for name, value in figures.items()}}


def test_a_centrelines_figures_stand_beside_the_best_rule() -> None:
    tables = {
        "transformer, seed 1": means(0.4),
        "views": means(0.3),
        "views with transformer": means(0.2, 0.7),
        "skeleton": means(None),
        "middle of the bright": means(0.25),
        "the displaced path": means(0.01),
    }
    found = figures_of(PLANS["centerline-airborne"], {"tables": tables}, "a road", is_inside=True)
    assert [(one.value, one.rule, one.unit) for one in found] == [
        (0.4, 0.25, "m"),
        (0.2, 0.25, "m"),
        (70.0, None, "%"),
        (90.0, None, "%"),
    ]


def test_a_segmentations_figures_leave_out_classes_without_points() -> None:
    classes = {
        "ground": {"iou": 0.5, "support": 10},
        "road": {"iou": 0.25, "support": 5},
        "vegetation": {"iou": 0.0, "support": 0},
    }
    scores = {"tests": {"cloud": {"classes": classes, "mean_iou": 0.375}}}
    found = figures_of(PLANS["segmentation-overhead"], scores, "a scan", is_inside=False)
    assert [one.name for one in found] == ["mean IoU, a scan", "IoU of ground, a scan", "IoU of road, a scan"]
    assert [one.value for one in found] == [37.5, 50.0, 25.0]
