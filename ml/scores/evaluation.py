"""Any predictor of centrelines, measured on roads with a known axis.

A predictor is a function from a road and M frames of slices to (M, 2 or more) numbers: y of the centre in each frame, m
(NaN: none), and its standard deviation, m (NaN: none). Columns of a corridor may follow, see `CORRIDOR_COLUMNS`.

Every predictor sees the same points in the same frames. Both depend on a seed:

- where a strip of points was cut around the axis beforehand, both sides of every slice are cropped at random and
  independently (`Cropping`), as the middle of what is left must not be the answer;
- the frames come from a path that strays to either side within a window and errs in its direction. What strays is the
  axis of a synthetic road, which is scanned far to both sides; for a real one it is the path that is estimated from its
  *cropped* points.

Of a synthetic road's carriageways the other one is cut off somewhere beside the middle of the median.

Slices in which the truth's axis has a gap are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream

from ..data.corridor import CORRIDOR
from ..data.frames import Frames, displace_frames, estimated_path, frames_along, stretches
from ..data.points import ROAD_CLASSES
from ..data.roads import LearningRoad, Slices, crop_road, cut_beside_median
from ..data.slices import SliceSettings
from . import baselines
from .distances import METRICS, Comparison, over_roads
from .metrics import Spread, figures, over_seeds

Predictor = Callable[[LearningRoad, Frames], Float]

CORRIDOR_COLUMNS = ("center", "center_std", *CORRIDOR, *(f"{name}_std" for name in CORRIDOR), "center_68", "center_95")
"""Columns of a prediction; only the first is needed. Those of the corridor are for pictures. The last two are the
half-widths of the centre's intervals of 68 % and 95 %, m: by the standard deviation where they aren't given."""
HALF_WIDTH = SliceSettings().half_width
"""Trivial predictors see points up to this far beside a frame where nothing else is said, m."""


@dataclass(frozen=True)
class Cropping:
    """Options for cutting off the sides of a measured road's slices at random, see `roads.crop_road`.

    Attributes:
        share: the largest part of the distance from the axis to the outermost point that is cut off; uniform from 0.
        length: metres along the axis over which the cuts stay the same. 1: every slice has cuts of its own, which
            average out over a sequence of slices. Longer ones don't.
    """

    share: float = 0.5
    length: float = 1.0


STRETCHES = Cropping(length=50.0)
"""Cuts that stay the same for 50 m: no model that sees less of the road can average them out."""


@dataclass(frozen=True)
class Case:
    """A road to evaluate on: its points, perhaps cropped, and the frames of a randomly displaced path."""

    road: LearningRoad
    frames: Frames


def make_case(
    road: LearningRoad, seed: int, *, cropping: Cropping | None, estimated: bool, settings: SliceSettings | None = None
) -> Case:
    """Return a road, cropped if asked, with frames along its axis or an estimated path, displaced by the seed.

    Args:
        road: road with a known truth.
        seed: seed of the cuts and of the path's displacement.
        cropping: options of cutting off the sides; None to keep all points.
        estimated: whether the path is found in the points; else it is the axis. Both stray.
        settings: options of the path's displacement; None for the defaults.

    Raises:
        InputError: the road has no truth.
    """
    settings = settings or SliceSettings()
    visible_road = road if cropping is None else crop_road(road, cropping.share, seed, cropping.length)
    visible_road = cut_beside_median(visible_road, settings.median_error, stream(seed, "median", road.name))
    path = estimated_path(visible_road.xyz.astype(np.float64)) if estimated else road.known_truth.axis
    rng = stream(seed, "frames", road.name)
    displaced_frames = displace_frames(
        frames_along(path), rng, settings.window, settings.direction_deg, settings.wander_length
    )
    return Case(visible_road, displaced_frames)


def evaluate(predictor: Predictor, case: Case) -> dict[str, float]:
    """Return one predictor's metrics (`distances.METRICS`) on one road, by name; undefined ones are NaN or missing."""
    frames = case.frames
    prediction = predictor(case.road, frames)
    true_y, _ = case.road.known_truth.axis.crossing(frames.position, frames.direction)
    std = prediction[:, 1] if prediction.shape[1] > 1 else None
    intervals = prediction[:, -2:] if prediction.shape[1] == len(CORRIDOR_COLUMNS) else None
    comparison = Comparison(frames.at(prediction[:, 0]), frames.at(true_y), frames.station, std, intervals)
    return figures(METRICS, comparison)


def measure(
    predictors: Mapping[str, Sequence[Predictor]], cases: Callable[[int], Sequence[Case]], seeds: Sequence[int]
) -> dict[str, dict[str, dict[str, Spread]]]:
    """Return each metric's mean and deviation over seeds, by predictor, road (`all`: combined) and metric.

    Args:
        predictors: predictors by name; one per seed, as models trained with it, or one for all seeds.
        cases: function that returns the cases of a seed.
        seeds: seeds of cuts and frames. The n-th predictor is measured with the n-th seed.

    Raises:
        InputError: two roads have the same name, by which figures are told apart.
    """
    rows: dict[str, dict[str, list[dict[str, float]]]] = {name: {} for name in predictors}
    for name, versions in predictors.items():
        if len(versions) not in (1, len(seeds)):
            raise ValueError(f"{name}: {len(versions)} predictors for {len(seeds)} seeds")
    for index, seed in enumerate(seeds):
        seed_cases = cases(seed)
        names = [case.road.name for case in seed_cases]
        if repeated_names := {name for name in names if names.count(name) > 1}:
            raise InputError(
                "road", sorted(repeated_names)[0], "is the name of several roads; rename one of the data sets"
            )
        metrics_by_road: dict[str, dict[str, dict[str, float]]] = {name: {} for name in predictors}
        for case in seed_cases:  # road by road: predictors share what they cut out of it
            for name, versions in predictors.items():
                metrics_by_road[name][case.road.name] = evaluate(versions[0 if len(versions) == 1 else index], case)
        for name, by_name in metrics_by_road.items():
            for road, row in (*by_name.items(), ("all", over_roads(by_name.values()))):
                rows[name].setdefault(road, []).append(row)
    return {name: {road: over_seeds(values) for road, values in by_road.items()} for name, by_road in rows.items()}


def trivial_predictor(name: str, slice_cache: SliceCache | None = None) -> Predictor:
    """Return the untrained predictor of a rule of `baselines.RULES`; predictors may share a cache of slices."""
    rule, length = baselines.RULES[name]
    slice_cache = slice_cache or SliceCache()

    def predict(road: LearningRoad, frames: Frames) -> Float:
        """Return each slice's centre (M, 1), m, by the rule."""
        slices = slice_cache(road, frames, length)
        belonging = road.belonging[slices.index]
        y, intensity = slices.xy[belonging, 1], road.intensity[slices.index[belonging]].astype(np.float64)
        return baselines.slice_centers(rule, slices.number[belonging], y, intensity, len(frames))[:, None]

    return predict


class SliceCache:
    """Cache of the slices of the last road and frames, per thickness.

    Args:
        half_width: reach of a slice to either side of its frame, m.
    """

    def __init__(self, half_width: float = HALF_WIDTH) -> None:
        self.half_width = half_width
        self._last: tuple[LearningRoad, Frames] | None = None
        self._slices: dict[float, Slices] = {}

    def __call__(self, road: LearningRoad, frames: Frames, thickness: float) -> Slices:
        """Return the road's points in the slices of `thickness` (m) at the frames, from the cache if the same again."""
        if self._last is None or self._last[0] is not road or self._last[1] is not frames:
            self._last, self._slices = (road, frames), {}
        if thickness not in self._slices:
            self._slices[thickness] = road.slices(frames, self.half_width, thickness)
        return self._slices[thickness]


def skeleton_predictor(settings: baselines.SkeletonSettings) -> Predictor:
    """Return the untrained predictor of centres (M, 1), m, by the road's morphological skeleton."""

    def predict(road: LearningRoad, frames: Frames) -> Float:
        """Return the skeleton's centres (M, 1), m, in the frames."""
        xy, intensity = mask_points(road, settings.mask)
        return baselines.skeleton_centers(xy, intensity, frames.position, frames.direction, settings)[:, None]

    return predict


def mask_points(road: LearningRoad, mask: str) -> tuple[Float, Float]:
    """Return xy (N, 2), m, and intensities (N,) of the skeleton's points: the road classes' for "classes", else all."""
    paved = road.of_class(ROAD_CLASSES)
    rows = road.belonging & paved if mask == "classes" and paved.any() else road.belonging
    return road.xyz[rows, :2].astype(np.float64), road.intensity[rows].astype(np.float64)


def predict_path(road: LearningRoad, frames: Frames) -> Float:
    """Return zeros (M, 1): the centre predicted at each frame's origin, which measures the displaced path itself."""
    return np.zeros((len(frames), 1))


def trivial_predictors(half_width: float = HALF_WIDTH) -> dict[str, list[Predictor]]:
    """Return all untrained baseline predictors by name, one each, for `measure`; they share the slices cut out."""
    predictors: dict[str, list[Predictor]] = {"the displaced path": [predict_path]}
    slice_cache = SliceCache(half_width)
    predictors |= {name: [trivial_predictor(name, slice_cache)] for name in baselines.RULES}
    for name in baselines.SPANNED:
        rule = trivial_predictor(name, slice_cache)
        predictors[f"{name}, parabola of {baselines.SPAN:.0f} m"] = [along_parabolas(rule, baselines.SPAN)]
    return predictors


def along_parabolas(predictor: Predictor, length: float) -> Predictor:
    """Return a predictor that smooths another's centres by a parabola fitted over `length` (m) around each frame."""

    def predict(road: LearningRoad, frames: Frames) -> Float:
        """Return the centres (M, 1), m, of parabolas through the other predictor's centres."""
        y = predictor(road, frames)[:, 0]
        center_points, result = frames.at(y), np.full(len(y), np.nan)
        for part in stretches(frames):
            found_rows = part[np.isfinite(y[part])]
            for index in part:
                neighbours = found_rows[np.abs(frames.station[found_rows] - frames.station[index]) <= 0.5 * length]
                if len(neighbours) >= baselines.FEWEST:
                    cos, sin = np.cos(frames.direction[index]), np.sin(frames.direction[index])
                    x, lateral_offset = (
                        (center_points[neighbours] - frames.position[index]) @ np.array([[cos, -sin], [sin, cos]])
                    ).T
                    result[index] = np.polyfit(x, lateral_offset, 2)[2]
        return result[:, None]

    return predict
