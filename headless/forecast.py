"""Forecast how long the training of a segmentation takes on this machine, from a few of its steps.

The measured time per step is multiplied by the number of steps. Scoring after the epochs takes additional time.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.options import add_changes_argument
from ml.configuration import load_configuration
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target, write_file
from synthroads_addon.base.schema import canonical_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads forecast` to its parser."""
    text = "shipped configuration of a segmentation, or a YAML file"
    parser.add_argument("configuration", metavar="CONFIGURATION", help=text)
    text = "number of steps to measure (%(default)s)"
    parser.add_argument("--steps", type=int, default=3, metavar="N", help=text)
    add_changes_argument(parser, "the configuration", "threads=1")
    parser.add_argument("--output", type=Path, metavar="FILE", help="also write this JSON file")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads forecast`; return exit code, figures as JSON data and printed text."""
    if arguments.steps < 1:
        raise InputError("--steps", arguments.steps, "must be 1 or more")
    if arguments.output:
        check_file_target(arguments.output, overwrite=True)
    from ml.segmentation.forecast import forecast

    configuration = load_configuration(arguments.configuration, arguments.changes, ["segmentation"])
    figures = forecast(configuration, arguments.steps)
    if arguments.output:
        write_file(arguments.output, canonical_json(figures).encode(), overwrite=True)
    return 0, figures, summary(figures)


def summary(forecast: dict[str, Any]) -> str:
    """Return a forecast as a line of text: hours, steps, seconds per step, device, batch."""
    return (
        f"{forecast['hours']:,.1f} hours for {forecast['steps']:,} steps of {forecast['seconds_per_step']:.2f} s, on "
        f"{forecast['device']} with {forecast['threads']} threads ({forecast['tiles']:,} tiles, "
        f"{forecast['batch_points']:,} points of a batch)"
    )


if __name__ == "__main__":
    entry("forecast")
