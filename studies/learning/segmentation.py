"""Write the tables and pictures of docs/segmentation.md from what was trained and measured.

    python studies/learning/segmentation.py --small out/segmentation --mixing out/mixing-small \\
        --gantries out/gantries-small --real REAL_FOLDER --prediction out/prediction/prediction.json \\
        --packed out/train.npz --forecast out/forecast.json \\
        --document docs/segmentation.md --pictures docs/pictures

What isn't given is left out, and its tables in the document stay as they are. The models that come with the package are
scored and drawn here on the labelled real clouds. Everything else was measured by the commands beside the tables.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.marked_documents import put_tables  # noqa: E402
from ml.data.pack import CROP, pack_summary  # noqa: E402
from ml.data.packed import PackReader  # noqa: E402
from ml.data.sources import Source  # noqa: E402
from ml.experiments import RESULTS  # noqa: E402
from ml.runs import HISTORY, METRICS, PRETRAINING  # noqa: E402
from ml.scores.confusion import table_by_class, tables_by_test  # noqa: E402
from ml.scores.metrics import Spread, finite_values  # noqa: E402
from ml.scores.pictures import comparison  # noqa: E402
from ml.segmentation.scoring import score, trained_model  # noqa: E402
from ml.shipped import open_shipped  # noqa: E402
from synthroads_addon.base.errors import InputError, SynthRoadsError  # noqa: E402
from synthroads_addon.base.files import write_file  # noqa: E402
from synthroads_addon.base.schema import read_json  # noqa: E402

REAL_CLOUDS = {
    "semantickitti": ("semkitti_seq00_000000.laz", "segmentation-sweeps"),
    "ign": ("ign_lidarhd_street.laz", "segmentation-overhead"),
}
"""Mapping of classes, which names table and picture; the file in the folder of real clouds, and the model for it."""
_WHOLE = 1000.0
"""Edge of the tiles that real clouds are cut into, m: the largest, so that each is one."""


def run_table(folder: Path) -> str:
    """Return a Markdown table of a trained run's first test, with weights and training time below."""
    metrics = read_json(folder / METRICS)
    if not metrics["tests"]:
        raise InputError(str(folder), None, "has no test")
    name, scores = next(iter(metrics["tests"].items()))
    seconds = sum(epoch["seconds"] for epoch in read_json(folder / HISTORY))
    note = f"{metrics['parameters']:,} weights, trained in {seconds:,.0f} s on {metrics['device']}, scored on: {name}."
    return f"{table_by_class([scores])}\n\n{note}"


def experiment_tables(folder: Path) -> str:
    """Return Markdown tables of an experiment, one per test, with the trainings' seconds in the first."""
    results: dict[str, dict[str, Any]] = read_json(folder / RESULTS)
    seconds = {
        name: [training_seconds(folder / name / f"seed-{seed}") for seed in seeds] for name, seeds in results.items()
    }
    cells = " | ".join(Spread.over(finite_values(values)).text(0, "-") for values in seconds.values() if values)
    return tables_by_test(results, [f"| *training, s* |  | {cells} |"])


def training_seconds(run: Path) -> float:
    """Return the seconds that a run's training took, its pretraining included; NaN if it wasn't trained."""
    parts = [path for path in (run / HISTORY, run / PRETRAINING / HISTORY) if path.is_file()]
    if not parts:
        return float("nan")
    return sum(epoch["seconds"] for path in parts for epoch in read_json(path))


def real_tables(folder: Path, pictures: Path) -> dict[str, str]:
    """Score the package's models on the labelled real clouds and write pictures; return Markdown tables."""
    texts: dict[str, str] = {}
    for name, (file, model_name) in REAL_CLOUDS.items():
        run = open_shipped(model_name)
        source = Source(path=str(folder / file), mapping=name, tile=_WHOLE)
        confusion, test_points = score(trained_model(run), run.configuration, [source])
        scores = confusion.to_dict()
        note = f"{scores['ignored']:,} points without such a class don't count."
        texts[f"real-{name}"] = f"{table_by_class([scores])}\n\n{note}"
        if test_points is not None:
            picture = comparison(*test_points, source.targets(run.configuration.scheme()))
            write_file(pictures / f"segmentation-{name}.png", picture, overwrite=True)
    return texts


def prediction_table(file: Path) -> str:
    """Return a Markdown table of the result file of `studies/costs/prediction.py`."""
    report = read_json(file)
    changed_text = ", ".join(report["changed"]) or "none"
    head = ("points", "LAZ (MB)", "points/s", "seconds", "peak memory (MB)", "attributes", "changed")
    row = (
        report["points"],
        report["bytes"] / 1e6,
        report["points_per_second"],
        report["seconds"],
        report["peak_memory_mb"],
    )
    return _table(head, [*(f"{value:,.0f}" for value in row), str(report["attributes"]), changed_text])


def packed_table(file: Path) -> str:
    """Return a Markdown table of a packed file's size, roads, tiles and points."""
    summary = pack_summary(PackReader(file).notes, file.stat().st_size)
    head = ("file (MB)", "roads", "tiles", "points", "bytes per point", f"crops of {CROP:,} points")
    cells = (f"{summary['bytes'] / 1e6:.1f}", *(f"{summary[name]:,}" for name in ("scenes", "tiles", "points")))
    return _table(head, [*cells, f"{summary['bytes_per_point']:.2f}", f"{summary['crops']:,}"])


def forecast_table(file: Path) -> str:
    """Return a Markdown table of the result file of `synthroads forecast`."""
    report = read_json(file)
    head = ("tiles", "points of a batch", "s per step", "threads", "steps", "hours in all", "peak memory (MB)")
    numbers = (report["threads"], report["steps"], report["hours"], report["peak_memory_mb"])
    cells = [f"{report['tiles']:,}", f"{report['batch_points']:,}", f"{report['seconds_per_step']:.1f}"]
    return _table(head, [*cells, *(f"{value:,.0f}" for value in numbers)])


def _table(head: Sequence[str], row: Sequence[str]) -> str:
    """Return a Markdown table of one row."""
    return f"| {' | '.join(head)} |\n|{'--:|' * len(head)}\n| {' | '.join(row)} |"


READERS = {
    "small": run_table,
    "mixing": experiment_tables,
    "gantries": experiment_tables,
    "prediction": prediction_table,
    "packed": packed_table,
    "forecast": forecast_table,
}
"""Functions that make a table out of a folder or file; the names are those of the options and of the tables."""


def expected_tables(arguments: argparse.Namespace) -> list[str]:
    """Return the names of the tables that the arguments ask for."""
    names = [name for name in READERS if getattr(arguments, name)]
    return names + ([f"real-{name}" for name in REAL_CLOUDS] if arguments.real else [])


def tables(arguments: argparse.Namespace) -> Mapping[str, str]:
    """Make the document's Markdown tables that the arguments ask for, by name."""
    texts = {name: read(getattr(arguments, name)) for name, read in READERS.items() if getattr(arguments, name)}
    return texts | (real_tables(arguments.real, arguments.pictures) if arguments.real else {})


def arguments_of(words: Sequence[str] | None) -> argparse.Namespace:
    """Return the parsed arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", type=Path, metavar="RUN", help="the small training, `segmentation-small`")
    parser.add_argument("--mixing", type=Path, metavar="DIR", help="the experiment on real, synthetic and mixed data")
    parser.add_argument("--gantries", type=Path, metavar="DIR", help="the experiment on shield gantries")
    parser.add_argument(
        "--real", type=Path, metavar="DIR", help="labelled real clouds: the package's models are scored"
    )
    parser.add_argument("--prediction", type=Path, metavar="FILE", help="result of studies/costs/prediction.py")
    parser.add_argument("--packed", type=Path, metavar="FILE", help="file of `synthroads pack`")
    parser.add_argument("--forecast", type=Path, metavar="FILE", help="file of `synthroads forecast`")
    parser.add_argument("--pictures", type=Path, default=Path(), metavar="DIR", help="folder for the pictures")
    parser.add_argument("--document", type=Path, metavar="FILE", help="Markdown whose tables are replaced")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> None:
    """Make the tables that the command line asks for, fill the document's and print them."""
    arguments = arguments_of(words)
    try:
        texts = put_tables(arguments.document, expected_tables(arguments), lambda: tables(arguments))
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    for name, text in texts.items():
        print(f"{name}\n\n{text}\n")


if __name__ == "__main__":
    main()
