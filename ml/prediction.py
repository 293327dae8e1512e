"""A trained model used on a cloud, in one call: which model, which file, and what was predicted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from synthroads_addon.base.files import path_beside
from synthroads_addon.base.progress import Progress, silent

from .choice import Choice, choose_model, usable_cards, with_agreements
from .runs import Run
from .shipped import open_run
from .tasks import Prediction, task

_ADDED = "-predicted"
"""Ending of the output's name after the cloud's, where none is given."""


@dataclass(frozen=True)
class Predicted:
    """Result of a prediction that was written to a file.

    Attributes:
        task: task of the model: "segmentation" or "centerline".
        output: file that was written.
        metrics: summary of the prediction, with its duration, as JSON data.
        choice: choice of the shipped model; None if a model was given.
    """

    task: str
    output: Path
    metrics: dict[str, Any]
    choice: Choice | None = None


def predict(
    cloud: Path,
    output: Path | None = None,
    run: Path | str | None = None,
    *,
    path: Path | None = None,
    classification: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
) -> Predicted:
    """Label a cloud's points, or find its road's centreline, by a trained model, and write the result to a file.

    Args:
        cloud: file to read (.laz, .las, .ply, ...).
        output: labelled cloud (.laz, .las) of a segmentation, centreline (.geojson) of a centreline model; one beside
            the cloud if None, see `usual_output`.
        run: folder of a trained run, or a shipped model's name; the shipped segmentation that was trained on what is
            most like the cloud if None.
        path: line along the road that a centreline model begins with, CSV or GeoJSON; found in the cloud if None.
        classification: write the classes' LAS codes to the field ``classification``, besides ``predicted_class``.
        overwrite: replace a file that is there.
        progress: called with the stage and its share.

    Raises:
        InputError: there is no such cloud or model, or the cloud isn't what the model needs.
    """
    choice, trained_run = (None, open_run(Path(run))) if run is not None else _choose_run(cloud)
    name = trained_run.configuration.task
    target = output or usual_output(cloud, name)
    prediction = Prediction(cloud, target, path, overwrite, classification, "--output" if output else "")
    return Predicted(name, target, task(name).predict(trained_run, prediction, progress), choice)


def _choose_run(cloud: Path) -> tuple[Choice, Run[Any]]:
    """Return the shipped segmentation for a cloud, by its traits and in doubt by a trial of those it fits, and its run.

    Raises:
        InputError: it is no cloud, or no model is of use for it.
    """
    choice = choose_model(cloud, "segmentation")
    cards = usable_cards("segmentation", choice.traits) if choice.doubtful else []
    if len(cards) < 2:
        return choice, open_run(Path(choice.card.name))
    # Imported here: networks take time to load, and most clouds are like what one of the models was trained on.
    from .segmentation.self_agreement import sample_cloud, self_agreement

    sample = sample_cloud(cloud, choice.traits.squares)
    runs = {card.name: open_run(Path(card.name)) for card in cards}
    choice = with_agreements(choice, cards, {name: self_agreement(run, sample) for name, run in runs.items()})
    return choice, runs[choice.card.name]


def usual_output(cloud: Path, task_name: str) -> Path:
    """Return the output file beside a cloud that is used where none is named; it differs for each cloud.

    Raises:
        InputError: the cloud's path has no file name.
    """
    if task_name == "segmentation":
        return path_beside(cloud, f"{cloud.stem}{_ADDED}{cloud.suffix}", "CLOUD")
    return path_beside(cloud, f"{cloud.name}{_ADDED}.geojson", "CLOUD")
