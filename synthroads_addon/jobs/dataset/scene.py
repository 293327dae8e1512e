"""One scene of a data set, made below a task's folder, which nobody else looks into before `DONE` is there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base.schema import canonical_json
from ...cloud.formats.registry import open_cloud
from ...dataset.layouts import write_layouts
from ...dataset.manifest import PUBLISHED, file_entries, write_atomically
from ...dataset.recipe import Recipe, SceneJob
from ...road.parameters import read_parameters
from ...scenario.scenario import Scenario
from ..epochs.epochs import SUMMARY, EpochsJob, epoch_name, generate_epochs
from ..generate import Job, generate
from .scene_files import DONE, FILES


def make_scene(task: dict[str, Any], folder: Path, threads: int) -> None:
    """Generate one scene below ``folder / FILES``, in all the recipe's layouts, and describe it in ``folder / DONE``.

    Raises:
        InputError: the scenario can't be met.
    """
    recipe = Recipe.from_dict(task["recipe"], "recipe")
    scenario = Scenario.from_dict(task["scenario"], "scenario")
    job = SceneJob(task["name"], task["number"], task["split"], scenario)
    scene = folder / FILES / "scenes" / job.name
    scan = scenario.scan.model_copy(update={"threads": threads})
    scene_job = Job(scenario.model_copy(update={"scan": scan}), scene, new_file=True)
    if recipe.epochs is None:
        generate(scene_job)
    else:
        _make_epochs(scene_job, scene, recipe.epochs)
    (scene / "report.json").replace(folder / "report.json")
    parameters = read_parameters(scene / "parameters.json")
    origin = np.array(parameters.transform.translate)
    cloud = scene / scenario.cloud.file_names()[0]
    write_layouts(cloud, folder / FILES, recipe, job, origin)
    classes = points_by_class(cloud)
    result = {
        "points": sum(classes.values()),
        "length": round(parameters.alignment.length, 6),
        "classes": classes,
        "files": file_entries(folder / FILES),
        "folders": [path.relative_to(folder / FILES).as_posix() for path in published_folders(folder / FILES)],
    }
    write_atomically(folder / DONE, canonical_json(result))


def _make_epochs(job: Job, scene: Path, count: int) -> None:
    """Make the epochs of a scene: the first one's files are the scene's, those of later ones lie in folders in it.

    Reports have times and are never the same twice: only the first one's is kept, among the logs.
    """
    generate_epochs(EpochsJob(job, count))
    (scene / SUMMARY).unlink()
    for number in range(2, count + 1):
        (scene / epoch_name(number) / "report.json").unlink()
    first = scene / epoch_name(1)
    for path in sorted(first.iterdir()):
        path.replace(scene / path.name)
    first.rmdir()


def points_by_class(cloud: Path) -> dict[str, int]:
    """Return the number of points of each class in a cloud file, by class name, ordered by id."""
    with open_cloud(cloud) as source:
        count = sum((np.bincount(block.class_id, minlength=256) for block in source.blocks()), np.zeros(256, np.int64))
        names = source.header.scheme.names()
    return {names.get(number, str(number)): int(count[number]) for number in np.flatnonzero(count).tolist()}


def published_folders(files: Path) -> list[Path]:
    """Return the folders below ``files`` that are moved into the data set: scene, tiles and sequence."""
    return sorted(path for pattern in PUBLISHED for path in files.glob(pattern))
