"""Train a model: a network for segmentation, or one of the centreline models, as a configuration says."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry, note_at_interrupt
from headless.messages import detail
from headless.options import add_changes_argument
from headless.progress import progress_bar
from ml.configuration import SHIPPED, load_configuration, names_in

if TYPE_CHECKING:
    from ml.runs import Run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads train` to its parser."""
    names = ", ".join(names_in(SHIPPED))
    parser.add_argument("configuration", metavar="CONFIGURATION", help=f"YAML file, or one of {names}")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the run")
    parser.add_argument("--resume", action="store_true", help="go on with an interrupted training")
    parser.add_argument("--overwrite", action="store_true", help="begin anew in a folder that holds a run")
    add_changes_argument(parser, "the configuration", "seed=2")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads train`; return exit code, metrics as JSON data and printed text."""
    from ml.runs import Run
    from ml.tasks import task

    configuration = load_configuration(arguments.configuration, arguments.changes)
    detail("configuration", configuration.to_dict())
    training = Run.start(arguments.output, configuration, resume=arguments.resume, overwrite=arguments.overwrite)
    note_at_interrupt(lambda: _kept(arguments, training))
    metrics = task(configuration.task).train(training, progress_bar(arguments))
    return 0, metrics, f"trained {arguments.output}: {summary(metrics)}"


def _kept(arguments: argparse.Namespace, run: Run[Any]) -> str:
    """Return what is kept of an interrupted training, and the command that goes on with it."""
    from ml.runs import CHECKPOINT, PRETRAINING

    changes = [word for change in arguments.changes for word in ("--set", change)]
    words = [arguments.configuration, "--output", str(arguments.output), *changes, "--resume"]
    if not run.begun and not run.kept:
        return f"nothing was changed in {arguments.output}: it was still reading data"
    epochs = run.configuration.schedule.epochs
    state = f"epoch {run.kept} of {epochs} is kept" if run.kept else f"no epoch of {epochs} was finished"
    if not run.kept and (arguments.output / PRETRAINING / CHECKPOINT).is_file():
        state = "the pretraining's epochs are kept"
    return f"{state} in {arguments.output}; go on with: {shlex.join(['synthroads', 'train', *words])}"


def summary(metrics: dict[str, object]) -> str:
    """Return the scalar metrics as one line of text, `name value, ...`; other metrics are left out."""
    numbers = {name: value for name, value in metrics.items() if isinstance(value, (int, float))}
    return ", ".join(f"{name} {value:.4g}" for name, value in numbers.items())


if __name__ == "__main__":
    entry("train")
