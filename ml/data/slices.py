"""Slices across roads as PyTorch data: sequences of slices in the frames of a path, with their truth.

A sample is a dictionary of tensors; S is the number of slices of a sequence, N that of its points.

- ``coord`` (N, 3) float32: x along the frame, y to its left, z up from the slice's origin, m;
- ``feat`` (N, 6) float32: intensity and contrast, red, green, blue, 1 where colours are known and else 0. The first two
  are `intensity.level` and `intensity.contrast` of the sequence, cut at +-`FEATURE_LIMIT`; colours are 0 to 1. What a
  cloud hasn't is noise of `MISSING_NOISE`;
- ``offset`` (S,) int64: ends of the slices' points in ``coord``;
- ``center`` (S,) float32, ``corridor`` (S, K) float32: the truth, see `corridor.CORRIDOR`; NaN if unknown;
- ``frame`` (S, 4) float64: x, y, direction and z origin (the median height of the slice's points) in the cloud's local
  metres; ``station`` (S,) float64 along the path; ``number`` (S,) int64 of the frame; ``road`` int64, its number.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from pydantic import Field
from torch import Tensor
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from synthroads_addon.base.arrays import Float, Index
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import quantity

from ..configuration import Part
from ..registry import apply_effects
from . import intensity
from .corridor import CORRIDOR, Learned
from .effects import SequenceEffects
from .frames import SPACING, Frames, displace_frames, sequences
from .points import ROAD_CLASSES
from .roads import LearningRoad, cut_beside_median
from .samples import HEIGHT, Stretch

Sample = dict[str, Tensor]
Batch = dict[str, Tensor]

FEATURES = ("intensity", "contrast", "red", "green", "blue", "has_color")
"""Columns of ``feat``."""
FEATURE_LIMIT = 5.0
MISSING_NOISE = 0.01


class SliceSettings(Part):
    """Options for cutting sequences of slices, and for how their path strays in training."""

    truth: Learned = Field(
        "road",
        description="Line that is learned. road: the middle of the whole road; carriageway: the line between its two "
        "lanes; either: the middle of whole roads, and of carriageways without shoulders, as roads of their own.",
    )
    slices: int = quantity(10, ge=1, le=1000, unit="1", description="Number of slices in a sequence.")
    spacing: float = quantity(
        1.0, gt=0, le=100, unit="m", description="Distance between the slices of a sequence, along the path."
    )
    thickness: float = quantity(1.0, gt=0, le=100, unit="m", description="Length of a slice, along the path.")
    half_width: float = quantity(
        30.0, gt=0, le=45, unit="m", description="Half-width of a slice, to each side of the path."
    )
    points_per_slice: int = quantity(
        256,
        ge=1,
        le=1_000_000,
        unit="1",
        description="Largest number of points in a slice; further points are dropped.",
    )
    window: float = quantity(
        12.0, ge=0, le=100, unit="m", description="Range of the path's random offset, half of it to each side."
    )
    direction_deg: float = quantity(
        2.0, ge=0, le=45, unit="deg", description="Standard deviation of the path's direction."
    )
    wander_length: float = quantity(
        100.0, ge=5, le=10_000, unit="m", description="Length over which the path's offset changes."
    )
    median_error: float = quantity(
        1.5,
        ge=0,
        le=20,
        unit="m",
        description="Largest distance from the middle of the median at which a carriageway is cut off.",
    )

    @property
    def frame_spacing(self) -> float:
        """Spacing of the frames along a path at prediction, m, `SPACING` at most: wider sequences are interleaved."""
        return min(SPACING, self.spacing)


@dataclass(eq=False)
class SliceDataset(Dataset[Sample]):
    """Map-style data set of random sequences of slices, each road equally often, with random path and effects.

    The n-th sample of an epoch depends on the seed, the epoch and n alone.

    Args:
        roads: roads with a known truth.
        settings: how slices are cut.
        samples: sequences per epoch.
        seed: seed of all random choices.
        effects: augmentation; None for none, though the path still strays.
        purpose: name of the random stream, so that samples for other purposes differ.

    Raises:
        InputError: no road is long enough for a sequence.
    """

    roads: Sequence[LearningRoad]
    settings: SliceSettings
    samples: int
    seed: int
    effects: SequenceEffects | None = None
    purpose: str = "slices"

    def __post_init__(self) -> None:
        """Find the stations at which sequences can begin."""
        self.epoch = 0
        starts_by_road = (_starts(road, number, self.settings) for number, road in enumerate(self.roads))
        self._starts = [starts for starts in starts_by_road if starts]
        if not self._starts:
            length = self.settings.spacing * (self.settings.slices - 1)
            raise InputError(
                "roads", len(self.roads), f"at least one road must have a known {self.settings.truth} over {length:g} m"
            )

    def __len__(self) -> int:
        return self.samples

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch whose samples indexing returns from now on."""
        self.epoch = epoch

    def __getitem__(self, number: int) -> Sample:
        if not 0 <= number < self.samples:
            raise IndexError(number)
        return self.draw_sample(self.epoch, number)

    def draw_sample(self, *key: int) -> Sample:
        """Return the random sample that a key of any integers (epoch, number, ...) determines."""
        rng = stream(self.seed, self.purpose, *key)
        starts = self._starts[rng.integers(len(self._starts))]
        lengths = np.array([last_start - first_start + 1e-3 for _, first_start, last_start in starts])
        number, first_start, last_start = starts[rng.choice(len(starts), p=lengths / lengths.sum())]
        settings = self.settings
        road = cut_beside_median(self.roads[number], settings.median_error, rng)
        station = rng.uniform(first_start, last_start) + settings.spacing * np.arange(settings.slices)
        axis = road.known_truth.axis
        true_frames = Frames(axis.position(station), axis.direction(station), station)
        path = displace_frames(true_frames, rng, settings.window, settings.direction_deg, settings.wander_length)
        stretch = cut_stretch(road, path, settings)
        if self.effects is not None:
            apply_effects("centerline", stretch, self.effects, rng, before_thinning=True)
            thin_slices(stretch, settings.points_per_slice, rng)
            apply_effects("centerline", stretch, self.effects, rng)
        return make_sample(stretch, settings, rng, number, np.arange(settings.slices))


@dataclass(eq=False)
class IterableSlices(IterableDataset[Sample]):
    """Endless iterable data set of a `SliceDataset`'s samples, epoch after epoch, divided among the workers."""

    dataset: SliceDataset

    def __iter__(self) -> Iterator[Sample]:
        worker = get_worker_info()
        offset, step = (0, 1) if worker is None else (worker.id, worker.num_workers)
        number = offset
        while True:
            yield self.dataset.draw_sample(*divmod(number, self.dataset.samples))
            number += step


@dataclass(eq=False)
class FrameSlices(Dataset[Sample]):
    """Map-style data set of the sequences that cover all frames along one road, in order, without effects.

    The points left out where a slice has too many depend on the place alone, so that cutting a road into parts
    changes nothing.

    Args:
        road: road with or without a truth.
        frames: M frames; ``number`` of a sample says which.
        settings: how slices are cut.
        step: slices from one sequence's start to the next one's; None for a sequence's length.
    """

    road: LearningRoad
    frames: Frames
    settings: SliceSettings
    step: int | None = None

    def __post_init__(self) -> None:
        """Divide the frames into sequences."""
        length = self.settings.slices
        self.runs = sequences(self.frames, length, self.step and min(self.step, length), self.settings.spacing)

    def __len__(self) -> int:
        return len(self.runs)

    def __getitem__(self, number: int) -> Sample:
        run = self.runs[number]
        run_frames = self.frames.select(run)
        station_key = int(np.floor(1000.0 * run_frames.station[0])) & 0xFFFFFFFF
        stretch = cut_stretch(self.road, run_frames, self.settings)
        return make_sample(stretch, self.settings, stream(0, "frames", station_key), 0, run)


def cut_stretch(road: LearningRoad, frames: Frames, settings: SliceSettings) -> Stretch:
    """Return the sequence of slices at some frames: the road's points in them, in frame coordinates, and the truth.

    Where the truth is a carriageway's, points beyond the middle of the median are left out, see `Truth.room`.
    """
    slices = road.slices(frames, settings.half_width, settings.thickness)
    labels = road.class_id[slices.index]
    if road.truth is None:
        unknown = np.full((len(frames), len(CORRIDOR)), np.nan)
        center, corridor, lines, room = unknown[:, 0], unknown, unknown[:, :2], unknown[:, :2]
    else:
        crossings = road.truth.at(frames)
        center, corridor, lines, room = crossings.center, crossings.corridor, crossings.lines, crossings.room
    stretch = Stretch(
        coord=np.column_stack([slices.xy, road.xyz[slices.index, 2].astype(np.float64)]),
        strength=road.intensity[slices.index].astype(np.float64),
        color=road.rgb[slices.index] / 255.0 if road.has_color else None,
        number=slices.number,
        paved=road.class_table(ROAD_CLASSES)[labels],
        marked=road.class_table(("road_marking",))[labels],
        frames=frames,
        center=center,
        corridor=corridor,
        lines=lines,
        room=room,
        carriageway=road.truth is not None and road.truth.kind == "carriageway",
    )
    if np.isfinite(room).any():
        y = stretch.coord[:, 1] - center[stretch.number]
        stretch.keep(~((y > room[stretch.number, 0]) | (-y > room[stretch.number, 1])))
    return stretch


def make_sample(
    stretch: Stretch, settings: SliceSettings, rng: np.random.Generator, road: int, number: Index
) -> Sample:
    """Return a sequence as a dictionary of tensors (see the module); it is thinned to `points_per_slice` in place."""
    thin_slices(stretch, settings.points_per_slice, rng)
    ends = np.searchsorted(stretch.number, np.arange(len(stretch.center)), side="right")
    height = _medians(stretch.coord[:, 2], ends)
    coord: Float = stretch.coord - np.column_stack([np.zeros((len(stretch.number), 2)), height[stretch.number]])
    corridor = stretch.corridor.copy()
    corridor[:, HEIGHT] -= height
    frame = np.column_stack([stretch.frames.position, stretch.frames.direction, height])
    return {
        "coord": torch.from_numpy(coord.astype(np.float32)),
        "feat": torch.from_numpy(_features(stretch, rng).astype(np.float32)),
        "offset": torch.from_numpy(ends.astype(np.int64)),
        "center": torch.from_numpy(stretch.center.astype(np.float32)),
        "corridor": torch.from_numpy(corridor.astype(np.float32)),
        "frame": torch.from_numpy(frame),
        "station": torch.from_numpy(stretch.frames.station.copy()),
        "number": torch.from_numpy(np.asarray(number, dtype=np.int64)),
        "road": torch.tensor(road),
    }


def collate(samples: Sequence[Mapping[str, Tensor]]) -> Batch:
    """Return B samples as one batch, padded by zeros to P points per slice, the most that any slice has.

    ``coord`` (B, S, P, 3), ``feat`` (B, S, P, F) and ``mask`` (B, S, P), True where there is a point; all else stacked.
    """
    slices = len(samples[0]["center"])
    starts = [torch.cat([item["offset"].new_zeros(1), item["offset"][:-1]]) for item in samples]
    counts = [item["offset"] - start for item, start in zip(samples, starts, strict=True)]
    largest_count = max(1, int(torch.stack(counts).max()))
    batch = {
        name: torch.stack([item[name] for item in samples])
        for name in samples[0]
        if name not in ("coord", "feat", "offset")
    }
    mask = torch.arange(largest_count) < torch.stack(counts)[:, :, None]
    batch["mask"] = mask
    for name in ("coord", "feat"):
        padded_values = torch.zeros(len(samples), slices, largest_count, samples[0][name].shape[1])
        # Both run through the points slice by slice.
        padded_values[mask] = torch.cat([item[name] for item in samples])
        batch[name] = padded_values
    return batch


def _starts(road: LearningRoad, number: int, settings: SliceSettings) -> list[tuple[int, float, float]]:
    """Return (road's number, first, last station, m) at which a sequence can begin, for each part of the true axis."""
    if road.truth is None:
        return []
    length = settings.spacing * (settings.slices - 1)
    parts = road.truth.axis.parts
    return [
        (number, first_station, last_station - length)
        for first_station, last_station in parts.tolist()
        if last_station - first_station >= length
    ]


def thin_slices(stretch: Stretch, largest_count: int, rng: np.random.Generator) -> None:
    """Drop random points so that each slice keeps at most ``largest_count``, in place."""
    counts = np.bincount(stretch.number, minlength=len(stretch.center))
    if counts.max() <= largest_count:
        return
    order = np.lexsort((rng.random(len(stretch.number)), stretch.number))
    rank = np.arange(len(stretch.number)) - np.repeat(np.cumsum(counts) - counts, counts)
    keep = np.zeros(len(stretch.number), dtype=bool)
    keep[order[rank < largest_count]] = True
    stretch.keep(keep)


def _medians(z: Float, ends: Index) -> Float:
    """Return the median z (S,) of each slice's points, m; of all points for an empty slice, 0 if there are none."""
    overall_median = float(np.median(z)) if len(z) else 0.0
    starts = np.concatenate([[0], ends[:-1]])
    return np.array([np.median(z[a:b]) if b > a else overall_median for a, b in zip(starts, ends, strict=True)])


def _features(stretch: Stretch, rng: np.random.Generator) -> Float:
    """Return the points' input features (K, 6), columns `FEATURES`; noise stands for missing intensities, colours."""
    count = len(stretch.number)
    if stretch.strength.any():
        logs = intensity.logarithms(stretch.strength)
        levels = np.column_stack([intensity.level(logs), intensity.contrast(logs, stretch.coord[:, 1])])
        brightness = np.clip(levels, -FEATURE_LIMIT, FEATURE_LIMIT)
    else:
        brightness = MISSING_NOISE * rng.standard_normal((count, 2))
    colors = MISSING_NOISE * rng.standard_normal((count, 3)) if stretch.color is None else stretch.color
    return np.column_stack([brightness, colors, np.full(count, float(stretch.color is not None))])


_OTHER_SIDE = {"left_edge": "right_edge", "right_edge": "left_edge"}
_TURNED = ("left_edge", "right_edge", "heading")
"""Columns of the corridor whose sign changes."""


def mirror_batch(batch: Batch) -> Batch:
    """Return a copy of the batch mirrored left to right, truth and frames included."""
    flip = batch["coord"].new_tensor([1.0, -1.0, 1.0])
    mirrored = dict(batch, coord=batch["coord"] * flip)
    mirrored["frame"] = batch["frame"] * batch["frame"].new_tensor([1.0, -1.0, -1.0, 1.0])
    if "center" in batch:
        mirrored["center"] = -batch["center"]
    if "corridor" in batch:
        mirrored["corridor"] = mirrored_corridor(batch["corridor"])
    return mirrored


def mirrored_corridor(corridor: Tensor) -> Tensor:
    """Return a corridor (..., K) mirrored left to right: edges exchanged, signs of edges and heading changed."""
    signs = corridor.new_tensor([-1.0 if name in _TURNED else 1.0 for name in CORRIDOR])
    return with_sides_swapped(corridor) * signs


def with_sides_swapped(corridor: Tensor) -> Tensor:
    """Return values (..., K), one per corridor column, with the left and the right edge's columns exchanged."""
    return corridor[..., [CORRIDOR.index(_OTHER_SIDE.get(name, name)) for name in CORRIDOR]]
