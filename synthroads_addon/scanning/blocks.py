"""How a scan is cut into blocks of pulses, whatever is scanned."""

from collections.abc import Iterator
from dataclasses import dataclass

from .devices.device import ScannerSetting
from .devices.shots import shot_count, shots
from .platforms.path import Path, Strip

RAYS_PER_BLOCK = 2**18
"""Rays of one block at most; what keeps memory bounded. Fixed, as blocks carry their own random streams."""
SECONDS_PER_BLOCK = 3.0
"""Seconds of one block at most: slow scanners' blocks don't reach far along the road either."""

Block = tuple[Strip, int]
"""A strip, and the number of a block in it."""


@dataclass(frozen=True)
class Blocks:
    """Division of a scan's strips into blocks of a fixed number of pulses.

    Attributes:
        setting: the scanner's.
        path: the scanner's.
        rays_per_pulse: rays that sample a pulse.
    """

    setting: ScannerSetting
    path: Path
    rays_per_pulse: int

    @property
    def size(self) -> int:
        """Return the fixed number of pulses of a block."""
        return max(1, min(RAYS_PER_BLOCK // self.rays_per_pulse, shot_count(self.setting, SECONDS_PER_BLOCK)))

    def pulse_count(self, strip: Strip) -> int:
        """Return the number of pulses fired during a strip, all heads together."""
        return shot_count(self.setting, strip.duration, strip.ends)

    def block_numbers(self, strip: Strip) -> range:
        """Return the range of the numbers of a strip's blocks, from 0."""
        return range(-(-self.pulse_count(strip) // self.size))

    def all(self) -> Iterator[Block]:
        """Yield (strip, number of the block within it) of every block, in the order of time."""
        return ((strip, block) for strip in self.path.strips for block in self.block_numbers(strip))

    def count(self) -> int:
        """Return the number of blocks of all strips."""
        return sum(len(self.block_numbers(strip)) for strip in self.path.strips)

    def pulse_span(self, strip: Strip, block: int) -> tuple[int, int]:
        """Return the number, within its strip, of a block's first pulse, and how many pulses the block has."""
        first_pulse = block * self.size
        return first_pulse, min(self.size, self.pulse_count(strip) - first_pulse)

    def time(self, strip: Strip, pulse: int) -> float:
        """Return the time at which a strip's pulse is fired, s since the first strip's start."""
        return strip.start_time + float(shots(self.setting, pulse, 1, False).time[0])
