"""Make the models that come with the package anew: roads, training, figures, weights and cards. `make weights` runs it.

Each step that is done is kept, and one that was interrupted goes on: data sets and trainings resume by themselves.
"""

from __future__ import annotations

import argparse
import json
import resource
import shlex
import subprocess
import sys
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import torch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ml.cards import WEIGHTS, Domain, Figure, ModelCard  # noqa: E402
from ml.data.points import GROUND_CLASSES, ROAD_CLASSES  # noqa: E402
from ml.runs import METRICS, Run  # noqa: E402
from ml.shipped import ship  # noqa: E402
from synthroads_addon.base.files import write_file  # noqa: E402
from synthroads_addon.base.schema import canonical_json, read_json  # noqa: E402
from synthroads_addon.cloud.formats.registry import open_cloud  # noqa: E402
from synthroads_addon.dataset.manifest import MANIFEST, read_manifest  # noqa: E402
from synthroads_addon.road.axes.measured_axis import MeasuredAxis  # noqa: E402

REAL = "a real scan"
"""How the names of figures on clouds of others call them."""
ROAD_AGAINST_VERGE = {
    "title": "Road, markings included, against everything beside it, by the offset from the road's axis",
    "classes": {"0": "verge", "1": "road"},
    "groups": {"road": ["road", "road_marking"], "verge": ["ground", "vegetation", "road_furniture"]},
}
"""Mapping of the classes of a cloud without labels, beside which an axis lies."""
RULES = ("views", "skeleton", "middle of", "between the", "centroid")
"""Beginnings of the names of what learns nothing in `synthroads evaluate`'s tables."""


@dataclass(frozen=True)
class Training:
    """One training: a configuration, its changes, and what it learns from.

    Attributes:
        configuration, changes: of the training.
        splits: of the data set, that it learns from.
    """

    configuration: str
    changes: tuple[str, ...]
    splits: tuple[str, ...]


@dataclass(frozen=True)
class Plan(Training):
    """Plan of one shipped model.

    Attributes:
        title, task: of its card.
        domain: what it is good for.
        limits: where it fails.
        inside, outside: splits of the recipe's roads that it is measured on, by how the figures call them: roads of the
            kinds that it has learned, and others.
        mapping: real cloud's name in the folder of real ones -> mapping of its classes; of centrelines axes lie beside.
        paved: real cloud's name -> smallest and largest offset of each pavement from the axis beside it, m.
        strips: splits whose roads are measured as strips of `STRIP` m to both sides of the axis, ground only, by how
            the figures call them.
        first: plan whose training this one continues from; None for random weights.
    """

    title: str
    task: Any
    domain: Domain
    limits: tuple[str, ...]
    inside: dict[str, str]
    outside: dict[str, str]
    mapping: dict[str, str | None] = field(default_factory=dict)
    paved: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    strips: dict[str, str] = field(default_factory=dict)
    first: str | None = None


RECIPE = "package-models"
"""Data set that all of them learn from."""
STRIP = 11.0
"""How far strips reach to both sides of an axis, m: as published airborne clouds of roads do."""
PAVED: dict[str, tuple[tuple[float, float], ...]] = {
    "als_dual4lane_t338-369.laz": ((-10.9, -3.4), (3.3, 10.9)),
    "als_dual6lane_t370-473.laz": ((-10.9, -3.6), (3.6, 10.9)),
    "als_rural2lane_t000-075.laz": ((-2.3, 2.3),),
    "als_rural2lane_t211-278.laz": ((-3.2, 3.4),),
}
"""Offsets of the pavements of real roads from the axes beside them, m: read off the profiles of intensity and height
across each road."""
PLANS = {
    "centerline-airborne": Plan(
        configuration="centerline-transformer",
        changes=(
            "schedule.epochs=32",
            "slices.truth=either",
            "data.calibration_split=held_out",
            "threads=1",
            "workers=2",
        ),
        splits=("train",),
        title="Centreline of roads with one or two carriageways, seen from the air, ten slices at a time",
        task="centerline",
        domain=Domain(density=(8.0, 60.0), platforms=("airborne", "uav"), needs=("intensity",)),
        limits=(
            "Roads in towns, with islands, tracks or cycle paths beside, it hasn't seen.",
            "Strips cut off within the pavement, and roads without markings, it knows from augmentation alone.",
            "Only ground is looked at: plants and vehicles must be told from it before.",
        ),
        inside={"test": "its own test roads"},
        outside={"held_out": "synthetic roads of another world"},
        mapping={
            "als_rural2lane_t211-278.laz": None,
            "als_rural2lane_t000-075.laz": None,
            "als_dual4lane_t338-369.laz": None,
            "als_dual6lane_t370-473.laz": None,
        },
    ),
    "segmentation-overhead": Plan(
        configuration="segmentation-any-scanner",
        changes=("schedule.epochs=36", "batch=8", "threads=1", "workers=3", "prepare_on=cpu"),
        splits=("train", "train_sweeps"),
        title="Five classes on and beside roads, from the air and from UAVs",
        task="segmentation",
        domain=Domain(density=(8.0, 1500.0), platforms=("airborne", "uav")),
        limits=(
            "Buildings, rails, water and furniture of streets are none of its classes: they become one of the five.",
            "Plants beside synthetic roads are of few kinds; hedges along a pavement may be taken for road furniture.",
            "In strips along dual carriageways, without vegetation, a third of the road is taken for ground.",
        ),
        inside={"test": "its own test roads"},
        outside={"held_out": "synthetic roads of another world"},
        mapping={"ign_lidarhd_street.laz": "ign"},
        paved=PAVED,
        strips={"test_medians": "motorways with other medians"},
    ),
    "segmentation-strips": Plan(
        configuration="segmentation-strips",
        # Of three seeds the best on synthetic strips.
        changes=("seed=2", "threads=1", "workers=1", "prepare_on=cpu"),
        splits=("train", "train_medians", "train_country", "train_sweeps"),
        title="Five classes in strips along roads, seen from the air, in which nothing stands",
        task="segmentation",
        domain=Domain(density=(8.0, 1500.0), platforms=("airborne", "uav"), ground_only=True),
        limits=(
            "Whole scenes are for segmentation-overhead, which is better where plants, buildings and vehicles stand.",
            "Hard verges beside rural roads, little brighter than the asphalt, are taken for road.",
            "On real strips it was measured by road against verge only, as they have no labels.",
        ),
        inside={},
        outside={},
        paved=PAVED,
        strips={"test_medians": "motorways with other medians", "test_country": "country roads"},
        first="segmentation-overhead",
    ),
    "segmentation-sweeps": Plan(
        configuration="segmentation-any-scanner",
        changes=(
            # Of three seeds the best on sweeps of its own.
            *("seed=1", "schedule.epochs=64", "batch=6", "crop_points=12000", "crops_per_tile=3"),
            # Balanced crops hold rare classes often already: with weights as well they are found where they aren't.
            *("class_weights=0", "fitted_offsets=true", "threads=1", "workers=2", "prepare_on=cpu"),
            # On sweeps of its own, eight views are one point better than one; a sweep is small enough for them.
            "votes=8",
        ),
        splits=("train_sweeps",),
        title="Five classes on and beside roads, in single sweeps of a car's head",
        task="segmentation",
        domain=Domain(density=(5.0, 15.0), platforms=("sweep",)),
        limits=(
            "Three trainings that differ in their seed alone differ by up to nine points on one real sweep.",
            "Sidewalks and kerbs it has never seen: in towns road and ground are taken for one another.",
            "Markings are found where the intensity tells them, which in sweeps of cars' heads it hardly does.",
        ),
        inside={"test_sweeps": "sweeps of its own"},
        outside={},
        mapping={"semkitti_seq00_000000.laz": "semantickitti"},
    ),
    "segmentation-terrestrial": Plan(
        configuration="segmentation-terrestrial",
        changes=("threads=1", "prepare_on=cpu"),
        splits=("train_mobile", "train_tripod"),
        title="Five classes on and beside roads, in whole drives of mobile scanners and from tripods",
        task="segmentation",
        domain=Domain(density=(6.0, 3000.0), platforms=("mobile", "tripod")),
        limits=(
            "It was measured on synthetic clouds only: no labelled real cloud of a drive or of a tripod was there.",
            "Buildings, rails, water and furniture of streets are none of its classes: they become one of the five.",
            "Sidewalks and kerbs it has never seen: in towns road and ground are taken for one another.",
        ),
        inside={"test_mobile": "its own test drives", "test_tripod": "its own tripods"},
        outside={
            "held_out_mobile": "drives with heads that it hasn't met",
            "held_out_tripod": "tripods with a scanner that it hasn't met",
        },
        first="segmentation-overhead",
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
    if unknown_names := [name for name in arguments.names if name not in PLANS]:
        parser.error(f"NAME is {unknown_names[0]}: must be one of {', '.join(PLANS)}")
    for name in arguments.names or PLANS:
        make(name, PLANS[name], arguments)


def make(name: str, plan: Plan, arguments: argparse.Namespace) -> None:
    """Make one model: its data set, training, figures, weights and card."""
    data_folder, folder = arguments.work / RECIPE, arguments.work / name
    first = PLANS[plan.first] if plan.first else None
    splits = needed_splits(plan)
    make_scenes = (RECIPE, "--output", str(data_folder), "--splits", *splits)
    run_command("dataset", *make_scenes, "--jobs", str(arguments.jobs), *resumption(data_folder))
    commands = [f"synthroads dataset {shlex.join(make_scenes)}"]
    minutes, epochs, machines = 0.0, 0, list[str]()
    start = (f"start={arguments.work / plan.first}",) if plan.first else ()
    trainings: list[tuple[Training, Path, tuple[str, ...]]] = [(plan, folder, start)]
    if first:
        trainings.insert(0, (first, arguments.work / str(plan.first), ()))
    for training, run_folder, start_change in trainings:
        changes = (*training.changes, *start_change, *data_changes(training, data_folder))
        options = [word for change in changes for word in ("--set", change)]
        training_minutes, machine = train(training, run_folder, options)
        minutes += training_minutes
        epochs += Run.open(run_folder).configuration.schedule.epochs
        machines.append(f"{machine} ({training_minutes:.1f})" if first else machine)
        commands.append(f"synthroads train {training.configuration} --output {run_folder} {shlex.join(options)}")
    run: Run[Any] = Run.open(folder)
    figures = [
        *(
            figure
            for split, place_text in plan.inside.items()
            for figure in measured(plan, name, split, place_text, arguments)
        ),
        *(
            figure
            for split, place_text in plan.outside.items()
            for figure in measured(plan, name, split, place_text, arguments)
        ),
        *(
            figure
            for split, place_text in plan.strips.items()
            for figure in measured_strips(plan, name, split, place_text, arguments)
        ),
        *foreign(plan, name, folder, arguments),
    ]
    arguments.weights.mkdir(parents=True, exist_ok=True)
    ship(run, arguments.weights / f"{name}.safetensors", overwrite=True)
    card = ModelCard(
        name=name,
        title=plan.title,
        task=plan.task,
        domain=plan.domain,
        recipe=tuple(commands),
        commit=commit(),
        seed=run.configuration.seed,
        scenes=training_roads({*plan.splits, *(first.splits if first else ())}, data_folder),
        epochs=epochs,
        minutes=round(minutes, 1),
        machine=", then ".join(machines),
        parameters=int(read_json(folder / "metrics.json")["parameters"]),
        figures=tuple(figures),
        limits=plan.limits,
    )
    write_file(arguments.weights / f"{name}.json", canonical_json(card.to_dict()).encode(), overwrite=True)
    write_file(arguments.weights / f"{name}.md", card_text(card).encode(), overwrite=True)


def needed_splits(plan: Plan) -> list[str]:
    """Return the splits of the data set that a model is trained and measured on, sorted."""
    first_splits = PLANS[plan.first].splits if plan.first else ()
    # Centrelines are validated after each epoch.
    validation = ("validation",) if plan.task == "centerline" else ()
    return sorted({*plan.splits, *first_splits, *plan.inside, *plan.outside, *plan.strips, *validation})


def resumption(data: Path) -> list[str]:
    """Return the option by which a data set that was begun is gone on with."""
    return ["--resume"] if (data / MANIFEST).is_file() else []


def train(training: Training, folder: Path, options: list[str]) -> tuple[float, str]:
    """Train a model to its end unless it is; return the minutes that all of it took so far, and on what.

    On a GPU that is time by the clock, else processor time.
    """
    minutes_file = folder / "minutes.json"
    minutes_data = read_json(minutes_file) if minutes_file.is_file() else {}
    minutes, machine = float(minutes_data.get("minutes", 0.0)), str(minutes_data.get("machine", "one core"))
    if not (folder / METRICS).is_file():
        graphics = torch.cuda.get_device_name() if torch.cuda.is_available() else None
        begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
        run_command("train", training.configuration, "--output", str(folder), "--resume", *options)
        end = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
        minutes += (end[1] - begin[1] if graphics else end[0] - begin[0]) / 60.0
        machine = graphics or "one core"
        write_file(minutes_file, canonical_json({"minutes": minutes, "machine": machine}).encode(), overwrite=True)
    return minutes, machine


def training_roads(splits: Collection[str], data: Path) -> int:
    """Return the number of a data set's roads that a model learns from."""
    return sum(1 for scene in read_manifest(data).scenes if scene.status == "done" and scene.split in splits)


def data_changes(training: Training, data: Path) -> list[str]:
    """Return the changes of a configuration that have it learn from a data set's folder."""
    if training.configuration.startswith("centerline"):
        return [f"data.data_sets={json.dumps([str(data)])}"]
    sources = [{"path": str(data), "split": split} for split in training.splits]
    return [f"data.synthetic={json.dumps(sources)}"]


def measured(plan: Plan, name: str, split: str, place_text: str, arguments: argparse.Namespace) -> list[Figure]:
    """Return the figures on a split of the data set's roads."""
    words = [str(arguments.work / RECIPE), "--split", split]
    scores = evaluate(arguments.work / name, words, arguments.work / f"{name}-scores" / split)
    return figures_of(plan, scores, place_text, is_inside=split in plan.inside)


def foreign(plan: Plan, name: str, folder: Path, arguments: argparse.Namespace) -> list[Figure]:
    """Return the figures on real scans; those of the card that is there where no folder of them is given."""
    card_file = arguments.weights / f"{name}.json"
    if arguments.real is None:
        figures_before = ModelCard.from_dict(read_json(card_file)).figures if card_file.is_file() else ()
        return [figure for figure in figures_before if REAL in figure.name]
    figures = []
    for cloud, mapping in plan.mapping.items():
        words = [str(arguments.real / cloud), *(["--mapping", mapping] if mapping else [])]
        scores = evaluate(folder, words, arguments.work / f"{name}-scores" / Path(cloud).stem)
        figures += figures_of(plan, scores, f"{REAL}, {Path(cloud).stem}", is_inside=False)
    for cloud, paved in plan.paved.items():
        stem = Path(cloud).stem
        mapping_file = arguments.work / f"{name}-scores" / f"{stem}-paved.json"
        mapping_data = {**ROAD_AGAINST_VERGE, "axis": f"{stem}_axis.csv", "paved": paved}
        write_file(mapping_file, canonical_json(mapping_data).encode(), overwrite=True)
        words = [str(arguments.real / cloud), "--mapping", str(mapping_file)]
        scores = evaluate(folder, words, arguments.work / f"{name}-scores" / stem)
        figures += road_figures(scores, f"{REAL}, {stem}")
    return figures


def measured_strips(plan: Plan, name: str, split: str, place_text: str, arguments: argparse.Namespace) -> list[Figure]:
    """Return how well road is told from ground on a split's roads cut to strips along their axes, ground only."""
    data_folder, strips_folder = arguments.work / RECIPE, arguments.work / f"{name}-scores" / "strips"
    (strips_folder / split).mkdir(parents=True, exist_ok=True)
    for scene in read_manifest(data_folder).scenes:
        if scene.split == split and scene.status == "done":
            folder = data_folder / "scenes" / scene.name
            cut_strip(folder / "cloud.laz", folder / "centerline.geojson", strips_folder / split / f"{scene.name}.laz")
    words = [str(strips_folder), "--split", split]
    scores = evaluate(arguments.work / name, words, arguments.work / f"{name}-scores" / f"{split}-strips")
    is_inside = split.replace("test", "train", 1) in plan.splits
    return road_figures(scores, f"{place_text} cut to {STRIP:g} m, ground only", is_inside=is_inside)


def cut_strip(cloud: Path, axis: Path, target: Path) -> None:
    """Write the ground, road and markings of a cloud within `STRIP` m of an axis; a file that is there stays."""
    if target.is_file():
        return
    with open_cloud(cloud) as reader:
        line, names = MeasuredAxis.read(axis, place=reader.header.place), reader.header.scheme.names()
    points = laspy.read(cloud)
    _, offset = line.project(points.xyz)
    ground_ids = [number for number, class_name in names.items() if class_name in GROUND_CLASSES]
    points.points = points.points[(np.abs(offset) <= STRIP) & np.isin(points["class_id"], ground_ids)]
    points.write(str(target))


def road_figures(scores: dict[str, Any], place_text: str, *, is_inside: bool = False) -> list[Figure]:
    """Return the recall and precision of the road, markings included, against everything else."""
    ((_, test),) = scores["tests"].items()
    is_road = np.array([class_name in ROAD_CLASSES for class_name in test["classes"]])
    counts = np.array(test["confusion"])
    hits = counts[np.ix_(is_road, is_road)].sum()
    shares = {"recall": hits / counts[is_road].sum(), "precision": hits / max(counts[:, is_road].sum(), 1)}
    return [
        Figure(name=f"{word} of road, {place_text}", value=round(100.0 * float(share), 1), unit="%", inside=is_inside)
        for word, share in shares.items()
    ]


def figures_of(plan: Plan, scores: dict[str, Any], place_text: str, *, is_inside: bool) -> list[Figure]:
    """Return an evaluation's figures for a card, of centrelines beside the best of the rules that learn nothing."""
    if plan.task == "segmentation":
        return segmentation_figures(scores, place_text, is_inside=is_inside)
    means = {name: rows["all"] for name, rows in scores["tables"].items()}
    errors = {name: row["mae"]["mean"] for name, row in means.items()}
    network_name = next(name for name in errors if not name.startswith((*RULES, "the displaced")))
    fused_name = next(name for name in errors if name.startswith("views with"))
    rule_errors = [error for name, error in errors.items() if name.startswith(RULES) and name != fused_name]
    best_rule = round(min(error for error in rule_errors if error is not None), 3)

    def figure(text: str, value: float, unit: str, rule: float | None = None) -> Figure:
        """Return a figure of the card, rounded."""
        return Figure(name=f"{text}, {place_text}", value=round(value, 3), rule=rule, unit=unit, inside=is_inside)

    shares = [(share, means[fused_name][f"coverage_{share}"]["mean"]) for share in (68, 95)]
    return [
        figure("mean error, the network by itself", errors[network_name], "m", best_rule),
        figure("mean error, fused with the views", errors[fused_name], "m", best_rule),
        *(figure(f"in the {share} % interval, fused", round(100.0 * value, 1), "%") for share, value in shares),
    ]


def segmentation_figures(scores: dict[str, Any], place_text: str, *, is_inside: bool) -> list[Figure]:
    """Return the figures of a segmentation: mean IoU, and the IoU of each class that occurs in the truth."""
    ((_, test),) = scores["tests"].items()
    by_class = {name: row["iou"] for name, row in test["classes"].items() if row["support"]}
    value_of_name = {"mean IoU": test["mean_iou"], **{f"IoU of {name}": value for name, value in by_class.items()}}
    return [
        Figure(name=f"{name}, {place_text}", value=round(100.0 * value, 1), unit="%", inside=is_inside)
        for name, value in value_of_name.items()
        if value is not None
    ]


def evaluate(folder: Path, words: list[str], output: Path) -> dict[str, Any]:
    """Return the scores of `synthroads evaluate` as JSON data, measured once for each training."""
    scores_file = output / "scores.json"
    if not scores_file.is_file() or scores_file.stat().st_mtime < (folder / METRICS).stat().st_mtime:
        scores_text = run_command("evaluate", str(folder), *words, "--output", str(output), "--json")
        write_file(scores_file, scores_text.encode(), overwrite=True)
    return dict(read_json(scores_file))


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
    answer = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return answer.stdout.strip()[:12] or "unknown"


def card_text(card: ModelCard) -> str:
    """Return a card as a page for people."""
    lowest, highest = card.domain.density
    rows = []
    for figure in card.figures:
        rule = "-" if figure.rule is None else f"{figure.rule:g} {figure.unit}"
        rows.append(f"| {figure.name} | {figure.value:g} {figure.unit} | {rule} |")
    made_text = (
        f"{card.title}. {card.parameters:,} weights in half precision, seed {card.seed}, {card.epochs} epochs of "
    )
    made_text += (
        f"{card.minutes:g} minutes in all on {card.machine}, {card.scenes} synthetic roads, source {card.commit}."
    )
    needs_text = f", with {' and '.join(card.domain.needs)}" if card.domain.needs else ""
    ground_text = ", in which nothing stands" if card.domain.ground_only else ""
    use_text = f"For clouds of {lowest:g} to {highest:g} points/m2, {' or '.join(card.domain.platforms)}{needs_text}"
    use_text += f"{ground_text}."
    lines = [
        f"# {card.name}",
        "",
        made_text,
        "",
        use_text,
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
