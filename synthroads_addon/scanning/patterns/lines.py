"""Patterns of lines across the forward direction: mirrors that turn or swing, and rows of a grid."""

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .base import Numbers, Pattern, PulseRays, PulseTiming


class LinePattern(Pattern):
    """A pattern of lines across the forward direction, centred on an angle from the nadir."""

    centre_from_nadir_deg: float = quantity(
        0.0, "deg", "Middle of the field of view, to the right of the nadir.", (-180, 180)
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the angle swept per line, rad: the field of view, as the laser fires all along the line."""
        return field_of_view

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Return a message if the field of view reaches beyond the zenith, else an empty string."""
        largest_angle = abs(self.centre_from_nadir_deg) + field_of_view_deg / 2.0
        return f"reaches {largest_angle:g} deg from the nadir, beyond 180" if largest_angle > 180.0 + 1e-9 else ""

    def rays(self, timing: PulseTiming, pulse: Numbers, with_frame: bool) -> PulseRays:
        """Return times and directions of the pulses with numbers (P,), in lines across the forward direction.

        Line k begins at k / lines per second, and its N pulses follow at the pulse rate. Pulse j is j - (N - 1) / 2
        steps from the middle of the field of view; where the mirror goes by a clock of its own, up to half a step to
        either side of that.
        """
        line, pulse_in_line = np.divmod(pulse, timing.pulses_per_line)
        place = pulse_in_line - (timing.pulses_per_line - 1) / 2.0  # steps from the middle
        delays = timing.delays(line)
        if delays is not None:
            pulse_in_line, place = pulse_in_line + delays, place + (delays - 0.5)
        time = line / timing.lines_per_second + pulse_in_line / timing.pulse_rate
        angle = self.angles(timing, line, place)
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


class RotatingMirror(LinePattern):
    """A mirror that turns at a constant rate; the laser fires only while the beam is within the field of view.

    With one face the beam turns by 360 degrees from one line to the next. A mirror with several faces turns it by less:
    a share field of view / turn per line of all pulses is fired.
    """

    order: ClassVar[int] = 1
    type: Literal["rotating_mirror"] = "rotating_mirror"
    turn_per_line_deg: float = quantity(
        360.0, "deg", "Angle by which the beam turns from one line to the next.", gt=0, le=360
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the angle by which the beam turns per line, rad."""
        return math.radians(self.turn_per_line_deg)

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the time, 0 to 1, in which the beam is within the field of view and the laser fires."""
        return field_of_view / math.radians(self.turn_per_line_deg)

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Return a message if the field of view exceeds the turn per line or passes the zenith, else an empty text."""
        if field_of_view_deg > self.turn_per_line_deg + 1e-9:
            return f"is wider than the {self.turn_per_line_deg:g} deg that the beam turns per line"
        return super().fault(field_of_view_deg, pulse_rate)


class PolygonMirror(LinePattern):
    """A polygon of mirrors, each of whose facets sweeps the whole field of view with every pulse."""

    order: ClassVar[int] = 2
    type: Literal["polygon_mirror"] = "polygon_mirror"


class OscillatingMirror(LinePattern):
    """A mirror that swings to and fro; a line is one swing, so that two lines are a period of the motion."""

    order: ClassVar[int] = 3
    type: Literal["oscillating_mirror"] = "oscillating_mirror"
    motion: Literal["triangular", "sinusoidal"] = Field(
        "triangular", description="At a constant rate, turning back at once; or as a sine of time."
    )

    @property
    def cycle_lines(self) -> int:
        """Return 2, the lines after which the directions repeat: the swings alternate."""
        return 2

    def sweep(self, field_of_view: float) -> float:
        """Return the angle per line at mid-line speed, rad: the field of view, or pi / 2 times it for a sine."""
        return field_of_view * (0.5 * math.pi if self.motion == "sinusoidal" else 1.0)

    def angles(self, timing: PulseTiming, line: Numbers, place: Float) -> Float:
        """Return the angles (P,) from the field's middle, rad, every second line reversed; overwrites `place`."""
        np.negative(place, where=line % 2 == 1, out=place)
        if self.motion == "triangular":
            return super().angles(timing, line, place)
        swing = place * (math.pi * timing.lines_per_second / timing.pulse_rate)
        return timing.field_of_view / 2.0 * np.sin(swing)


class Grid(LinePattern):
    """Rows of equal angle steps, one after the other: a line is a row, whose plane is tilted forward row by row."""

    order: ClassVar[int] = 4
    type: Literal["grid"] = "grid"
    rows: int = quantity(..., "1", "Rows of a frame, from the rearmost to the foremost.", (1, 100_000))
    along_field_deg: float = quantity(
        ..., "deg", "Field of view along the forward direction, centred on the nadir.", (0, 170)
    )

    @property
    def cycle_lines(self) -> int:
        """Return the rows of a frame, after which the directions repeat."""
        return self.rows

    def tilts(self, line: Numbers) -> Float:
        """Return the angles (P,) by which the planes of rows are tilted forward, rad."""
        row = line % self.rows - (self.rows - 1) / 2.0
        return row * (math.radians(self.along_field_deg) / self.rows)


def make_rays(time: Float, angle: Float, tilt: Float | None, with_frame: bool) -> PulseRays:
    """Return rays at angles from the nadir, in planes across the forward direction that are tilted forward.

    direction = cos(angle) down + sin(angle) right, where down = (sin(tilt), 0, -cos(tilt)) and right = (0, -1, 0).

    Args:
        time: (P,) s.
        angle: (P,) positive to the right, rad.
        tilt: (P,) rad; None for 0.
        with_frame: whether the axes across the beam are worked out.
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    tilt_sine, tilt_cosine = (0.0, 1.0) if tilt is None else (np.sin(tilt), np.cos(tilt))
    direction = np.empty((3, len(angle)))
    np.multiply(cosine, tilt_sine, out=direction[0])
    np.negative(sine, out=direction[1])
    np.multiply(cosine, -tilt_cosine, out=direction[2])
    if not with_frame:
        return PulseRays(time, angle, direction)
    # in_plane is the direction's derivative by the angle, across the plane's normal.
    in_plane, across = np.empty_like(direction), np.zeros_like(direction)
    np.multiply(sine, -tilt_sine, out=in_plane[0])
    np.negative(cosine, out=in_plane[1])
    np.multiply(sine, tilt_cosine, out=in_plane[2])
    across[0], across[2] = tilt_cosine, tilt_sine
    return PulseRays(time, angle, direction, in_plane, across)
