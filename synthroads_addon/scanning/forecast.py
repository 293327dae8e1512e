"""Forecast of a scan before it begins: pulses, time, memory; and the refusal of one that nobody can have meant."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..base.errors import InputError
from ..base.machine import available_cores, free_cores, physical_memory, share_of_core
from ..base.progress import duration
from .blocks import Blocks

MOST_PULSES = 5_000_000_000
"""Pulses of a scan that isn't said to be a large one: 200 times the demo job's, hours of the fastest scanner."""
_PULSE, _RAY = 1.2e-6, 0.1e-6
"""Seconds of one core for a pulse and for each of its rays, with colours by the materials' nodes, and LAZ.

From docs/benchmark.md: the demo job with 7 rays takes 1.9 us of one core a pulse, of which casting and radiometry take
0.2 us with 1 ray, 0.9 us with 7 and 5.6 us with 61. Pulses into the sky, which have no points, take less.
"""
_RENDERED = 3e-6
"""Seconds of one core that a pulse takes longer if colours are rendered, as images or as a pixel for each return.

From docs/tradeoff.md: 27 to 34 s more than by nodes for the 10 million pulses of a motorway by UAV.
"""
_BASE, _TRIANGLE, _THREAD = 4e8, 350.0, 2.5e8
"""Bytes of memory: of the program, of a triangle with the tree above it, of a block that is being worked on.

Chosen so that the demo job's 1.2 GB on two cores (docs/benchmark.md) are told as 1.7 GB.
"""
_POINT = 13.0
"""Bytes of a point in LAZ with the usual attributes: 10 to 15 in all scenes that were measured."""


LONG = 30.0
"""Expected seconds from which on a scan's forecast is reported unasked: chosen."""
_SHORT = 3.0
"""Expected seconds from which on the forecast takes into account how busy the machine is: chosen."""


@dataclass(frozen=True)
class ScanForecast:
    """Expected size and cost of a scan, to the order of magnitude.

    Attributes:
        pulses: of all strips.
        seconds: on this machine, if it has nothing else to do.
        memory: bytes.
        scene_memory: bytes of these that the scene takes.
        workers: threads that work on it.
    """

    pulses: int
    seconds: float
    memory: float
    scene_memory: float
    workers: int = 1

    def beside_others(self) -> ScanForecast:
        """Return the forecast with the seconds that the scan takes beside the machine's other work of this moment.

        Measuring that work takes 0.1 s; a forecast of less than `_SHORT` seconds is returned as it is.
        """
        if self.seconds < _SHORT:
            return self
        slowdown = free_cores(self.workers, 1.0) / free_cores(self.workers, share_of_core())
        return replace(self, seconds=self.seconds * slowdown)

    @property
    def is_long(self) -> bool:
        """Return whether the scan takes so long that users are told beforehand."""
        return self.seconds >= LONG

    def text(self) -> str:
        """Return the forecast in words: pulses, LAZ size, computing time and memory."""
        size = self.pulses * _POINT
        return (
            f"{self.pulses:,} pulses, so up to about as many points ({_file_size(size)} as LAZ), in about "
            f"{duration(self.seconds)} (0.4 to 1.5 times that) and {self.memory / 1e9:,.1f} GB of memory"
        )


def forecast_scan(division: Blocks, triangles: int, threads: int = 0, rendered: bool = False) -> ScanForecast:
    """Return the expected pulses, computing time (s) and memory (bytes) of a scan on this machine.

    Args:
        division: its pulses.
        triangles: of the scene.
        threads: blocks that are worked on at once; 0 for every core.
        rendered: whether the points' colours are rendered.
    """
    pulses = sum(division.pulse_count(strip) for strip in division.path.strips)
    workers = threads or available_cores()
    seconds_per_pulse = _PULSE + _RAY * division.rays_per_pulse + (_RENDERED if rendered else 0.0)
    seconds = pulses * seconds_per_pulse / free_cores(workers, 1.0)
    scene_memory = _TRIANGLE * triangles
    blocks_at_once = min(workers + 1, division.count())
    return ScanForecast(pulses, seconds, _BASE + scene_memory + _THREAD * blocks_at_once, scene_memory, workers)


def check_scan_size(forecast: ScanForecast, most_pulses: int | None = None) -> None:
    """Raise `InputError` if a scan has more pulses than it may or its scene exceeds the machine's memory.

    Args:
        forecast: of the scan.
        most_pulses: pulses that it may have; if None `MOST_PULSES`, and the scene must fit into the machine's memory.

    Raises:
        InputError: it is larger; the message says how long it would take.
    """
    limit = MOST_PULSES if most_pulses is None else most_pulses
    if forecast.pulses > limit:
        remedy = (
            f"{forecast.text()}: --allow-large or a larger number lets it be done; is the scene in another unit, or "
            "does a part of it lie astray?"
        )
        raise InputError("scan.most_pulses", limit, remedy)
    memory = physical_memory()
    if most_pulses is None and memory is not None and forecast.scene_memory > memory:
        remedy = (
            f"its triangles take about {forecast.scene_memory / 1e9:,.0f} GB of memory, this machine has "
            f"{memory / 1e9:,.0f} GB: --allow-large tries all the same"
        )
        raise InputError("scene", None, remedy)


def _file_size(count: float) -> str:
    """Return a number of bytes in words."""
    return f"{count / 1e9:,.1f} GB" if count >= 1e9 else f"{count / 1e6:,.0f} MB"
