"""Learning tasks, as the commands see them."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

from synthroads_addon.base.progress import Progress, silent

from .configuration import TASKS, Configuration


@dataclass(frozen=True)
class Evaluation:
    """Data that a trained run is measured on.

    Attributes:
        data: folders of data sets, or cloud files with what they need beside them.
        split: of the data sets.
        output: folder for tables and pictures.
        mapping: which of a cloud's own numbers are which class; None where clouds have ours. Of use to segmentation.
    """

    data: Sequence[Path]
    split: str
    output: Path
    mapping: str | None = None


@dataclass(frozen=True)
class Prediction:
    """Cloud that a trained run is used on.

    Attributes:
        cloud: file to be read.
        output: file or folder to be written.
        path: line along the road (CSV or GeoJSON); None: found in the cloud. Of use to centrelines only.
        overwrite: whether files that are there may be replaced.
        classification: write the classes' LAS codes to the standard field too. Of use to segmentation only.
    """

    cloud: Path
    output: Path
    path: Path | None = None
    overwrite: bool = False
    classification: bool = False


class Task(Protocol):
    """A module of `TASKS`, with the class of its configurations. Results are JSON data, but for tables."""

    CONFIGURATION: type[Configuration]

    def train(self, run: Any, progress: Progress = silent) -> dict[str, Any]:
        """Train a `Run`, save it and return its metrics."""

    def evaluate(self, run: Any, evaluation: Evaluation, progress: Progress = silent) -> tuple[dict[str, Any], str]:
        """Measure a trained `Run`; ``files`` are the names of what was written to the output. And tables for people."""

    def predict(self, run: Any, prediction: Prediction, progress: Progress = silent) -> dict[str, Any]:
        """Use a trained `Run` on a cloud and write what it says."""


def task(name: str) -> Task:
    """Return the module of a task out of `TASKS`."""
    return cast(Task, import_module(TASKS[name]))
