"""Make a data set of many scenes from a recipe: each scene in a process of its own, resumable, with checksums."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, add_changes_argument, entry
from headless.messages import detail, progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.dataset.manifest import Manifest, faults, read_manifest
from synthroads_addon.dataset.recipe import Recipe, load_recipe, path_within, recipe_names
from synthroads_addon.scenario.scenario import scenario_changes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads dataset` to its parser."""
    known = ", ".join(recipe_names())
    parser.add_argument("recipe", metavar="RECIPE", help=f"{known}, or a .yaml or .json file")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the data set")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=int, metavar="N", help="scenes made at once on this machine (1)")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers make them (none), tcp://HOST:PORT"
    )
    parser.add_argument(
        "--worker-timeout", type=float, metavar="S", help="seconds that a scheduler may be without any worker (1800)"
    )
    parser.add_argument("--resume", action="store_true", help="continue what was begun in this folder")
    parser.add_argument("--overwrite", action="store_true", help="replace the data set that is there")
    parser.add_argument(
        "--splits", nargs="+", metavar="SPLIT", help="make scenes of these splits only (all); --resume makes the others"
    )
    parser.add_argument("--verify", action="store_true", help="make nothing: compare every file with its checksum")
    add_changes_argument(parser, "every scenario after the recipe's own", "fidelity=draft")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads dataset`; return exit code (3 if scenes failed), manifest as JSON data and printed text."""
    for name, keeps in (("--resume", arguments.resume), ("--verify", arguments.verify)):
        if keeps and arguments.overwrite:
            raise InputError("--overwrite", None, f"can't be given with {name}, which keeps what is there")
    if arguments.verify:
        return _verify(arguments.output)
    if arguments.jobs is not None and not 1 <= arguments.jobs <= 1024:
        raise InputError("--jobs", arguments.jobs, "must be 1 to 1024")
    if arguments.worker_timeout is not None and not (arguments.scheduler and 1.0 <= arguments.worker_timeout < 1e9):
        raise InputError("--worker-timeout", arguments.worker_timeout, "must be 1 s or more, and goes with --scheduler")
    recipe = change_recipe(load_recipe(arguments.recipe), arguments.changes)
    detail("recipe", recipe.to_dict())
    from headless.dataset_run import DatasetRun, dask_workers, local_processes

    splits = frozenset(arguments.splits) if arguments.splits else None
    folder, progress = arguments.output.absolute(), progress_bar(arguments)
    work = DatasetRun(recipe, folder, arguments.resume, progress, splits, arguments.overwrite)
    if arguments.scheduler:
        submit = dask_workers(arguments.scheduler, arguments.worker_timeout or 1800.0)
    else:
        submit = local_processes(arguments.jobs or 1)
    manifest = work.run(submit)
    failed = [scene for scene in manifest.scenes if scene.status == "failed"]
    return 3 if failed else 0, manifest.to_dict(), summary(manifest, arguments.output)


def change_recipe(recipe: Recipe, changes: list[str]) -> Recipe:
    """Return a copy of a recipe with further changes (``path=value``) to the scenarios of all its groups."""
    if not changes:
        return recipe
    values = dict(scenario_changes(changes))
    groups = []
    for group in recipe.groups:
        draw = {
            path: drawn for path, drawn in group.draw.items() if not any(path_within(path, set_) for set_ in values)
        }
        variants = tuple(each | values for each in group.variants)
        update = {"set": group.set | values, "draw": draw, "variants": variants}
        groups.append(group.model_copy(update=update))
    return Recipe.from_dict(recipe.model_copy(update={"groups": tuple(groups)}).to_dict(), "recipe")


def _verify(folder: Path) -> Outcome:
    manifest = read_manifest(folder)
    faulty = faults(folder, manifest.scenes)
    files = sum(len(scene.files or {}) for scene in manifest.scenes)
    text = "\n".join(faulty) if faulty else f"{files:,} files of {len(manifest.scenes)} scenes are as the manifest says"
    return 3 if faulty else 0, {"files": files, "faults": faulty}, text


def summary(manifest: Manifest, folder: Path) -> str:
    """Return a line on the scenes and points that were made, and where they are."""
    done = [scene for scene in manifest.scenes if scene.status == "done"]
    points = sum(scene.points or 0 for scene in done)
    return f"{len(done)} of {len(manifest.scenes)} scenes, {points:,} points\nwritten to {folder}"


if __name__ == "__main__":
    entry("dataset")
