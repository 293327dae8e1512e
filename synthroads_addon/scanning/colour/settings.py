"""How colours are rendered: as the points show them, and how finely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ColourMode = Literal["lit", "unlit", "false_colour"]


@dataclass(frozen=True)
class ColourSettings:
    """What trades speed for accuracy.

    Attributes:
        image_spacing: distance between two images along the path, m.
        ground_sampling_distance: width of a pixel at the usual range, m.
        samples: samples per pixel of the lit colours.
    """

    image_spacing: float
    ground_sampling_distance: float
    samples: int
