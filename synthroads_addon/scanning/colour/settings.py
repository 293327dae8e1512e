"""Settings of colours and layers in which nothing is left open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ColourSource = Literal["auto", "images", "returns", "material"]
Engine = Literal["cycles", "eevee"]
ColourMode = Literal["lit", "unlit", "false_colour"]
Lighting = Literal["direct", "path"]


@dataclass(frozen=True)
class ColourSettings:
    """How colours and layers are rendered.

    Attributes:
        image_spacing: distance between two images along the path, m.
        ground_sampling_distance: width of a pixel at the usual range, m.
        samples: samples per pixel of the lit colours.
        source: images, a pixel per return, or each material's mean; auto takes a pixel per return where that is there.
        engine: renderer of the images.
        mode: what RGB shows.
        lighting: sun and open sky without noise, or whole light paths.
        max_resolution: largest side of an image, px.
    """

    image_spacing: float
    ground_sampling_distance: float
    samples: int
    source: ColourSource = "auto"
    engine: Engine = "cycles"
    mode: ColourMode = "lit"
    lighting: Lighting = "direct"
    max_resolution: int = 4096
