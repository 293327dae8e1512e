"""Segmentation as one of the learning tasks: train, evaluate, predict."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target, write_file
from synthroads_addon.base.progress import Progress, peak_memory_mb, silent
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud

from ..data.classes import IGNORED, class_names
from ..data.crops import Item
from ..data.scene_stream import SceneStream
from ..data.sources import Source
from ..data.tiles import CloudTile, scalings
from ..data.workers import report_lost_workers
from ..onnx_export import Exportable
from ..processes import helper_processes, process_number
from ..runs import PRETRAINING, Run
from ..scores.confusion import Confusion, score_table
from ..scores.pictures import comparison
from ..shipped import open_run
from ..tasks import Evaluation, Prediction
from ..training_loop import Figures, chosen_device, fit
from .exporting import exportable_network
from .loading import CropBatches, ExchangedBatches, StreamedCropBatches, read_domains, thin_tiles
from .network import build, prepare_on_gpu, scores_of
from .offsets import fit_offsets
from .prediction import Labelling, predict_file
from .recipes import SegmentationConfiguration, class_shares, class_weights
from .scoring import check_tests, classifier, label_tile, load_weights, score, score_all, trained_model
from .self_training import label_confident_points, target_tiles

OFFSETS = "offsets"
"""Key of the checkpoint's offsets that were added to the network's scores, (C,)."""
MIXED = "start_share"
"""Key of the share of the start's weights that those of the checkpoint were mixed with."""
_ONE_TILE = 5_000_000
"""Points of a cloud up to which it is scored as one tile. Chosen: bounds memory."""
SegmentationRun = Run[SegmentationConfiguration]


CONFIGURATION = SegmentationConfiguration
"""Class of the task's configurations."""


def train(run: SegmentationRun, progress: Progress = silent) -> dict[str, Any]:
    """Train a run's network, score it on the configuration's tests, write and return the metrics.

    Raises:
        InputError: data are missing, or don't fit the configuration.
        OutputError: another training is at work in the run's folder, or it can't be written.
    """
    with run.alone():
        return _train_alone(run, progress)


def _train_alone(run: SegmentationRun, progress: Progress) -> dict[str, Any]:
    """Train a run's network as `train` does, with the run's folder locked."""
    configuration = run.configuration
    check_tests(configuration)
    device = chosen_device(configuration)
    with helper_processes(run, train_network, device):
        model, domains = train_network(run, progress)
    tests = score_all(model, configuration, progress)
    stream = configuration.data.stream
    metrics = {
        **{f"{name}_mean_iou": result["mean_iou"] for name, result in tests.items()},
        "parameters": sum(weight.numel() for weight in model.parameters()),
        "training_points": {name: sum(map(len, tiles)) for name, tiles in domains.items()},
        "training_tiles": {name: len(tiles) for name, tiles in domains.items()},
        **({"streamed_scenes": stream.window(configuration.schedule.epochs - 1).stop} if stream else {}),
        "device": str(device),
        "peak_memory_mb": peak_memory_mb(),
        "tests": tests,
    }
    run.write_metrics(metrics)
    return metrics


def evaluate(run: SegmentationRun, evaluation: Evaluation, progress: Progress = silent) -> tuple[dict[str, Any], str]:
    """Score a trained run on each of the labelled data, write tables and pictures; return scores and text tables.

    Each of the data has its files as soon as it is measured: one that is refused leaves those before it, and the error
    names them.

    Raises:
        InputError: a cloud has no labels and there is no mapping, or its classes don't fit.
        OutputError: the folder can't be written.
    """
    configuration = run.configuration
    model = trained_model(run)
    results: dict[str, Any] = {}
    tables: dict[str, str] = {}
    files: list[str] = []
    for path, name in zip(evaluation.data, _names(evaluation), strict=True):
        source = _test_source(path, evaluation)
        try:
            confusion, largest_result = score(model, configuration, [source], progress)
        except InputError as error:
            if not files:
                raise
            kept = f"{error.allowed}; what was measured before it is in {evaluation.output}: {', '.join(files)}"
            raise InputError(error.field, error.value, kept) from error
        results[name] = confusion.to_dict()
        tables[name] = score_table(results[name]) + "\n"
        files.append(f"{name}.txt")
        write_file(evaluation.output / files[-1], tables[name].encode(), overwrite=True)
        if largest_result is not None:
            tile, labels = largest_result
            scheme = configuration.scheme()
            files.append(f"{name}.png")
            picture = comparison(tile, labels, source.targets(scheme), scheme)
            write_file(evaluation.output / files[-1], picture, overwrite=True)
    means = {f"{name}_mean_iou": result["mean_iou"] for name, result in results.items()}
    text = "\n".join(f"{name}:\n{table}" for name, table in tables.items())
    return {**means, "tests": results, "files": files}, text.rstrip("\n")


def exportable(run: SegmentationRun) -> Exportable:
    """Return a trained run's network, to be written as ONNX.

    Raises:
        InputError: the checkpoint is damaged, or the network isn't one that ONNX takes.
    """
    return exportable_network(trained_model(run), run.configuration)


def _names(evaluation: Evaluation) -> list[str]:
    """Return a unique name for each of the data: the last parts of its path, as few as make all names differ.

    Raises:
        InputError: a path is given twice.
    """
    unique_paths = [
        path.parent / f"{path.name}-{evaluation.split}" if path.is_dir() else path.with_suffix("")
        for path in (path_places.absolute() for path_places in evaluation.data)
    ]
    path_places = zip(evaluation.data, unique_paths, strict=True)
    if repeated_paths := sorted(str(path) for path, unique_path in path_places if unique_paths.count(unique_path) > 1):
        raise InputError("data", repeated_paths[0], "must be given once; it is given twice, perhaps with two endings")
    longest = max(len(unique_path.parts) for unique_path in unique_paths)
    name_candidates = (
        ["-".join(unique_path.parts[-parts:]) for unique_path in unique_paths] for parts in range(1, longest + 1)
    )
    return next(names for names in name_candidates if len(set(names)) == len(names))


def _test_source(path: Path, evaluation: Evaluation) -> Source:
    """Return a test's source; a cloud of up to 5 million points is one tile, as points at tiles' edges lack context."""
    if path.is_dir():
        class_options = {"mapping": evaluation.mapping, "yardstick": evaluation.yardstick}
        return Source(path=str(path), split=evaluation.split, **class_options)
    # Chosen: tiles of 60 m bound memory; 1 km takes in a small cloud as a whole.
    tile = 60.0
    if path.suffix.lower() in ENDINGS and path.is_file():
        with suppress(InputError), open_cloud(path) as cloud:  # a packed file is no cloud
            tile = 1000.0 if cloud.header.count <= _ONE_TILE else tile
    return Source(path=str(path), mapping=evaluation.mapping, tile=tile)


def predict(run: SegmentationRun, prediction: Prediction, progress: Progress = silent) -> dict[str, Any]:
    """Write a copy of a LAS or LAZ file with each point's predicted class; return counts, speed and peak memory."""
    check_file_target(prediction.output, prediction.output_option, prediction.overwrite)
    configuration = run.configuration
    labelling = Labelling(
        classifier(trained_model(run), configuration),
        configuration.crop_settings(),
        configuration.scheme(),
        configuration.intensity,
    )
    result = predict_file(
        prediction.cloud,
        prediction.output,
        labelling,
        classification=prediction.classification,
        overwrite=prediction.overwrite,
        progress=progress,
    )
    return {**result, "peak_memory_mb": peak_memory_mb()}


Domains = dict[str, list[CloudTile]]


def train_network(run: Run[SegmentationConfiguration], progress: Progress = silent) -> tuple[nn.Module, Domains]:
    """Train the network of a run's configuration; return it with the last epoch's weights, and its tiles by domain.

    Raises:
        InputError: data are missing, or don't fit the configuration.
    """
    configuration = run.configuration
    device = chosen_device(configuration)
    domains = read_domains(configuration)
    validation = list(thin_tiles(configuration.data.validation, configuration, "validation"))
    torch.manual_seed(configuration.seed)
    model = build(configuration).to(device)
    if configuration.start:
        _begin_with(model, configuration)
    start_weights = deepcopy(model.state_dict())
    target = target_tiles(configuration) if configuration.set_up == "self_trained" else []
    run.begin()
    with _scene_stream(run, progress) as stream:
        if configuration.set_up == "self_trained":
            _self_train(model, run, domains, target, validation, progress)
        elif configuration.set_up == "fine_tuned":
            _fit(model, _pretraining(run), {"synthetic": domains["synthetic"]}, validation, progress, stream)
            fine_tuning = configuration.model_copy(update={"schedule": configuration.fine_tuning})
            _fit(model, replace(run, configuration=fine_tuning), {"real": domains["real"]}, validation, progress)
        else:
            _fit(model, run, domains, validation, progress, stream)
        if configuration.start_share:
            _mix_with_start(model, run, start_weights)
        if configuration.fitted_offsets:
            _shift_scores(model, run, domains, stream)
    if stream is not None:
        stream.remove()
    return model.eval(), domains


def _scene_stream(
    run: Run[SegmentationConfiguration], progress: Progress
) -> AbstractContextManager[SceneStream | None]:
    """Return the context in which the configuration's stream of scenes flows; one of None where there is none."""
    configuration = run.configuration
    options = configuration.data.stream
    if options is None or configuration.set_up == "real":
        return nullcontext()
    epochs = configuration.schedule.epochs
    return SceneStream(options, configuration.seed, run.folder, epochs, ("pointcept",), progress)


def _mix_with_start(model: nn.Module, run: Run[SegmentationConfiguration], start_weights: Mapping[str, Tensor]) -> None:
    """Set the weights to a weighted mean of those at the training's start and end, in place, and save them; once.

    Wortsman et al., "Robust fine-tuning of zero-shot models" (2022): classes that the new labels lack aren't forgotten.
    """
    state, share = run.last_checkpoint(next(model.parameters()).device), run.configuration.start_share
    if process_number() or state is None or MIXED in state:
        return
    for name, value in model.state_dict().items():
        if value.is_floating_point():
            value.lerp_(start_weights[name], share)
    run.save({**state, "model": model.state_dict(), MIXED: share})


def _shift_scores(
    model: nn.Module, run: Run[SegmentationConfiguration], domains: Domains, stream: SceneStream | None
) -> None:
    """Fit the scores' offsets on the training tiles (of the last epoch), add them to the network, save it; once."""
    if process_number():
        return
    configuration, state = run.configuration, run.last_checkpoint()
    if state is None or OFFSETS in state:
        return
    if stream is not None:
        device = next(model.parameters()).device
        batches = StreamedCropBatches(configuration, domains, stream, device)
        domains = batches.domains(configuration.schedule.epochs - 1)
    tiles = [tile for domain_tiles in domains.values() for tile in domain_tiles]
    offsets = torch.from_numpy(fit_offsets(tiles, classifier(model, configuration), configuration))
    configuration.network.shift_scores(model, offsets)
    run.save({**state, "model": model.state_dict(), OFFSETS: offsets})


def _begin_with(model: nn.Module, configuration: SegmentationConfiguration) -> None:
    """Load the weights of the run or model `start` into a network, in place.

    Raises:
        MissingFileError: there is no such run or model.
        InputError: it has another network, other classes or other features.
    """
    start_run = open_run(Path(configuration.start))
    for name in ("task", "classes", "features", "intensity", "network"):
        start_value, value = getattr(start_run.configuration, name, None), getattr(configuration, name)
        if start_value != value:
            raise InputError(
                "start", configuration.start, f"must have the same {name}: it has {start_value}, not {value}"
            )
    load_weights(model, start_run)


def _self_train(
    model: nn.Module,
    run: Run[SegmentationConfiguration],
    domains: Domains,
    target: list[CloudTile],
    validation: list[CloudTile],
    progress: Progress,
) -> None:
    """Train on synthetic tiles unless the training has a start, then round by round on the target's tiles as well."""
    configuration, rounds = run.configuration, run.configuration.self_training.rounds
    if not configuration.start:
        _fit(model, _pretraining(run), domains, validation, progress)
    round_configuration = configuration.model_copy(update={"schedule": configuration.fine_tuning})
    for number in range(1, rounds + 1):
        folder = run.part(PRETRAINING, f"round-{number}")
        is_last_round = number == rounds
        round_run = (
            replace(run, configuration=round_configuration)
            if is_last_round
            else Run.start(folder, round_configuration, resume=True)
        )
        labelled_tiles = label_confident_points(target, classifier(model, configuration), configuration)
        _fit(model, round_run, {**domains, "target": labelled_tiles}, validation, progress)


def _pretraining(run: Run[SegmentationConfiguration]) -> Run[SegmentationConfiguration]:
    """Start or resume the run of a training's first part, on synthetic data, in the run's folder; return it."""
    configuration = run.configuration.model_copy(update={"set_up": "synthetic"})
    return Run.start(run.part(PRETRAINING), configuration, resume=True)


def _fit(
    model: nn.Module,
    run: Run[SegmentationConfiguration],
    domains: Domains,
    validation: list[CloudTile],
    progress: Progress,
    stream: SceneStream | None = None,
) -> None:
    """Train the model in place on some domains, and a stream, by the run's schedule, to the last epoch's weights."""
    configuration, device = run.configuration, next(model.parameters()).device
    batches: CropBatches | StreamedCropBatches
    if stream is None:
        kind = ExchangedBatches if "target" in domains else CropBatches
        batches = kind(configuration, domains.values(), device)
        loss = objective(configuration, batches.tiles, device)
    else:
        batches = StreamedCropBatches(configuration, domains, stream, device)
        loss = _objective_of_epochs(batches, device)
    validate = _validation(configuration, validation) if validation else None
    with report_lost_workers(configuration.workers):
        fit(model, run, batches, len(batches), loss, validate=validate, progress=progress)


def smoothed_loss(scores: Tensor, truth: Tensor, weights: Tensor, smoothing: float) -> Tensor:
    """Return the label-smoothed cross-entropy, averaged with each point's class weight; 0 without any label.

    The share ``smoothing`` of a label goes to all classes alike. (PyTorch's own weights weigh these shares too: with
    weights as far apart as a road's, the best answer to a point of a frequent class would then be a rare one.)

    Args:
        scores: (N, C).
        truth: (N,) int64 classes, or `IGNORED`.
        weights: (C,).
        smoothing: from 0 to below 1.
    """
    has_label = truth != IGNORED
    losses = functional.cross_entropy(scores[has_label], truth[has_label], reduction="none", label_smoothing=smoothing)
    weight = weights[truth[has_label]]
    return (losses * weight).sum() / weight.sum().clamp_min(1e-12)


def objective(
    configuration: SegmentationConfiguration, tiles: Sequence[CloudTile], device: torch.device
) -> Callable[[nn.Module, Item], tuple[Tensor, Figures]]:
    """Return a function (model, batch) -> (loss, {"accuracy": share}); classes weigh by their share of the tiles.

    Raises:
        InputError: no point has a label.
    """
    shares = class_shares(tiles, len(class_names(configuration.scheme())))
    weights = torch.from_numpy(class_weights(shares, configuration.class_weights).astype(np.float32)).to(device)

    def loss(model: nn.Module, batch: Item) -> tuple[Tensor, Figures]:
        """Return the loss of a batch, and the share of labelled points with the right class."""
        scores, truth = scores_of(model, prepare_on_gpu(configuration, batch)), batch["segment"]
        value = smoothed_loss(scores, truth, weights, configuration.label_smoothing)
        has_label = truth != IGNORED
        is_correct = (scores.detach().argmax(dim=1) == truth) & has_label
        return value, {"accuracy": float(is_correct.sum() / has_label.sum().clamp_min(1))}

    return loss


def _objective_of_epochs(
    batches: StreamedCropBatches, device: torch.device
) -> Callable[[nn.Module, Item], tuple[Tensor, Figures]]:
    """Return the `objective` whose classes weigh by their share of the tiles of the epoch that is under way."""

    @lru_cache(maxsize=1)
    def of_epoch(epoch: int | None) -> Callable[[nn.Module, Item], tuple[Tensor, Figures]]:
        """Return the objective of the epoch under way; the number only tells epochs apart in the cache."""
        return objective(batches.configuration, batches.tiles, device)

    def loss(model: nn.Module, batch: Item) -> tuple[Tensor, Figures]:
        """Return the loss of a batch by the objective of the epoch under way."""
        return of_epoch(batches.epoch)(model, batch)

    return loss


def _validation(
    configuration: SegmentationConfiguration, tiles: list[CloudTile]
) -> Callable[[nn.Module, int], Figures]:
    """Return a function (model, epoch) -> mean IoU on the validation tiles."""
    scaling = scalings(tiles, configuration.intensity)

    def validate(model: nn.Module, epoch: int) -> Figures:
        """Return the mean IoU over all validation tiles."""
        confusion = Confusion(class_names(configuration.scheme()))
        scores = classifier(model, configuration)
        for tile in tiles:
            labels = label_tile(tile, scaling[tile.scene], scores, configuration.crop_settings())
            confusion.add(tile.segment, labels)
        return {"validation_mean_iou": confusion.mean("iou")}

    return validate
