"""Recipes: which data are mixed how, and with which settings a network learns them; all of it configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from synthroads_addon.base.arrays import Float, Index, Int
from synthroads_addon.base.classes import ClassScheme, class_scheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import quantity
from synthroads_addon.cloud.tools.quantile_mapping import LEVELS, QuantileMap

from ..configuration import Configuration, Part, Schedule
from ..data.classes import class_names
from ..data.crops import FEATURES, CropSettings, Draw, Feature
from ..data.effects import CropEffects
from ..data.scene_stream import StreamOptions
from ..data.sources import FULL, Source
from ..data.tiles import CloudTile
from ..networks.base import SegmentationNetwork
from ..networks.segmentation.pointnext import PointNeXtOptions
from ..registry import network_union

if TYPE_CHECKING:
    NetworkModel = SegmentationNetwork
else:
    NetworkModel = network_union("segmentation", "pointnext")

SetUp = Literal["real", "synthetic", "mixed", "mixed_mapped", "fine_tuned", "self_trained"]


class Adaptation(Part):
    """Options of domain adaptation: AdaBN and Mix3D."""

    adabn: bool = Field(
        False,
        description="Before a test, compute the norms' statistics from the test's points, without labels.",
    )
    adabn_crops: int = quantity(40, ge=1, le=100_000, unit="1", description="Number of crops for these statistics.")
    mix3d: float = quantity(
        0.0, ge=0, le=1, unit="1", description="Share of batches whose crops are mixed with others."
    )


class SelfTraining(Part):
    """Options of self-training on unlabelled clouds, the set-up `self_trained`."""

    rounds: int = quantity(
        2, ge=1, le=20, unit="1", description="Number of rounds in which labels are guessed and learned."
    )
    believed: float = quantity(
        0.5, gt=0, le=1, unit="1", description="Share of the points of each guessed class whose label is learned."
    )


class Data(Part):
    """Sources of real and synthetic training, validation and test points."""

    real: tuple[Source, ...] = Field((), description="Real training data, or data that replace them.")
    synthetic: tuple[Source, ...] = Field((), description="Synthetic training data.")
    target: tuple[Source, ...] = Field((), description="Clouds without labels that self-training adapts to.")
    stream: StreamOptions | None = Field(
        None,
        description="Synthetic training data that are made during the training, in addition to those of `synthetic`.",
    )
    validation: tuple[Source, ...] = Field(
        (), description="Data that are scored after each epoch; they are never used for the training."
    )
    tests: dict[str, tuple[Source, ...]] = Field(
        {}, description="Data that are scored at the end, each test separately."
    )


class SegmentationConfiguration(Configuration):
    """Configuration of a segmentation training; the defaults are the full recipe."""

    task: Literal["segmentation"] = Field("segmentation", description="Task: segmentation.")
    classes: str = Field("5", min_length=1, description="Scheme of classes: 5, 17, or a JSON file.")
    network: NetworkModel = Field(PointNeXtOptions(), description="The network.")
    features: tuple[Feature, ...] = Field(
        FEATURES, min_length=1, description="Features of each point that the network gets."
    )
    intensity: Literal["share", "robust"] = Field(
        "share", description="Intensity as a share of 16 bits, or scaled in each scene to median 0 and span 1."
    )
    voxel: float = quantity(
        0.1, ge=0.02, le=5, unit="m", description="Edge of the grid cells, each of which keeps one point."
    )
    crop_points: int = quantity(24_000, ge=64, le=2_000_000, unit="1", description="Number of points in a crop.")
    crops_per_tile: int = quantity(
        30, ge=1, le=100_000, unit="1", description="Number of crops of each tile in an epoch."
    )
    crops_per_epoch: int | None = quantity(
        None, ge=1, le=100_000_000, unit="1", description="Number of crops in an epoch; it replaces crops_per_tile."
    )
    batch: int = quantity(16, ge=1, le=1024, unit="1", description="Number of crops in a batch.")
    set_up: SetUp = Field("synthetic", description="Kind of the training data, and order in which they are used.")
    synthetic_share: float | None = quantity(
        None,
        gt=0,
        lt=1,
        unit="1",
        description="Synthetic share of the crops in a mixed set-up; if not given, the share of synthetic tiles.",
    )
    balanced: bool = Field(False, description="Cut equally many crops around points of each class.")
    effects: CropEffects = Field(CropEffects(), description="Random changes of the crops.")
    adaptation: Adaptation = Field(
        Adaptation(), description="Methods that make synthetic and real domains more similar."
    )
    label_smoothing: float = quantity(
        0.2, ge=0, lt=1, unit="1", description="Share of the label that is spread over all classes."
    )
    class_weights: float = quantity(
        1.0,
        ge=0,
        le=1,
        unit="1",
        description="Power p of the weights (f + 0.02)^-p, where f is the share of a class; 0: equal weights.",
    )
    fitted_offsets: bool = Field(
        False, description="Add an offset to the score of each class that maximises the mean IoU of the training tiles."
    )
    votes: int = quantity(
        1,
        ge=1,
        le=64,
        unit="1",
        description="Number of turned and mirrored views whose mean probability labels a point.",
    )
    fine_tuning: Schedule = Field(
        Schedule(epochs=30, learning_rate=0.001),
        description="Schedule of the second part of fine_tuned, and of each round of self_trained.",
    )
    self_training: SelfTraining = Field(SelfTraining(), description="Settings of the training on unlabelled clouds.")
    prepare_on: Literal["auto", "cpu"] = Field(
        "auto",
        description="Device that prepares batches: the GPU, if there is one and the network supports it, or workers.",
    )
    start: str = Field(
        "",
        description="Folder of a run, or built-in model, with the initial weights; if empty, they are random.",
    )
    start_share: float = quantity(
        0.0, ge=0, lt=1, unit="1", description="Share of the initial weights in the final weights."
    )
    data: Data = Field(Data(), description="Source of the points.")

    @field_validator("class_weights", mode="before")
    @classmethod
    def _read_switch(cls, power: Any) -> Any:
        """Return the power 1 for true and 0 for false, as older configurations have it."""
        return float(power) if isinstance(power, bool) else power

    @field_validator("features")
    @classmethod
    def _refuse_repetitions(cls, features: tuple[Feature, ...]) -> tuple[Feature, ...]:
        """Refuse a feature that is named twice."""
        if len(set(features)) < len(features):
            raise ValueError("features must not name a feature twice")
        return features

    @model_validator(mode="after")
    def _check_data(self) -> SegmentationConfiguration:
        """Refuse options that don't fit the set-up or the stream of scenes."""
        if self.synthetic_share is not None and not self.set_up.startswith("mixed"):
            raise ValueError(f"synthetic_share is for mixed set-ups, not for {self.set_up}")
        if self.start_share and not self.start:
            raise ValueError("start_share needs a start, whose weights are kept in part")
        if self.data.stream is not None and self.set_up == "self_trained":
            raise ValueError("data.stream is not for self_trained, whose rounds learn from the same scenes")
        if self.data.stream is not None and self.crops_per_epoch is None:
            raise ValueError("data.stream needs crops_per_epoch: its epochs have more tiles or fewer")
        return self

    def scheme(self) -> ClassScheme:
        """Return the class scheme named by `classes`; raise `InputError` if there is none."""
        return class_scheme(self.classes)

    def crop_settings(self) -> CropSettings:
        """Return the size, voxel, features, votes, scaling and classes of crops."""
        names = class_names(self.scheme())
        return CropSettings(self.crop_points, self.voxel, self.features, self.votes, self.intensity, names)

    def needed_sources(self) -> dict[str, tuple[Source, ...]]:
        """Return the training sources of the set-up by domain; the synthetic ones may be none where there is a stream.

        Raises:
            InputError: the set-up needs data of a kind and none are named.
        """
        single_domains = {"real": ("real",), "synthetic": ("synthetic",), "self_trained": ("synthetic",)}
        domains = single_domains.get(self.set_up, ("synthetic", "real"))
        sources = {"real": self.data.real, "synthetic": self.data.synthetic}
        for domain in domains:
            if not sources[domain] and not (domain == "synthetic" and self.data.stream is not None):
                raise InputError(f"data.{domain}", [], f"must name training data, which the set-up {self.set_up} needs")
        if self.set_up == "self_trained" and not self.data.target:
            raise InputError(
                "data.target", [], "must name the clouds without labels that the set-up self_trained adapts to"
            )
        return {domain: sources[domain] for domain in domains}


def class_shares(tiles: Sequence[CloudTile], classes: int) -> Float:
    """Return each class's share of the labelled points (C,), of the sum 1.

    Raises:
        InputError: no point has a label.
    """
    counts = np.sum([tile.class_counts(classes) for tile in tiles], axis=0) if tiles else np.zeros(classes)
    if not counts.sum():
        raise InputError("training data", 0, "must have labelled points")
    return np.asarray(counts / counts.sum(), dtype=np.float64)


def class_weights(shares: Float, power: float = 1.0) -> Float:
    """Return the classes' loss weights (C,): 1 / (share + 0.02) to a power, scaled to the mean 1."""
    # Chosen: 0.02 bounds the weight of a rare class to 50 times that of one that is everywhere.
    weights = (shares + 0.02) ** -power
    return np.asarray(weights / weights.mean(), dtype=np.float64)


def map_intensities(synthetic: Sequence[CloudTile], real: Sequence[CloudTile]) -> list[CloudTile]:
    """Return the synthetic tiles with intensities quantile-mapped to the real tiles' distribution.

    Both are training data: nothing of a test is looked at.

    Raises:
        InputError: one of them has no intensities.
    """
    synthetic_histogram, real_histogram = _histogram(synthetic, "data.synthetic"), _histogram(real, "data.real")
    mapping = QuantileMap(synthetic_histogram, real_histogram)
    return [
        replace(tile, strength=(mapping.map(_levels(tile)) / FULL).astype(np.float32))
        if tile.strength is not None
        else tile
        for tile in synthetic
    ]


def _levels(tile: CloudTile) -> Index:
    """Return a tile's intensities (N,) as 16-bit levels."""
    assert tile.strength is not None
    return np.rint(np.clip(tile.strength, 0.0, 1.0) * FULL).astype(np.intp)


def _histogram(tiles: Sequence[CloudTile], where: str) -> Int:
    """Return the number of points by 16-bit intensity level over all tiles; InputError without any."""
    counts = np.zeros(LEVELS, dtype=np.int64)
    for tile in tiles:
        if tile.strength is not None:
            counts += np.bincount(_levels(tile), minlength=LEVELS)
    if not counts.sum():
        raise InputError(where, 0, "has no intensities, which a mapping of intensities needs")
    return counts


def plan(
    domains: Sequence[int],
    per_tile: int,
    synthetic_share: float | None,
    seed: int,
    epoch: int,
    total: int | None = None,
) -> list[Draw]:
    """Return the planned crops of an epoch over the tiles of one or two domains, shuffled.

    Args:
        domains: number of tiles of each domain, the synthetic one first where there are two.
        per_tile: number of crops of a tile; the epoch has those of all tiles.
        synthetic_share: share of the first domain's crops; None for ``per_tile`` crops of every tile.
        seed, epoch: key of the random order, which also decides the tiles with one crop more where a rest is left.
        total: number of the epoch's crops, in the place of ``per_tile``; None for that.
    """
    tile_count = sum(domains)
    total = per_tile * tile_count if total is None else total
    random = stream(seed, "plan", epoch)
    if synthetic_share is None or len(domains) < 2:
        counts = np.diff(np.rint(total * np.cumsum([0, *domains]) / tile_count).astype(int)).tolist()
    else:
        synthetic_crops = min(max(round(total * synthetic_share), 1), total - 1)
        counts = [synthetic_crops, total - synthetic_crops]
    draws: list[Draw] = []
    begin = 0
    for tiles, count in zip(domains, counts, strict=True):
        order = random.permutation(tiles)
        draws += [Draw(begin + int(order[k % tiles]), k // tiles) for k in range(count)]
        begin += tiles
    return [draws[draw_index] for draw_index in random.permutation(len(draws))]
