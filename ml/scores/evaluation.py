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
        road: with a known truth.
        seed: of cuts and of how the path strays.
        cropping: None: all points stay.
        estimated: whether the path is found in the points; else it is the axis. Both stray.
        settings: how far the path strays; those of `SliceSettings` if not given.

    Raises:
        InputError: the road has no truth.
    """
    settings = settings or SliceSettings()
    seen = road if cropping is None else crop_road(road, cropping.share, seed, cropping.length)
    seen = cut_beside_median(seen, settings.median_error, stream(seed, "median", road.name))
    path = estimated_path(seen.xyz.astype(np.float64)) if estimated else road.known_truth.axis
    rng = stream(seed, "frames", road.name)
    strayed = displace_frames(frames_along(path), rng, settings.window, settings.direction_deg, settings.wander_length)
    return Case(seen, strayed)


def evaluate(predictor: Predictor, shown: Case) -> dict[str, float]:
    """Return one predictor's metrics (`distances.METRICS`) on one road, by name; undefined ones are NaN or missing."""
    frames = shown.frames
    predicted = predictor(shown.road, frames)
    true, _ = shown.road.known_truth.axis.crossing(frames.position, frames.direction)
    std = predicted[:, 1] if predicted.shape[1] > 1 else None
    intervals = predicted[:, -2:] if predicted.shape[1] == len(CORRIDOR_COLUMNS) else None
    compared = Comparison(frames.at(predicted[:, 0]), frames.at(true), frames.station, std, intervals)
    return figures(METRICS, compared)


def measure(
    predictors: Mapping[str, Sequence[Predictor]], cases: Callable[[int], Sequence[Case]], seeds: Sequence[int]
) -> dict[str, dict[str, dict[str, Spread]]]:
    """Return each metric's mean and deviation over seeds, by predictor, road (`all`: combined) and metric.

    Args:
        predictors: by name; one per seed, as models that were trained with it, or one for all seeds.
        cases: the roads as a seed shows them.
        seeds: of cuts and frames. The n-th predictor is measured with the n-th seed.

    Raises:
        InputError: two roads have the same name, by which figures are told apart.
    """
    rows: dict[str, dict[str, list[dict[str, float]]]] = {name: {} for name in predictors}
    for name, versions in predictors.items():
        if len(versions) not in (1, len(seeds)):
            raise ValueError(f"{name}: {len(versions)} predictors for {len(seeds)} seeds")
    for index, seed in enumerate(seeds):
        shown = cases(seed)
        names = [one.road.name for one in shown]
        if twice := {name for name in names if names.count(name) > 1}:
            raise InputError("road", sorted(twice)[0], "is the name of several roads; rename one of the data sets")
        metrics_by_road: dict[str, dict[str, dict[str, float]]] = {name: {} for name in predictors}
        for one in shown:  # road by road: predictors share what they cut out of it
            for name, versions in predictors.items():
                metrics_by_road[name][one.road.name] = evaluate(versions[0 if len(versions) == 1 else index], one)
        for name, by_name in metrics_by_road.items():
            for road, row in (*by_name.items(), ("all", over_roads(by_name.values()))):
                rows[name].setdefault(road, []).append(row)
    return {name: {road: over_seeds(values) for road, values in by_road.items()} for name, by_road in rows.items()}


def trivial_predictor(name: str, cut: SliceCache | None = None) -> Predictor:
    """Return the untrained predictor of a rule's name in `baselines.RULES`; `cut` shares slices between predictors."""
    rule, length = baselines.RULES[name]
    cut = cut or SliceCache()

    def predict(road: LearningRoad, frames: Frames) -> Float:
        slices = cut(road, frames, length)
        belonging = road.belonging[slices.index]
        y, intensity = slices.xy[belonging, 1], road.intensity[slices.index[belonging]].astype(np.float64)
        return baselines.slice_centers(rule, slices.number[belonging], y, intensity, len(frames))[:, None]

    return predict


class SliceCache:
    """Cache of the slices of the last road and frames, per thickness.

    Args:
        half_width: points up to this are seen beside a frame, m.
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
        xy, intensity = mask_points(road, settings.mask)
        return baselines.skeleton_centers(xy, intensity, frames.position, frames.direction, settings)[:, None]

    return predict


def mask_points(road: LearningRoad, mask: str) -> tuple[Float, Float]:
    """Return xy (N, 2), m, and intensities (N,) of the skeleton's points: the road classes' for "classes", else all."""
    paved = road.of_class(ROAD_CLASSES)
    rows = road.belonging & paved if mask == "classes" and paved.any() else road.belonging
    return road.xyz[rows, :2].astype(np.float64), road.intensity[rows].astype(np.float64)


def predict_path(road: LearningRoad, frames: Frames) -> Float:
    """Predict the centre at each frame's origin: zeros (M, 1); what the displaced path alone is worth."""
    return np.zeros((len(frames), 1))


def trivial_predictors(half_width: float = HALF_WIDTH) -> dict[str, list[Predictor]]:
    """Return all untrained baseline predictors by name, one each, for `measure`; they share the slices cut out."""
    predictors: dict[str, list[Predictor]] = {"the displaced path": [predict_path]}
    cut = SliceCache(half_width)
    predictors |= {name: [trivial_predictor(name, cut)] for name in baselines.RULES}
    for name in baselines.SPANNED:
        rule = trivial_predictor(name, cut)
        predictors[f"{name}, parabola of {baselines.SPAN:.0f} m"] = [along_parabolas(rule, baselines.SPAN)]
    return predictors


def along_parabolas(predictor: Predictor, length: float) -> Predictor:
    """Return a predictor that smooths another's centres by a parabola fitted over `length` (m) around each frame."""

    def predict(road: LearningRoad, frames: Frames) -> Float:
        y = predictor(road, frames)[:, 0]
        place, result = frames.at(y), np.full(len(y), np.nan)
        for part in stretches(frames):
            known = part[np.isfinite(y[part])]
            for index in part:
                near = known[np.abs(frames.station[known] - frames.station[index]) <= 0.5 * length]
                if len(near) >= baselines.FEWEST:
                    cos, sin = np.cos(frames.direction[index]), np.sin(frames.direction[index])
                    x, aside = ((place[near] - frames.position[index]) @ np.array([[cos, -sin], [sin, cos]])).T
                    result[index] = np.polyfit(x, aside, 2)[2]
        return result[:, None]

    return predict
