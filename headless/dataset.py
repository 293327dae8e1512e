"""Make a data set of many scenes from a recipe: each scene in a process of its own, resumable, with checksums."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import detail
from headless.options import add_changes_argument
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.dataset.changes import change_recipe
from synthroads_addon.dataset.manifest import Manifest, faults, read_manifest
from synthroads_addon.dataset.recipe import load_recipe, recipe_names
from synthroads_addon.jobs.dataset.cluster import TIMEOUT, Cluster


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads dataset` to its parser."""
    names = ", ".join(recipe_names())
    parser.add_argument("recipe", metavar="RECIPE", help=f"{names}, or a .yaml or .json file")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the data set")
    place_group = parser.add_mutually_exclusive_group()
    place_group.add_argument("--jobs", type=int, metavar="N", help="scenes made at the same time on this machine (1)")
    place_group.add_argument(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers make the scenes (none), tcp://HOST:PORT"
    )
    parser.add_argument(
        "--worker-timeout", type=float, metavar="S", help="give up after this many seconds without a worker (1800)"
    )
    parser.add_argument("--resume", action="store_true", help="continue the data set that was begun in this folder")
    parser.add_argument("--overwrite", action="store_true", help="replace the data set that is there")
    parser.add_argument(
        "--splits", nargs="+", metavar="SPLIT", help="make scenes of these splits only (all); --resume makes the others"
    )
    parser.add_argument("--verify", action="store_true", help="make nothing: compare every file with its checksum")
    add_changes_argument(parser, "every scenario after the recipe's own", "fidelity=draft")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads dataset`; return exit code (3 if scenes failed), manifest as JSON data and printed text."""
    for name, is_given in (("--resume", arguments.resume), ("--verify", arguments.verify)):
        if is_given and arguments.overwrite:
            raise InputError("--overwrite", None, f"can't be given with {name}, which keeps existing scenes")
    if arguments.verify:
        return _verify(arguments.output)
    workers = _workers(arguments)
    recipe = change_recipe(load_recipe(arguments.recipe), arguments.changes)
    detail("recipe", recipe.to_dict())
    from synthroads_addon.jobs.dataset.make import make_dataset

    manifest = make_dataset(
        recipe,
        arguments.output,
        jobs=workers,
        resume=arguments.resume,
        overwrite=arguments.overwrite,
        splits=arguments.splits,
        progress=progress_bar(arguments),
    )
    has_failures = [scene for scene in manifest.scenes if scene.status == "failed"]
    return 3 if has_failures else 0, manifest.to_dict(), summary(manifest, arguments.output)


def _workers(arguments: argparse.Namespace) -> int | Cluster:
    """Return how many scenes are made at once on this machine, or the cluster that makes them."""
    if arguments.scheduler:
        timeout = arguments.worker_timeout
        return Cluster(arguments.scheduler) if timeout is None else Cluster(arguments.scheduler, timeout)
    if arguments.worker_timeout is not None:
        raise InputError("--worker-timeout", arguments.worker_timeout, TIMEOUT)
    return 1 if arguments.jobs is None else int(arguments.jobs)


def _verify(folder: Path) -> Outcome:
    """Compare a data set's files with its manifest; return the outcome."""
    manifest = read_manifest(folder)
    fault_texts = faults(folder, manifest.scenes)
    files = sum(len(scene.files or {}) for scene in manifest.scenes)
    text = (
        "\n".join(fault_texts)
        if fault_texts
        else f"{files:,} files of {len(manifest.scenes)} scenes are as the manifest says"
    )
    return 3 if fault_texts else 0, {"files": files, "faults": fault_texts}, text


def summary(manifest: Manifest, folder: Path) -> str:
    """Return a line on the scenes and points that were made, and where they are."""
    scenes = [scene for scene in manifest.scenes if scene.status == "done"]
    points = sum(scene.points or 0 for scene in scenes)
    return f"{len(scenes)} of {len(manifest.scenes)} scenes, {points:,} points\nwritten to {folder}"


if __name__ == "__main__":
    entry("dataset")
