"""The models that come with the package, opened like runs of one's own; and how a run becomes one of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from synthroads_addon.base.errors import InputError, MissingFileError, nearest_name

from .cards import LARGEST_MB, ModelCard, model_names, read_card
from .configuration import from_data
from .runs import Run
from .safetensors import read_metadata, read_tensors, write_tensors


@dataclass
class ShippedRun(Run[Any]):
    """A shipped model in the place of a run: configuration, weights and calibration come from one file.

    Attributes:
        card: card of the model.
    """

    card: ModelCard | None = None

    def last_checkpoint(self, device: torch.device | str = "cpu") -> dict[str, Any] | None:
        """Return the model's weights in single precision on a device, with its last epoch's number."""
        tensors = read_tensors(self._weights())
        model = {name: (value.float() if value.dtype == torch.float16 else value) for name, value in tensors.items()}
        on_device = {name: value.to(device) for name, value in model.items()}
        return {"model": on_device, "epoch": self.configuration.schedule.epochs}

    def calibration(self) -> dict[str, Any] | None:
        """Return the calibration of the model's deviations as JSON data; None if it has none."""
        text = read_metadata(self._weights()).get("calibration")
        try:
            return json.loads(text) if text else None
        except ValueError:
            raise InputError(str(self._weights()), None, "its calibration must be JSON: the file is damaged") from None

    def _weights(self) -> Path:
        """Return the file of the model's weights."""
        assert self.card is not None
        return self.card.weights


def open_shipped(name: str) -> ShippedRun:
    """Open a shipped model by its name.

    Raises:
        InputError: there is no model of this name, or its weights are damaged.
    """
    card = read_card(name)
    text = read_metadata(card.weights).get("configuration", "")
    try:
        data = json.loads(text)
    except ValueError:
        raise InputError(
            str(card.weights), None, "must describe the network of its weights: the file is damaged"
        ) from None
    return ShippedRun(card.weights.with_suffix(""), from_data(data, str(card.weights)), card=card)


def open_run(run: Path) -> Run[Any]:
    """Open a trained run by its folder, or a shipped model by its name; a folder of that name comes first.

    Raises:
        MissingFileError, InputError: there is neither such a folder nor such a model.
    """
    if run.is_dir() or len(run.parts) > 1 or str(run) not in model_names():
        if not run.exists() and (hint := nearest_name(str(run), model_names())):
            raise MissingFileError(str(run), None, f"must be the folder of a trained run, or the name of a model{hint}")
        return Run.open(run)
    return open_shipped(str(run))


def ship(run: Run[Any], weights: Path, *, overwrite: bool = False) -> int:
    """Write a trained run's weights in half precision, with its configuration and calibration; return the bytes.

    The optimiser's state is left out; paths of data and caches stay those of the configuration.

    Raises:
        InputError: the run isn't finished, or the weights take more than `LARGEST_MB`.
        OutputError: the file is there already, or can't be written.
    """
    state = run.last_checkpoint()
    if state is None or state["epoch"] < run.configuration.schedule.epochs:
        raise InputError(
            str(run.folder), None, "the training of this run isn't finished; `synthroads train --resume` continues it"
        )
    tensors = {name: _to_half_precision(value) for name, value in state["model"].items()}
    size = sum(value.numel() * value.element_size() for value in tensors.values())
    if size > LARGEST_MB * 1e6:
        raise InputError(str(run.folder), round(size / 1e6, 1), f"its weights must take less than {LARGEST_MB:g} MB")
    metadata: Mapping[str, str] = {"format": "pt", "configuration": _json_text(run.configuration.to_dict())}
    if (calibration := run.calibration()) is not None:
        metadata = {**metadata, "calibration": _json_text(calibration)}
    write_tensors(weights, tensors, metadata, overwrite=overwrite)
    return weights.stat().st_size


def _to_half_precision(value: torch.Tensor) -> torch.Tensor:
    """Return a tensor in half precision; integers, and values beyond its range, as they are."""
    # Half precision ends at 65,504.
    if not value.is_floating_point() or float(value.abs().max() if value.numel() else 0.0) > 6e4:
        return value
    return value.half()


def _json_text(data: Any) -> str:
    """Return data as compact JSON with sorted keys."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"))
