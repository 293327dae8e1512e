"""Segmentation as one of the learning tasks: train, evaluate, predict."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.progress import Progress, peak_memory_mb, silent
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud

from ..configuration import Configuration
from ..processes import helpers
from ..runs import Run
from ..tasks import Evaluation, Prediction
from ..training_loop import chosen_device
from .data.sources import Source
from .prediction import Labelling, predict_file
from .recipes import SegmentationConfiguration
from .scores.evaluation import check_tests, classifier, score, score_all, trained_model
from .scores.metrics import score_table
from .scores.pictures import comparison
from .training import train_network

_ONE_TILE = 5_000_000
"""Points of a cloud up to which it is scored as one tile."""
SegmentationRun = Run[SegmentationConfiguration]


def configuration_kind() -> type[Configuration]:
    """Return the class of the configurations."""
    return SegmentationConfiguration


def train(run: SegmentationRun, progress: Progress = silent) -> dict[str, Any]:
    """Train a run, score it on its configuration's tests and return the metrics.

    Raises:
        InputError: data are missing, or don't fit the configuration.
    """
    configuration = run.configuration
    check_tests(configuration)
    device = chosen_device(configuration)
    with helpers(run, train_network, device):
        model, domains = train_network(run, progress)
    tests = score_all(model, configuration, device, progress)
    metrics = {
        **{f"{name}_mean_iou": result["mean_iou"] for name, result in tests.items()},
        "parameters": sum(weight.numel() for weight in model.parameters()),
        "training_points": {name: sum(map(len, tiles)) for name, tiles in domains.items()},
        "training_tiles": {name: len(tiles) for name, tiles in domains.items()},
        "device": str(device),
        "peak_memory_mb": peak_memory_mb(),
        "tests": tests,
    }
    run.write_metrics(metrics)
    return metrics


def evaluate(run: SegmentationRun, evaluation: Evaluation, progress: Progress = silent) -> dict[str, Any]:
    """Score a trained run on labelled data, each by itself; write tables and pictures.

    Raises:
        InputError: a cloud has no labels and there is no mapping, or its classes don't fit.
        OutputError: the folder can't be written.
    """
    configuration = run.configuration
    device = chosen_device(configuration)
    model = trained_model(run, device)
    results: dict[str, Any] = {}
    files: list[str] = []
    for path, name in zip(evaluation.data, _names(evaluation), strict=True):
        source = _test_source(path, evaluation)
        confusion, shown = score(model, configuration, [source], device, progress)
        results[name] = confusion.to_dict()
        files.append(f"{name}.txt")
        write_file(evaluation.output / files[-1], (score_table(results[name]) + "\n").encode(), overwrite=True)
        if shown is not None:
            tile, labels = shown
            classes = source.targets(configuration.scheme())
            files.append(f"{name}.png")
            write_file(evaluation.output / files[-1], comparison(tile, labels, classes), overwrite=True)
    means = {f"{name}_mean_iou": result["mean_iou"] for name, result in results.items()}
    return {**means, "tests": results, "files": files}


def report(result: Mapping[str, Any]) -> str:
    """Return what `evaluate` found as tables for people: scores by class of each test, in percent."""
    return "\n\n".join(f"{name}:\n{score_table(scores)}" for name, scores in result["tests"].items())


def _names(evaluation: Evaluation) -> list[str]:
    """Return a name for the results of each data, with as many of its folders as tell it from the others.

    Raises:
        InputError: data are given twice.
    """
    places = [
        path.with_name(f"{path.name}-{evaluation.split}") if path.is_dir() else path.with_suffix("")
        for path in (given.absolute() for given in evaluation.data)
    ]
    given = zip(evaluation.data, places, strict=True)
    if twice := sorted(str(path) for path, place in given if places.count(place) > 1):
        raise InputError("data", twice[0], "is given twice, or with two endings")
    longest = max(len(place.parts) for place in places)
    tried = (["-".join(place.parts[-parts:]) for place in places] for parts in range(1, longest + 1))
    return next(names for names in tried if len(set(names)) == len(names))


def _test_source(path: Path, evaluation: Evaluation) -> Source:
    """Return a test's source; a cloud that memory holds with ease is one tile, as tiles' edges see less around them."""
    if path.is_dir():
        return Source(path=str(path), split=evaluation.split, mapping=evaluation.mapping)
    tile = 60.0
    if path.suffix.lower() in ENDINGS and path.is_file():
        with suppress(InputError), open_cloud(path) as cloud:  # a packed file is no cloud
            tile = 1000.0 if cloud.header.count <= _ONE_TILE else tile
    return Source(path=str(path), mapping=evaluation.mapping, tile=tile)


def predict(run: SegmentationRun, prediction: Prediction, progress: Progress = silent) -> dict[str, Any]:
    """Label the points of a LAS or LAZ file; see `prediction.predict_file`."""
    configuration = run.configuration
    device = chosen_device(configuration)
    labelling = Labelling(
        classifier(trained_model(run, device), configuration, device),
        configuration.crop_settings(),
        configuration.scheme(),
        configuration.intensity,
    )
    result = predict_file(
        prediction.cloud,
        prediction.output,
        labelling,
        classification=prediction.classification,
        overwrite=prediction.overwrite,
        progress=progress,
    )
    return {**result, "peak_memory_mb": peak_memory_mb()}
