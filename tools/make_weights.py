"""Make the models that come with the package anew: roads, training, figures, weights and cards. `make weights` runs it.

Each step that is done is kept, and one that was interrupted goes on: data sets and trainings resume by themselves.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ml.cards import WEIGHTS, Domain, Figure, ModelCard  # noqa: E402
from ml.runs import Run  # noqa: E402
from ml.shipped import ship  # noqa: E402
from synthroads_addon.base.files import write_file  # noqa: E402
from synthroads_addon.base.schema import canonical_json, read_json  # noqa: E402

RULES = ("views", "skeleton", "middle of", "between the", "centroid")
"""Beginnings of the names of what learns nothing in `synthroads evaluate`'s tables."""


@dataclass(frozen=True)
class Plan:
    """Plan of one shipped model.

    Attributes:
        title, task: of its card.
        recipe: of the data set that it learns from.
        configuration, changes: of the training.
        domain: what it is good for.
        limits: where it fails.
        mapping: real cloud's name in the folder of real ones -> mapping of its classes; of centrelines axes lie beside.
    """

    title: str
    task: Any
    recipe: str
    configuration: str
    changes: tuple[str, ...]
    domain: Domain
    limits: tuple[str, ...]
    mapping: dict[str, str | None] = field(default_factory=dict)


PLANS = {
    "centerline-airborne": Plan(
        "Centreline of whole roads in airborne surveys, ten slices at a time",
        "centerline",
        "centerline-small",
        "centerline-transformer",
        ("schedule.epochs=10", "threads=1"),
        Domain(density=(8.0, 45.0), platforms=("airborne",), needs=("intensity",)),
        (
            "It has seen twenty synthetic roads; roads in towns, with islands, tracks or cycle paths it doesn't know.",
            "Strips cut off within the pavement, and roads without markings, it knows from augmentation alone.",
        ),
        {"als_rural2lane_t211-278.laz": None, "als_dual4lane_t338-369.laz": None},
    ),
    "segmentation-uav": Plan(
        "Five classes on and beside motorways in dense clouds seen from above",
        "segmentation",
        "small-roads",
        "segmentation-small",
        ("threads=1",),
        Domain(density=(60.0, 1500.0), platforms=("uav",)),
        (
            "It has seen six motorways of 120 m by one scanner; buildings, rails and water are none of its classes.",
            "Scans from the road, and sparse ones from aircraft, are unlike what it was trained on.",
        ),
        {"ign_lidarhd_street.laz": "ign", "semkitti_seq00_000000.laz": "semantickitti"},
    ),
}


def main() -> None:
    """Make the models named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"models to make: {', '.join(PLANS)} (all)")
    parser.add_argument("--work", type=Path, default=Path("out/weights"), help="folder for data sets and runs")
    parser.add_argument("--weights", type=Path, default=WEIGHTS, help="folder for weights and cards (the package's)")
    parser.add_argument("--real", type=Path, help="folder of real scans to measure on; without it those figures stay")
    parser.add_argument("--jobs", type=int, default=2, help="scenes at a time")
    arguments = parser.parse_args()
    for name in arguments.names or PLANS:
        make(name, PLANS[name], arguments)


def make(name: str, plan: Plan, arguments: argparse.Namespace) -> None:
    """Make one model: its data set, training, figures, weights and card."""
    data, folder = arguments.work / plan.recipe, arguments.work / name
    run_command("dataset", plan.recipe, "--output", str(data), "--jobs", str(arguments.jobs))
    changes = [*plan.changes, *data_changes(plan, data)]
    options = [word for change in changes for word in ("--set", change)]
    begin = time.perf_counter()
    run_command("train", plan.configuration, "--output", str(folder), "--resume", *options)
    minutes = (time.perf_counter() - begin) / 60.0
    run: Run[Any] = Run.open(folder)
    spent = sum(epoch.get("seconds", 0.0) for epoch in run.history) / 60.0 or minutes
    figures = [*measured(plan, name, folder, data, arguments), *foreign(plan, name, folder, arguments)]
    arguments.weights.mkdir(parents=True, exist_ok=True)
    ship(run, arguments.weights / f"{name}.safetensors", overwrite=True)
    card = ModelCard(
        name=name,
        title=plan.title,
        task=plan.task,
        domain=plan.domain,
        recipe=(
            f"synthroads dataset {plan.recipe} --output {data}",
            f"synthroads train {plan.configuration} --output {folder} {' '.join(options)}",
        ),
        commit=commit(),
        seed=run.configuration.seed,
        scenes=sum(1 for _ in (data / "scenes").iterdir()),
        epochs=run.configuration.schedule.epochs,
        minutes=round(spent, 1),
        parameters=int(read_json(folder / "metrics.json")["parameters"]),
        figures=tuple(figures),
        limits=plan.limits,
    )
    write_file(arguments.weights / f"{name}.json", canonical_json(card.to_dict()).encode(), overwrite=True)
    write_file(arguments.weights / f"{name}.md", card_text(card).encode(), overwrite=True)


def data_changes(plan: Plan, data: Path) -> list[str]:
    """Return the changes of a configuration that have it learn from a data set's folder."""
    if plan.task == "centerline":
        return [f"data.data_sets={json.dumps([str(data)])}"]
    return [
        f"data.synthetic={json.dumps([{'path': str(data), 'split': 'train'}])}",
        f"data.tests={json.dumps({'unseen road': [{'path': str(data), 'split': 'test'}]})}",
    ]


def measured(plan: Plan, name: str, folder: Path, data: Path, arguments: argparse.Namespace) -> list[Figure]:
    """Return the figures on the data set's own test roads."""
    scores = evaluate(folder, [str(data), "--split", "test"], arguments.work / f"{name}-scores" / "inside")
    return figures_of(plan, scores, "its own test roads", inside=True)


def foreign(plan: Plan, name: str, folder: Path, arguments: argparse.Namespace) -> list[Figure]:
    """Return the figures on real scans; those of the card that is there where no folder of them is given."""
    before = arguments.weights / f"{name}.json"
    if arguments.real is None:
        told = ModelCard.from_dict(read_json(before)).figures if before.is_file() else ()
        return [figure for figure in told if not figure.inside]
    found = []
    for cloud, mapping in plan.mapping.items():
        words = [str(arguments.real / cloud), *(["--mapping", mapping] if mapping else [])]
        scores = evaluate(folder, words, arguments.work / f"{name}-scores" / Path(cloud).stem)
        found += figures_of(plan, scores, f"a real scan, {Path(cloud).stem}", inside=False)
    return found


def figures_of(plan: Plan, scores: dict[str, Any], where: str, *, inside: bool) -> list[Figure]:
    """Return an evaluation's figures for a card, of centrelines beside the best of the rules that learn nothing."""
    if plan.task == "segmentation":
        ((_, told),) = scores["tests"].items()
        return [Figure(name=f"mean IoU on {where}", value=round(100.0 * told["mean_iou"], 1), unit="%", inside=inside)]
    errors = {name: rows["all"]["mae"]["mean"] for name, rows in scores["tables"].items()}
    rules = {name: error for name, error in errors.items() if error is not None and name.startswith(RULES)}
    own = next(error for name, error in errors.items() if not name.startswith((*RULES, "the displaced")))
    alone = {name: error for name, error in rules.items() if not name.startswith("views with")}
    together = next(error for name, error in errors.items() if name.startswith("views with"))
    best = round(min(alone.values()), 3)
    return [
        Figure(
            name=f"mean error, the network by itself, {where}", value=round(own, 3), rule=best, unit="m", inside=inside
        ),
        Figure(
            name=f"mean error, fused with the views, {where}",
            value=round(together, 3),
            rule=best,
            unit="m",
            inside=inside,
        ),
    ]


def evaluate(folder: Path, words: list[str], output: Path) -> dict[str, Any]:
    """Return the scores of `synthroads evaluate` as JSON data, measured once."""
    kept = output / "scores.json"
    if not kept.is_file():
        told = run_command("evaluate", str(folder), *words, "--output", str(output), "--json")
        write_file(kept, told.encode(), overwrite=True)
    return dict(read_json(kept))


def run_command(name: str, *words: str) -> str:
    """Run a sub-command of `synthroads` and return what it prints; its progress goes to standard error."""
    result = subprocess.run(
        [sys.executable, "-m", f"headless.{name}", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False
    )
    if result.returncode:
        sys.exit(result.returncode)
    return result.stdout


def commit() -> str:
    """Return the commit of the source that the models are made with."""
    told = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return told.stdout.strip()[:12] or "unknown"


def card_text(card: ModelCard) -> str:
    """Return a card as a page for people."""
    low, high = card.domain.density
    rows = [
        f"| {one.name} | {one.value:g} {one.unit} | {'-' if one.rule is None else f'{one.rule:g} {one.unit}'} |"
        for one in card.figures
    ]
    made = f"{card.title}. {card.parameters:,} weights in half precision, seed {card.seed}, {card.epochs} epochs of "
    made += f"{card.minutes:g} minutes in all on one core, {card.scenes} synthetic roads, source {card.commit}."
    needed = f", with {' and '.join(card.domain.needs)}" if card.domain.needs else ""
    use = f"For clouds of {low:g} to {high:g} points/m2, {' or '.join(card.domain.platforms)}{needed}."
    lines = [
        f"# {card.name}",
        "",
        made,
        "",
        use,
        "",
        "| measured | model | best rule that learns nothing |",
        "|---|--:|--:|",
        *rows,
        "",
        "Where it fails:",
        "",
        *(f"- {limit}" for limit in card.limits),
        "",
        "Made by",
        "",
        *(f"    {command}" for command in card.recipe),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
