"""Effects on sequences of slices, carried along to the truth."""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from synthroads_addon.base.schema import quantity

from ...configuration import Part
from ...registry import effect
from ..frames import Frames
from ..samples import HEADING, HEIGHT, LEFT, RIGHT, Stretch
from .base import PointEffects, point_effect_field

Generator = np.random.Generator

_RIM = 0.7
"""Width of the pavement's rim over which its edge's height is taken, m."""
_USUAL_LINE = 3.5
"""Distance (m) of a carriageway's edge line from its centre where it isn't known. Chosen: two lanes of common width."""


class SequenceCrop(Part):
    """Options for cropping both sides of every slice, so that the middle of what is left isn't the centre.

    A strip reaches to a distance R from the true centre to either side, two numbers drawn for the whole sequence: a
    road's from ``reach``, a carriageway's from its edge line out to ``beyond`` farther, but at most to the middle of
    the median. In it every slice, and each of its sides by itself, is cut to a distance between (1 - ``share``) R and
    R; with the probability ``steady`` the same in all slices, since cuts of their own average out over a sequence. What
    isn't cut is seen as far as slices reach, as in scans of whole landscapes.
    """

    probability: float = quantity(
        0.7, ge=0, le=1, unit="1", description="Probability that a sequence is cut at the sides."
    )
    reach: tuple[float, float] = Field((4.0, 30.0), description="Smallest and largest R of a road's strip, m.")
    beyond: tuple[float, float] = Field((0.0, 4.0), description="R of a carriageway's strip beyond its edge line, m.")
    share: float = quantity(0.75, ge=0, le=0.95, unit="1", description="Largest part of R that is cut off.")
    steady: float = quantity(
        0.25, ge=0, le=1, unit="1", description="Probability that all slices of a sequence have the same cut."
    )

    @model_validator(mode="after")
    def _check_sides(self) -> Self:
        """Refuse limits of the crop that don't ascend or are out of bounds."""
        for name, lower_limit in (("reach", 0.5), ("beyond", 0.0)):
            smallest, largest = getattr(self, name)
            if not lower_limit <= smallest <= largest <= 1000.0:
                raise ValueError(
                    f"{name} is {smallest:g}, {largest:g}: must be two ascending numbers from {lower_limit:g} to 1000"
                )
        return self


class SequenceEffects(PointEffects):
    """Options of the augmentation of sequences of slices; strengths are upper limits, each sample draws below them."""

    renamed: ClassVar[Mapping[str, str]] = {"colorless": "color_drop"}

    mirror: float = point_effect_field("mirror", 0.5)
    dropout: float = point_effect_field("dropout", 0.3)
    color_drop: float = point_effect_field("color_drop", 0.3)
    turn_round: float = quantity(
        0.5, ge=0, le=1, unit="1", description="Probability that a sequence runs against the path."
    )
    crop: SequenceCrop = Field(default=SequenceCrop(), description="Cuts at the sides.")
    alone: float = quantity(
        0.5,
        ge=0,
        le=1,
        unit="1",
        description="Probability that a carriageway without shoulders has ground on both sides, and no second one.",
    )
    hidden: float = quantity(
        0.2, ge=0, le=1, unit="1", description="Probability of a hole like the one behind a vehicle."
    )
    empty: float = quantity(0.02, ge=0, le=1, unit="1", description="Probability of a slice without any point.")
    jitter: float = quantity(0.02, ge=0, le=1, unit="m", description="Standard deviation of the noise of the points.")
    footprint: float = quantity(1.2, ge=0, le=5, unit="m", description="Width over which intensities are averaged.")
    tilt: float = quantity(0.01, ge=0, le=0.2, unit="1", description="Cross slope and grade that are added.")
    plain: float = quantity(0.25, ge=0, le=1, unit="1", description="Probability that intensities stay unchanged.")
    contrast: float = quantity(
        1.5, ge=0, le=3, unit="1", description="Largest logarithm of the factor on everything but pavement."
    )
    verge: float = quantity(
        2.5,
        ge=0,
        le=20,
        unit="m",
        description="Width of verges that look like asphalt beside a carriageway without shoulders.",
    )
    paint: float = quantity(
        0.95, ge=0, le=1, unit="1", description="Share of the markings' brightness that is worn off."
    )
    repaint: float = quantity(
        0.3,
        ge=0,
        le=0.5,
        unit="1",
        description="Probability that the lane line of a carriageway without shoulders is solid, that it is worn off, "
        "that both edge lines are, and that one of them is.",
    )
    gamma: tuple[float, float] = Field((0.15, 1.5), description="Smallest and largest power of the intensities.")
    falloff: float = quantity(
        4.0, ge=0, le=10, unit="1", description="Power of the range fall-off from scanners somewhere above the road."
    )
    stripes: float = quantity(
        0.15,
        ge=0,
        le=2,
        unit="1",
        description="Pattern of wheel tracks, joints and lanes in the intensities, in the units of speckle.",
    )
    speckle: float = quantity(
        0.3,
        ge=0,
        le=2,
        unit="1",
        description="Noise of intensities, in units of the difference between their 90th and 10th percentiles.",
    )
    patches: float = quantity(
        0.2, ge=0, le=2, unit="1", description="The same noise for patches some metres long and wide."
    )
    tint: float = quantity(
        0.2,
        ge=0,
        le=1,
        unit="1",
        description="Largest logarithm of the common factor on the colours, and of the factor on each channel.",
    )

    @model_validator(mode="after")
    def _check_gamma(self) -> Self:
        """Refuse powers of the intensities that don't ascend or are out of bounds."""
        if not 0.01 <= self.gamma[0] <= self.gamma[1] <= 10.0:
            smallest, largest = self.gamma
            raise ValueError(f"gamma is {smallest:g}, {largest:g}: must be two ascending numbers from 0.01 to 10")
        return self


@effect("centerline", order=-30)
def mirror_side(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Replace the median's side of a carriageway by its mirrored outer side, in place, with probability `alone`.

    So a motorway's carriageway becomes a rural road. Mirrored heights continue the height of the inner edge.
    """
    if rng.random() >= effects.alone or not stretch.without_shoulders():
        return
    edges = stretch.paved_sides()
    inwards, outwards = (0, 1) if np.isfinite(stretch.room[:, 0]).any() else (1, 0)
    sign = 1.0 if outwards == 0 else -1.0
    # How far beyond the pavement's outer and inner edge each point lies.
    outward_distance = sign * (stretch.coord[:, 1] - stretch.center[stretch.number])
    beyond_outer = outward_distance - edges[stretch.number, outwards]
    beyond_inner = -outward_distance - edges[stretch.number, inwards]
    rise = stretch.coord[:, 2] - stretch.corridor[stretch.number, HEIGHT]
    rims = [rise[(excess <= 0.0) & (excess >= -_RIM)] for excess in (beyond_inner, beyond_outer)]
    if not len(rims[0]) or not len(rims[1]):
        return
    outer_points = np.flatnonzero((beyond_outer > 0.0) & np.isfinite(edges[stretch.number, inwards]))
    points_kept = np.flatnonzero(~(beyond_inner > 0.0))
    number = stretch.number[outer_points]
    mirrored_y = stretch.center[number] - sign * (edges[number, inwards] + beyond_outer[outer_points])
    mirrored_points = stretch.coord[outer_points].copy()
    mirrored_points[:, 1] = mirrored_y
    mirrored_points[:, 2] += float(np.median(rims[0]) - np.median(rims[1]))
    source_rows = np.concatenate([points_kept, outer_points])
    xyz = np.concatenate([stretch.coord[points_kept], mirrored_points])
    order = np.argsort(stretch.number[source_rows], kind="stable")
    stretch.keep(source_rows[order])
    stretch.coord = xyz[order]
    stretch.room = np.full_like(stretch.room, np.inf)


@effect("centerline", order=-20)
def crop_sides(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Drop points on both sides of every slice at random, in place, as `SequenceCrop` says.

    An unknown centre counts as the frame's origin.
    """
    slice_count, crop = len(stretch.center), effects.crop
    center = np.nan_to_num(stretch.center)
    if rng.random() >= crop.probability:
        return
    # (S, 2) distances from each slice's centre to the strip's left and right end, m: R of `SequenceCrop`.
    if stretch.carriageway:
        strip_ends = np.nan_to_num(stretch.lines, nan=_USUAL_LINE) + rng.uniform(*crop.beyond, 2)
        # Points beyond the middle of the median aren't there in the first place.
        strip_ends = np.minimum(strip_ends, np.nan_to_num(stretch.room, nan=np.inf))
    else:
        # Uniform logarithms: narrow strips differ more from each other than wide ones.
        log_least, log_largest = np.log(crop.reach)
        strip_ends = np.tile(np.exp(rng.uniform(log_least, log_largest, 2)), (slice_count, 1))
    # Shares cut off the left and the right: one pair for all slices, or a pair for each.
    pair_count = 1 if rng.random() < crop.steady else slice_count
    cut_ends = strip_ends * (1.0 - rng.uniform(0.0, crop.share, (pair_count, 2)))
    left_distance = stretch.coord[:, 1] - center[stretch.number]
    left_end, right_end = cut_ends[stretch.number].T
    stretch.keep((left_distance <= left_end) & (-left_distance <= right_end))


@effect("centerline", order=-10)
def drop_parts(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Drop random points, whole slices and a rectangular hole of some metres from the sequence, in place."""
    slices, points = len(stretch.center), len(stretch)
    keep = effects.kept_points(points, rng)
    keep &= (rng.random(slices) >= effects.empty)[stretch.number]
    if rng.random() < effects.hidden and points:
        # Chosen: a hole as large as a vehicle, from a car to a lorry.
        hole_point, length, width = rng.integers(points), rng.uniform(2.0, 12.0), rng.uniform(1.5, 3.0)
        x, y = stretch.points_along(), stretch.coord[:, 1]
        keep &= ~((np.abs(x - x[hole_point]) <= length / 2.0) & (np.abs(y - y[hole_point]) <= width / 2.0))
    stretch.keep(keep)


@effect("centerline", order=10)
def mirror(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Mirror left and right with probability `mirror`, in place, frames included: no way back to the cloud remains."""
    if rng.random() >= effects.mirror:
        return
    frames = stretch.frames
    stretch.frames = Frames(frames.position * np.array([1.0, -1.0]), -frames.direction, frames.station)
    stretch.coord = stretch.coord * np.array([1.0, -1.0, 1.0])
    stretch.center = -stretch.center
    corridor = stretch.corridor.copy()
    corridor[:, LEFT], corridor[:, RIGHT] = -stretch.corridor[:, RIGHT], -stretch.corridor[:, LEFT]
    corridor[:, HEADING] *= -1.0
    stretch.corridor = corridor
    stretch.lines, stretch.room = stretch.lines[:, ::-1], stretch.room[:, ::-1]


@effect("centerline", order=20)
def turn_round(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Reverse the sequence's direction of travel with probability `turn_round`, in place, the last slice first."""
    if rng.random() >= effects.turn_round:
        return
    last_slice = len(stretch.center) - 1
    order = np.argsort(last_slice - stretch.number, kind="stable")
    stretch.keep(order)
    stretch.number = last_slice - stretch.number
    stretch.coord = stretch.coord * np.array([-1.0, -1.0, 1.0])
    stretch.center = -stretch.center[::-1]
    corridor = stretch.corridor[::-1].copy()
    corridor[:, [LEFT, RIGHT]] = -corridor[:, [RIGHT, LEFT]]
    stretch.corridor = corridor
    stretch.lines, stretch.room = stretch.lines[::-1, ::-1], stretch.room[::-1, ::-1]
    stretch.frames = stretch.frames.reverse()


@effect("centerline", order=30)
def tilt_and_jitter(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Tilt the ground (truth included) and jitter the points at random, in place; each stays in its slice."""
    grade, cross = rng.uniform(-effects.tilt, effects.tilt, 2)
    distances = stretch.along()
    middle = 0.5 * distances[-1]
    x, y = stretch.points_along() - middle, stretch.coord[:, 1]
    noise = rng.uniform(0.0, effects.jitter) * rng.standard_normal(stretch.coord.shape)
    stretch.coord = stretch.coord + noise
    stretch.coord[:, 2] += grade * x + cross * y
    stretch.corridor = stretch.corridor.copy()
    stretch.corridor[:, HEIGHT] += grade * (distances - middle) + cross * stretch.center
