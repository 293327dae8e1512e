"""The job "make a data set": a recipe -> scenes, each in a process of its own -> manifest, descriptions, data card."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from ...base.errors import InputError
from ...base.progress import Progress, silent
from ...dataset.changes import change_recipe
from ...dataset.manifest import Manifest
from ...dataset.recipe import Recipe, load_recipe
from .cluster import Cluster, dask_workers
from .processes import local_processes
from .run import DatasetRun

_MOST_JOBS = 1024


def make_dataset(
    recipe: Recipe | str | Path,
    output: Path,
    *,
    jobs: int | Cluster = 1,
    resume: bool = False,
    overwrite: bool = False,
    splits: Collection[str] | None = None,
    changes: Sequence[str] = (),
    progress: Progress = silent,
) -> Manifest:
    """Make a data set's scenes, each in a process of its own, and return its manifest.

    A scene that fails is logged, and stands in the manifest with ``status`` "failed" and its error; the others are
    made all the same. What an interrupted run has finished stays, and ``resume`` continues it.

    Args:
        recipe: what is made: a recipe, the name of a built-in one, or a .yaml or .json file.
        output: folder for the data set.
        jobs: scenes made at once on this machine, 1 to 1024; or the Dask cluster whose workers make them.
        resume: continue what was begun in the folder.
        overwrite: replace the data set that is there.
        splits: make scenes of these splits only; all if None.
        changes: ``path=value`` for every scenario after the recipe's own, as in "fidelity=draft".
        progress: told how many scenes are done.

    Raises:
        InputError: a value is wrong, what is there was made from another recipe, or the cluster is lost.
        OutputError: the folder holds something else, or can't be written, or another run is at work in it.
    """
    if overwrite and resume:
        raise InputError("--overwrite", None, "can't be given with --resume, which keeps existing scenes")
    if not isinstance(jobs, Cluster) and not 1 <= jobs <= _MOST_JOBS:
        raise InputError("--jobs", jobs, f"must be 1 to {_MOST_JOBS}")
    base_recipe = recipe if isinstance(recipe, Recipe) else load_recipe(str(recipe))
    split_names = frozenset(splits) if splits else None
    work = DatasetRun(change_recipe(base_recipe, changes), output.absolute(), resume, progress, split_names, overwrite)
    return work.run(dask_workers(jobs) if isinstance(jobs, Cluster) else local_processes(jobs))
