"""Measure a trained run on data sets or clouds with known truth: prints the scores, writes tables and pictures."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import progress_bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads evaluate` to its parser."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a trained run")
    parser.add_argument("data", type=Path, nargs="+", metavar="DATA", help="data sets' folders or clouds")
    parser.add_argument("--split", default="test", metavar="NAME", help="split of the data sets (test)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for tables and pictures")
    text = "classes of clouds of others, for segmentation: semantickitti, ign or a JSON file (the cloud's own)"
    parser.add_argument("--mapping", metavar="MAPPING", help=text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads evaluate`; return exit code, scores as JSON data and printed tables."""
    from ml.runs import Run
    from ml.tasks import Evaluation, task

    trained = Run.open(arguments.run)
    evaluation = Evaluation(arguments.data, arguments.split, arguments.output, arguments.mapping)
    scores, tables = task(trained.configuration.task).evaluate(trained, evaluation, progress_bar(arguments))
    written = f"written to {arguments.output}: {', '.join(scores['files'])}"
    return 0, scores, f"{tables}\n\n{written}"


if __name__ == "__main__":
    entry("evaluate")
