"""Measure a trained run on data sets or clouds with known truth: prints the scores, writes tables and pictures."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.progress import progress_bar
from synthroads_addon.base.files import check_folder_target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads evaluate` to its parser."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a trained run, or name of a shipped model")
    parser.add_argument("data", type=Path, nargs="+", metavar="DATA", help="folders of data sets, or clouds")
    parser.add_argument("--split", default="test", metavar="NAME", help="split of the data sets (test)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for tables and pictures")
    text = "for segmentation: mapping of the clouds' classes to the model's: semantickitti, ign or a JSON file (none)"
    parser.add_argument("--mapping", metavar="MAPPING", help=text)
    text = "for segmentation: public data set in the folders (`synthroads list yardsticks`), or a JSON file (none)"
    parser.add_argument("--yardstick", metavar="NAME", help=text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads evaluate`; return exit code, scores as JSON data and printed tables."""
    from ml.shipped import open_run
    from ml.tasks import Evaluation, task

    check_folder_target(arguments.output)
    trained = open_run(arguments.run)
    evaluation = Evaluation(arguments.data, arguments.split, arguments.output, arguments.mapping, arguments.yardstick)
    scores, tables = task(trained.configuration.task).evaluate(trained, evaluation, progress_bar(arguments))
    summary = f"written to {arguments.output}: {', '.join(scores['files'])}"
    return 0, scores, f"{tables}\n\n{summary}"


if __name__ == "__main__":
    entry("evaluate")
