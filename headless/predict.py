"""Use a trained model on a cloud: label its points, or find its road's centreline and corridor."""

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import progress_bar
from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import path_beside
from synthroads_addon.base.text.table import text_table

_ADDED = "-predicted"
"""Ending of the output's name after the cloud's, where none is given."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads predict` to its parser."""
    text = "cloud to read (.laz, .las, .ply, ...); before it the folder of a trained run, or a shipped model's name of "
    text += "`synthroads list models` (the shipped segmentation that was trained on what is most like the cloud)"
    parser.add_argument("files", nargs="*", metavar="[RUN] CLOUD", help=text)
    parser.words = "files"  # type: ignore[attr-defined]
    text = "labelled cloud (.laz, .las) for segmentation, centreline (.geojson) for a centreline model "
    text += "(beside the cloud: of cloud.laz cloud-predicted.laz, or cloud.laz-predicted.geojson)"
    parser.add_argument("--output", type=Path, metavar="FILE", help=text)
    parser.set_defaults(writes=True)
    text = "line along the road that a centreline model begins with, CSV or GeoJSON (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "write the classes' LAS codes to the field classification, besides predicted_class (segmentation)"
    parser.add_argument("--classification", action="store_true", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads predict`; return exit code (3 if doubtful), metrics as JSON data and printed text."""
    if not 1 <= len(arguments.files) <= 2:
        raise InputError("CLOUD", " ".join(arguments.files), "one cloud is needed, perhaps with a RUN before it")
    *given, cloud = map(Path, arguments.files)
    from headless.train import summary
    from ml.choice import choose_model
    from ml.shipped import open_run
    from ml.tasks import Prediction, task

    choice = None if given else choose_model(cloud, "segmentation")
    trained = open_run(given[0] if choice is None else Path(choice.card.name))
    name = trained.configuration.task
    output = arguments.output or usual_output(cloud, name)
    files, option = (cloud, output, arguments.path), "--output" if arguments.output else ""
    asked = Prediction(*files, arguments.overwrite, arguments.classification, option)
    metrics = task(name).predict(trained, asked, progress_bar(arguments))
    metrics |= {"output": str(output), "next": next_step(cloud, output, name)}
    text = f"written {output}: {summary(metrics)}" if name == "centerline" else labelled(metrics)
    text += f"\nnext: {metrics['next']}"
    if choice is None:
        return 0, metrics, text
    return 3 if choice.doubtful else 0, metrics | {"choice": choice.to_dict()}, f"{choice.why()}\n{text}"


def usual_output(cloud: Path, task: str) -> Path:
    """Return the file beside a cloud that is written where none is named; another one for each cloud.

    Raises:
        InputError: the cloud's is no name of a file.
    """
    if task == "segmentation":
        return path_beside(cloud, f"{cloud.stem}{_ADDED}{cloud.suffix}", "CLOUD")
    return path_beside(cloud, f"{cloud.name}{_ADDED}.geojson", "CLOUD")


def next_step(cloud: Path, output: Path, task: str) -> str:
    """Return the command that draws what was written: the predicted classes, or the cloud along its centreline."""
    line = [] if task == "segmentation" else ["--centerline", str(output)]
    shown = cloud if line else output
    return shlex.join(["synthroads", "cloud", "preview", str(shown), *line, "--output", str(output.with_suffix(""))])


def labelled(metrics: dict[str, Any]) -> str:
    """Return what a segmentation did to a cloud as text: file, attribute, points and share of each class, time."""
    count, left = metrics["points"], metrics["left_out"]
    rows = [(name, f"{points:,}", f"{points / (count - left):.1%}") for name, points in metrics["classes"].items()]
    time = f"{metrics['seconds']:.1f} s, {metrics['points_per_second']:,} points/s"
    lines = [f"written {metrics['output']}: {count:,} points with the attribute {metrics['attribute']} ({time})"]
    if left:
        text = f"{metrics['attribute']} {UNLABELLED}, all else as in the file"
        lines.append(f"  {left:,} of them withheld or noise, which aren't labelled: {text}")
    return "\n".join([*lines, *(f"  {line}" for line in text_table(("class", "points", "share"), rows, (1, 2)))])


if __name__ == "__main__":
    entry("predict")
