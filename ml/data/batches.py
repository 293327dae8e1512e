"""The roads that a configuration names, and the batches of an epoch."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from pydantic import Field, model_validator

from synthroads_addon.base.arrays import Index
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import quantity
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from ..configuration import Part
from .corridor import Learned, Truth
from .effects import SequenceEffects
from .effects.slices import SequenceCrop
from .roads import LearningRoad, axis_beside, clouds_with_axes, read_measured, read_scene, scene_folders
from .scene_stream import EpochScenes, SceneStream, StreamOptions
from .slices import Batch, Sample, SliceDataset, SliceSettings, collate, mirror_batch
from .workers import load_batches

APART = 20.0
"""Length of a real road between what is learned from and what is validated with, m."""


class MeasuredRoad(Part):
    """A real cloud and its axis, or all those of a folder: whole roads, or the parts between two stations."""

    cloud: str = Field(
        min_length=1,
        description="Cloud, or folder of clouds with their axes in the same folder, e.g. NAME_axis.csv.",
    )
    axis: str = Field(
        "",
        description="CSV or GeoJSON file with the axis, in the cloud's map coordinates; if empty, the one beside it.",
    )
    roads: tuple[str, ...] = Field(
        (), description="Names of the folder's clouds, without endings; if empty, all clouds."
    )
    left_out: tuple[str, ...] = Field((), description="Names of clouds in the folder that aren't used.")
    first: float = quantity(0.0, ge=0, unit="m", description="Station along the axis where the used part begins.")
    last: float = quantity(1e9, gt=0, unit="m", description="Station where the used part ends.")

    @model_validator(mode="after")
    def _check_stations(self) -> Self:
        """Refuse an end before the begin."""
        if self.last <= self.first:
            raise ValueError(f"last must be larger than first, {self.first:g}")
        return self

    def files(self) -> list[tuple[Path, Path]]:
        """Return the paths of the clouds and of their axes, by name.

        Raises:
            MissingFileError: there is no such cloud or folder, or no axis beside a cloud.
            InputError: `roads` or `left_out` name no cloud of the folder, or nothing is left.
        """
        path = Path(self.cloud)
        if not path.is_dir():
            return [(path, Path(self.axis) if self.axis else axis_beside(path))]
        if self.axis:
            raise InputError(
                "axis",
                self.axis,
                f"must be empty, as {self.cloud} is a folder: each of its clouds has its axis in the same folder",
            )
        clouds_by_name = {cloud.stem: cloud for cloud in clouds_with_axes(path)}
        for field_name, names in (("roads", self.roads), ("left_out", self.left_out)):
            if unknown := sorted(set(names) - set(clouds_by_name)):
                raise InputError(
                    field_name, unknown[0], f"must be one of the roads of {path}: {', '.join(clouds_by_name)}"
                )
        names_kept = [
            name for name in clouds_by_name if name in (self.roads or clouds_by_name) and name not in self.left_out
        ]
        if not names_kept:
            raise InputError("left_out", list(self.left_out), f"must leave at least one road of {path}")
        return [(clouds_by_name[name], axis_beside(clouds_by_name[name])) for name in names_kept]


class DataOptions(Part):
    """Training data. Paths count from the working folder."""

    data_sets: tuple[str, ...] = Field((), description="Folders that `synthroads dataset` made.")
    stream: StreamOptions | None = Field(
        None, description="Training roads that are made during the training, in addition to those of the data sets."
    )
    train_split: str = Field(
        "train", description="Split of the data sets that is used for the training; if empty, no split is used."
    )
    validation_split: str = Field("validation", description="Split for the validation curves and the calibration.")
    calibration_split: str = Field(
        "",
        description="Split whose roads, as a whole and cut at random, calibrate the deviations instead of those of the "
        "validation: roads that differ from the training roads give deviations that are right elsewhere.",
    )
    measured: tuple[MeasuredRoad, ...] = Field((), description="Real roads for the training.")
    measured_validation: tuple[MeasuredRoad, ...] = Field((), description="Real roads for the validation.")
    measured_validation_share: float = quantity(
        0.0,
        ge=0,
        le=0.5,
        unit="1",
        description="Share of each real training road, at its end, that is used for the validation if no real roads "
        "are named for it.",
    )
    measured_share: float = quantity(
        0.5, ge=0, le=1, unit="1", description="Share of real roads in the samples, if there are both kinds."
    )
    cache: str = Field(
        "", description="Folder for sorted points, to speed up the next start; if empty they aren't kept."
    )

    @model_validator(mode="after")
    def _check_roads(self) -> Self:
        """Refuse data without roads to learn from or to validate with."""
        validated = self.measured_validation or self.measured_validation_share
        if not self.data_sets and not (self.measured and validated):
            raise ValueError(
                "name data_sets, or measured and measured_validation roads (or a measured_validation_share)"
            )
        return self


class BatchOptions(Part):
    """How many sequences make a batch and an epoch."""

    size: int = quantity(16, ge=1, le=100_000, unit="1", description="Number of sequences in a batch.")
    steps: int = quantity(100, ge=1, le=1_000_000, unit="1", description="Number of batches in an epoch.")
    passes: int = quantity(
        2,
        ge=1,
        le=100,
        unit="1",
        description="Number of times that an epoch uses its samples; every second time they are mirrored.",
    )
    validation: int = quantity(
        128, ge=1, le=1_000_000, unit="1", description="Number of sequences for the validation after an epoch."
    )

    @model_validator(mode="after")
    def _check_passes(self) -> Self:
        """Refuse a number of batches that passes don't divide."""
        if self.steps % self.passes:
            raise ValueError(f"steps is {self.steps}: must be a multiple of passes, {self.passes}")
        return self


@dataclass(frozen=True)
class Roads:
    """Synthetic and measured roads to train on (`train`, `measured`), to validate with, and held out to calibrate."""

    train: list[LearningRoad]
    measured: list[LearningRoad]
    validation: list[LearningRoad]
    measured_validation: list[LearningRoad]
    held_out: list[LearningRoad] = field(default_factory=list)


def read_roads(data: DataOptions, truth: Learned, progress: Progress = silent) -> Roads:
    """Read the synthetic and the measured roads that a configuration trains on and validates with.

    Raises:
        MissingFileError, InputError: a file or folder is missing or damaged, or holds nothing of use.
    """
    cache = Path(data.cache) if data.cache else None
    train = _read_scenes(data.data_sets, data.train_split, truth, cache, progress) if data.train_split else []
    validation = _read_scenes(data.data_sets, data.validation_split, truth, cache, progress)
    share = 0.0 if data.measured_validation else data.measured_validation_share
    measured_roads: list[LearningRoad] = []
    measured_validation: list[LearningRoad] = []
    for training_part, validation_part in (
        _split_road(road, share) for road in _read_measured(data.measured, truth, progress)
    ):
        measured_roads.append(training_part)
        measured_validation += validation_part
    measured_validation += _read_measured(data.measured_validation, truth, progress)
    if not train and not measured_roads and data.stream is None:
        raise InputError(
            "data", list(data.data_sets), f"must hold at least one road with a known {truth} for the training"
        )
    if not validation and not measured_validation:
        raise InputError(
            "data", list(data.data_sets), f"must hold at least one road with a known {truth} for the validation"
        )
    calibration = data.calibration_split
    held_out = _read_scenes(data.data_sets, calibration, truth, cache, progress) if calibration else []
    return Roads(train, measured_roads, validation, measured_validation, held_out)


class Batches:
    """Random training batches: called with an epoch's number it yields them, determined by seed and epoch alone.

    Args:
        roads: roads to learn from.
        settings: how slices are cut.
        effects: augmentation, drawn for each sample.
        options: sizes of batches and epochs.
        seed: seed of all random choices.
        measured_share: share of the samples from real roads, where there are both kinds.
        workers: processes that draw samples; 0 for this one. The samples don't depend on it.
    """

    def __init__(
        self,
        roads: Roads,
        settings: SliceSettings,
        effects: SequenceEffects,
        options: BatchOptions,
        seed: int,
        measured_share: float,
        workers: int = 0,
    ) -> None:
        self.options = options
        self.workers = workers
        self.seed = seed
        self.drawn_per_epoch = options.size * options.steps // options.passes
        kinds = ((roads.train, 1.0 - measured_share), (roads.measured, measured_share))
        nonempty_groups = [(group, share) for group, share in kinds if group]
        total = sum(share for _, share in nonempty_groups)
        self.shares = (
            np.array([share / total for _, share in nonempty_groups])
            if total
            else np.full(len(nonempty_groups), 1.0 / len(nonempty_groups))
        )
        self.datasets = [
            SliceDataset(group, settings, self.drawn_per_epoch, seed, effects) for group, _ in nonempty_groups
        ]

    def kinds(self, epoch: int) -> Index:
        """Return the index in `datasets` of each sample that an epoch draws, (drawn_per_epoch,), random by shares."""
        random = stream(self.seed, "kinds of road", epoch)
        return random.choice(len(self.shares), self.drawn_per_epoch, p=self.shares)

    def __call__(self, epoch: int, share: slice = slice(None)) -> Iterator[Batch]:
        """Yield the batches of an epoch whose numbers, from 0, `share` selects; every second pass is mirrored."""
        kind = self.kinds(epoch)
        plan = [self._batch_plan(epoch, number) for number in range(self.options.steps)[share]]
        new_numbers = _first_occurrences([numbers for _, numbers in plan])
        samples: dict[int, Sample] = {}
        draws = load_batches(_Draws(self.datasets, kind, epoch), new_numbers, _as_arrays, self.workers)
        for (turn, numbers), indices, drawn_samples in zip(plan, new_numbers, draws, strict=True):
            samples |= zip(indices, map(_as_tensors, drawn_samples), strict=True)
            batch = collate([samples[n] for n in numbers])
            if self.options.passes == 1:
                samples.clear()
            yield mirror_batch(batch) if turn % 2 else batch

    def _batch_plan(self, epoch: int, number: int) -> tuple[int, list[int]]:
        """Return the pass over an epoch's samples that a batch belongs to, and the numbers of its samples.

        The first pass takes the samples in the order in which they are drawn, further ones in random order.
        """
        size, steps_per_pass = self.options.size, self.options.steps // self.options.passes
        turn, batch_in_pass = divmod(number, steps_per_pass)
        order = stream(self.seed, "order", epoch, turn).permutation(self.drawn_per_epoch)
        numbers = order if turn else np.arange(len(order))
        return turn, numbers[batch_in_pass * size : (batch_in_pass + 1) * size].tolist()


class StreamedBatches:
    """Training batches like those of `Batches`, whose synthetic roads are also those of a stream's scenes.

    Args:
        roads: roads to learn from; the stream's come behind the synthetic ones.
        batches: function that makes an epoch's `Batches` of the roads that it draws from.
        stream: stream of scenes.
        truth: kind of truth that is learned.
    """

    def __init__(self, roads: Roads, batches: Callable[[Roads], Batches], stream: SceneStream, truth: Learned) -> None:
        self._roads, self._batches, self._truth = roads, batches, truth
        self._scenes = EpochScenes(stream, self._read)

    def _read(self, number: int, folder: Path) -> list[LearningRoad]:
        """Return the roads of a scene; points are read whole, as the scene is removed one day."""
        (scene,) = (folder / "scenes").iterdir()
        return [replace(road, name=f"{number:06d}-{road.name}") for road in read_scene(scene, self._truth)]

    def __call__(self, epoch: int, share: slice = slice(None)) -> Iterator[Batch]:
        """Yield the batches of an epoch whose numbers, from 0, `share` selects.

        Raises:
            InputError: a scene can't be made, or all of them together have no road to learn from.
        """
        train = [*self._roads.train, *self._scenes(epoch)]
        if not train:
            raise InputError("data.stream", epoch, f"at least one scene of an epoch must have a known {self._truth}")
        yield from self._batches(replace(self._roads, train=train))(epoch, share)


def _first_occurrences(batches: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the numbers of each batch that occur in no batch before it."""
    numbers_before: set[int] = set()
    new_numbers = []
    for batch in batches:
        new_numbers.append([number for number in batch if number not in numbers_before])
        numbers_before.update(batch)
    return new_numbers


@dataclass(frozen=True)
class _Draws:
    """An epoch's samples by their numbers, each from the data set of its kind of road."""

    datasets: Sequence[SliceDataset]
    kind: Index
    epoch: int

    def __getitem__(self, number: int) -> Sample:
        return self.datasets[self.kind[number]].draw_sample(self.epoch, number)


def _as_arrays(samples: list[Sample]) -> list[dict[str, Any]]:
    """Return samples as arrays: each tensor from a worker would hold a file open, of which there are too few."""
    return [{name: value.numpy() for name, value in sample.items()} for sample in samples]


def _as_tensors(sample: Mapping[str, Any]) -> Sample:
    """Return a sample's arrays as tensors."""
    return {name: torch.as_tensor(value) for name, value in sample.items()}


def fixed_batches(
    roads: Sequence[LearningRoad], settings: SliceSettings, effects: SequenceEffects | None, count: int, seed: int
) -> list[Batch]:
    """Return `count` validation sequences in batches of up to 32, drawn from the seed: always the same.

    Args:
        roads: roads with a known truth.
        settings: how slices are cut.
        effects: augmentation of the points; None for none.
        count: number of sequences.
        seed: seed of the drawn sequences.
    """
    dataset = SliceDataset(roads, settings, count, seed, effects, "validation slices")
    samples = [dataset.draw_sample(number) for number in range(count)]
    return [collate(samples[start : start + 32]) for start in range(0, len(samples), 32)]


def crop_only_effects(crop: SequenceCrop) -> SequenceEffects:
    """Return effects that crop the slices' sides as `crop` says and are off otherwise."""
    strengths = [name for name, field in SequenceEffects.model_fields.items() if field.annotation is float]
    return SequenceEffects(crop=crop, gamma=(1.0, 1.0), **dict.fromkeys(strengths, 0.0))


def _read_scenes(
    data_sets: Sequence[str], split: str, truth: Learned, cache: Path | None, progress: Progress
) -> list[LearningRoad]:
    """Read the roads of all finished scenes of a split of some data sets."""
    folders = [folder for data_set in data_sets for folder in scene_folders(Path(data_set), split)]
    roads: list[LearningRoad] = []
    for number, folder in enumerate(folders):
        progress(f"reading {split} roads", number / len(folders))
        roads += read_scene(folder, truth, cache)
    return roads


def _read_measured(roads: Sequence[MeasuredRoad], truth: Learned, progress: Progress) -> list[LearningRoad]:
    """Read measured roads, the true axis of each clipped to the stations `first` to `last`."""
    files = [(road, *paths) for road in roads for paths in road.files()]
    learning_roads = []
    for number, (road, cloud, axis) in enumerate(files):
        progress(f"reading {cloud.name}", number / len(files))
        learning_roads.append(_clip(read_measured(cloud, axis, truth), road.first, road.last, f"{axis}: first"))
    return learning_roads


def _clip(road: LearningRoad, first_station: float, last_station: float, field: str) -> LearningRoad:
    """Return a road with its true axis clipped between two stations, m; ``field`` names the input in the error."""
    axis = road.known_truth.axis
    in_part = (axis.station >= first_station) & (axis.station <= last_station)
    if np.count_nonzero(in_part) < 2:
        raise InputError(
            field, first_station, f"first and last must select a part of the axis, which is {axis.length:.0f} m long"
        )
    part = MeasuredAxis(axis.points[in_part], axis.joined[in_part[:-1] & in_part[1:]])
    return replace(road, truth=Truth.of_axis(part, road.known_truth.kind))


def _split_road(road: LearningRoad, share: float) -> tuple[LearningRoad, list[LearningRoad]]:
    """Return a road's part to learn from, and in a list the end to validate with, a share of its length.

    Both lie `APART` from each other; with a share of 0 the whole road is learned from.
    """
    if not share:
        return road, []
    length = road.known_truth.axis.length
    end, field = (1.0 - share) * length, f"{road.name}: measured_validation_share"
    return _clip(road, 0.0, end, field), [_clip(road, min(end + APART, length), length, field)]
