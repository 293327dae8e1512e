"""Crops of tiles as PyTorch data: plain dictionaries of tensors under Pointcept's names.

An item holds N points: ``coord`` (N, 3) float32 m, centred; ``grid_coord`` (N, 3) int32, cells of the voxel grid from
0; ``color`` (N, 3) and ``strength`` (N, 1) float32; ``feat`` (N, F) float32, the network's input; ``segment`` (N,)
int64, -1 ignored; ``offset`` (1,) int64, N. A batch has the points of its items one after another, and where each
ends in ``offset``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from synthroads_addon.base.arrays import AnyArray, Float32
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream

from ..registry import apply_effects
from .effects import CropEffects
from .samples import Crop
from .tiles import CloudTile, Scaling, scalings

Feature = Literal["x", "y", "z", "red", "green", "blue", "intensity"]
FEATURES: tuple[Feature, ...] = get_args(Feature)
Item = dict[str, Tensor]
NO_EFFECTS = CropEffects(
    rotation=False, smallest_scale=1.0, largest_scale=1.0, jitter=0.0, jitter_limit=0.0, color_drop=0.0
)
"""Options that change nothing, for validation and prediction."""
MISSING_SIGMA = 0.02
"""Standard deviation of the noise that stands for a missing feature: nothing, but never exactly the same."""
COORDINATE_SPAN = 10.0
"""Centred coordinates as features are in units of this, m, so that they are about as large as the others."""


@dataclass(frozen=True)
class CropSettings:
    """Size, voxel and features of the items that crops become.

    Attributes:
        points: largest number of points of a crop.
        voxel: edge of the cells of ``grid_coord``, m.
        features: columns of ``feat``, in this order.
        votes: views, turned and mirrored, whose mean probability is a point's when it is labelled.
        intensity: scaling of intensities, ``share`` or ``robust``, anew where an effect changes a whole tile's points.
        classes: names of the classes by their places, for effects that act on some of them.
    """

    points: int = 24_000
    voxel: float = 0.1
    features: tuple[Feature, ...] = FEATURES
    votes: int = 1
    intensity: str = "share"
    classes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Draw:
    """One planned crop of an epoch: the tile, and a number that seeds it unlike the tile's other crops."""

    tile: int
    number: int


class Seeds:
    """Sampler of crop centres: any point of the given tile, or points balanced over the classes.

    Args:
        tiles: of all scenes.
        classes: number of classes.
        balanced: draw the class first, then the tile by its number of points of that class, then one of these.
        groups: number of tiles of each consecutive group within which a balanced draw stays; one group if empty.
    """

    def __init__(self, tiles: Sequence[CloudTile], classes: int, balanced: bool, groups: Sequence[int] = ()) -> None:
        self._tiles = tiles
        self._counts = np.array([tile.class_counts(classes) for tile in tiles]) if balanced else None
        self._ends = np.cumsum(groups or [len(tiles)])

    def draw(self, tile: int, random: np.random.Generator) -> tuple[int, int]:
        """Return the indices of a tile and of a random point in it; a balanced draw chooses a tile of the same group.

        In a group without a labelled point it is any point of the given tile.
        """
        if self._counts is not None:
            group = int(np.searchsorted(self._ends, tile, side="right"))
            first_tile, end_tile = int(self._ends[group - 1]) if group else 0, int(self._ends[group])
            counts = self._counts[first_tile:end_tile]
            per_class = counts.sum(axis=0)
            if per_class.any():
                label = random.choice(np.flatnonzero(per_class))
                chosen_tile = first_tile + int(
                    random.choice(end_tile - first_tile, p=counts[:, label] / per_class[label])
                )
                return chosen_tile, int(random.choice(np.flatnonzero(self._tiles[chosen_tile].segment == label)))
        return tile, int(random.integers(len(self._tiles[tile])))


@dataclass(eq=False)
class CropDataset(Dataset[Item]):
    """Map-style data set of the planned crops of one epoch, each augmented and drawn from a random stream of its own.

    The same seed, epoch and place give the same item, in whichever worker and order.

    Args:
        tiles: tiles, thinned to the training voxel.
        scalings: scaling of intensities by scene.
        settings: size, voxel and features of the items.
        plan: planned crops of the epoch.
        seeds: sampler of the crops' centres.
        effects: augmentation of the crops.
        seed, epoch: key of the random streams.
    """

    tiles: Sequence[CloudTile]
    scalings: dict[str, Scaling]
    settings: CropSettings
    plan: Sequence[Draw]
    seeds: Seeds
    effects: CropEffects = field(kw_only=True, default=NO_EFFECTS)
    seed: int = field(kw_only=True, default=0)
    epoch: int = field(kw_only=True, default=0)

    def __len__(self) -> int:
        return len(self.plan)

    def __getitem__(self, crop_index: int) -> Item:
        crop, random = self.crop(crop_index)
        return make_item(crop, self.settings, random)

    def crop(self, crop_index: int) -> tuple[Crop, np.random.Generator]:
        """Return a planned crop after its effects, and the random stream to go on with."""
        draw = self.plan[crop_index]
        random = stream(self.seed, "crop", self.epoch, draw.tile, draw.number)
        return _draw_crop(self, draw.tile, random), random


@dataclass(eq=False)
class CropStream(IterableDataset[Item]):
    """Endless iterable data set of augmented crops of random tiles, a random stream per worker.

    Args: see `CropDataset`.
    """

    tiles: Sequence[CloudTile]
    scalings: dict[str, Scaling]
    settings: CropSettings
    seeds: Seeds
    effects: CropEffects
    seed: int

    def __iter__(self) -> Iterator[Item]:
        worker = get_worker_info()
        random = stream(self.seed, "crops", 0 if worker is None else worker.id)
        while True:
            yield make_item(_draw_crop(self, int(random.integers(len(self.tiles))), random), self.settings, random)


def cut_crop(tile: CloudTile, middle: Float32, points: int, scaling: Scaling) -> Crop:
    """Return the `points` points of a tile nearest to a place (3,) in plan, or all of a smaller tile, as a crop.

    Columns rather than balls: a gantry stays with its posts and a crown with its trunk.
    """
    if len(tile) > points:
        squared_distance = ((tile.coord[:, :2] - middle[:2]) ** 2).sum(axis=1)
        keep = np.sort(np.argpartition(squared_distance, points - 1)[:points])
        tile = tile.select(keep)
    return crop_of(tile, scaling)


def crop_of(tile: CloudTile, scaling: Scaling) -> Crop:
    """Return a whole tile as a crop, with colours from 0 to 1 and intensities scaled."""
    color = None if tile.color is None else (tile.color / np.float32(255.0)).astype(np.float32)
    return Crop(tile.coord, None if tile.strength is None else scaling.apply(tile.strength), color, tile.segment)


def centre_coordinates(coord: AnyArray) -> Float32:
    """Return coordinates (N, 3) less the mean of x and y and the median of z."""
    middle = [*coord[:, :2].mean(axis=0, dtype=np.float64), np.median(coord[:, 2])]
    return np.asarray((coord - np.array(middle)).astype(np.float32))


def make_item(crop: Crop, settings: CropSettings, random: np.random.Generator) -> Item:
    """Return a crop as a dictionary of tensors (see the module), centred; noise stands for missing features.

    The crop is centred on the mean of x and y and the median of z. Missing colours and intensities are small noise.

    Raises:
        InputError: the crop must have at least one point.
    """
    count = len(crop)
    if count == 0:
        raise InputError("crop", 0, "must have at least one point")
    coord = centre_coordinates(crop.coord)
    color = _noise(random, (count, 3)) if crop.color is None else crop.color
    strength = _noise(random, (count, 1)) if crop.strength is None else crop.strength[:, None]
    columns = np.concatenate([coord / COORDINATE_SPAN, color, strength], axis=1)
    feature_columns = [FEATURES.index(name) for name in settings.features]
    grid = np.floor(coord / settings.voxel).astype(np.int32)
    arrays: dict[str, AnyArray] = {
        "coord": coord,
        "grid_coord": grid - grid.min(axis=0),
        "color": color,
        "strength": strength,
        "feat": columns[:, feature_columns],
        "segment": crop.segment.astype(np.int64),
        "offset": np.array([count], dtype=np.int64),
    }
    return {name: torch.from_numpy(np.ascontiguousarray(array)) for name, array in arrays.items()}


def _draw_crop(crops: CropDataset | CropStream, tile_index: int, random: np.random.Generator) -> Crop:
    """Return an augmented crop around a random point of the tile, or of the tile that the seeds choose."""
    number, point = crops.seeds.draw(tile_index, random)
    tile = crops.tiles[number]
    middle, scaling = tile.coord[point], crops.scalings[tile.scene]
    changed_tile = change_tile(tile, crops.settings, crops.effects, random)
    if changed_tile is not tile:
        tile = changed_tile
        # Where a strip was cut, the crop lies around its point nearest to the place that was drawn.
        middle = tile.coord[((tile.coord[:, :2] - middle[:2]) ** 2).sum(axis=1).argmin()]
        scaling = scalings([tile], crops.settings.intensity)[tile.scene]
    crop = cut_crop(tile, middle, crops.settings.points, scaling)
    apply_effects("segmentation", crop, crops.effects, random)
    return crop


def change_tile(
    tile: CloudTile, settings: CropSettings, effects: CropEffects, random: np.random.Generator
) -> CloudTile:
    """Return a tile after the effects that act on whole tiles; the tile itself where none of them changes anything.

    They see the intensities before these are scaled: a cloud is scaled by the points that it has.
    """
    sample = Crop(tile.coord, tile.strength, tile.color, tile.segment, tile.offset, settings.classes)
    apply_effects("segmentation", sample, effects, random, before_thinning=True)
    if sample.coord is tile.coord and sample.strength is tile.strength:
        return tile
    arrays = {name: getattr(sample, name) for name in Crop.per_point}
    return replace(tile, **arrays)


def collate(items: Sequence[Item]) -> Item:
    """Concatenate the points of B items into a batch; its ``offset`` (B,) holds where each item ends."""
    batch = {name: torch.cat([entry[name] for entry in items]) for name in items[0]}
    return batch | {"offset": torch.cumsum(batch["offset"], dim=0)}


def _noise(random: np.random.Generator, shape: tuple[int, int]) -> Float32:
    """Return small normal noise that stands for a missing feature."""
    return random.normal(0.0, MISSING_SIGMA, shape).astype(np.float32)
