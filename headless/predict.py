"""Use a trained run on a cloud: label its points, or find its road's centreline and corridor."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import progress_bar
from headless.train import summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads predict` to its parser."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a trained run")
    parser.add_argument("cloud", type=Path, metavar="CLOUD", help="cloud to read (.laz, .las, .ply, ...)")
    text = "labelled cloud (.laz, .las) for segmentation, centreline (.geojson) for a centreline model"
    parser.add_argument("--output", required=True, type=Path, metavar="FILE", help=text)
    text = "line along the road that a centreline model begins with, CSV or GeoJSON (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "write the classes' LAS codes to the field classification, besides predicted_class (segmentation)"
    parser.add_argument("--classification", action="store_true", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads predict`; return exit code, metrics as JSON data and printed text."""
    from ml.runs import Run
    from ml.tasks import Prediction, task

    trained = Run.open(arguments.run)
    files = (arguments.cloud, arguments.output, arguments.path)
    prediction = Prediction(*files, overwrite=arguments.overwrite, classification=arguments.classification)
    metrics = task(trained.configuration.task).predict(trained, prediction, progress_bar(arguments))
    return 0, metrics, f"written {arguments.output}: {summary(metrics)}"


if __name__ == "__main__":
    entry("predict")
