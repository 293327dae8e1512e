"""Write the tables of what labelled and unlabelled real clouds add to a model in the package.

    python studies/learning/adaptation.py --real FOLDER --synthetic FOLDER --output out/adaptation

Few labels: one half of a labelled sweep, by azimuth about the scanner, is learned from and the other half is the test,
both ways; ten degrees between them are left out. With synthetic sweeps it is the configuration
`segmentation-few-labels`. Self-training: whole clouds are learned from without their labels, and scored with them. All
trainings begin with a model of the package. What is done is kept; the same command goes on.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.marked_documents import put_tables  # noqa: E402
from ml.configuration import load_configuration  # noqa: E402
from ml.runs import METRICS, Run  # noqa: E402
from ml.shipped import open_run  # noqa: E402
from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.base.schema import read_json  # noqa: E402

GAP = 10.0
"""Degrees between the halves of a sweep that belong to neither."""
LEARNING = (
    "schedule.learning_rate=0.001",
    "fine_tuning.learning_rate=0.001",
    "threads=1",
    "workers=1",
    "prepare_on=cpu",
)
"""Changes of the configuration that all trainings share: they begin with weights that are learned already."""
SWEEPS = ("crop_points=12000", "batch=6", "class_weights=0", "fitted_offsets=true")
"""Changes with which `segmentation-sweeps` was trained."""
TABLES = ("few-labels", "self-training")
ANY_SCANNER = "segmentation-any-scanner"
FEW_LABELS = "segmentation-few-labels"


@dataclass(frozen=True)
class Case:
    """A training and its test.

    Attributes:
        table: which table it belongs to.
        title: of its row.
        model: of the package, that it begins with.
        configuration: of the training; empty where the model is only tested.
        changes: of the configuration.
        test: cloud that it is scored on.
        mapping: of the test's classes.
        seed: of the training.
        votes: views by which a model labels that is only tested.
    """

    table: str
    title: str
    model: str
    configuration: str
    changes: tuple[str, ...]
    test: Path
    mapping: str
    seed: int
    votes: int = 1

    @property
    def name(self) -> str:
        """Return the name of the case's folder."""
        words = f"{self.table} {self.title} {self.test.stem} {self.seed}"
        return "-".join("".join(letter if letter.isalnum() else " " for letter in words).split())


def main() -> None:
    """Train and score what the options name, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, required=True, help="folder of the real clouds")
    parser.add_argument("--synthetic", type=Path, required=True, help="data set, or packed file, of synthetic sweeps")
    parser.add_argument("--overhead", type=Path, help="the same of roads from above; without it the street is left out")
    parser.add_argument("--output", type=Path, required=True, help="folder for halves, runs and scores")
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=TABLES, help=f"of {', '.join(TABLES)} (all)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], help="of the trainings (1 2 3)")
    parser.add_argument("--epochs", type=int, default=16, help="epochs of few labels; twice those of a round (16)")
    parser.add_argument("--jobs", type=int, default=1, help="trainings side by side (1)")
    parser.add_argument("--document", type=Path, help="page whose tables are replaced")
    arguments = parser.parse_args()
    sweep = arguments.real / "semkitti_seq00_000000.laz"
    halves = write_halves(sweep, arguments.output / "halves")
    cases = [
        *few_labels(halves, arguments),
        *self_training("segmentation-sweeps", SWEEPS, sweep, "semantickitti", arguments.synthetic, arguments),
    ]
    if arguments.overhead:
        street = arguments.real / "ign_lidarhd_street.laz"
        cases += self_training("segmentation-overhead", ("batch=8",), street, "ign", arguments.overhead, arguments)
    cases = [case for case in cases if case.table in arguments.tables]
    names = list(dict.fromkeys(case.table for case in cases))

    def tables() -> dict[str, str]:
        """Train and score all cases, and return the tables' texts by name."""
        with ThreadPoolExecutor(arguments.jobs) as pool:
            scores = list(pool.map(lambda case: score(case, arguments.output), cases))
        pairs = list(zip(cases, scores, strict=True))
        return {name: table([(case, texts) for case, texts in pairs if case.table == name]) for name in names}

    try:
        texts = put_tables(arguments.document, names, tables)
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    for name, text in texts.items():
        print(f"{name}\n\n{text}\n")


def write_halves(cloud: Path, folder: Path) -> tuple[Path, Path]:
    """Write the two halves of a sweep by azimuth about its origin, less `GAP` degrees between; return their paths."""
    sweep = laspy.read(cloud)
    azimuth = np.degrees(np.arctan2(np.asarray(sweep.y), np.asarray(sweep.x)))
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, side in (("left", azimuth), ("right", -azimuth)):
        half = laspy.LasData(sweep.header, sweep.points[(side > GAP / 2) & (side < 180.0 - GAP / 2)])
        half.write(folder / f"{name}.laz")
        paths.append(folder / f"{name}.laz")
    return paths[0], paths[1]


def few_labels(halves: tuple[Path, Path], arguments: argparse.Namespace) -> list[Case]:
    """Return the cases that learn from one half of the sweep and are tested on the other."""
    cases = []
    votes = load_configuration(FEW_LABELS).votes
    epochs = f"schedule.epochs={arguments.epochs}"
    synthetic = sources("synthetic", {"path": str(arguments.synthetic)})
    for learning_half, test in (halves, halves[::-1]):
        real = sources("real", {"path": str(learning_half), "mapping": "semantickitti", "tile": 1000})
        real_changes = ("set_up=real", "crops_per_tile=60", "balanced=false", epochs, real)
        mixed_changes = (*LEARNING, epochs, real, synthetic)
        trainings = {
            "and one half of a sweep": (ANY_SCANNER, (*SWEEPS, *LEARNING, *real_changes)),
            "and one half, with synthetic sweeps": (FEW_LABELS, mixed_changes),
            "and the same without offsets": (FEW_LABELS, (*mixed_changes, "fitted_offsets=false")),
        }
        test_arguments = ("segmentation-sweeps", "", (), test, "semantickitti", arguments.seeds[0])
        cases += [
            Case("few-labels", "the model, by one view", *test_arguments),
            Case("few-labels", f"the model as it comes, by {votes} views", *test_arguments, votes=votes),
            *(
                Case("few-labels", title, "segmentation-sweeps", *training, test, "semantickitti", seed)
                for title, training in trainings.items()
                for seed in arguments.seeds
            ),
        ]
    return cases


def self_training(
    model: str,
    changes: Sequence[str],
    cloud: Path,
    mapping: str,
    synthetic: Path,
    arguments: argparse.Namespace,
) -> list[Case]:
    """Return the cases that learn from a whole cloud without its labels, and the model by itself."""
    target = sources("target", {"path": str(cloud), "tile": 1000})
    rounds = ("set_up=self_trained", "crops_per_tile=3", f"fine_tuning.epochs={arguments.epochs // 2}")
    learning_changes = (*changes, *LEARNING, *rounds, target, sources("synthetic", {"path": str(synthetic)}))
    return [
        Case("self-training", f"{model}{words}", model, configuration, case_changes, cloud, mapping, seed)
        for words, configuration, case_changes in (("", "", ()), (", self-trained", ANY_SCANNER, learning_changes))
        for seed in (arguments.seeds if case_changes else arguments.seeds[:1])
    ]


def sources(domain: str, source: dict[str, Any]) -> str:
    """Return the change of a configuration that names one source of a domain."""
    return f"data.{domain}={json.dumps([source])}"


def score(case: Case, output: Path) -> dict[str, float]:
    """Train a case unless it is trained, and return its IoUs by class and their mean, %."""
    folder, scores = output / "runs" / case.name, output / "scores" / case.name
    run = case.model
    if not case.configuration:
        run = str(write_with_votes(case.model, case.votes, folder))
    if case.configuration:
        run = str(folder)
        if not (folder / METRICS).is_file():
            changes = (*case.changes, f"start={case.model}", f"seed={case.seed}")
            options = [word for change in changes for word in ("--set", change)]
            command("train", case.configuration, "--output", str(folder), "--resume", "--quiet", *options)
    scores_file = scores / "told.json"
    if not scores_file.is_file():
        words = ("--mapping", case.mapping, "--output", str(scores), "--json", "--quiet")
        scores_text = command("evaluate", run, str(case.test), *words)
        scores_file.write_text(scores_text, encoding="utf-8")
    ((_, test),) = read_json(scores_file)["tests"].items()
    ious = {name: 100.0 * row["iou"] for name, row in test["classes"].items() if row["iou"] is not None}
    return {"mean": 100.0 * test["mean_iou"], **ious}


def write_with_votes(model: str, votes: int, folder: Path) -> Path:
    """Write a model of the package as a run that labels by so many views; return the run's folder."""
    shipped_run = open_run(Path(model))
    run = Run.start(folder, shipped_run.configuration.model_copy(update={"votes": votes}), overwrite=True)
    run.save(shipped_run.last_checkpoint() or {})
    return folder


def command(name: str, *words: str) -> str:
    """Run a sub-command of `synthroads` and return what it prints; its faults end this program."""
    answer = subprocess.run(
        [sys.executable, "-m", f"headless.{name}", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False
    )
    if answer.returncode:
        raise SystemExit(f"synthroads {name} {' '.join(words)}: exit code {answer.returncode}")
    return answer.stdout


def table(rows: Sequence[tuple[Case, dict[str, float]]]) -> str:
    """Return a Markdown table with a row for each title and test: mean over the seeds, and each seed's mean IoU."""
    columns = list(dict.fromkeys(name for _, row_scores in rows for name in row_scores))
    lines = [f"| {' | '.join(['', 'tested on', *columns, 'each seed'])} |", f"|---|---|{'--:|' * len(columns)}---|"]
    for title, test in dict.fromkeys((case.title, case.test.stem) for case, _ in rows):
        row_scores = [case_scores for case, case_scores in rows if (case.title, case.test.stem) == (title, test)]
        values_of_columns = [
            [case_scores[name] for case_scores in row_scores if name in case_scores] for name in columns
        ]
        cells = [f"{statistics.mean(values):.1f}" if values else "–" for values in values_of_columns]
        means_text = ", ".join(f"{case_scores['mean']:.1f}" for case_scores in row_scores)
        lines.append(f"| {' | '.join([title, test, *cells, means_text])} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
