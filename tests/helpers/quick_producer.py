"""Scenes for a training in no time, as `jobs.dataset.scene_producer` makes them with Blender: ``FOLDER PRODUCERS``.

The environment says how: ``QUICK_LOG`` a file for the numbers of the scenes that are begun, and how many stand then;
``QUICK_DELAY`` seconds that a scene takes at most; ``QUICK_FAULT`` ``NUMBER:KIND``: a scene and its fault, "error"
once and for all, "exit" of the producer, or "scenario", which can't be met.
"""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.base.process.leave import leave
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.dataset.manifest import SceneEntry, file_entries
from synthroads_addon.dataset.scene_stream import WORK, Failure, StreamPlan, publish, scene_numbers
from synthroads_addon.jobs.dataset.processes import Stop
from synthroads_addon.jobs.dataset.scene_producer import SceneFailedError, serve
from tests.helpers.clouds.road_tiles import road_tile


def make(folder: Path, plan: StreamPlan, number: int, stopping: Stop) -> None:
    """Make a scene: a tile for segmentation, or a road of few kinds for centrelines."""
    job, files = plan.job(number), folder / WORK / str(number)
    files.mkdir()
    with Path(os.environ["QUICK_LOG"]).open("a", encoding="utf-8") as log:
        log.write(f"{number} {len(scene_numbers(folder))} {job.scenario.seed}\n")
    stopping.wait(random.uniform(0.0, float(os.environ.get("QUICK_DELAY", "0"))))
    about: dict[str, Any] = {"name": job.name, "split": job.split, "seed": job.scenario.seed, "status": "done"}
    at, _, kind = os.environ.get("QUICK_FAULT", "").partition(":")
    if at == str(number) and kind == "error":
        raise SceneFailedError(Failure(number=number, name=job.name, error="the disk is on fire"))
    if at == str(number) and kind == "exit":
        sys.stderr.write("out of luck\n")
        sys.stderr.flush()
        os._exit(9)
    if at == str(number) and kind == "scenario":
        about |= {"status": "failed", "error": "road.length is 1: must be more"}
    elif plan.recipe.layouts:
        tile = road_tile(500, job.scenario.seed % 1000, job.name, length=20.0)
        place = files / f"pointcept/classes-5/{job.split}/{job.name}-n00e00"
        place.mkdir(parents=True)
        for array in ("coord", "strength", "segment"):
            np.save(place / f"{array}.npy", getattr(tile, array))
    else:
        from tests.helpers.clouds.road_data_sets import write_cloud
        from tests.helpers.roads import analytic_roads

        scene, seed = files / "scenes" / job.name, 5 + job.scenario.seed % 2
        scene.mkdir(parents=True)
        write_cloud(scene / "cloud.laz", analytic_roads.points(seed=seed))
        (scene / "parameters.json").write_text(canonical_json(analytic_roads.parameters(seed=seed).to_dict()))
    entry = SceneEntry.from_dict({**about, "files": file_entries(files)}, "scene")
    if not stopping.is_set():
        publish(folder, number, files, entry, plan)


if __name__ == "__main__":
    leave(lambda: serve(Path(sys.argv[1]), int(sys.argv[2]), make, patience=1.0))
