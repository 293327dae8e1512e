"""Print the tables of docs/dataset.md: scenes, points, classes, time and memory of a data set, by group; or its cost.

synthroads dataset reference --output out/reference --jobs 2
python studies/costs/dataset.py out/reference
python studies/costs/dataset.py out/reference --scenes 10000 --cores 2
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.dataset.manifest import SceneEntry, read_manifest  # noqa: E402

HEAD = ("group", "scenes", "points", "classes", "images (s)", "scan and LAZ (s)", "all stages (s)", "memory (MB)")


def rows(folder: Path) -> list[tuple[str, ...]]:
    """Return a data set's table as rows of cells: one per group of scenes and one for all, with ranges over scenes.

    Raises:
        MissingFileError, InputError: the folder holds no readable data set.
    """
    scenes = read_manifest(folder).scenes
    logs = {scene.name: json.loads((folder / "logs" / f"{scene.name}.json").read_text()) for scene in scenes}
    groups: dict[str, list[SceneEntry]] = {}
    for scene in scenes:
        groups.setdefault(scene.name.rpartition("-")[0], []).append(scene)
    return [_row(name, members, logs) for name, members in (*groups.items(), ("all", list(scenes)))]


def _row(name: str, members: list[SceneEntry], logs: dict[str, Any]) -> tuple[str, ...]:
    """Return the cells of a group's row."""
    points = [sum((scene.classes or {}).values()) for scene in members]
    classes_present = {label for scene in members for label, count in (scene.classes or {}).items() if count}
    stages = [logs[scene.name]["stages"] for scene in members]
    images, scan = (_times(stages, stage) for stage in ("images", "scan"))
    seconds_of_scenes = [sum(stage["seconds"] for stage in scene_stages.values()) for scene_stages in stages]
    memory = [max(stage["peak_memory_mb"] for stage in scene_stages.values()) for scene_stages in stages]
    ranges = (_range(values) for values in (images, scan, seconds_of_scenes, memory))
    return (name, str(len(members)), f"{sum(points):,}", str(len(classes_present)), *ranges)


def _times(stages: list[dict[str, Any]], name: str) -> list[float]:
    """Return the seconds of a stage in each scene; 0 where it wasn't run."""
    return [scene_stages[name]["seconds"] if name in scene_stages else 0.0 for scene_stages in stages]


def _range(values: list[float]) -> str:
    """Return the range of values as text, one number where both ends are alike."""
    lowest, highest = min(values), max(values)
    return f"{lowest:,.0f}" if round(lowest) == round(highest) else f"{lowest:,.0f} to {highest:,.0f}"


def costs(folder: Path, scenes: int, cores: int) -> list[tuple[str, str, str]]:
    """Return the cost of `scenes` scenes like a data set's, as rows (what, per scene, in all): hours, bytes, files.

    The time is that of the whole run, from its recipe, which is written first, to its manifest, which is last; so the
    run must not have been stopped in between, and nothing else have used its cores.

    Args:
        folder: of the finished data set.
        scenes: how many.
        cores: that the run had.

    Raises:
        MissingFileError, InputError: the folder holds no readable data set.
    """
    manifest = read_manifest(folder)
    count = len(manifest.scenes)
    hours = (_changed(folder / "manifest.json") - _changed(folder / "recipe.json")) / 3600.0 * cores / count
    files = [(name, entry.bytes) for scene in manifest.scenes for name, entry in (scene.files or {}).items()]
    table = [("core hours", f"{hours:,.3f}", f"{hours * scenes:,.0f}")]
    for top_folder in sorted({name.partition("/")[0] for name, _ in files}):
        size = sum(each for name, each in files if name.startswith(f"{top_folder}/")) / count
        table.append((f"`{top_folder}/`", f"{size / 1e6:,.0f} MB", f"{size * scenes / 1e9:,.0f} GB"))
    table.append(("files", f"{len(files) / count:,.0f}", f"{len(files) / count * scenes:,.0f}"))
    size = (folder / "manifest.json").stat().st_size / count
    return [*table, ("`manifest.json`", f"{size / 1e3:,.0f} kB", f"{size * scenes / 1e9:,.2f} GB")]


def _changed(path: Path) -> float:
    """Return the time at which a file was written last, s."""
    return path.stat().st_mtime


def main() -> None:
    """Print the table of the data set that the command line names, or its cost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="finished data set")
    parser.add_argument("--scenes", type=int, help="print what so many scenes cost instead")
    parser.add_argument("--cores", type=int, default=2, help="cores that the run had (%(default)s)")
    arguments = parser.parse_args()
    try:
        if arguments.scenes:
            head: tuple[str, ...] = ("", "a scene", f"{arguments.scenes:,} scenes")
            table: list[tuple[str, ...]] = [*costs(arguments.folder, arguments.scenes, arguments.cores)]
        else:
            head, table = HEAD, rows(arguments.folder)
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    for number, row in enumerate((head, *table)):
        print(f"| {' | '.join(row)} |")
        if number == 0:
            print("|" + "---|" * len(head))


if __name__ == "__main__":
    main()
