"""Use a trained model on a cloud: label its points, or find its road's centreline and corridor."""

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.progress import progress_bar
from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.text.table import text_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads predict` to its parser."""
    text = "cloud to read (.laz, .las, .ply, ...); before it, the folder of a trained run or the name of a model from "
    text += "`synthroads list models` (the shipped segmentation whose training data are most like the cloud)"
    parser.add_argument("files", nargs="*", metavar="[RUN] CLOUD", help=text)
    parser.words = "files"  # type: ignore[attr-defined]
    text = "labelled cloud (.laz, .las) for segmentation, centreline (.geojson) for a centreline model "
    text += "(beside cloud.laz: cloud-predicted.laz, or cloud.laz-predicted.geojson)"
    parser.add_argument("--output", type=Path, metavar="FILE", help=text)
    parser.set_defaults(writes=True)
    text = "for a centreline model: approximate line along the road, CSV or GeoJSON (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "for segmentation: also write the LAS codes of the classes to the field classification"
    parser.add_argument("--classification", action="store_true", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads predict`; return exit code (3 if doubtful), metrics as JSON data and printed text."""
    if not 1 <= len(arguments.files) <= 2:
        raise InputError("CLOUD", " ".join(arguments.files), "one cloud is needed, perhaps with a RUN before it")
    *run_folders, cloud = map(Path, arguments.files)
    from headless.train import summary
    from ml.prediction import predict

    prediction = predict(
        cloud,
        arguments.output,
        run_folders[0] if run_folders else None,
        path=arguments.path,
        classification=arguments.classification,
        overwrite=arguments.overwrite,
        progress=progress_bar(arguments),
    )
    metrics, output, name, choice = prediction.metrics, prediction.output, prediction.task, prediction.choice
    metrics |= {"output": str(output), "next": next_step(cloud, output, name)}
    text = f"written {output}: {summary(metrics)}" if name == "centerline" else labelled(metrics)
    text += f"\nnext: {metrics['next']}"
    if choice is None:
        return 0, metrics, text
    return 3 if choice.doubtful else 0, metrics | {"choice": choice.to_dict()}, f"{choice.why()}\n{text}"


def next_step(cloud: Path, output: Path, task: str) -> str:
    """Return the command that draws what was written: the predicted classes, or the cloud along its centreline."""
    line = [] if task == "segmentation" else ["--centerline", str(output)]
    picture_cloud = cloud if line else output
    return shlex.join(
        ["synthroads", "cloud", "preview", str(picture_cloud), *line, "--output", str(output.with_suffix(""))]
    )


def labelled(metrics: dict[str, Any]) -> str:
    """Return what a segmentation did to a cloud as text: file, attribute, points and share of each class, time."""
    count, left_out_count = metrics["points"], metrics["left_out"]
    rows = [
        (name, f"{points:,}", f"{points / (count - left_out_count):.1%}") for name, points in metrics["classes"].items()
    ]
    time = f"{metrics['seconds']:.1f} s, {metrics['points_per_second']:,} points/s"
    lines = [f"written {metrics['output']}: {count:,} points with the attribute {metrics['attribute']} ({time})"]
    if left_out_count:
        text = f"{metrics['attribute']} {UNLABELLED}, all else as in the file"
        lines.append(f"  {left_out_count:,} of them withheld or noise, which aren't labelled: {text}")
    return "\n".join([*lines, *(f"  {line}" for line in text_table(("class", "points", "share"), rows, (1, 2)))])


if __name__ == "__main__":
    entry("predict")
