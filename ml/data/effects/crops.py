"""Effects on crops of tiles."""

from typing import Any, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from synthroads_addon.base.schema import quantity

from ...registry import effect
from ..samples import Crop
from .base import PointEffects, point_effect_field
from .strips import StripCut

Generator = np.random.Generator


class CropEffects(PointEffects):
    """Options of the random augmentation of segmentation crops; the defaults are the recipe's."""

    rotation: bool = Field(True, description="Turn the crop about the vertical by a random angle.")
    smallest_scale: float = quantity(0.9, gt=0, le=1, unit="1", description="Smallest factor on the coordinates.")
    largest_scale: float = quantity(1.1, ge=1, le=10, unit="1", description="Largest factor on the coordinates.")
    jitter: float = quantity(
        0.005, ge=0, le=1, unit="m", description="Standard deviation of the noise of each coordinate."
    )
    jitter_limit: float = quantity(0.02, ge=0, le=5, unit="m", description="Largest noise of a coordinate.")
    color_drop: float = point_effect_field("color_drop", 0.2)
    intensity_drop: float = quantity(
        0.0, ge=0, le=1, unit="1", description="Share of crops whose intensities are removed."
    )
    intensity_gain: float = quantity(
        0.0,
        ge=0,
        le=3,
        unit="1",
        description="Standard deviation of the logarithms of a random gain and exponent of the intensities.",
    )
    strip: StripCut = Field(StripCut(), description="Cuts of whole tiles along the road, as of strips.")
    contrast: float = quantity(
        0.0,
        ge=0,
        le=3,
        unit="1",
        description="Largest logarithm of the factor on the intensities of everything but pavement.",
    )
    stripes: float = quantity(
        0.0,
        ge=0,
        le=2,
        unit="1",
        description="Largest standard deviation of the logarithm of a brightness pattern across the road, as of wheel "
        "tracks, joints and lanes of different age; only where the road's axis is known.",
    )
    verge_band: float = quantity(
        0.0,
        ge=0,
        le=1,
        unit="1",
        description="Probability that a band along the pavement has a brightness between that of the pavement and its "
        "own, as verges of gravel have; only where the road's axis is known.",
    )

    @field_validator("mirror", mode="before")
    @classmethod
    def _read_true(cls, mirror: Any) -> Any:
        """Return the probability of mirroring: 0.5 for true and 0 for false, as older configurations have it."""
        return 0.5 * mirror if isinstance(mirror, bool) else mirror

    @model_validator(mode="after")
    def _check_limit(self) -> Self:
        """Refuse a limit of the jitter below its standard deviation."""
        if self.jitter_limit < self.jitter:
            raise ValueError(f"jitter_limit must not be less than jitter, {self.jitter:g}")
        return self


@effect("segmentation", order=10)
def drop_points(crop: Crop, effects: CropEffects, random: Generator) -> None:
    """Drop random points from the crop, in place, up to the share `dropout`."""
    if effects.dropout:
        crop.keep(effects.kept_points(len(crop), random))


@effect("segmentation", order=20)
def transform_crop(crop: Crop, effects: CropEffects, random: Generator) -> None:
    """Rotate the crop about its mean's vertical, scale and mirror it at random, and jitter its points, in place."""
    angle = random.uniform(0.0, 2.0 * np.pi) if effects.rotation else 0.0
    scale = random.uniform(effects.smallest_scale, effects.largest_scale)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    if effects.mirror and random.random() < effects.mirror:
        turn[:, 0] *= -1.0
    middle = crop.coord.mean(axis=0, dtype=np.float64)
    centred_points = crop.coord - middle
    centred_points[:, :2] = centred_points[:, :2] @ turn
    centred_points *= scale
    if effects.jitter:
        noise = random.normal(0.0, effects.jitter, centred_points.shape)
        centred_points += np.clip(noise, -effects.jitter_limit, effects.jitter_limit)
    crop.coord = (centred_points + middle).astype(np.float32)


@effect("segmentation", order=30)
def change_intensities(crop: Crop, effects: CropEffects, random: Generator) -> None:
    """Apply a random gain and exponent to the intensities, in place, as another scanner would have."""
    if crop.strength is not None and effects.intensity_gain:
        gain, exponent = np.exp(random.normal(0.0, effects.intensity_gain, 2))
        crop.strength = (np.sign(crop.strength) * np.abs(crop.strength) ** exponent * gain).astype(np.float32)


@effect("segmentation", order=60)
def drop_intensities(crop: Crop, effects: CropEffects, random: Generator) -> None:
    """Remove the crop's intensities with probability `intensity_drop`, in place."""
    if random.random() < effects.intensity_drop:
        crop.strength = None
