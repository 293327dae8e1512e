"""Run an experiment: several trainings that differ in their data, each with several seeds.

One table has all scores. Finished trainings are kept: after an interruption, run the same command again to go on.
"""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry, note_at_interrupt
from headless.options import add_changes_argument
from headless.progress import progress_bar
from ml.configuration import EXPERIMENTS, names_in
from synthroads_addon.base.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads experiment` to its parser."""
    names = ", ".join(names_in(EXPERIMENTS))
    parser.add_argument("experiment", metavar="EXPERIMENT", help=f"YAML file, or one of {names}")
    text = "folder that replaces {NAME} in the experiment's paths (can be repeated)"
    parser.add_argument("--data", type=_folder, action="append", default=[], metavar="NAME=FOLDER", help=text)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder for runs, scores and table")
    text = "configuration that all trainings start from: a name or a YAML file (the experiment's)"
    parser.add_argument("--configuration", metavar="NAME_OR_FILE", help=text)
    text = "seeds of each training, one after another (the experiment's)"
    parser.add_argument("--seeds", type=int, nargs="+", metavar="N", help=text)
    text = (
        "names of real roads, with commas, that are left out of the training together and tested on (can be repeated: "
    )
    text += "turn by turn), for centrelines (each road by itself)"
    parser.add_argument("--leave-out", type=_names, action="append", default=[], metavar="ROADS", help=text)
    add_changes_argument(parser, "all configurations", "threads=1")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads experiment`; return exit code, scores as JSON data and a printed table."""
    from ml.experiments import RESULTS, TABLE, configurations, experiment_module, load_experiment

    experiment = load_experiment(arguments.experiment)
    work = experiment_module(experiment.task)
    if arguments.configuration:
        experiment = experiment.model_copy(update={"configuration": arguments.configuration})
    if arguments.leave_out:
        if experiment.task != "centerline":
            raise InputError("--leave-out", ",".join(arguments.leave_out[0]), "is for experiments with centrelines")
        data = experiment.data.model_copy(update={"left_out": tuple(arguments.leave_out)})
        experiment = experiment.model_copy(update={"data": data})
    configuration_of_name = configurations(experiment, dict(arguments.data), arguments.changes)
    seeds = arguments.seeds or experiment.seeds
    for seed in seeds:
        if not 0 <= seed < 2**63:
            raise InputError("--seeds", seed, "must be whole numbers from 0")
    note_at_interrupt(lambda: f"what is trained and tested is kept in {arguments.output}; the same command goes on")
    results = work.run_experiment(experiment, configuration_of_name, arguments.output, seeds, progress_bar(arguments))
    table = work.table(experiment.title, results, list(configuration_of_name))
    text = f"{table}\nwritten to {arguments.output}: {TABLE}, {RESULTS} and the runs"
    return 0, {"title": experiment.title, "results": results}, text


def _folder(text: str) -> tuple[str, str]:
    """Return the name and folder of a text NAME=FOLDER: a type for argparse."""
    name, _, folder = text.partition("=")
    if not name or not folder:
        raise argparse.ArgumentTypeError(f"is '{text}': must be NAME=FOLDER, e.g. real=out/standin")
    return name, folder


def _names(text: str) -> tuple[str, ...]:
    """Return the names of a text, separated by commas: a type for argparse."""
    return tuple(filter(None, text.split(",")))


if __name__ == "__main__":
    entry("experiment")
