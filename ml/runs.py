"""A run's folder: configuration, history, curves, metrics and checkpoint of one training."""

from __future__ import annotations

import io
import math
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import nn

from synthroads_addon.base.errors import InputError, MissingFileError, OutputError
from synthroads_addon.base.figure import new_figure, save_figure
from synthroads_addon.base.files import folder_at_work, write_file
from synthroads_addon.base.named_paths import path_inside
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import canonical_json, read_json
from synthroads_addon.base.text.literal import literal_texts, shown_text

from .configuration import Configuration, from_data
from .processes import process_number, wait_for_all

CONFIGURATION = "configuration.json"
CHECKPOINT = "checkpoint.pt"
HISTORY = "history.json"
METRICS = "metrics.json"
CURVES = "curves.png"
CALIBRATION = "calibration.json"
PRETRAINING = "pretraining"
"""Folder within a fine-tuned or self-trained run's that holds its pretraining, and its rounds but the last."""
LOCK = ".lock"
"""File that the training at work in the folder holds locked; it is gone at the end."""
NOT_FINITE = (
    "the output of the network must be finite for this cloud, but isn't: its weights are too large; train again"
)
"""Fault of a network, as an error says it."""
FREE_WHEN_RESUMING = ("threads", "device", "workers", "prepare_on")
"""Fields that may change between the parts of one training: they say where it runs, not what it learns."""
_FREE_IN_STREAM = ("producers", "folder")
"""Fields of `data.stream` that may change between the parts of one training."""

C = TypeVar("C", bound=Configuration)


@dataclass
class Run(Generic[C]):
    """One training: its folder, configuration and history.

    Attributes:
        folder: folder of its files.
        configuration: configuration that determines it.
        history: figures by name of each finished epoch.
        kept: number of finished epochs that the checkpoint holds.
        resume, overwrite: whether a run in the folder is resumed, or replaced.
        begun: whether the configuration was written to the folder.
        held: whether this process holds the folder's lock.
    """

    folder: Path
    configuration: C
    history: list[dict[str, float]] = field(default_factory=list)
    kept: int = 0
    resume: bool = False
    overwrite: bool = False
    begun: bool = False
    held: bool = False

    @classmethod
    def start(cls, folder: Path, configuration: C, *, resume: bool = False, overwrite: bool = False) -> Run[C]:
        """Return a new run, or with `resume` the interrupted run in a folder; nothing is written before `begin`.

        A configuration beside which no epoch is kept is no run: whatever ended that training, nothing is lost with it.

        Raises:
            OutputError: the folder holds a run already and neither ``resume`` nor ``overwrite`` says what to do.
            InputError: the run to resume was made with another configuration.
        """
        run = cls(folder, configuration, resume=resume, overwrite=overwrite)
        if not process_number():  # the first process's, which alone writes
            run._take_over()
        return run

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Context in which this process holds the lock of the run's folder; nested contexts do nothing more.

        After an InputError before the first checkpoint nothing of the run is left.

        Raises:
            OutputError: another training holds the lock, or the folder can't be written.
        """
        if self.held or process_number():
            yield
            return
        with folder_at_work(self.folder, LOCK, keep=False):
            self.held = True
            try:
                yield
            except InputError:
                self._remove_unless_saved()
                raise
            finally:
                self.held = False

    def begin(self) -> None:
        """Write the run's configuration and remove the files of a run that it replaces; once, after data are read.

        All processes that train together call it, and the first one writes.

        Raises:
            OutputError, InputError: see `start`; or the folder can't be written.
        """
        if self.begun:
            return
        if not process_number():
            if not self._take_over():
                self._clear()
            content = canonical_json(self.configuration.to_dict()).encode()
            write_file(self.folder / CONFIGURATION, content, overwrite=True)
        self.begun = True
        wait_for_all()  # nobody goes on with a checkpoint that is removed until here

    def _take_over(self) -> bool:
        """Return whether the folder's run is resumed, after taking over its history; for errors see `start`."""
        if not (self.folder / CONFIGURATION).exists() or not self._has_checkpoints():
            return False
        if self.resume:
            self._resume(read_json(self.folder / CONFIGURATION))
        elif not self.overwrite:
            fault = "already holds a run; --resume continues it, --overwrite starts again"
            raise OutputError("--output", str(self.folder), fault)
        return self.resume

    def _has_checkpoints(self) -> bool:
        """Return whether the folder holds a checkpoint of the run, or of its pretraining."""
        return (self.folder / CHECKPOINT).exists() or any((self.folder / PRETRAINING).rglob(CHECKPOINT))

    def _remove_unless_saved(self) -> None:
        """Remove the files that `begin` has written, unless there is a checkpoint."""
        if self.begun and not self._has_checkpoints():
            with suppress(OSError):  # what ended the training is told
                self._clear()
                (self.folder / CONFIGURATION).unlink(missing_ok=True)

    def _clear(self) -> None:
        """Remove the files of a run from the folder; of links the links alone."""
        try:
            for name in (CHECKPOINT, HISTORY, METRICS, CURVES, CALIBRATION):
                (self.folder / name).unlink(missing_ok=True)
            if (self.folder / PRETRAINING).is_symlink():
                (self.folder / PRETRAINING).unlink()
            elif (self.folder / PRETRAINING).is_dir():
                shutil.rmtree(self.folder / PRETRAINING)
        except OSError as error:
            raise OutputError("--output", str(self.folder), f"cannot be written ({error.strerror})") from None

    def part(self, *names: str) -> Path:
        """Return the folder of a part of the training within the run's; InputError if a link leads out of that."""
        return path_inside(self.folder, Path(*names), self.folder, follow=True)

    @classmethod
    def open(cls, folder: Path) -> Run[Any]:
        """Open the run in a folder that holds at least one checkpoint.

        Raises:
            MissingFileError: the folder holds no run.
        """
        if not (folder / CONFIGURATION).is_file() or not (folder / CHECKPOINT).is_file():
            raise MissingFileError(
                str(folder), None, "must be the folder of a trained run, as `synthroads train` makes it"
            )
        run: Run[Any] = cls(folder, from_data(read_json(folder / CONFIGURATION), str(folder / CONFIGURATION)))
        if (folder / HISTORY).is_file():
            run.history = _read_history(folder / HISTORY)
        return run

    def save(self, state: Mapping[str, Any]) -> None:
        """Write `state` as the run's checkpoint, replacing the last one atomically; see also `begin`."""
        self.begin()
        content = io.BytesIO()
        torch.save(dict(state), content)
        write_file(self.folder / CHECKPOINT, content.getvalue(), overwrite=True)
        self.kept = int(state.get("epoch", 0))

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
            raise InputError(str(path), None, f"must be an undamaged checkpoint ({type(problem).__name__})") from None
        if not isinstance(state, dict) or not {"model", "epoch"} <= set(state):
            raise InputError(str(path), None, "must be a checkpoint of SynthRoads")
        epoch, model = state["epoch"], state["model"]
        if isinstance(epoch, bool) or not isinstance(epoch, int) or epoch < 0:
            raise InputError(f"{path}: epoch", _value_text(epoch), "a whole number from 0 is needed")
        if not isinstance(model, Mapping) or not all(isinstance(value, torch.Tensor) for value in model.values()):
            raise InputError(f"{path}: model", _value_text(model), "a dictionary of tensors is needed")
        return state

    def calibration(self) -> dict[str, Any] | None:
        """Return the calibration of the model's deviations as JSON data; None if there is none (yet)."""
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

    def _resume(self, previous_data: Any) -> None:
        """Take over the history of an interrupted run; InputError if its configuration differs."""
        if not isinstance(previous_data, dict):
            raise InputError(str(self.folder / CONFIGURATION), None, "must be a JSON object")
        current_data = self.configuration.to_dict()
        with suppress(InputError):  # fields may be called otherwise by now, or be new
            previous_data = self.configuration.from_dict(previous_data).to_dict()
        previous_lasting, current_lasting = lasting_data(previous_data), lasting_data(current_data)
        changed_fields = [
            name
            for name in {**previous_lasting, **current_lasting}
            if previous_lasting.get(name) != current_lasting.get(name)
        ]
        if changed_fields:
            name = changed_fields[0]
            raise InputError(
                f"--resume: {name}",
                current_data.get(name),
                f"must be {previous_data.get(name)!r}, as at the start of this run",
            )
        state = self.last_checkpoint()
        self.kept = epoch_count = 0 if state is None else state["epoch"]
        if epoch_count:
            self.history = _read_history(self.folder / HISTORY)[:epoch_count]


def load_state(module: nn.Module | torch.optim.Optimizer, state: Any, source: str) -> None:
    """Load the weights of a checkpoint into a network, or an optimiser's state, in place.

    Args:
        module: network or optimiser of the run's configuration.
        state: its state in the checkpoint.
        source: run or file of the checkpoint, for the message.

    Raises:
        InputError: the state is another network's, or a weight isn't finite.
    """
    if isinstance(module, nn.Module) and any(value.is_complex() for value in state.values()):
        raise InputError(
            source, None, "the checkpoint must not hold complex numbers: it is no checkpoint of SynthRoads"
        )
    try:
        module.load_state_dict(state)
    except (RuntimeError, ValueError, TypeError, LookupError, AttributeError):  # whatever doesn't fit
        raise InputError(source, None, "the checkpoint must belong to the network of the configuration") from None
    if isinstance(module, nn.Module):
        damaged_names = [name for name, value in module.state_dict().items() if not torch.isfinite(value).all()]
        if damaged_names:
            fault = f"all weights in the checkpoint must be finite, but some of {damaged_names[0]} aren't: train again"
            raise InputError(source, None, fault)


def _value_text(value: object) -> str:
    """Return a number or text as in Python code, for anything else the name of its type (tensors have long texts)."""
    return repr(value) if isinstance(value, (str, int, float)) else type(value).__name__


def _read_history(path: Path) -> list[dict[str, float]]:
    """Return the figures of each epoch of a history's file; InputError if it isn't a list of objects."""
    history = read_json(path)
    if not isinstance(history, list) or not all(isinstance(epoch, dict) for epoch in history):
        raise InputError(str(path), None, "must be a list with an object for each epoch")
    return history


def stream_seed(seed: int, *purpose: str | int) -> int:
    """Return a 63-bit seed derived from a seed and a purpose, e.g. for PyTorch."""
    return int(stream(seed, *purpose).integers(2**63))


def lasting_data(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration's data without the fields that may change on resuming, those of `FREE_WHEN_RESUMING`."""
    lasting_fields = {name: value for name, value in configuration.items() if name not in FREE_WHEN_RESUMING}
    data = lasting_fields.get("data")
    if isinstance(data, Mapping) and isinstance(data.get("stream"), Mapping):
        stream_data = {name: value for name, value in data["stream"].items() if name not in _FREE_IN_STREAM}
        lasting_fields["data"] = {**data, "stream": stream_data}
    return lasting_fields


def to_json_data(value: Any) -> Any:
    """Return a copy of nested data as JSON can hold it: NaN and infinity become None, tuples lists, keys strings."""
    if isinstance(value, Mapping):
        return {str(key): to_json_data(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_data(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@literal_texts()
def _curves(history: list[dict[str, float]]) -> bytes:
    """Return a PNG with one small plot per figure of the history, over the epochs."""
    names = [name for name in history[-1] if name not in ("epoch", "seconds")]
    figure = new_figure(4 * min(len(names), 3), 3 * -(-len(names) // 3))
    for plot_number, name in enumerate(names):
        axes = figure.add_subplot(-(-len(names) // 3), min(len(names), 3), plot_number + 1)
        axes.plot([epoch["epoch"] for epoch in history], [epoch.get(name, float("nan")) for epoch in history])
        axes.set(title=shown_text(name.replace("_", " ")), xlabel="epoch")
        axes.grid(alpha=0.3)
    content = io.BytesIO()
    save_figure(figure, content, dpi=110)
    return content.getvalue()
