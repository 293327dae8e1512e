"""Use a trained model on a cloud: label its points, or find its road's centreline and corridor."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import progress_bar
from headless.train import summary
from synthroads_addon.base.errors import InputError

_ENDINGS = {"segmentation": "-labelled.laz", "centerline": "-centerline.geojson"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads predict` to its parser."""
    text = "cloud to read (.laz, .las, .ply, ...); before it the folder of a trained run, or a shipped model's name of "
    text += "`synthroads list models` (the shipped segmentation that was trained on what is most like the cloud)"
    parser.add_argument("files", nargs="*", metavar="[RUN] CLOUD", help=text)
    parser.words = "files"  # type: ignore[attr-defined]
    text = "labelled cloud (.laz, .las) for segmentation, centreline (.geojson) for a centreline model "
    text += "(CLOUD-labelled.laz or CLOUD-centerline.geojson in the folder that the command runs in)"
    parser.add_argument("--output", type=Path, metavar="FILE", help=text)
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
    from ml.choice import choose_model
    from ml.shipped import open_run
    from ml.tasks import Prediction, task

    choice = None if given else choose_model(cloud, "segmentation")
    trained = open_run(given[0] if choice is None else Path(choice.card.name))
    name = trained.configuration.task
    output = arguments.output or Path(cloud.stem + _ENDINGS[name])
    files = (cloud, output, arguments.path)
    prediction = Prediction(*files, overwrite=arguments.overwrite, classification=arguments.classification)
    metrics = task(name).predict(trained, prediction, progress_bar(arguments))
    text = f"written {output}: {summary(metrics)}"
    if choice is None:
        return 0, metrics, text
    return 3 if choice.doubtful else 0, metrics | {"choice": choice.to_dict()}, f"{choice.why()}\n{text}"


if __name__ == "__main__":
    entry("predict")
