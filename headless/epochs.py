"""Survey the same road several times: parameters, changes, twins and clouds of each epoch, with each point's change."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import detail
from headless.options import (
    add_allow_large_argument,
    add_changes_argument,
    add_device_argument,
    add_twin_argument,
    all_changes,
    whole_number,
)
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.scenario.scenario import load_scenario, scenario_names

_FIELDS = {
    "device": "scan.device",
    "seed": "seed",
    "fidelity": "fidelity",
    "twin": "twin",
    "years": "road.changes.years",
    "allow_large": "scan.most_pulses",
}
"""Arguments that are short for fields of the scenario."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads epochs` to its parser."""
    names = ", ".join(scenario_names())
    text = f"{names}, or a .json file (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help=text)
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the epochs' folders")
    parser.add_argument("--epochs", type=whole_number(100, "100"), default=2, metavar="N", help="how many (2)")
    parser.add_argument("--years", type=float, metavar="YEARS", help="years from one epoch to the next (2)")
    text = "list of changes to make instead of drawing them (changes.json); one for each later epoch"
    parser.add_argument("--changes", action="append", default=[], type=Path, metavar="FILE", dest="lists", help=text)
    text = "survey every epoch from the same path with the same random numbers, light and traffic"
    parser.add_argument("--same-survey", action="store_true", help=text)
    text = "change one field of one epoch's scenario, e.g. 2:scan.device=generic-grid (can be repeated)"
    parser.add_argument("--set-epoch", action="append", default=[], metavar="N:PATH=VALUE", help=text)
    add_device_argument(parser)
    seed = whole_number(2**63 - 1, "2^63 - 1")
    parser.add_argument("--seed", type=seed, metavar="N", help="seed of all random choices (the scenario's own)")
    text = "speed against accuracy, as a preset (the scenario's own)"
    parser.add_argument("--fidelity", choices=("draft", "standard", "high"), help=text)
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="take this set as the first epoch")
    add_allow_large_argument(parser)
    add_twin_argument(parser)
    add_changes_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads epochs`; return exit code, the report as JSON data and printed text."""
    from synthroads_addon.road.changes.change import read_changes

    start = time.perf_counter()
    scenario = load_scenario(arguments.scenario, all_changes(arguments, _FIELDS))
    detail("scenario", scenario.to_dict())
    settings = _settings(arguments.set_epoch, arguments.epochs)
    lists = tuple(read_changes(path) for path in arguments.lists)
    if len(lists) > arguments.epochs - 1:
        text = f"at most {arguments.epochs - 1} lists are needed for {arguments.epochs} epochs"
        raise InputError("--changes", len(lists), text)
    from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs
    from synthroads_addon.jobs.generate import Job

    job = Job(scenario, arguments.output, arguments.parameters, overwrite=arguments.overwrite, new_file=True)
    request = EpochsJob(job, arguments.epochs, arguments.same_survey, settings, lists)
    report = generate_epochs(request, progress_bar(arguments))
    report["seconds"] = round(time.perf_counter() - start, 3)
    return 0, report, summary(report, arguments.output)


def _settings(texts: list[str], count: int) -> dict[int, list[str]]:
    """Return the changes of epochs' scenarios (``path=value``) by the epoch's number.

    Raises:
        InputError: a text has another form, or names an epoch that isn't made.
    """
    result: dict[int, list[str]] = {}
    for text in texts:
        number, colon, change = text.partition(":")
        if not colon or not number.isdigit() or not 1 <= int(number) <= count:
            raise InputError("--set-epoch", text, f"must be N:PATH=VALUE with an epoch N from 1 to {count}")
        result.setdefault(int(number), []).append(change)
    return result


def summary(report: dict[str, Any], output: Path) -> str:
    """Return the report of epochs as text: a line for each."""
    lines = []
    for epoch in report["epochs"]:
        points = "no cloud" if epoch["points"] is None else f"{epoch['points']:,} points"
        changes = f", {epoch['changes']} changes in {epoch['years']:g} years" if epoch["years"] is not None else ""
        lines.append(f"{epoch['folder']}: {points}{changes}, {epoch['seconds']:.1f} s")
    return "\n".join([*lines, f"written to {output}"])


if __name__ == "__main__":
    entry("epochs")
