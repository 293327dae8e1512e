"""Print the table of docs/dataset.md: scenes, points, classes, time and memory of a data set, by group.

synthroads dataset reference --output out/reference --jobs 2
python tools/figures_dataset.py out/reference
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.dataset.manifest import SceneEntry, read_manifest  # noqa: E402

HEAD = ("group", "scenes", "points", "classes", "images (s)", "scan and LAZ (s)", "all stages (s)", "memory (MB)")


def rows(folder: Path) -> list[tuple[str, ...]]:
    """Return the table's cells, a row per group of scenes and one for all; times and memory are ranges over scenes.

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
    points = [sum((scene.classes or {}).values()) for scene in members]
    present = {label for scene in members for label, count in (scene.classes or {}).items() if count}
    stages = [logs[scene.name]["stages"] for scene in members]
    images, scan = (_times(stages, stage) for stage in ("images", "scan"))
    whole = [sum(stage["seconds"] for stage in one.values()) for one in stages]
    memory = [max(stage["peak_memory_mb"] for stage in one.values()) for one in stages]
    ranges = (_range(values) for values in (images, scan, whole, memory))
    return (name, str(len(members)), f"{sum(points):,}", str(len(present)), *ranges)


def _times(stages: list[dict[str, Any]], name: str) -> list[float]:
    return [one[name]["seconds"] if name in one else 0.0 for one in stages]


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:,.0f}" if round(low) == round(high) else f"{low:,.0f} to {high:,.0f}"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="finished data set")
    try:
        table = rows(parser.parse_args().folder)
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    for number, row in enumerate((HEAD, *table)):
        print(f"| {' | '.join(row)} |")
        if number == 0:
            print("|" + "---|" * len(HEAD))


if __name__ == "__main__":
    main()
