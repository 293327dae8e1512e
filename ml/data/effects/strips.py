"""Effects on whole tiles of a road before crops are cut from them: strips along the axis, and their brightness.

Published airborne clouds of roads are often strips cut along the axis, ground only. A network that has only met whole
scenes takes the pavement in them for ground. Both effects act before intensities are scaled, since `predict` scales a
cloud by the points that it has.
"""

from typing import TYPE_CHECKING, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.ndimage import distance_transform_edt

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.base.schema import quantity

from ...configuration import Part
from ...registry import effect
from ..points import GROUND_CLASSES, ROAD_CLASSES
from ..samples import Crop

if TYPE_CHECKING:
    from .crops import CropEffects

Generator = np.random.Generator

_BAND_WIDTHS = (0.5, 3.0)
"""Least and largest width of the band beside the pavement, m. Chosen: up to twice the 1.5 m of hard verges (RAL)."""
_BAND_SHARES = (0.2, 1.0)
"""How near the band's brightness comes to what was there, from that of the pavement, 0, by logarithms. Chosen: not 0,
as no band can be told from pavement that is as bright."""
_CELL = 0.25
"""Width, m, of the strips along the road that are paved or not. Chosen: a footprint's."""
_FEWEST = 64
"""Points that a cut leaves at least, as many as the smallest crop has: fewer show no road, and `dropout` could remove
them all."""
_WAVES = 5
"""Waves of a pattern across the road. Chosen: five look irregular."""
_WAVELENGTHS = (1.5, 8.0)
"""Shortest and longest wavelength across the road, m: from wheel tracks to two lanes."""


class StripCut(Part):
    """Options for cutting tiles along the road's axis, as strips of published airborne clouds are cut.

    With a probability, a tile is cut to a distance R to both sides of the axis, or of the middle of one carriageway. R
    is drawn from ``reach``, uniformly in its logarithm. In a share of the cut tiles only ground, road and markings
    are kept. Tiles of scenes without an axis are never cut.
    """

    probability: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability that a tile is cut.")
    reach: tuple[float, float] = Field((6.0, 60.0), description="Smallest and largest R, m.")
    ground_only: float = quantity(
        0.5,
        ge=0,
        le=1,
        unit="1",
        description="Share of the cut tiles in which only ground, road and markings are kept.",
    )
    carriageway: float = quantity(
        0.25,
        ge=0,
        le=1,
        unit="1",
        description="Share of the cut tiles that are cut along a carriageway's middle, down to half of R.",
    )

    @model_validator(mode="after")
    def _check_reach(self) -> Self:
        """Refuse limits of the strip that don't ascend or are out of bounds."""
        smallest, largest = self.reach
        if not 1.0 <= smallest <= largest <= 1000.0:
            raise ValueError(f"reach is {smallest:g}, {largest:g}: must be two ascending numbers from 1 to 1000")
        return self


@effect("segmentation", order=-20)
def cut_strip(crop: Crop, effects: "CropEffects", random: Generator) -> None:
    """Drop what lies beyond a strip along the road, in half of the strips also what isn't ground, in place.

    A tile stays as it is where its road has no axis, or fewer than `_FEWEST` points would be left.
    """
    strip = effects.strip
    if crop.offset is None or random.random() >= strip.probability:
        return
    reach = float(np.exp(random.uniform(*np.log(strip.reach))))
    middle = 0.0
    if random.random() < strip.carriageway:
        # Strips of roads with one carriageway are half as wide as those of two.
        middle, reach = _carriageway_middle(crop, random), reach / 2.0
    keep = np.abs(crop.offset - middle) <= reach
    if random.random() < strip.ground_only:
        keep &= crop.points_of(GROUND_CLASSES)
    if np.count_nonzero(keep) >= _FEWEST:
        crop.keep(keep)


@effect("segmentation", order=-10)
def change_contrast(crop: Crop, effects: "CropEffects", random: Generator) -> None:
    """Multiply the intensities beside the pavement by a factor, and all by a pattern across the road, in place."""
    if crop.strength is None:
        return
    strength = crop.strength
    if effects.contrast:
        factor = np.exp(random.uniform(-effects.contrast, effects.contrast))
        strength = np.where(crop.points_of(ROAD_CLASSES), strength, factor * strength)
    if effects.stripes and crop.offset is not None:
        sigma = random.uniform(0.0, effects.stripes)
        strength = strength * np.exp(sigma * _pattern(crop.offset, random))
    crop.strength = strength if strength is crop.strength else strength.astype(np.float32)


@effect("segmentation", order=-5)
def add_verge_band(crop: Crop, effects: "CropEffects", random: Generator) -> None:
    """Give a band of the ground beside the pavement a brightness between the pavement's and its own, in place.

    Beside real roads lies a strip of gravel and short grass, brighter than asphalt and darker than grass.
    """
    if crop.strength is None or crop.offset is None or not effects.verge_band or random.random() >= effects.verge_band:
        return
    paved = crop.points_of(ROAD_CLASSES)
    distance = _distance_to_pavement(crop.offset, paved)
    width, log_share = random.uniform(*_BAND_WIDTHS), random.uniform(*_BAND_SHARES)
    band = crop.points_of(GROUND_CLASSES) & ~paved & (distance > 0.0) & (distance <= width)
    if not paved.any() or not band.any():
        return
    pavement_level, band_level = np.median(crop.strength[paved]), np.median(crop.strength[band])
    if min(pavement_level, band_level) <= 0.0:
        return
    factor = (pavement_level / band_level) ** (1.0 - log_share)
    crop.strength = np.where(band, factor * crop.strength, crop.strength).astype(np.float32)


def _distance_to_pavement(offset: Float, paved: Bool) -> Float:
    """Return the distances (N,), m across the road, from the next offset at which most points are paved, to `_CELL`."""
    cell = np.floor((offset - offset.min()) / _CELL).astype(np.int64)
    counts = np.bincount(cell)
    is_paved = np.bincount(cell, weights=paved, minlength=len(counts)) > 0.5 * np.maximum(counts, 1)
    if not is_paved.any():
        return np.full(len(offset), np.inf)
    result: Float = _CELL * distance_transform_edt(~is_paved)[cell]
    return result


def _carriageway_middle(crop: Crop, random: Generator) -> float:
    """Return the offset (m) of the middle of a random side's pavement; 0 where there is none."""
    assert crop.offset is not None
    side = random.choice([-1.0, 1.0])
    offset = crop.offset[crop.points_of(ROAD_CLASSES)]
    offset = offset[side * offset > 0.0]
    # The middle of the range without its outermost hundredths, which may be a turnout's.
    return float(np.percentile(offset, [1.0, 99.0]).mean()) if len(offset) else 0.0


def _pattern(offset: Float, random: Generator) -> Float:
    """Return random values (N,) of about unit deviation that vary with the offset (m) only: a sum of waves."""
    shortest, longest = np.log(_WAVELENGTHS)
    rate = 2.0 * np.pi / np.exp(random.uniform(shortest, longest, _WAVES))
    angle = offset[:, None] * rate + random.uniform(0.0, 2.0 * np.pi, _WAVES)
    result: Float = np.cos(angle).sum(axis=1) * np.sqrt(2.0 / _WAVES)
    return result
