"""Base of the scan patterns: the part of a device preset that says how the beam is deflected, and its directions.

Angles of a line are counted from the nadir, positive to the right of the forward direction; azimuths of a rotating head
from the forward direction, positive to the right. Directions are those in the frame of the pattern's head: x forward,
y left, z up. Every pulse is worked out from its own number: nothing is summed up from pulse to pulse, so that the
billionth is as exact as the first.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Int
from ...base.schema import Model

Numbers = Int

FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class PulseTiming:
    """Timing of one head's pulses and scan lines; angles in radians.

    Attributes:
        pulse_rate: pulses per second, all beams together.
        lines_per_second: lines, as the pattern counts them.
        field_of_view: angle within which the head fires.
        angle_step: angle between two pulses, see `Pattern.sweep`.
        pulses_per_line: pulses of a line: a whole number of firing sequences.
        free_mirror: whether mirror and pulses go by clocks of their own.
    """

    pulse_rate: float
    lines_per_second: float
    field_of_view: float
    angle_step: float
    pulses_per_line: int
    free_mirror: bool = False

    def delays(self, line: Numbers) -> Float | None:
        """Return the delays (P,) of lines' first pulses, pseudo-random, 0 to 1 pulse intervals; None without.

        Clocks that run free of each other drift by many steps from line to line, so that a line's delay says nothing of
        the next one's: it is a hash of the line's number.
        """
        return hashed_shares(line) if self.free_mirror else None


@dataclass(frozen=True)
class PulseRays:
    """Times and directions of P pulses, in a head's frame or a whole scanner's; see `devices.shots`.

    Attributes:
        time: (P,) s since the head, or the strip, began to be scanned.
        scan_angle: (P,) rad: across the forward direction from the nadir, positive to the right; a rotating head's
            azimuth from the forward direction, positive to the right. Of the head itself, however it is mounted.
        direction: (3, P) unit vectors of the beam's axis.
        in_plane: (3, P) unit vectors across the beam, in the scan plane (along a rotating head's turn; to the right
            for a wedge prism); None if not asked for.
        across: (3, P) unit vectors across the beam and `in_plane`; None if not asked for.
        beam: (P,) number of the beam: on a head, None if it has only one; of a scanner, that of the beam on its head
            + beams of a head x number of the head.
    """

    time: Float
    scan_angle: Float
    direction: Float
    in_plane: Float | None = None
    across: Float | None = None
    beam: NDArray[np.integer] | None = None


def hashed_shares(number: Numbers) -> Float:
    """Return pseudo-random numbers (P,), uniform over 0 to 1, hashed from integers (SplitMix64, Steele et al. 2014)."""
    bits = (np.asarray(number, dtype=np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    return np.asarray((bits ^ (bits >> np.uint64(31))) * 2.0**-64)


class Pattern(Model):
    """Base of the scan patterns. A pattern's field ``type`` is the name that presets call it by.

    Attributes:
        order: place among the patterns in lists, if it has one; else they are listed by name.
        beams: pulses that share one step of the mirror or of the head.
        fixed_view: the optics alone decide on the field of view: it can't be narrowed.
        cycle_lines: lines after which a head's directions repeat; 0 if they don't.
    """

    fixed_view: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Return the pattern's name in presets, the value of its field ``type``."""
        return str(type(self).model_fields["type"].default)

    @property
    def beams(self) -> int:
        """Return the number of pulses that share one step of the mirror or of the head: here one."""
        return 1

    @property
    def cycle_lines(self) -> int:
        """Return the number of lines after which a head's directions repeat, 0 if they don't: here one."""
        return 1

    def sweep(self, field_of_view: float) -> float:
        """Return the angle (rad) swept per line at the speed of the line's middle.

        A step, from one pulse to the next, is that angle times lines per second / pulse rate.
        """
        raise NotImplementedError

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the time, 0 to 1, in which the laser fires."""
        return 1.0

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Return why the pattern can't have a field of view (deg) and a pulse rate (1/s), or an empty string."""
        return ""

    def rays(self, timing: PulseTiming, pulse: Numbers, with_frame: bool) -> PulseRays:
        """Return times and directions, in the head's frame, of a head's pulses by their numbers (P,) from 0.

        Args:
            timing: the head's.
            pulse: numbers of the pulses.
            with_frame: whether the axes across the beam are wanted.
        """
        raise NotImplementedError
