"""Forecast of a scan before it begins: pulses, time, memory; and the refusal of one that nobody can have meant."""

from dataclasses import dataclass

from ..base.errors import InputError
from ..base.machine import available_cores, physical_memory
from .blocks import Blocks

MOST_PULSES = 5_000_000_000
"""Pulses of a scan that isn't said to be a large one: 200 times the demo job's, hours of the fastest scanner."""
_PULSE, _RAY = 4e-6, 0.4e-6
"""Seconds of one core for a pulse and for each of its rays, with colours and LAZ, as the demo job takes them."""
_BASE, _TRIANGLE, _THREAD = 4e8, 350.0, 5e8
"""Bytes of memory: of the program, of a triangle with the tree above it, of a block that is being worked on."""
_POINT = 10.0
"""Bytes of a point in LAZ, as the demo job has them."""


@dataclass(frozen=True)
class ScanForecast:
    """Expected size and cost of a scan, to the order of magnitude.

    Attributes:
        pulses: of all strips.
        seconds: on this machine.
        memory: bytes.
        scene_memory: bytes of these that the scene takes.
    """

    pulses: int
    seconds: float
    memory: float
    scene_memory: float

    def text(self) -> str:
        """Return the forecast in words: pulses, LAZ size, computing time and memory."""
        size = self.pulses * _POINT / 1e9
        return (
            f"{self.pulses:,} pulses, so up to about as many points ({size:,.1f} GB as LAZ), in about "
            f"{_duration(self.seconds)} and {self.memory / 1e9:,.1f} GB of memory"
        )


def forecast_scan(cut: Blocks, triangles: int, threads: int = 0) -> ScanForecast:
    """Return the expected pulses, computing time (s) and memory (bytes) of a scan on this machine.

    Args:
        cut: its pulses.
        triangles: of the scene.
        threads: blocks that are worked on at once; 0 for every core.
    """
    pulses = sum(cut.pulse_count(strip) for strip in cut.path.strips)
    workers = threads or available_cores()
    seconds = pulses * (_PULSE + _RAY * cut.rays_per_pulse) / workers
    scene = _TRIANGLE * triangles
    busy = min(workers + 1, cut.count())
    return ScanForecast(pulses, seconds, _BASE + scene + _THREAD * busy, scene)


def check_scan_size(forecast: ScanForecast, most_pulses: int | None = None) -> None:
    """Raise `InputError` if a scan has more pulses than it may or its scene exceeds the machine's memory.

    Args:
        forecast: of the scan.
        most_pulses: pulses that it may have; if None `MOST_PULSES`, and the scene must fit into the machine's memory.

    Raises:
        InputError: it is larger; the message says how long it would take.
    """
    if forecast.pulses > (MOST_PULSES if most_pulses is None else most_pulses):
        allowed = (
            f"{forecast.text()}: --allow-large or a larger number lets it be done; is the scene in another unit, or "
            "does a part of it lie astray?"
        )
        raise InputError("scan.most_pulses", MOST_PULSES if most_pulses is None else most_pulses, allowed)
    memory = physical_memory()
    if most_pulses is None and memory is not None and forecast.scene_memory > memory:
        allowed = (
            f"its triangles take about {forecast.scene_memory / 1e9:,.0f} GB of memory, this machine has "
            f"{memory / 1e9:,.0f} GB: --allow-large tries all the same"
        )
        raise InputError("scene", None, allowed)


def _duration(seconds: float) -> str:
    for unit, size in (("days", 86_400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:,.0f} {unit}"
    return f"{seconds:.0f} s"
