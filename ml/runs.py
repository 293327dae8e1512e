"""A run's folder: configuration, history, curves, metrics and checkpoint of one training."""

from __future__ import annotations

import io
import math
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch

from synthroads_addon.base.errors import InputError, MissingFileError, OutputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import canonical_json, read_json

from .configuration import Configuration, from_data
from .processes import process_number

CONFIGURATION = "configuration.json"
CHECKPOINT = "checkpoint.pt"
HISTORY = "history.json"
METRICS = "metrics.json"
CURVES = "curves.png"
CALIBRATION = "calibration.json"
PRETRAINING = "pretraining"
"""Folder, within that of a fine-tuned or self-trained run, of what it began with, and of its rounds but the last."""
FREE_WHEN_RESUMING = ("threads", "device", "workers", "prepare_on")
"""Fields that may change between the parts of one training: they say where it runs, not what it learns."""
_FREE_IN_STREAM = ("producers", "folder")
"""Those of `data.stream`."""

C = TypeVar("C", bound=Configuration)


@dataclass
class Run(Generic[C]):
    """One training: its folder, configuration and history.

    Attributes:
        folder: of its files.
        configuration: all that it depends on.
        history: one dictionary of numbers per epoch that is done.
    """

    folder: Path
    configuration: C
    history: list[dict[str, float]] = field(default_factory=list)

    @classmethod
    def start(cls, folder: Path, configuration: C, *, resume: bool = False, overwrite: bool = False) -> Run[C]:
        """Return a new run whose folder is made, or with `resume` the interrupted run in it.

        Raises:
            OutputError: the folder holds a run already and neither ``resume`` nor ``overwrite`` says what to do.
            InputError: the run to resume was made with another configuration.
        """
        run = cls(folder, configuration)
        if process_number():
            return run  # the first process's, which alone writes
        there = (folder / CONFIGURATION).exists()
        if there and resume:
            run._resume(read_json(folder / CONFIGURATION))
        elif there and not overwrite:
            raise OutputError("--output", str(folder), "holds a run already; --resume goes on, --overwrite begins anew")
        else:
            try:
                for name in (CHECKPOINT, HISTORY, METRICS, CURVES, CALIBRATION):
                    (folder / name).unlink(missing_ok=True)
                if (folder / PRETRAINING).is_dir():
                    shutil.rmtree(folder / PRETRAINING)
            except OSError as error:
                raise OutputError("--output", str(folder), f"cannot be written ({error.strerror})") from None
        write_file(folder / CONFIGURATION, canonical_json(configuration.to_dict()).encode(), overwrite=True)
        return run

    @classmethod
    def open(cls, folder: Path) -> Run[Any]:
        """Open the run in a folder that holds at least one checkpoint.

        Raises:
            MissingFileError: the folder holds no run.
        """
        if not (folder / CONFIGURATION).is_file() or not (folder / CHECKPOINT).is_file():
            raise MissingFileError(str(folder), None, "holds no trained run; `synthroads train` makes one")
        run: Run[Any] = cls(folder, from_data(read_json(folder / CONFIGURATION), str(folder / CONFIGURATION)))
        if (folder / HISTORY).is_file():
            run.history = read_json(folder / HISTORY)
        return run

    def save(self, state: Mapping[str, Any]) -> None:
        """Write `state` as the run's checkpoint, replacing the last one atomically."""
        content = io.BytesIO()
        torch.save(dict(state), content)
        write_file(self.folder / CHECKPOINT, content.getvalue(), overwrite=True)

    def last_checkpoint(self, device: torch.device | str = "cpu") -> dict[str, Any] | None:
        """Load the last checkpoint (model, optimizer, epoch) onto a device; None if there is none yet.

        Raises:
            InputError: the file is damaged.
        """
        path = self.folder / CHECKPOINT
        if not path.exists():
            return None
        try:
            state: dict[str, Any] = torch.load(path, map_location=device, weights_only=True)
        except Exception as problem:  # pickle, zip and torch each have errors of their own
            raise InputError(str(path), None, f"is no checkpoint, or damaged ({type(problem).__name__})") from None
        if not isinstance(state, dict) or not {"model", "epoch"} <= set(state):
            raise InputError(str(path), None, "is no checkpoint of a training of ours")
        return state

    def calibration(self) -> dict[str, Any] | None:
        """Return the calibration of a model's deviations as JSON data, None if it has none or not yet."""
        path = self.folder / CALIBRATION
        return read_json(path) if path.is_file() else None

    def record(self, figures: Mapping[str, float]) -> None:
        """Append an epoch's figures to the history, and write the history's file."""
        self.history.append({name: float(value) for name, value in figures.items()})
        write_file(self.folder / HISTORY, canonical_json(to_json_data(self.history)).encode(), overwrite=True)

    def write_metrics(self, metrics: Mapping[str, Any]) -> None:
        """Write the trained model's metrics as JSON, and the history's curves as a PNG."""
        write_file(self.folder / METRICS, canonical_json(to_json_data(dict(metrics))).encode(), overwrite=True)
        if self.history:
            write_file(self.folder / CURVES, _curves(self.history), overwrite=True)

    def _resume(self, before: Any) -> None:
        if not isinstance(before, dict):
            raise InputError(str(self.folder / CONFIGURATION), None, "must be a JSON object")
        now = self.configuration.to_dict()
        with suppress(InputError):  # fields may be called otherwise by now, or be new
            before = self.configuration.from_dict(before).to_dict()
        begun, wanted = lasting_data(before), lasting_data(now)
        different = [name for name in {**begun, **wanted} if begun.get(name) != wanted.get(name)]
        if different:
            name = different[0]
            raise InputError(f"--resume: {name}", now.get(name), f"the run was begun with {before.get(name)!r}")
        state = self.last_checkpoint()
        done = 0 if state is None else int(state["epoch"])
        if done:
            self.history = read_json(self.folder / HISTORY)[:done]


def stream_seed(seed: int, *purpose: str | int) -> int:
    """Return a 63-bit seed derived from a seed and a purpose, e.g. for PyTorch."""
    return int(stream(seed, *purpose).integers(2**63))


def lasting_data(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration's data without the fields that may change on resuming, those of `FREE_WHEN_RESUMING`."""
    kept = {name: value for name, value in configuration.items() if name not in FREE_WHEN_RESUMING}
    data = kept.get("data")
    if isinstance(data, Mapping) and isinstance(data.get("stream"), Mapping):
        lasting = {name: value for name, value in data["stream"].items() if name not in _FREE_IN_STREAM}
        kept["data"] = {**data, "stream": lasting}
    return kept


def to_json_data(value: Any) -> Any:
    """Return a copy of nested data as JSON can hold it: NaN and infinity become None, tuples lists, keys strings."""
    if isinstance(value, Mapping):
        return {str(key): to_json_data(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_data(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _curves(history: list[dict[str, float]]) -> bytes:
    """Return a PNG with one small plot per figure of the history, over the epochs."""
    from matplotlib.figure import Figure  # takes half a second, which only pictures need

    names = [name for name in history[-1] if name not in ("epoch", "seconds")]
    figure = Figure(figsize=(4 * min(len(names), 3), 3 * -(-len(names) // 3)), layout="constrained")
    for place, name in enumerate(names):
        axes = figure.add_subplot(-(-len(names) // 3), min(len(names), 3), place + 1)
        axes.plot([epoch["epoch"] for epoch in history], [epoch.get(name, float("nan")) for epoch in history])
        axes.set(title=name.replace("_", " "), xlabel="epoch")
        axes.grid(alpha=0.3)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=110)
    return content.getvalue()
