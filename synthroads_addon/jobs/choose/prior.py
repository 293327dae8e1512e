"""What settings cost and how large their errors are where nothing was measured: the shipped table.

Made by ``python tools/make_tradeoff_prior.py`` on one built-in scenario of each platform.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from ...base.files import PRESETS
from ...base.schema import read_json

FILE = PRESETS / "tradeoff_prior.json"


@dataclass(frozen=True)
class Prior:
    """Errors by `tolerance.KINDS`, and seconds on the machine that they were measured on.

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
        """Return the seconds of a pulse of so many rays, linear between what was measured."""
        known = sorted((int(number), 1e-6 * value) for number, value in self.pulse.items())
        if rays <= known[0][0]:
            return known[0][1]
        (a, low), (b, high) = next(
            (pair for pair in pairwise(known) if rays <= pair[1][0]), (known[-2], known[-1])
        )
        return low + (high - low) * (rays - a) / (b - a)


@cache
def prior_of(platform: str) -> Prior:
    """Return the table of a kind of platform; a trajectory has the UAV's."""
    data: dict[str, Any] = read_json(FILE)
    platforms = data["platforms"]
    return Prior(**platforms.get(platform, platforms["uav"]), cores=data["cores"])
