"""The plans of the models in the package: configurations, splits and mappings exist, and figures are those measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from ml.centerline.task import CenterlineConfiguration
from ml.configuration import load_configuration
from ml.data.classes import LabelMapping, class_names, load_mapping
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from tests.helpers.clouds.road_clouds import block_of
from tests.helpers.clouds.segmentation_data import write_cloud
from tools.make_weights import (
    PLANS,
    RECIPE,
    ROAD_AGAINST_VERGE,
    STRIP,
    cut_strip,
    data_changes,
    figures_of,
    needed_splits,
    road_figures,
)

DATA = Path("out/weights") / RECIPE


@pytest.mark.parametrize("name", PLANS)
def test_a_plan_fits_its_configuration_and_the_recipe(name: str) -> None:
    plan = PLANS[name]
    configuration = load_configuration(plan.configuration, [*plan.changes, *data_changes(plan, DATA)])
    assert configuration.task == plan.task
    splits = {job.split for job in scene_jobs(load_recipe(RECIPE))}
    assert {*plan.splits, *plan.inside, *plan.outside, *plan.strips} <= set(needed_splits(plan)) <= splits
    if isinstance(configuration, CenterlineConfiguration):
        assert {configuration.data.validation_split, configuration.data.calibration_split} <= splits
        assert not any(plan.mapping.values())
    else:
        assert all(mapping and load_mapping(mapping) for mapping in plan.mapping.values())
        for paved in plan.paved.values():
            mapping = LabelMapping.from_dict({**ROAD_AGAINST_VERGE, "axis": "axis.csv", "paved": paved})
            assert mapping.targets(class_names(configuration.scheme())) == ("road", "verge")


@pytest.mark.parametrize("name", [name for name, plan in PLANS.items() if plan.first])
def test_a_second_training_can_continue_the_first_one(name: str) -> None:
    """Their networks, classes and features must be the same: `train` refuses others."""
    plan = PLANS[name]
    first = PLANS[str(plan.first)]
    second_configuration = load_configuration(plan.configuration, [*plan.changes, *data_changes(plan, DATA)])
    first_configuration = load_configuration(first.configuration, [*first.changes, *data_changes(first, DATA)])
    for field in ("task", "classes", "features", "intensity", "network"):
        assert getattr(first_configuration, field) == getattr(second_configuration, field)
    assert set(first.splits) <= set(needed_splits(plan))


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


def test_recall_and_precision_of_the_road_count_its_markings() -> None:
    classes = {name: {} for name in ("ground", "road", "road_marking")}
    confusion = [[50, 8, 2], [20, 60, 0], [0, 10, 10]]
    scores = {"tests": {"strips": {"classes": classes, "confusion": confusion}}}
    recall, precision = road_figures(scores, "strips")
    assert (recall.name, recall.value) == ("recall of road, strips", 80.0)
    assert (precision.name, precision.value) == ("precision of road, strips", 88.9)


def test_a_strip_is_the_ground_near_the_axis(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.uniform(0.0, 50.0, 4000), rng.uniform(-30.0, 30.0, 4000), np.zeros(4000)])
    place = np.array([400_000.0, 5_600_000.0, 0.0])
    block = block_of(xyz + place, rng.uniform(0.1, 0.9, 4000), rng.integers(0, 5, 4000))
    cloud = write_cloud(tmp_path / "cloud.laz", block)
    axis = tmp_path / "axis.csv"
    axis.write_text("\n".join(["x,y,z", *(f"{place[0] + x},{place[1]},0" for x in range(51))]))
    cut_strip(cloud, axis, tmp_path / "strip.laz")
    points = laspy.read(tmp_path / "strip.laz")
    offset = np.asarray(points.y) - place[1]
    assert np.abs(offset).max() <= STRIP
    names = {row.id: row.name for row in class_scheme("5").rows}
    assert {names[number] for number in np.unique(points["class_id"])} == {"ground", "road", "road_marking"}
    expected = (np.abs(xyz[:, 1]) <= STRIP) & (np.asarray(block.class_id) < 3)
    assert len(points.points) == pytest.approx(expected.sum(), abs=3)
