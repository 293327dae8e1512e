"""What is done to a block's points after the scan: colours and layers, intensities from these, micro-relief."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import PointBlock
from ..cloud.roughness import MicroRelief, adjusted
from ..colour import LayerSource, Targets
from .radiometry import reflectivity
from .surfaces import Surfaces

LAYERS = ("roughness", "metallic", "specular")
"""Material layers that points can keep."""
_OF_INTENSITY = frozenset({"base_color", "metallic", "specular"})
_DARKEST = 1e-9


@dataclass(frozen=True)
class Finish:
    """The work on points that are measured already; the same for every block, whatever the order.

    Attributes:
        source: of colours and layers.
        wanted: ``rgb`` and `LAYERS` that the points get.
        surfaces: the materials' means, which the scan was made with.
        intensity_from_layers: each point's intensity is that of its own layers.
        relief: of the materials; None without.
        strength: of the relief.
        octaves: of the relief.
        seed: of the relief.
        kept: `PointBlock`'s optional arrays that stay; the others were needed on the way.
    """

    source: LayerSource
    wanted: frozenset[str]
    surfaces: Surfaces
    intensity_from_layers: bool
    relief: MicroRelief | None
    strength: float
    octaves: int
    seed: int
    kept: frozenset[str]

    def __call__(self, points: PointBlock, seen: Targets | None) -> tuple[PointBlock, NDArray[np.int64]]:
        """Return the finished points, and how many took their colour from each source (256,)."""
        counts = np.zeros(256, dtype=np.int64)
        if seen is not None and (self.wanted or self.intensity_from_layers):
            points, source = self._coloured(points, seen)
            counts += np.bincount(source, minlength=256)
        if seen is not None and self.relief is not None and self.strength > 0.0:
            points = adjusted(points, seen.position, self.relief, self.strength, self.seed, self.octaves)
        dropped: dict[str, Any] = {name: None for name in OPTIONAL if name not in self.kept}
        return replace(points, **dropped), counts

    def _coloured(self, points: PointBlock, seen: Targets) -> tuple[PointBlock, NDArray[np.uint8]]:
        layers = self.wanted | (_OF_INTENSITY if self.intensity_from_layers else frozenset())
        values = self.source.sample(seen.position, seen.scanner, seen.normal, seen.material, seen.time, layers)
        changes: dict[str, Any] = {name: values.arrays[name] for name in self.wanted}
        changes["color_source"] = values.source
        if self.intensity_from_layers:
            own = reflectivity(*(values.arrays[name] for name in ("base_color", "metallic", "specular")))
            mean = self.surfaces.reflectivity[seen.material]
            changes["intensity"] = points.intensity * own / np.maximum(mean, _DARKEST)
        return replace(points, **changes), values.source


OPTIONAL = (
    "normal",
    "material",
    "scanner",
    "true_range",
    "true_xyz",
    "roughness",
    "metallic",
    "specular",
    "color_source",
)
"""Arrays of `PointBlock` that may be None."""
