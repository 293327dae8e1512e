"""Effects between tracing and returns, such as drops in the air, that change a pulse's echoes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .devices.device import ScannerSetting

Float = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class PulseHits:
    """Hits of the K rays of each of P pulses, before returns are formed of them.

    Brightness is the share of the pulse's energy that a surface sends back: 1 for an ideal white target that all of
    the beam strikes at a right angle. What it makes of the intensity, by range and weather, isn't in it.

    Attributes:
        time: (P,) s since the first strip's start.
        origin: (3, P) where each pulse leaves the scanner, local, m.
        direction: (3, P) unit vectors of the beam's axis.
        share: (K,) of the pulse's energy that each ray stands for; they add up to 1.
        distance: (K, P) range of what each ray meets first, m; inf where there is nothing within reach.
        brightness: (K, P) of that; 0 where there is nothing.
        behind_pulse, behind_ray: (B,) pulse and ray of what lies behind leaves and the like, and of echoes that
            effects before this one have added.
        behind_distance, behind_brightness: (B,) of these.
        setting: the scanner's.
    """

    time: Float
    origin: Float
    direction: Float
    share: Float
    distance: Float
    brightness: Float
    behind_pulse: Index
    behind_ray: Index
    behind_distance: Float
    behind_brightness: Float
    setting: ScannerSetting


def _no_index() -> Index:
    return np.empty(0, dtype=np.intp)


def _no_float() -> Float:
    return np.empty(0)


@dataclass(frozen=True)
class EchoChanges:
    """Changes that an effect makes to the pulses of a block.

    Attributes:
        pulse, ray: (N,) pulse and ray of each echo that is added, as indices into `PulseHits.distance`.
        distance: (N,) range of these, m; those that the scanner doesn't record are left out.
        brightness: (N,) of these, see `PulseHits`.
        transmission: (K, P) factor on the brightness of all that a ray meets, 0 to 1; what is left with 0 isn't met
            at all. None leaves everything as bright as it is. It doesn't apply to the echoes that are added here.
    """

    pulse: Index = field(default_factory=_no_index)
    ray: Index = field(default_factory=_no_index)
    distance: Float = field(default_factory=_no_float)
    brightness: Float = field(default_factory=_no_float)
    transmission: Float | None = None


class EchoEffect(Protocol):
    """Something that adds echoes to pulses, or weakens what they meet.

    It is called from several threads, for blocks in any order, so it must keep nothing from one call to the next.
    """

    @property
    def name(self) -> str:
        """Return the name by which its random numbers are keyed: another name gives others."""
        ...

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the changes for a block of pulses.

        Args:
            hits: what the pulses meet; of one block, pulses that meet nothing included.
            random: random numbers of this effect and this block, the same in whatever order blocks are scanned.
        """
        ...
