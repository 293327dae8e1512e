"""The data card: what a data set is, how it was made, what is in it and under which licence, for people."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath

from ..cloud.sweeps.registry import sweep_file_names
from .manifest import Manifest
from .recipe import Recipe, SceneJob

_LAYOUTS = {
    "pointcept": "`pointcept/classes-N/SPLIT/SCENE-TILE/*.npy`: coord (m, from the tile's corner), color, strength, "
    "segment, instance; -1 is unlabelled. `tile.json` has the corner's map coordinates.",
    "semantickitti": "`semantickitti/classes-N/sequences/NN`: a tile is a frame; `synthroads.yaml` names classes and "
    "splits.",
}


def data_card(recipe: Recipe, manifest: Manifest, jobs: Sequence[SceneJob]) -> str:
    """Return the data card as Markdown, made from recipe and manifest alone, so that it has the same bytes too."""
    files = _files(recipe, manifest, jobs)
    return "\n".join([*_head(recipe, manifest), *_how(recipe, jobs), *_content(manifest), *files]) + "\n"


def _head(recipe: Recipe, manifest: Manifest) -> list[str]:
    """Return the card's first lines: title, content, licence and what failed."""
    scenes = [scene for scene in manifest.scenes if scene.status == "done"]
    points = sum(scene.points or 0 for scene in scenes)
    length = math.fsum(scene.length or 0.0 for scene in scenes)
    lines = [f"# {recipe.title}", ""]
    if recipe.description:
        lines += [recipe.description, ""]
    lines += [
        f"- **Content:** {len(scenes)} scenes, {length / 1000.0:.2f} km of road, {points:,} points, all labelled",
        f"- **Licence:** {recipe.licence}",
        f"- **Made by:** {manifest.generator} from `recipe.json` (seed {recipe.seed}): both give the same bytes",
        "- **Not real:** no measured data is in it, and no person",
    ]
    failed_scenes = [scene for scene in manifest.scenes if scene.status == "failed"]
    return lines + [f"- **Failed:** {scene.name}: {scene.error}" for scene in failed_scenes] + [""]


def _how(recipe: Recipe, jobs: Sequence[SceneJob]) -> list[str]:
    """Return the lines about how the set was made: fidelity, scanner, platform and what is drawn."""

    def count_names(values: Iterable[str]) -> str:
        """Return names with how often each is there, as text."""
        return ", ".join(f"{name} ({count})" for name, count in sorted(Counter(values).items()))

    return [
        "## How it was made",
        "",
        "Each scene is a road drawn within the limits of a scenario by its own seed, built in Blender, and scanned by",
        "a simulated laser scanner. Class and instance of each point are those of the surface that the beam met.",
        "",
        f"- Fidelity: {count_names(job.scenario.fidelity for job in jobs)}",
        f"- Laser scanner: {count_names(job.scenario.scan.device for job in jobs)}",
        f"- Platform: {count_names(job.scenario.scan.platform.kind for job in jobs)}",
        *_drawn_fields(recipe),
        "",
    ]


def _drawn_fields(recipe: Recipe) -> list[str]:
    """Return a list of the fields of which each scene has its own value; empty if the recipe draws none."""
    parts = [("", recipe.draw), *((f" ({group.name})", group.draw) for group in recipe.groups)]
    rows = [
        f"  - `{path}`{group_text}: {drawn_value.text()}"
        for group_text, draws in parts
        for path, drawn_value in draws.items()
    ]
    return ["- Drawn for each scene, evenly unless said:", *rows] if rows else []


def _content(manifest: Manifest) -> list[str]:
    """Return the tables of the scenes, and of the points by class and split."""
    scenes = [scene for scene in manifest.scenes if scene.status == "done"]
    lines = ["## Scenes", "", "| scene | split | length (m) | points |", "|---|---|---|---|"]
    lines += [
        f"| {scene.name} | {scene.split} | {scene.length or 0.0:.0f} | {scene.points or 0:,} |" for scene in scenes
    ]
    totals: dict[str, Counter[str]] = {}
    for scene in scenes:
        totals.setdefault(scene.split, Counter()).update(scene.classes or {})
    splits = sorted(totals)
    names = dict.fromkeys(name for scene in scenes for name in scene.classes or {})
    lines += ["", "## Points by class", "", f"| class | {' | '.join(splits)} |", "|---|" + "---|" * len(splits)]
    for name in names:
        lines.append(f"| {name} | " + " | ".join(f"{totals[split][name]:,}" for split in splits) + " |")
    return [*lines, ""]


def _files(recipe: Recipe, manifest: Manifest, jobs: Sequence[SceneJob]) -> list[str]:
    """Return the lines about the set's files."""
    lines = [
        "## Files",
        "",
        "- `manifest.json`: size and SHA-256 of every file of every scene",
        "- `scenes/SCENE`: cloud, parameters, centreline and what else the recipe asked for",
    ]
    rigs = sorted({job.scenario.scan.cameras.rig for job in jobs if job.scenario.scan.cameras is not None})
    if rigs:
        names = [name for scene in manifest.scenes for name in scene.files or {}]
        count = sum(PurePosixPath(name).match("scenes/*/images/rgb/*/*") for name in names)
        lines.append(
            f"- `scenes/SCENE/images`: pictures with depth, normals, classes, instances and poses, by {', '.join(rigs)}"
            + (f"; {count:,} pictures" if count else "")
        )
    sweeps = sorted({name for job in jobs for name in job.scenario.sweeps.formats})
    if sweeps:
        files = ", ".join(f"`{name}`" for name in sweep_file_names(sweeps))
        lines.append(f"- `scenes/SCENE`: sweeps with boxes, tracks and labels: {files}")
    lines += [f"- {_LAYOUTS[name]}" for name in recipe.layouts]
    return [*lines, "- `logs`: time and memory of each scene (not part of the manifest)"]
