"""What settings cost beyond what pilots time: by the shipped table, at the speed that this machine has shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...scanning.devices.shots import shot_count
from ...scanning.platforms.path import Path as ScanPath
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from ..scan.files import wanted_layers
from .pilot import Pilot
from .pilot_colour import image_counts
from .prior import Prior

_IMAGE = 0.3
"""Megapixels whose rendering costs as much as it costs to begin an image."""
_RETURN = 1.6
"""Megapixels that cost as much as a million returns with a pixel each."""


class Costs:
    """Costs of a job's parts.

    Args:
        scenario: the job.
        path: the scanner's.
        area: of the model, m2.
        prior: the shipped table's row.

    Attributes:
        wanted: layers that the points get.
        points: of the whole scan, once they are known.
        speed: seconds here for a second of the table, once that is known.
    """

    def __init__(self, scenario: Scenario, path: ScanPath, area: float, prior: Prior) -> None:
        self.scenario, self.path, self.area, self.prior = scenario, path, area, prior
        self.wanted = wanted_layers(scenario)
        self.points, self.speed = 0, 1.0

    def relief_seconds(self, octaves: int) -> float:
        """Return what octaves cost beyond the two that are timed with the scan, s.

        The table has processor seconds, and `speed` is a second here for one of the table's cores together.
        """
        extra = nearest(self.prior.octave, octaves) - nearest(self.prior.octave, 2)
        return max(0.0, extra) * 1e-6 * self.points * self.speed / self.prior.cores

    def colour_cost(self, pilot: Pilot, changes: Mapping[str, Any]) -> float:
        """Return what a source of colours costs in megapixels, which is the same on every machine."""
        source = changes["colour.source"]
        if source == "images":
            count, megapixels = image_counts(pilot, changes, self.wanted)
            return 1.0 + _IMAGE * count + megapixels
        return 0.0 if source == "material" else _RETURN * 1e-6 * pulses_of(pilot)

    def colour_seconds(
        self, pilot: Pilot, changes: Mapping[str, Any], timing: tuple[float, float, float]
    ) -> float:
        """Return what a source of colours costs, s.

        Args:
            pilot: of a scene.
            changes: see `knobs.colour_choices`.
            timing: seconds before the first image, of each image, and of each megapixel.
        """
        source = changes["colour.source"]
        if source == "material":
            return 0.0
        sampling = 1e-6 * self.prior.sample[source] * self.points * self.speed
        if source != "images":
            return sampling
        count, megapixels = image_counts(pilot, changes, self.wanted)
        return timing[0] + timing[1] * count + timing[2] * megapixels + sampling

    def build_seconds(self, number: int) -> float:
        """Return the seconds of building a model: the first, with few plants, or the last, with all."""
        return 1e-6 * self.prior.model[number] * self.area * self.speed

    def apart(self) -> float:
        """Return the seconds of what no knob changes, beyond the scan."""
        outputs = self.scenario.outputs
        seconds = 1e-6 * self.prior.scene_file * self.area if "scene" in outputs else 0.0
        seconds += 1e-6 * self.prior.previews * self.points if "previews" in outputs else 0.0
        return seconds * self.speed

    def path_pulses(self) -> int:
        """Return how many pulses the whole path has."""
        setting = scanner_setting(self.scenario.scan)
        return sum(shot_count(setting, strip.duration) for strip in self.path.strips)


def pulses_of(pilot: Pilot) -> int:
    """Return how many pulses a pilot's whole path has."""
    return sum(pilot.scan.pulses(strip) for strip in pilot.scan.path.strips)


def nearest(table: Mapping[str, Any], number: int) -> Any:
    """Return the row of the number nearest to one."""
    return table[min(table, key=lambda key: abs(int(key) - number))]
