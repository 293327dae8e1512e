"""What is done to a block's points after the scan: colours and layers, intensities from these, micro-relief."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import NO_MATERIAL, PointBlock
from ..materials.reflectance import reflectivity, returned_share
from ..materials.surfaces import Surfaces, brightness_of
from .colour.colour import LayerSource, LayerValues, Targets, sample_targets
from .devices.device import ScannerSetting
from .radiometry import saturated
from .relief import MicroRelief, adjusted
from .returns import number_returns
from .scan import BlockResult

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
        surfaces: the means of the scene's materials, which the layers vary around.
        scanned: the materials' means that the scan was made with.
        setting: the scanner's, for its detector.
        intensity_from_layers: each point's intensity is that of its own layers; the scan left the detector to this.
        range_corrected: intensities are multiplied by the squared range, after the detector.
        relief: of the materials; None without.
        strength: of the relief.
        octaves: of the relief.
        seed: of the relief.
        frame: (3,) m, of the relief; see `Scan`.
        kept: `PointBlock`'s optional arrays that stay; the others were needed on the way.
    """

    source: LayerSource
    wanted: frozenset[str]
    surfaces: Surfaces
    scanned: Surfaces
    setting: ScannerSetting
    intensity_from_layers: bool
    range_corrected: bool
    relief: MicroRelief | None
    strength: float
    octaves: int
    seed: int
    kept: frozenset[str]
    frame: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def __call__(self, result: BlockResult) -> BlockResult:
        """Return a block, or several joined, with its points finished."""
        if result.seen is not None and (self.wanted or self.intensity_from_layers):
            result = self._coloured(result, result.seen)
        points = result.points
        if result.seen is not None and self.relief is not None and self.strength > 0.0:
            place = result.seen.position + self.frame
            points = adjusted(points, place, self.relief, self.strength, self.seed, self.octaves)
        changes: dict[str, Any] = {name: None for name in OPTIONAL if name not in self.kept}
        if self.range_corrected:
            changes["intensity"] = points.intensity * points.range**2
        return replace(result, points=replace(points, **changes), seen=None)

    def _coloured(self, result: BlockResult, seen: Targets) -> BlockResult:
        layers = self.wanted | (_OF_INTENSITY if self.intensity_from_layers else frozenset())
        values = sample_targets(self.source, seen, layers)
        changes: dict[str, Any] = {name: values.arrays[name] for name in self.wanted}
        changes["color_source"] = values.source
        if self.intensity_from_layers:
            changes["intensity"] = result.points.intensity * self._brighter(result.points, seen, values)
        result = replace(result, points=replace(result.points, **changes))
        if self.intensity_from_layers:
            result = detected(result, self.setting)
        assert result.points.color_source is not None
        return replace(result, sources=np.bincount(result.points.color_source, minlength=256))

    def _brighter(self, points: PointBlock, seen: Targets, values: LayerValues) -> NDArray[np.float64]:
        """Return how many times as bright points are by their own layers as by their materials' means (N,).

        A return has the layers of what gave most of it. What beads and prisms send back doesn't depend on them, nor
        does what comes from the air.
        """
        own = reflectivity(*(values.arrays[name] for name in ("base_color", "metallic", "specular")))
        usual = np.take(self.surfaces.reflectivity, seen.material, mode="clip")
        factor = np.asarray(own / np.maximum(usual, _DARKEST))
        factor[seen.material == NO_MATERIAL] = 1.0
        of = self.scanned
        if not of.retroreflective:
            return factor
        shining = np.flatnonzero(np.append(of.shining, False).take(seen.material, mode="clip"))
        material = seen.material[shining]
        cosine = np.cos(np.deg2rad(points.incidence_deg[shining].astype(np.float64)))
        usual = brightness_of(of, material, cosine)
        beads = usual - returned_share(cosine, of.reflectivity[material], of.facet_a[material], of.facet_b[material])
        factor[shining] = (factor[shining] * (usual - beads) + beads) / np.maximum(usual, _DARKEST)
        return factor


def detected(result: BlockResult, setting: ScannerSetting) -> BlockResult:
    """Return what the detector makes of echoes in a block, or several joined, that were kept for it until now.

    Weak echoes are lost, those beyond the device's largest number as well, and what is left is numbered anew and
    saturates. The returns of a pulse have one time and lie side by side.
    """
    points = result.points
    strong = np.flatnonzero(points.intensity >= setting.threshold)
    time, strip = points.gps_time[strong], points.strip[strong]
    begins = np.ones(len(strong), dtype=bool)
    begins[1:] = (time[1:] != time[:-1]) | (strip[1:] != strip[:-1])
    recorded, number, returns = number_returns(np.cumsum(begins), setting.device.maximum_returns)
    rows = strong[recorded]
    points = points.select(rows)
    intensity, clipped = saturated(points.intensity, setting.saturation)
    return replace(
        result,
        points=replace(points, intensity=intensity, return_number=number, number_of_returns=returns),
        seen=None if result.seen is None else result.seen.select(rows),
        below_threshold=result.below_threshold + len(result.points) - len(strong),
        saturated=clipped,
    )


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
