"""A trained model along a path: what it says about every frame, put together from overlapping sequences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field

import numpy as np
import torch
from pydantic import Field

from synthroads_addon.base.arrays import Bool, Float, Index
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import quantity

from ..configuration import Part
from ..data.corridor import CORRIDOR, Truth
from ..data.frames import Frames, interleave_count, stretches
from ..data.roads import LearningRoad
from ..data.slices import FrameSlices, SliceSettings, collate
from ..networks.centerline.models import LINES, TARGETS, CenterlineModel, all_targets, both_ways
from ..runs import NOT_FINITE
from ..scores.calibration import IntervalCalibration, calibrate_target
from ..training_loop import move_to_device

_NEAR = 2
"""A frame with no point in it nor in this many frames to either side has no prediction. Chosen: lines go on over a gap
of a few metres."""
_HEIGHT = TARGETS.index("height")
"""Column of the height among the targets."""


class UseOptions(Part):
    """How a trained model is used."""

    mirror: bool = Field(True, description="Average the predictions for the slices and for their mirror images.")
    step: int = quantity(
        5, ge=1, le=1000, unit="1", description="Number of slices between the starts of two sequences."
    )
    batch: int = quantity(32, ge=1, le=10_000, unit="1", description="Number of sequences that are processed at once.")


@dataclass(frozen=True)
class Regression:
    """Centreline and corridor that a model regressed in M frames, with deviations; T are the `TARGETS`, centre first.

    Attributes:
        frames: where.
        value: (M, T) float64; y in the frame (m) of the centre and the edges; the height is the elevation in the road's
            local coordinates. NaN: nothing found.
        raw_std: (M, T) the model's own standard deviations.
        std: (M, T) the same, calibrated.
        widths: (M, T, 2) half-widths of the intervals that cover 68 % and 95 % on roads like the validation's.
        epsg: code of the coordinate system, None if it isn't known.
        height_epsg: code of the vertical system, None if it isn't known.
    """

    frames: Frames
    value: Float
    raw_std: Float
    std: Float
    widths: Float
    epsg: int | None = None
    height_epsg: int | None = None

    def points(self, name: str) -> Float:
        """Return the points (M, 3) of `center`, `left_edge` or `right_edge`, m; z is always the centre's elevation."""
        y, height = (self.value[:, TARGETS.index(each)] for each in (name, "height"))
        return np.column_stack([self.frames.at(y), height])

    @property
    def center(self) -> Float:
        """Return the centreline's y (M,) in each frame, m, left positive; NaN where nothing was found."""
        return self.value[:, 0]


@dataclass(eq=False)
class CenterlinePredictor:
    """A trained centreline model with its deviations' calibration; callable as a predictor of `scores.evaluation`.

    Args:
        model: trained.
        settings: how its slices are cut.
        use: how it is used.
        calibration: of each target by name; deviations of those that it lacks are the model's own.
    """

    model: CenterlineModel
    settings: SliceSettings
    use: UseOptions
    calibration: Mapping[str, IntervalCalibration] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Give every target without a calibration the identity."""
        self.calibration = {name: self.calibration.get(name, IntervalCalibration()) for name in TARGETS}

    def __call__(self, road: LearningRoad, frames: Frames) -> Float:
        """Return (M, 4 + 2 K) numbers, columns `evaluation.CORRIDOR_COLUMNS`, NaN where nothing is found."""
        regression = self.regress(road, frames)
        center, corridor = (
            (regression.value[:, :1], regression.std[:, :1]),
            (regression.value[:, 1:], regression.std[:, 1:]),
        )
        return np.column_stack([*center, *corridor, regression.widths[:, 0]])

    def regress(self, road: LearningRoad, frames: Frames) -> Regression:
        """Return centreline and corridor in M frames with calibrated deviations; NaN where no points are near.

        A frame in several sequences has the mean of what they say, weighted by the inverse variances. Its variance is
        their mean as well, since errors of the same points don't average out. Where sequences are interleaved, lines
        are `smooth_line`.
        """
        mean, raw = self._regress(road, frames)
        calibration = [self.calibration[name] for name in TARGETS]
        factors, widths = np.array([one.factor for one in calibration]), np.array([one.widths for one in calibration])
        return Regression(frames, mean, raw, raw * factors, raw[:, :, None] * widths)

    def _regress(self, road: LearningRoad, frames: Frames) -> tuple[Float, Float]:
        shape = (len(frames), len(TARGETS))
        weight, value, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        seen = np.zeros(len(frames), dtype=bool)
        for number, height, filled, estimate, std in self._sequences(road, frames):
            estimate[:, _HEIGHT] += height
            inverse = 1.0 / std**2
            np.add.at(weight, number, inverse)
            np.add.at(value, number, inverse * estimate)
            np.add.at(spread, number, 1.0)
            np.logical_or.at(seen, number, filled)
        # The mean of the variances, each weighted by its inverse, is the harmonic one.
        with np.errstate(invalid="ignore", divide="ignore"):
            mean, raw = value / weight, np.sqrt(spread / weight)
        around = np.convolve(seen, np.ones(2 * _NEAR + 1))[_NEAR:-_NEAR] if len(seen) else np.zeros(0)
        mean[around == 0], raw[around == 0] = np.nan, np.nan
        reach = interleave_count(frames, self.settings.spacing)
        for line in LINES:
            column = TARGETS.index(line)
            mean[:, column] = smooth_line(frames, mean[:, column], raw[:, column], reach)
        return mean, raw

    def calibrate(self, shown: Iterable[tuple[LearningRoad, Frames]]) -> tuple[CenterlinePredictor, Float]:
        """Return a copy calibrated so that its deviations fit its errors on some roads, and these errors (N, T).

        Found on a few roads of another scanner, one factor per target makes its deviations right there (see
        `calibration`); what the model says stays the same.

        Args:
            shown: roads with a known truth, and frames along each.

        Raises:
            InputError: the truth of a road isn't known.
        """
        error, raw = [], []
        for road, frames in shown:
            regression = self.regress(road, frames)
            error.append(target_errors(regression, road.known_truth))
            raw.append(regression.raw_std)
        every = np.concatenate(error)
        other = copy(self)
        targets = zip(TARGETS, every.T, np.concatenate(raw).T, strict=True)
        other.calibration = {name: calibrate_target(size, std) for name, size, std in targets}
        return other, every

    def _sequences(self, road: LearningRoad, frames: Frames) -> Iterator[tuple[Index, Float, Bool, Float, Float]]:
        """Yield per batch, for its N slices: frame index, z origin (m), has points, values and deviations (N, T)."""
        data = FrameSlices(road, frames, self.settings, self.use.step)
        self.model.eval()
        for first in range(0, len(data), self.use.batch):
            some = data.runs[first : first + self.use.batch]
            samples = [data[number] for number in range(first, first + len(some))]
            batch = move_to_device(self.model, collate(samples))
            with torch.no_grad():
                output = both_ways(self.model, batch) if self.use.mirror else self.model(batch)
            values, deviations = (
                all_targets(output, kind).flatten(0, 1).cpu().numpy().astype(np.float64) for kind in ("", "_std")
            )
            filled = batch["mask"].any(-1).flatten().cpu().numpy()
            if not np.isfinite(values[filled]).all() or np.isnan(deviations[filled]).any():
                raise InputError("network", None, NOT_FINITE)
            yield some.flatten(), batch["frame"][..., 3].flatten().cpu().numpy(), filled, values, deviations


def smooth_line(frames: Frames, y: Float, std: Float, reach: int) -> Float:
    """Return y (M,) of a line, m, smoothed by weighted local lines where neighbouring frames come from other sequences.

    Each is that of the straight line through the places in fewer than ``reach`` frames to either side, weighted by the
    inverse variances and the nearer the more: 5 mm off a circle of 280 m with a reach of 4 m.

    Args:
        frames: in order, with equal spacing but for gaps, which aren't crossed.
        y: (M,) of the line, m; NaN: not found, and it stays so.
        std: (M,) its standard deviation, m.
        reach: frames that belong to different sequences; 1: nothing changes.
    """
    place, result = frames.at(y), y.copy()
    cos, sin = np.cos(frames.direction), np.sin(frames.direction)
    for part in stretches(frames):
        total = np.zeros((5, len(part)))
        for by in range(1 - reach, reach):
            rows = part[max(0, -by) : max(0, len(part) - max(0, by))]
            other = rows + by
            dx, dy = (place[other] - frames.position[rows]).T
            ahead, aside = cos[rows] * dx + sin[rows] * dy, cos[rows] * dy - sin[rows] * dx
            weight = np.nan_to_num((reach - abs(by)) / std[other] ** 2) * np.isfinite(aside)
            ahead, aside = np.nan_to_num(ahead), np.nan_to_num(aside)
            terms = (np.ones_like(ahead), ahead, aside, ahead * ahead, ahead * aside)
            total[:, rows - part[0]] += weight * np.stack(terms)
        result[part] = np.where(np.isfinite(y[part]), _crossing_of(*total), np.nan)
    return result


def _crossing_of(one: Float, x: Float, y: Float, xx: Float, xy: Float) -> Float:
    """Return y at x = 0 of weighted least-squares lines, from weighted sums of 1, x, y, x^2, xy; NaN without weight."""
    spread = one * xx - x * x
    slope = np.divide(one * xy - x * y, spread, out=np.zeros_like(one), where=spread > 1e-6 * one * one)
    return np.divide(y - slope * x, one, out=np.full_like(one, np.nan), where=one > 0.0)


def target_errors(regression: Regression, truth: Truth) -> Float:
    """Return the regressed targets minus the truth (M, T), in the targets' units; NaN where either is missing."""
    there = truth.at(regression.frames)
    return regression.value - np.column_stack([there.center, there.corridor])


assert TARGETS[1:] == CORRIDOR
