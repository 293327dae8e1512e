"""Effects on a crop while training: cheap, on the fly, each drawn from the stream that is handed in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from synthroads_addon.base.schema import quantity

from ..tiles import CloudTile
from .base import PointEffects, usually

FloatArray = NDArray[np.float32]

MISSING_SIGMA = 0.02
"""Standard deviation of the noise that stands for a missing feature: nothing, but never exactly the same."""


@dataclass(frozen=True)
class Crop:
    """N points on their way into the network.

    Attributes:
        coord: (N, 3) m, relative to the tile.
        color: (N, 3) from 0 to 1, or None.
        strength: (N,) scaled intensity, or None.
        segment: (N,) places of classes, or -1.
    """

    coord: FloatArray
    color: FloatArray | None
    strength: FloatArray | None
    segment: NDArray[np.int16]

    def select(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> Crop:
        """Return the points chosen by a mask or indices."""
        return Crop(
            self.coord[keep],
            None if self.color is None else self.color[keep],
            None if self.strength is None else self.strength[keep],
            self.segment[keep],
        )


class Effects(PointEffects):
    """Effects on crops. All of it off leaves them as they are; the defaults are the recipe's."""

    rotation: bool = Field(True, description="Turn about the vertical by any angle.")
    smallest_scale: float = quantity(0.9, gt=0, le=1, unit="1", description="Smallest factor on the coordinates.")
    largest_scale: float = quantity(1.1, ge=1, le=10, unit="1", description="Largest factor on the coordinates.")
    jitter: float = quantity(0.005, ge=0, le=1, unit="m", description="Noise of each coordinate, one sigma.")
    jitter_limit: float = quantity(0.02, ge=0, le=5, unit="m", description="Largest noise of a coordinate.")
    color_drop: float = usually("color_drop", 0.2)
    intensity_drop: float = quantity(0.0, ge=0, le=1, unit="1", description="Share that loses its intensities.")
    intensity_gain: float = quantity(
        0.0, ge=0, le=3, unit="1", description="Another intensity model: sigma of the logarithm of gain and exponent."
    )

    @field_validator("mirror", mode="before")
    @classmethod
    def _every_second(cls, mirror: Any) -> Any:
        """Read true, which was every second crop."""
        return 0.5 * mirror if isinstance(mirror, bool) else mirror

    @model_validator(mode="after")
    def _limit_is_no_less(self) -> Effects:
        if self.jitter_limit < self.jitter:
            raise ValueError(f"jitter_limit must not be less than jitter, {self.jitter:g}")
        return self

    def apply(self, crop: Crop, random: np.random.Generator) -> Crop:
        """Return a crop with all effects, in a fixed order."""
        if self.dropout:
            crop = crop.select(self.kept_points(len(crop.coord), random))
        crop = replace(crop, coord=self._moved(crop.coord, random))
        if crop.strength is not None and self.intensity_gain:
            crop = replace(crop, strength=self._other_intensities(crop.strength, random))
        if self.loses_colors(random):
            crop = replace(crop, color=None)
        if random.random() < self.intensity_drop:
            crop = replace(crop, strength=None)
        return crop

    def _moved(self, coord: FloatArray, random: np.random.Generator) -> FloatArray:
        angle = random.uniform(0.0, 2.0 * np.pi) if self.rotation else 0.0
        scale = random.uniform(self.smallest_scale, self.largest_scale)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        if self.mirror and random.random() < self.mirror:
            turn[:, 0] *= -1.0
        middle = coord.mean(axis=0, dtype=np.float64)
        moved = coord - middle
        moved[:, :2] = moved[:, :2] @ turn
        moved *= scale
        if self.jitter:
            noise = random.normal(0.0, self.jitter, coord.shape)
            moved += np.clip(noise, -self.jitter_limit, self.jitter_limit)
        return (moved + middle).astype(np.float32)

    def _other_intensities(self, strength: FloatArray, random: np.random.Generator) -> FloatArray:
        gain, exponent = np.exp(random.normal(0.0, self.intensity_gain, 2))
        return (np.sign(strength) * np.abs(strength) ** exponent * gain).astype(np.float32)


NO_EFFECTS = Effects(
    rotation=False, smallest_scale=1.0, largest_scale=1.0, jitter=0.0, jitter_limit=0.0, color_drop=0.0
)
"""For validation and prediction."""


def crop_of(tile: CloudTile, strength: FloatArray | None) -> Crop:
    """Return a whole tile as a crop; ``strength`` (N,) is its scaled intensity."""
    color = None if tile.color is None else (tile.color / np.float32(255.0)).astype(np.float32)
    return Crop(tile.coord, color, strength, tile.segment)
