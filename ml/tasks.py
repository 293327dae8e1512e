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
    """Request to measure a trained run: data, output folder and class mapping.

    Attributes:
        data: folders of data sets, or cloud files with what they need beside them.
        split: split of the data sets.
        output: folder for tables and pictures.
        mapping: mapping of a cloud's class numbers to classes; None for the project's own. Used by segmentation only.
        yardstick: public data set that each folder holds; None for the project's own. Used by segmentation only.
    """

    data: Sequence[Path]
    split: str
    output: Path
    mapping: str | None = None
    yardstick: str | None = None


@dataclass(frozen=True)
class Prediction:
    """Request to use a trained run on a cloud: input, output and options.

    Attributes:
        cloud: file to be read.
        output: file or folder to be written.
        path: line along the road (CSV or GeoJSON); None if it is found in the cloud. Used by centrelines only.
        overwrite: whether files that are there may be replaced.
        classification: whether LAS codes are written to the standard field too. Used by segmentation only.
        output_option: name of the option by which the user named the output; empty if they named none.
    """

    cloud: Path
    output: Path
    path: Path | None = None
    overwrite: bool = False
    classification: bool = False
    output_option: str = "--output"


class Task(Protocol):
    """Protocol of the modules of `TASKS`: train, evaluate, predict, export; results are JSON data, tables are text."""

    CONFIGURATION: type[Configuration]

    def train(self, run: Any, progress: Progress = silent) -> dict[str, Any]:
        """Train a `Run`, save the model and the metrics in its folder; return the metrics as JSON data."""

    def evaluate(self, run: Any, evaluation: Evaluation, progress: Progress = silent) -> tuple[dict[str, Any], str]:
        """Measure a trained `Run`, write tables and pictures; return figures (``files``: their names) and a text."""

    def predict(self, run: Any, prediction: Prediction, progress: Progress = silent) -> dict[str, Any]:
        """Apply a trained `Run` to a cloud, write the prediction's files; return a summary as JSON data."""

    def exportable(self, run: Any) -> Any:
        """Return the network of a trained `Run` as `onnx_export.Exportable`."""


def task(name: str) -> Task:
    """Import and return the module of a task of `TASKS`."""
    return cast(Task, import_module(TASKS[name]))
