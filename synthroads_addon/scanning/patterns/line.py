"""Base of the patterns of lines across the forward direction."""

from __future__ import annotations

import math

import numpy as np

from ...base.schema import quantity
from .base import Float, Numbers, Pattern, PulseRays, PulseTiming


class LinePattern(Pattern):
    """A pattern of lines across the forward direction, centred on an angle from the nadir."""

    centre_from_nadir_deg: float = quantity(
        0.0, ge=-180, le=180, unit="deg", description="Middle of the field of view, to the right of the nadir."
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the field of view: a line is swept with every pulse."""
        return field_of_view

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Refuse angles beyond the zenith."""
        largest = abs(self.centre_from_nadir_deg) + field_of_view_deg / 2.0
        return f"reaches {largest:g} deg from the nadir, beyond 180" if largest > 180.0 + 1e-9 else ""

    def rays(self, timing: PulseTiming, pulse: Numbers, with_frame: bool) -> PulseRays:
        """Return pulses of lines across the forward direction.

        Line k begins at k / lines per second, and its N pulses follow at the pulse rate. Pulse j is j - (N - 1) / 2
        steps from the middle of the field of view.
        """
        line, within = np.divmod(pulse, timing.pulses_per_line)
        time = line / timing.lines_per_second + within / timing.pulse_rate
        angle = self.angles(timing, line, within - (timing.pulses_per_line - 1) / 2.0)
        angle += math.radians(self.centre_from_nadir_deg)
        return make_rays(time, angle, self.tilts(line), with_frame)

    def angles(self, timing: PulseTiming, line: Numbers, place: Float) -> Float:
        """Return the angles (P,) of pulses from the middle of the field of view, rad.

        Args:
            timing: the head's.
            line: (P,) number of each pulse's line.
            place: (P,) how many pulses each is after the middle of its line.
        """
        return place * timing.angle_step

    def tilts(self, line: Numbers) -> Float | None:
        """Return the angles (P,) by which the planes of lines are tilted forward, rad; None if none is."""
        return None


def make_rays(time: Float, angle: Float, forward: Float | None, with_frame: bool) -> PulseRays:
    """Return rays at angles (P,) from the nadir, in planes that are tilted forward by angles (P,), None for 0.

    direction = cos(angle) down + sin(angle) right, where down = (sin(forward), 0, -cos(forward)).
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    nodding = (0.0, 1.0) if forward is None else (np.sin(forward), np.cos(forward))
    direction = np.empty((3, len(angle)))
    np.multiply(cosine, nodding[0], out=direction[0])
    np.negative(sine, out=direction[1])
    np.multiply(cosine, -nodding[1], out=direction[2])
    if not with_frame:
        return PulseRays(time, angle, direction)
    in_plane, across = np.empty_like(direction), np.zeros_like(direction)
    np.multiply(sine, -nodding[0], out=in_plane[0])
    np.negative(cosine, out=in_plane[1])
    np.multiply(sine, nodding[1], out=in_plane[2])
    across[0], across[2] = nodding[1], nodding[0]
    return PulseRays(time, angle, direction, in_plane, across)
