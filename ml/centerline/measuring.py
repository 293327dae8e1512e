"""A trained model measured beside predictors that learn nothing: figures, tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.dataset.manifest import MANIFEST

from ..data.roads import LearningRoad, axis_beside, clouds_with_axes, read_measured, read_scene, scene_folders
from ..data.slices import SliceSettings
from ..networks.centerline.models import TARGETS
from ..scores.baselines import SkeletonSettings
from ..scores.distances import TARGET_METRICS, TargetErrors
from ..scores.evaluation import (
    STRETCHES,
    Case,
    Predictor,
    make_case,
    measure,
    skeleton_predictor,
    trivial_predictors,
)
from ..scores.metrics import figures, nan_to_none
from ..scores.pictures import PictureView, corridor_picture, lines_picture
from ..scores.tables import as_data, report, write_tables
from ..tasks import Evaluation
from .predictor import CenterlinePredictor, target_errors
from .rules import views_predictor

if TYPE_CHECKING:
    from .task import CenterlineConfiguration


PICTURES = 3
"""Roads that are drawn. Chosen: a look at the first ones."""
_VIEW = 200.0
"""Length of road that a picture shows, m. Chosen: centimetres across can be told."""


def measure_run(
    configuration: CenterlineConfiguration,
    predictor: CenterlinePredictor,
    evaluation: Evaluation,
    progress: Progress = silent,
) -> tuple[dict[str, Any], str]:
    """Measure a trained model on data sets and on real clouds with an axis beside them; write tables and pictures.

    Synthetic roads are looked at along a path that strays from the axis, and whole. Real ones, whose strips were cut
    around the axis, have both sides cropped at random, anew every 50 m, and the path is found in what is left.

    Returns:
        the model's mean figures; ``tables`` has those of all predictors and roads, ``corridor`` its errors by target,
        ``files`` the names of what was written. And tables for people.
    """
    cases = read_cases(configuration, evaluation, progress)
    name = f"{configuration.network.name}, seed {configuration.seed}"
    width = configuration.slices.half_width
    predictors: dict[str, Sequence[Predictor]] = {name: [predictor]}
    predictors |= {
        "views": [views_predictor()],
        f"views with {configuration.network.name}": [views_predictor(predictor)],
    }
    predictors |= {"skeleton": [skeleton_predictor(SkeletonSettings())], **trivial_predictors(width)}
    progress("measuring", 0.0)
    spreads = measure(predictors, lambda seed: cases, [configuration.seed])
    corridor = corridor_figures(predictor, cases)
    files = [*write_tables(evaluation.output, "centerline", spreads), "corridor.json"]
    write_file(evaluation.output / files[-1], canonical_json(corridor).encode(), overwrite=True)
    for number, case in enumerate(cases[:PICTURES]):
        progress("drawing", number / min(len(cases), PICTURES))
        files += _draw_road(evaluation.output, case, predictor, name)
    results = {"corridor": corridor, "tables": as_data(spreads), "files": files}
    means = {figure: nan_to_none(spread.mean) for figure, spread in spreads[name]["all"].items()}
    return {"roads": len(cases), **means, **results}, report(spreads, corridor)


def read_cases(
    configuration: CenterlineConfiguration, evaluation: Evaluation, progress: Progress = silent
) -> list[Case]:
    """Return the evaluation's roads, each with frames along a path drawn by the configuration's seed.

    Raises:
        MissingFileError: there is no such data set or cloud, or no axis beside a cloud.
        InputError: something is damaged, or no road has a truth of the configuration's kind.
    """
    settings, seed = configuration.slices, configuration.seed
    cases: list[Case] = []
    for path in evaluation.data:
        progress(f"reading {path.name}", len(cases) / max(1, len(evaluation.data)))
        if (path / MANIFEST).is_file():
            cache = Path(configuration.data.cache) if configuration.data.cache else None
            for folder in scene_folders(path, evaluation.split):
                # Nothing is written where a run's file says: it may be somebody else's.
                for road in read_scene(folder, settings.truth, cache, keep=False):
                    cases.append(make_case(road, seed, cropping=None, estimated=False, settings=settings))
        else:
            for cloud in clouds_with_axes(path) if path.is_dir() else [path]:
                road = read_measured(cloud, axis_beside(cloud), settings.truth)
                cases.append(measured_case(road, seed, settings))
    if not cases:
        names = ", ".join(str(path) for path in evaluation.data)
        raise InputError("data", names, f"holds no road with a {settings.truth} of the kind that was learned")
    return cases


def measured_case(road: LearningRoad, seed: int, settings: SliceSettings) -> Case:
    """Return a real road as a case: both sides cropped, anew every 50 m, the path found in the points left."""
    return make_case(road, seed, cropping=STRETCHES, estimated=True, settings=settings)


def corridor_figures(predictor: CenterlinePredictor, cases: Sequence[Case]) -> dict[str, dict[str, float | None]]:
    """Return the figures `TARGET_METRICS` of each target over all roads' frames; None without known truth."""
    error, std, interval_widths = [], [], []
    for case in cases:
        regression = predictor.regress(case.road, case.frames)
        error.append(target_errors(regression, case.road.known_truth))
        std.append(regression.std)
        interval_widths.append(regression.widths)
    all_errors, deviation, widths = np.concatenate(error), np.concatenate(std), np.concatenate(interval_widths)
    rows = {}
    for index, name in enumerate(TARGETS):
        is_known = np.isfinite(all_errors[:, index]) & np.isfinite(deviation[:, index])
        size = np.abs(all_errors[is_known, index])
        target = TargetErrors(size, deviation[is_known, index], widths[is_known, index], name == "lanes")
        rows[name] = {figure: nan_to_none(value) for figure, value in figures(TARGET_METRICS, target).items()}
    return rows


def _draw_road(folder: Path, case: Case, predictor: CenterlinePredictor, name: str) -> list[str]:
    """Write two PNG pictures of a road, its centrelines and its corridor, to a folder; return their file names."""
    length = case.road.known_truth.axis.length
    view = PictureView(max(0.0, 0.5 * (length - _VIEW)), min(length, 0.5 * (length + _VIEW)))
    prediction = predictor(case.road, case.frames)
    lines: Mapping[str, Float] = {
        name: prediction[:, 0],
        "skeleton": skeleton_predictor(SkeletonSettings())(case.road, case.frames)[:, 0],
    }
    pictures = {
        "lines": lines_picture(case, lines, view, f"{case.road.name}: centrelines"),
        "corridor": corridor_picture(case, prediction, view, f"{case.road.name}: corridor of {name}"),
    }
    for kind, content in pictures.items():
        write_file(folder / f"{case.road.name}-{kind}.png", content, overwrite=True)
    return [f"{case.road.name}-{kind}.png" for kind in pictures]
