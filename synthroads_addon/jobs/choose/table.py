"""The shipped table of times and errors, and the times of a job by it at the speed that this machine has shown.

Made by ``python tools/make_tradeoff_prior.py`` on one built-in scenario of each platform.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

from ...base.files import PRESETS
from ...base.schema import read_json
from ...scenario.scenario import Scenario

FILE = PRESETS / "tradeoff_prior.json"
_IMAGE = 0.3
"""Megapixels whose rendering costs as much as it costs to begin an image."""
_RETURN = 1.6
"""Megapixels that cost as much as a million returns with a pixel each."""


@dataclass(frozen=True)
class Table:
    """Shipped table of one platform: errors by `tolerance.KINDS`, and times on the machine that measured them.

    Attributes:
        beam: errors by rays per pulse, among all plants.
        few_plants: errors of one ray among few plants.
        relief: error by octaves.
        colour: errors by name of `knobs.colour_choices`.
        pulse: microseconds per pulse by rays, to the file.
        model: microseconds per square metre of the model, its search trees included: with few plants and with all.
        octave: microseconds per point by octaves.
        image: seconds before the first image, of each image, of each megapixel.
        sample: microseconds per point that takes its colour from images, or is rendered by itself.
        scene_file, previews: microseconds per square metre of the model, and per point.
        cores: that the machine of the measurements used; times per octave are of one of them.
    """

    beam: Mapping[str, Mapping[str, float]]
    few_plants: Mapping[str, float]
    relief: Mapping[str, float]
    colour: Mapping[str, Mapping[str, float]]
    pulse: Mapping[str, float]
    model: tuple[float, float]
    octave: Mapping[str, float]
    image: tuple[float, float, float]
    sample: Mapping[str, float]
    scene_file: float
    previews: float
    cores: int

    def pulse_seconds(self, rays: int) -> float:
        """Return the seconds per pulse for a number of rays, interpolated linearly between measured numbers."""
        rows = sorted((int(number), 1e-6 * value) for number, value in self.pulse.items())
        rays = max(rays, rows[0][0])
        (rays_below, seconds_below), (rays_above, seconds_above) = next(
            (pair for pair in pairwise(rows) if rays <= pair[1][0]), (rows[-2], rows[-1])
        )
        return seconds_below + (seconds_above - seconds_below) * (rays - rays_below) / (rays_above - rays_below)


@cache
def shipped_table(platform: str) -> Table:
    """Return the shipped table of a kind of platform, cached; of the UAV for a kind that has none, as a trajectory."""
    data: dict[str, Any] = read_json(FILE)
    platforms = data["platforms"]
    return Table(**platforms.get(platform, platforms["uav"]), cores=data["cores"])


def nearest_row(rows: Mapping[str, Any], number: int) -> Any:
    """Return the value whose key, a number as text, is nearest to a number."""
    return rows[min(rows, key=lambda key: abs(int(key) - number))]


@dataclass
class JobTimes:
    """Expected seconds of a job's parts on this machine: the table's times scaled by short runs.

    Attributes:
        table: the platform's.
        area: of the model, m2.
        pulses: of the whole path.
        points: of the whole scan, once they are known.
        speed: seconds here for a second of the table, once that is known.
        timed: seconds of the whole scan by rays per pulse, projected from short runs.
        relief: octaves of the relief that were timed, and the seconds of the whole scan that they take beyond two; None
            before.
    """

    table: Table
    area: float
    pulses: int
    points: int = 0
    speed: float = 1.0
    timed: dict[int, float] = field(default_factory=dict)
    relief: tuple[int, float] | None = None

    def calibrate(self, rays: int, seconds: float, points: int) -> None:
        """Set the number of points, and the machine's speed, from a timed scan with a number of rays per pulse."""
        self.speed = seconds / max(self._table_seconds(rays), 1e-9)
        self.points = points
        self.timed[rays] = seconds

    def scan_seconds(self, rays: int) -> float:
        """Return the seconds of the scan into files, with the coarsest relief and the materials' mean colours.

        Of two timed scans the table only says how far between or beyond them a number of rays lies.
        """
        seconds = self._table_seconds(rays)
        if len(self.timed) > 1:
            (few_rays, few_seconds), *_, (many_rays, many_seconds) = sorted(self.timed.items())
            table_few, table_many = self._table_seconds(few_rays), self._table_seconds(many_rays)
            if table_few < table_many and few_seconds < many_seconds:  # else the clock or the table shows no difference
                return few_seconds + (many_seconds - few_seconds) * (seconds - table_few) / (table_many - table_few)
        return seconds * self.speed

    def _table_seconds(self, rays: int) -> float:
        """Return the seconds of the whole scan on the table's machine for a number of rays per pulse."""
        return self.pulses * self.table.pulse_seconds(rays)

    def model_seconds(self, number: int) -> float:
        """Return the seconds expected here for building a model: number 0 is the one with few plants, 1 with all."""
        return 1e-6 * self.table.model[number] * self.area * self.speed

    def relief_seconds(self, octaves: int) -> float:
        """Return the additional seconds of a micro-relief with so many octaves, beyond the two included in the scan.

        Where some were timed the table only says how others compare to them. It has processor seconds, and `speed` is a
        second here for one of the table's cores together.
        """
        if self.relief is not None and (timed_cost := self._extra_octaves(self.relief[0])) > 0.0:
            return self.relief[1] * self._extra_octaves(octaves) / timed_cost
        return self._extra_octaves(octaves) * 1e-6 * self.points * self.speed / self.table.cores

    def _extra_octaves(self, octaves: int) -> float:
        """Return the table's microseconds per point that octaves cost beyond the two that every scan has."""
        return max(0.0, nearest_row(self.table.octave, octaves) - nearest_row(self.table.octave, 2))

    def colour_seconds(self, source: str, images: int, megapixels: float) -> float:
        """Return the additional seconds of a colour source beyond the materials' mean colours."""
        if source == "material":
            return 0.0
        seconds_before, seconds_per_image, seconds_per_megapixel = (
            self.table.image if source == "images" else (0.0, 0.0, 0.0)
        )
        rendering_seconds = seconds_before + seconds_per_image * images + seconds_per_megapixel * megapixels
        return (rendering_seconds + 1e-6 * self.table.sample[source] * self.points) * self.speed

    def colour_cost(self, source: str, images: int, megapixels: float) -> float:
        """Return a colour source's cost in megapixels rendered, independent of the machine."""
        if source == "images":
            return 1.0 + _IMAGE * images + megapixels
        return 0.0 if source == "material" else _RETURN * 1e-6 * self.pulses

    def other_seconds(self, scenario: Scenario) -> float:
        """Return the seconds of outputs that no choice affects: scene file and previews."""
        seconds = 1e-6 * self.table.scene_file * self.area if "scene" in scenario.outputs else 0.0
        seconds += 1e-6 * self.table.previews * self.points if "previews" in scenario.outputs else 0.0
        return seconds * self.speed
