"""The task "centerline" of the commands: training, measuring and using the centreline models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import torch
from pydantic import Field
from torch import nn

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import check_file_target, write_file
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.cloud.formats.registry import open_cloud

from ..configuration import Configuration
from ..data.batches import (
    Batches,
    BatchOptions,
    DataOptions,
    Roads,
    StreamedBatches,
    crop_only_effects,
    fixed_batches,
    read_roads,
)
from ..data.effects import SequenceEffects
from ..data.frames import read_path
from ..data.roads import cut_strip
from ..data.scene_stream import SceneStream
from ..data.slices import Batch, SliceSettings
from ..data.workers import report_lost_workers
from ..networks.centerline.losses import LossOptions, centerline_loss
from ..networks.centerline.models import TARGETS, CenterlineModel, ModelOptions, all_targets
from ..networks.centerline.transformer import TransformerOptions
from ..onnx_export import Exportable
from ..processes import helper_processes
from ..registry import network_union
from ..runs import CALIBRATION, Run, load_state, stream_seed, to_json_data
from ..scores.calibration import DEVIATIONS, IntervalCalibration
from ..scores.evaluation import STRETCHES, make_case
from ..tasks import Evaluation, Prediction
from ..training_loop import chosen_device, fit, move_to_device
from .exporting import exportable_network
from .find_road import centerline_geojson, corridor_json, find_road
from .measuring import measure_run
from .predictor import CenterlinePredictor, UseOptions

if TYPE_CHECKING:
    NetworkModel = ModelOptions
else:
    NetworkModel = network_union("centerline", "transformer")

_FIRST_WEIGHTS = "first weights"
"""Name of the random stream that the network begins with."""


class CenterlineConfiguration(Configuration):
    """Configuration of a centreline training: data, slices, augmentation, network, loss, batches and use."""

    renamed: ClassVar[Mapping[str, str]] = {"model": "network"}

    task: Literal["centerline"] = Field("centerline", description="Task: centerline.")
    data: DataOptions = Field(description="Training data.")
    slices: SliceSettings = Field(default=SliceSettings(), description="How slices are cut.")
    effects: SequenceEffects = Field(default=SequenceEffects(), description="Random changes of the training samples.")
    network: NetworkModel = Field(default=TransformerOptions(), description="The network.")
    loss: LossOptions = Field(default=LossOptions(), description="Terms of the loss.")
    batches: BatchOptions = Field(default=BatchOptions(), description="Amount of data in an epoch.")
    use: UseOptions = Field(default=UseOptions(), description="Settings for the use of the trained model.")
    begin_with: str = Field(
        "", description="Folder of a run whose weights are the initial weights; if empty, the weights are random."
    )


CONFIGURATION = CenterlineConfiguration
"""Class of the task's configurations."""


def train(run: Run[CenterlineConfiguration], progress: Progress = silent) -> dict[str, Any]:
    """Train a model, calibrate its deviations on the validation roads, save both in the run; return the metrics.

    Raises:
        InputError: data are missing, or don't fit the configuration.
        OutputError: another training is at work in the run's folder, or it can't be written.
    """
    with run.alone():
        with helper_processes(run, train_network, chosen_device(run.configuration)):
            model, roads = train_network(run, progress)
        progress("calibrating", 0.0)
        metrics = calibrate(run, model, roads)
        run.write_metrics(metrics)
        return metrics


def train_network(run: Run[CenterlineConfiguration], progress: Progress = silent) -> tuple[CenterlineModel, Roads]:
    """Train the network of a run's configuration; return it with the weights of the last epoch, and the roads read.

    Raises:
        InputError: data are missing, or don't fit the configuration.
    """
    configuration = run.configuration
    device = chosen_device(configuration)
    roads = read_roads(configuration.data, configuration.slices.truth, progress)
    model = _first_model(configuration).to(device)
    run.begin()

    def batches_of(roads: Roads) -> Batches:
        """Return the configuration's training batches of some roads."""
        return Batches(
            roads,
            configuration.slices,
            configuration.effects,
            configuration.batches,
            configuration.seed,
            configuration.data.measured_share,
            configuration.workers,
        )

    with _scene_stream(run, progress) as stream, report_lost_workers(configuration.workers):
        truth = configuration.slices.truth
        fit(
            model,
            run,
            batches_of(roads) if stream is None else StreamedBatches(roads, batches_of, stream, truth),
            configuration.batches.steps,
            centerline_loss(configuration.loss, configuration.slices.half_width),
            validate=_validation(configuration, roads),
            progress=progress,
        )
    if stream is not None:
        stream.remove()
    return model, roads


def _scene_stream(run: Run[CenterlineConfiguration], progress: Progress) -> AbstractContextManager[SceneStream | None]:
    """Return the context in which the configuration's stream of scenes flows; one of None where there is none."""
    configuration = run.configuration
    if configuration.data.stream is None:
        return nullcontext()
    epochs = configuration.schedule.epochs
    return SceneStream(configuration.data.stream, configuration.seed, run.folder, epochs, progress=progress)


def evaluate(
    run: Run[CenterlineConfiguration], evaluation: Evaluation, progress: Progress = silent
) -> tuple[dict[str, Any], str]:
    """Measure a trained model and untrained baselines, write tables and pictures; return figures and a report as text.

    Raises:
        InputError: the run isn't finished, or the data hold no road with a known centreline.
    """
    return measure_run(run.configuration, load_predictor(run), evaluation, progress)


def predict(run: Run[CenterlineConfiguration], prediction: Prediction, progress: Progress = silent) -> dict[str, Any]:
    """Regress a cloud's centreline, write it as GeoJSON and the corridor as JSON beside it; return a summary.

    Raises:
        InputError: the run isn't finished, the output isn't a .geojson file, or the cloud has no ground.
        OutputError: an output is already there.
    """
    lines = prediction.output
    check_file_target(lines, prediction.output_option, prediction.overwrite, ending=".geojson")
    corridor = lines.with_suffix(".corridor.json")
    check_file_target(corridor, prediction.output_option, prediction.overwrite)
    predictor = load_predictor(run)
    line = None if prediction.path is None else read_path(prediction.path, place=_read_placement(prediction.cloud))
    regression = find_road(predictor, prediction.cloud, line, progress)
    name = prediction.cloud.stem
    text = canonical_json(centerline_geojson(regression, name, predictor.settings.frame_spacing))
    calibration = {name: target_calibration.to_dict() for name, target_calibration in predictor.calibration.items()}
    table = canonical_json(to_json_data(corridor_json(regression, calibration)))
    write_file(lines, text.encode(), overwrite=prediction.overwrite)
    write_file(corridor, table.encode(), overwrite=prediction.overwrite)
    is_found = np.isfinite(regression.value[:, 0])
    return {
        "slices": len(is_found),
        "found": float(is_found.mean()) if len(is_found) else 0.0,
        "mean_std": float(regression.std[is_found, 0].mean()) if is_found.any() else None,
        "files": [str(lines), str(corridor)],
    }


def _read_placement(cloud: Path) -> Placement:
    """Return the coordinate system of a cloud's file."""
    with open_cloud(cloud) as reader:
        return reader.header.place


def exportable(run: Run[CenterlineConfiguration]) -> Exportable:
    """Return a trained run's network, to be written as ONNX.

    Raises:
        InputError: the training isn't finished.
    """
    return exportable_network(load_predictor(run), run.configuration.seed)


def load_predictor(run: Run[CenterlineConfiguration]) -> CenterlinePredictor:
    """Load a run's trained and calibrated centreline model.

    Raises:
        InputError: the training isn't finished.
    """
    configuration = run.configuration
    device = chosen_device(configuration)
    calibration_data = run.calibration()
    state = run.last_checkpoint(device)
    if state is None or state["epoch"] < configuration.schedule.epochs or calibration_data is None:
        raise InputError(
            str(run.folder), None, "the training of this run isn't finished; `synthroads train --resume` continues it"
        )
    model = _empty_model(configuration).to(device)
    load_state(model, state["model"], str(run.folder))
    calibration = _calibration_of(calibration_data, run.folder)
    return CenterlinePredictor(model, configuration.slices, configuration.use, calibration)


def _calibration_of(data: Any, folder: Path) -> dict[str, IntervalCalibration]:
    """Return the calibration of each target from JSON data; InputError if it isn't one."""
    try:
        calibration = {name: IntervalCalibration.from_dict(target_data) for name, target_data in data.items()}
    except (TypeError, ValueError, LookupError, AttributeError, OverflowError):
        calibration = None
    if calibration is None or any(not 0.0 < target_data.factor < np.inf for target_data in calibration.values()):
        remedy = "`synthroads train --resume` calibrates again"
        raise InputError(
            str(folder),
            None,
            f"the file calibration.json must hold a positive, finite factor for each target; {remedy}",
        )
    return calibration


def _empty_model(configuration: CenterlineConfiguration) -> CenterlineModel:
    """Return the configuration's model with random weights."""
    return configuration.network.build(configuration.slices.half_width, configuration.slices.slices)


def _first_model(configuration: CenterlineConfiguration) -> CenterlineModel:
    """Return the model that training begins with: random weights by the seed, or those of the run `begin_with`.

    Raises:
        MissingFileError, InputError: there is no such run, or its model is another.
    """
    torch.manual_seed(stream_seed(configuration.seed, _FIRST_WEIGHTS))
    model = _empty_model(configuration)
    if configuration.begin_with:
        state = Run.open(Path(configuration.begin_with)).last_checkpoint()
        if state is None:
            raise MissingFileError(
                "begin_with",
                configuration.begin_with,
                "must be the folder of a run that has weights: at least one finished epoch",
            )
        try:
            load_state(model, state["model"], configuration.begin_with)
        except InputError:
            raise InputError(
                "begin_with", configuration.begin_with, "must hold a model with the same settings as `network`"
            ) from None
    return model


def _validation(configuration: CenterlineConfiguration, roads: Roads) -> Any:
    """Return a function (model, epoch) -> mean absolute error (m) and coverage of the centre on fixed sequences."""
    crop = crop_only_effects(configuration.effects.crop)
    count = configuration.batches.validation
    validation_roads = [*roads.validation, *roads.measured_validation]
    batches = fixed_batches(validation_roads, configuration.slices, crop, count, configuration.seed)

    def validate(model: nn.Module, epoch: int) -> dict[str, float]:
        """Return the centre's mean absolute error (m), and the shares within its 68 % and 95 % intervals."""
        error, std = _residuals(model, batches)
        is_known = np.isfinite(error[:, 0])
        ratio = np.abs(error[is_known, 0]) / std[is_known, 0]
        return {
            "validation_mae": float(np.abs(error[is_known, 0]).mean()),
            "validation_68": float((ratio <= DEVIATIONS[0]).mean()),
            "validation_95": float((ratio <= DEVIATIONS[1]).mean()),
        }

    return validate


def calibrate(run: Run[CenterlineConfiguration], model: CenterlineModel, roads: Roads) -> dict[str, Any]:
    """Calibrate the model's deviations and write the calibration to the run; return the metrics on these roads.

    Roads are predicted from end to end, as in use: joined lines are better than those of single sequences. They are
    the validation's, or those held out, which are shown whole and once more as strips cut unevenly around them, as
    scans of road networks are.
    """
    configuration = run.configuration
    seed, settings = configuration.seed, configuration.slices
    predictor = CenterlinePredictor(model, settings, configuration.use)
    calibration_roads = roads.held_out or roads.validation
    cases = [make_case(road, seed, cropping=None, estimated=False, settings=settings) for road in calibration_roads]
    cases += [
        make_case(cut_strip(road, seed), seed, cropping=STRETCHES, estimated=False, settings=settings)
        for road in roads.held_out
    ]
    # Strips that were cut around their axis beforehand: the middle of the strip must not be the answer.
    cases += [
        make_case(road, seed, cropping=STRETCHES, estimated=True, settings=settings)
        for road in roads.measured_validation
    ]
    calibrated, error = predictor.calibrate((case.road, case.frames) for case in cases)
    calibration = calibrated.calibration
    data = to_json_data({name: case.to_dict() for name, case in calibration.items()})
    write_file(run.folder / CALIBRATION, canonical_json(data).encode(), overwrite=True)
    center = calibration["center"]
    return {
        "validation_mae": float(np.nanmean(np.abs(error[:, 0]))),
        "validation_68": center.after[0],
        "validation_95": center.after[1],
        "calibration_factor": center.factor,
        "parameters": sum(weights.numel() for weights in model.parameters()),
        "corridor_mae": {name: _mean_absolute(error[:, index]) for index, name in enumerate(TARGETS)},
        "calibration": data,
    }


def _residuals(model: nn.Module, batches: Sequence[Batch]) -> tuple[Any, Any]:
    """Return errors and predicted deviations (N, T) of all slices of some batches; errors are NaN without truth."""
    model.eval()
    error, std = [], []
    for batch in batches:
        batch_on_device = move_to_device(model, batch)
        with torch.no_grad():
            output = model(batch_on_device)
        error.append((all_targets(output) - all_targets(batch_on_device)).flatten(0, 1).cpu().numpy())
        std.append(all_targets(output, "_std").flatten(0, 1).cpu().numpy())
    return np.concatenate(error).astype(np.float64), np.concatenate(std).astype(np.float64)


def _mean_absolute(values: Any) -> float | None:
    """Return the mean absolute value of those values that are finite; None without any."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(sizes.mean()) if len(sizes) else None
