"""One scene of a data set in a process of its own: ``python headless/dataset_scene.py TASK.json THREADS``.

It ends when whoever began it does: its standard input is then closed. What it makes lies in the task's folder, which
nobody else looks into before `DONE` is there.
"""

import json
import os
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import leave
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import canonical_json, read_json
from synthroads_addon.base.scratch.folders import remove_scratch_folders
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.dataset.layouts import write_layouts
from synthroads_addon.dataset.manifest import PUBLISHED, file_entries, write_atomically
from synthroads_addon.dataset.recipe import Recipe, SceneJob
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.scenario.scenario import Scenario

FILES = "files"
"""Subfolder of a task's folder that is laid out as the data set."""
DONE = "done.json"
FAILED = "failed.json"


def make_scene(task: dict[str, Any], folder: Path, threads: int) -> None:
    """Generate one scene below ``folder / FILES``, in all the recipe's layouts, and describe it in ``folder / DONE``.

    Raises:
        InputError: the scenario can't be met.
    """
    from synthroads_addon.jobs.generate import Job, generate

    recipe = Recipe.from_dict(task["recipe"], "recipe")
    scenario = Scenario.from_dict(task["scenario"], "scenario")
    job = SceneJob(task["name"], task["number"], task["split"], scenario)
    scene = folder / FILES / "scenes" / job.name
    scan = scenario.scan.model_copy(update={"threads": threads})
    generate(Job(scenario.model_copy(update={"scan": scan}), scene, new_file=True))
    (scene / "report.json").replace(folder / "report.json")
    parameters = read_parameters(scene / "parameters.json")
    origin = np.array(parameters.transform.translate)
    cloud = scene / scenario.cloud.file_names()[0]
    write_layouts(cloud, folder / FILES, recipe, job, origin)
    classes = points_by_class(cloud)
    done = {
        "points": sum(classes.values()),
        "length": round(parameters.alignment.length, 6),
        "classes": classes,
        "files": file_entries(folder / FILES),
        "folders": [path.relative_to(folder / FILES).as_posix() for path in published_folders(folder / FILES)],
    }
    write_atomically(folder / DONE, canonical_json(done))


def points_by_class(cloud: Path) -> dict[str, int]:
    """Return the number of points of each class in a cloud file, by class name, ordered by id."""
    with open_cloud(cloud) as source:
        count = sum((np.bincount(block.class_id, minlength=256) for block in source.blocks()), np.zeros(256, np.int64))
        names = source.header.scheme.names()
    return {names.get(number, str(number)): int(count[number]) for number in np.flatnonzero(count).tolist()}


def published_folders(files: Path) -> list[Path]:
    """Return the folders below ``files`` that are moved into the data set: scene, tiles and sequence."""
    return sorted(path for pattern in PUBLISHED for path in files.glob(pattern))


def main() -> int:
    """Make the scene of the task file in ``sys.argv``; return the exit code, 2 if the scenario can't be met."""
    path = Path(sys.argv[1])
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        make_scene(read_json(path), path.parent, int(sys.argv[2]))
    except InputError as error:
        message = str(error).replace(str(path.parent), "")
        of_scenario = type(error) is InputError  # and not a file that is missing or can't be written
        write_atomically(path.parent / FAILED, json.dumps({"error": message, "of_scenario": of_scenario}))
        return 2
    return 0


def _end_with_parent() -> None:
    """Block until standard input is closed, as when the parent ends; then end the process with code 130."""
    sys.stdin.buffer.read()
    remove_scratch_folders()
    os._exit(130)


if __name__ == "__main__":
    leave(main, supervised=False)  # the data set's run tries again what the system ends
