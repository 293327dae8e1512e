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
from ..networks.centerline.models import LINES, TARGETS, CenterlineModel, all_targets, predict_both_ways
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
        frames: the M frames along a path.
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
        y, height = (self.value[:, TARGETS.index(target)] for target in (name, "height"))
        return np.column_stack([self.frames.at(y), height])

    @property
    def center(self) -> Float:
        """Return the centreline's y (M,) in each frame, m, left positive; NaN where nothing was found."""
        return self.value[:, 0]


@dataclass(eq=False)
class CenterlinePredictor:
    """A trained centreline model with its deviations' calibration; callable as a predictor of `scores.evaluation`.

    Args:
        model: the trained model.
        settings: options by which slices are cut.
        use: options of prediction: mirroring, step, batch.
        calibration: calibration by target's name; targets that it lacks keep the model's own deviations.
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
        center = (regression.value[:, :1], regression.std[:, :1])
        corridor = (regression.value[:, 1:], regression.std[:, 1:])
        return np.column_stack([*center, *corridor, regression.widths[:, 0]])

    def regress(self, road: LearningRoad, frames: Frames) -> Regression:
        """Return centreline and corridor in M frames with calibrated deviations; NaN where no points are near.

        A frame in several sequences has the mean of their estimates, weighted by inverse variances. Its variance is
        the mean of their variances, since errors of the same points don't average out. Where sequences are interleaved,
        lines are smoothed by `smooth_line`.
        """
        mean, raw_std = self._combine_sequences(road, frames)
        calibration = [self.calibration[name] for name in TARGETS]
        factors = np.array([target_calibration.factor for target_calibration in calibration])
        widths = np.array([target_calibration.widths for target_calibration in calibration])
        return Regression(frames, mean, raw_std, raw_std * factors, raw_std[:, :, None] * widths)

    def _combine_sequences(self, road: LearningRoad, frames: Frames) -> tuple[Float, Float]:
        """Return means and standard deviations (M, T) of the targets over all sequences that a frame is in."""
        shape = (len(frames), len(TARGETS))
        weight, value, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        has_points = np.zeros(len(frames), dtype=bool)
        for number, height, slice_has_points, estimate, std in self._predict_sequences(road, frames):
            estimate[:, _HEIGHT] += height
            inverse = 1.0 / std**2
            np.add.at(weight, number, inverse)
            np.add.at(value, number, inverse * estimate)
            np.add.at(spread, number, 1.0)
            np.logical_or.at(has_points, number, slice_has_points)
        # The mean of the variances, each weighted by its inverse, is the harmonic one.
        with np.errstate(invalid="ignore", divide="ignore"):
            mean, raw_std = value / weight, np.sqrt(spread / weight)
        nearby_points = (
            np.convolve(has_points, np.ones(2 * _NEAR + 1))[_NEAR:-_NEAR] if len(has_points) else np.zeros(0)
        )
        mean[nearby_points == 0], raw_std[nearby_points == 0] = np.nan, np.nan
        reach = interleave_count(frames, self.settings.spacing)
        for line in LINES:
            column = TARGETS.index(line)
            mean[:, column] = smooth_line(frames, mean[:, column], raw_std[:, column], reach)
        return mean, raw_std

    def calibrate(self, roads: Iterable[tuple[LearningRoad, Frames]]) -> tuple[CenterlinePredictor, Float]:
        """Return a copy calibrated so that its deviations fit its errors on some roads, and these errors (N, T).

        A calibration found on a few roads of another scanner corrects the deviations for that scanner (see
        `calibration`); the predicted values stay the same.

        Args:
            roads: roads with a known truth, and frames along each.

        Raises:
            InputError: the truth of a road isn't known.
        """
        error, raw_std = [], []
        for road, frames in roads:
            regression = self.regress(road, frames)
            error.append(target_errors(regression, road.known_truth))
            raw_std.append(regression.raw_std)
        all_errors = np.concatenate(error)
        calibrated = copy(self)
        targets = zip(TARGETS, all_errors.T, np.concatenate(raw_std).T, strict=True)
        calibrated.calibration = {name: calibrate_target(size, std) for name, size, std in targets}
        return calibrated, all_errors

    def _predict_sequences(
        self, road: LearningRoad, frames: Frames
    ) -> Iterator[tuple[Index, Float, Bool, Float, Float]]:
        """Yield per batch, for its N slices: frame index, z origin (m), has points, values and deviations (N, T)."""
        data = FrameSlices(road, frames, self.settings, self.use.step)
        self.model.eval()
        for start in range(0, len(data), self.use.batch):
            frame_indices = data.runs[start : start + self.use.batch]
            samples = [data[number] for number in range(start, start + len(frame_indices))]
            batch = move_to_device(self.model, collate(samples))
            with torch.no_grad():
                output = predict_both_ways(self.model, batch) if self.use.mirror else self.model(batch)
            values, deviations = (
                all_targets(output, kind).flatten(0, 1).cpu().numpy().astype(np.float64) for kind in ("", "_std")
            )
            has_points = batch["mask"].any(-1).flatten().cpu().numpy()
            if not np.isfinite(values[has_points]).all() or np.isnan(deviations[has_points]).any():
                raise InputError("network", None, NOT_FINITE)
            yield (
                frame_indices.flatten(),
                batch["frame"][..., 3].flatten().cpu().numpy(),
                has_points,
                values,
                deviations,
            )


def smooth_line(frames: Frames, y: Float, std: Float, reach: int) -> Float:
    """Return a line's y (M,), m, smoothed by weighted local lines where neighbouring frames come from other sequences.

    Each y is that of the straight line fitted to the places in fewer than ``reach`` frames to either side, weighted by
    the inverse variances and the nearer the more: 5 mm off a circle of 280 m with a reach of 4 m.

    Args:
        frames: in order, with equal spacing but for gaps, which aren't crossed.
        y: (M,) of the line, m; NaN: not found, and it stays so.
        std: (M,) its standard deviation, m.
        reach: number of interleaved sequences; with 1 nothing changes.
    """
    line_points, result = frames.at(y), y.copy()
    cos, sin = np.cos(frames.direction), np.sin(frames.direction)
    for part in stretches(frames):
        total = np.zeros((5, len(part)))
        for shift in range(1 - reach, reach):
            rows = part[max(0, -shift) : max(0, len(part) - max(0, shift))]
            neighbour_rows = rows + shift
            dx, dy = (line_points[neighbour_rows] - frames.position[rows]).T
            forward_distance, lateral_distance = cos[rows] * dx + sin[rows] * dy, cos[rows] * dy - sin[rows] * dx
            weight = np.nan_to_num((reach - abs(shift)) / std[neighbour_rows] ** 2) * np.isfinite(lateral_distance)
            forward_distance, lateral_distance = np.nan_to_num(forward_distance), np.nan_to_num(lateral_distance)
            terms = (
                np.ones_like(forward_distance),
                forward_distance,
                lateral_distance,
                forward_distance * forward_distance,
                forward_distance * lateral_distance,
            )
            total[:, rows - part[0]] += weight * np.stack(terms)
        result[part] = np.where(np.isfinite(y[part]), _line_at_zero(*total), np.nan)
    return result


def _line_at_zero(sum_w: Float, sum_x: Float, sum_y: Float, sum_xx: Float, sum_xy: Float) -> Float:
    """Return y at x = 0 of weighted least-squares lines, from weighted sums of 1, x, y, x^2, xy; NaN without weight."""
    spread = sum_w * sum_xx - sum_x * sum_x
    slope = np.divide(
        sum_w * sum_xy - sum_x * sum_y, spread, out=np.zeros_like(sum_w), where=spread > 1e-6 * sum_w * sum_w
    )
    return np.divide(sum_y - slope * sum_x, sum_w, out=np.full_like(sum_w, np.nan), where=sum_w > 0.0)


def target_errors(regression: Regression, truth: Truth) -> Float:
    """Return the regressed targets minus the truth (M, T), in the targets' units; NaN where either is missing."""
    true_targets = truth.at(regression.frames)
    return regression.value - np.column_stack([true_targets.center, true_targets.corridor])


assert TARGETS[1:] == CORRIDOR
