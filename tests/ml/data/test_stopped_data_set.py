"""A data set whose making was stopped, or killed, is one to learn from as far as it goes: by both tasks.

The scenes are small roads that are written without Blender.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.data.batches import DataOptions, read_roads
from ml.data.sources import Source
from ml.runs import Run
from ml.segmentation import task
from ml.segmentation.recipes import Data
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.dataset.manifest import file_entries, read_manifest
from synthroads_addon.dataset.recipe import Recipe
from synthroads_addon.jobs.dataset.processes import Outcome
from synthroads_addon.jobs.dataset.run import DatasetRun
from synthroads_addon.jobs.dataset.scene import published_folders
from synthroads_addon.jobs.dataset.scene_files import DONE, FILES
from tests.helpers.clouds.road_data_sets import write_cloud
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy
from tests.helpers.roads import analytic_roads

RECIPE: dict[str, Any] = {
    "title": "Roads",
    "layouts": ["pointcept", "semantickitti"],
    "set": {"cloud.classes": "5"},
    "groups": [{"name": "a", "scenes": 5, "split": {"train": 2, "validation": 1, "test": 2}}],
}


def make_scene(folder: Path) -> Outcome:
    """Make a scene as its process does: cloud, parameters, a tile and a sequence."""
    attempt = folder / "attempt-1"
    attempt.mkdir()
    shutil.copy(folder / "task.json", attempt)
    task = json.loads((attempt / "task.json").read_text())
    name, files, seed = task["name"], attempt / FILES, 5 + task["number"]
    (files / "scenes" / name).mkdir(parents=True)
    write_cloud(files / "scenes" / name / "cloud.laz", analytic_roads.points(seed=seed))
    road = analytic_roads.parameters(seed=seed)
    (files / "scenes" / name / "parameters.json").write_text(canonical_json(road.to_dict()))
    tile, place = road_tile(500, seed, name, length=20.0), files / f"pointcept/classes-5/{task['split']}/{name}-n00e00"
    place.mkdir(parents=True)
    for array in ("coord", "strength", "segment"):
        np.save(place / f"{array}.npy", getattr(tile, array))
    (files / f"semantickitti/classes-5/sequences/{task['number']:02d}").mkdir(parents=True)
    done = {"points": 500, "length": 160.0, "classes": {"ground": 500}, "files": file_entries(files)}
    done["folders"] = [path.relative_to(files).as_posix() for path in published_folders(files)]
    (attempt / DONE).write_text(json.dumps(done))
    (attempt / "report.json").write_text("{}")
    return Outcome(attempt)


def stopped(folder: Path, killed: bool) -> Path:
    """Make a data set up to its fourth of five scenes; killed: a copy of the folder in that very moment."""

    def scenes(folders: list[str]) -> Iterator[Outcome]:
        for task_folder in folders[:4]:
            yield make_scene(Path(task_folder))
        shutil.copytree(folder, folder.with_name("killed"))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        DatasetRun(Recipe.from_dict(RECIPE), folder).run(scenes)
    return folder.with_name("killed") if killed else folder


@pytest.mark.parametrize("killed", [False, True])
def test_what_there_is_of_a_stopped_data_set_is_learned_from(tmp_path: Path, killed: bool) -> None:
    folder = stopped(tmp_path / "set", killed)
    assert not read_manifest(folder).complete
    roads = read_roads(DataOptions(data_sets=(str(folder),)), "road")
    assert [road.name for road in roads.train] == ["a-01", "a-02"]
    assert [road.name for road in roads.validation] == ["a-03"]
    train, test = (Source(path=str(folder), split=split) for split in ("train", "test"))
    small = toy(tmp_path, set_up="synthetic", crop_points=200, crops_per_tile=2, schedule={"epochs": 1})
    small = small.model_copy(update={"data": Data(synthetic=(train,), tests={"unseen": (test,)})})
    metrics = task.train(Run.start(tmp_path / "run", small))
    assert metrics["training_tiles"] == {"synthetic": 2}
    assert metrics["tests"]["unseen"]["points"] == 500
    assert (folder / "semantickitti" / "classes-5" / "synthroads.yaml").is_file()
