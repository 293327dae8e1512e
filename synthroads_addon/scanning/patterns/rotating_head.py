"""Several beams on a head that turns."""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...base.rotations import wrap_angle
from .base import FULL_TURN, Numbers, Pattern, PulseRays, PulseTiming

_Elevation = Annotated[float, Field(strict=True, gt=-90, lt=90)]
_Azimuth = Annotated[float, Field(strict=True, ge=-180, le=180)]
_Microseconds = Annotated[float, Field(strict=True, ge=0, le=1e6)]


class RotatingHead(Pattern):
    """Several beams, each at its elevation, on a head that turns about the body's vertical axis, to the right.

    A line is a turn of the head. All beams fire once per firing sequence, which lasts beams / pulse rate.
    """

    order: ClassVar[int] = 6
    type: Literal["rotating_head"] = "rotating_head"
    elevations_deg: tuple[_Elevation, ...] = Field(
        min_length=1,
        max_length=256,
        description="Elevation of each beam above the horizon; its place in the list is its channel.",
        json_schema_extra={"unit": "deg"},
    )
    azimuths_deg: tuple[_Azimuth, ...] | None = Field(
        None,
        description="How far to the right of the head's direction each beam points; straight on if not given.",
        json_schema_extra={"unit": "deg"},
    )
    firing_times_us: tuple[_Microseconds, ...] | None = Field(
        None,
        description="When each beam fires within the sequence; one after the other at equal intervals if not given.",
        json_schema_extra={"unit": "us"},
    )

    @model_validator(mode="after")
    def _check_beams(self) -> Self:
        """Raise ValueError unless azimuths and firing times, where they are given, are as many as the beams."""
        for name, values, quantity_name in (
            ("azimuths_deg", self.azimuths_deg, "angles"),
            ("firing_times_us", self.firing_times_us, "times"),
        ):
            if values is not None and len(values) != self.beams:
                raise ValueError(f"{name} must be {self.beams} {quantity_name}, one for each beam (not {len(values)})")
        return self

    @property
    def beams(self) -> int:
        """Return the number of beams, each of which fires once per step."""
        return len(self.elevations_deg)

    def sweep(self, field_of_view: float) -> float:
        """Return a full turn (rad) times the number of beams, as all pulses of a sequence share an angle step."""
        return FULL_TURN * self.beams

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the time, 0 to 1, in which the head fires: field of view / full turn."""
        return field_of_view / FULL_TURN

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Return a message if a beam would fire after the end of its firing sequence, else an empty string."""
        sequence = self.beams / pulse_rate * 1e6
        if self.firing_times_us and max(self.firing_times_us) >= sequence:
            return f"goes with a firing sequence of {sequence:.4g} us: a beam fires after its end"
        return ""

    def rays(self, timing: PulseTiming, pulse: Numbers, with_frame: bool) -> PulseRays:
        """Return times, directions and beams of a rotating head's pulses by their numbers (P,).

        Turn k begins at k / lines per second. Its S firing sequences begin a step apart, from S / 2 steps left of the
        forward direction on; the head turns on while the beams of a sequence fire. A head that goes by a clock of its
        own begins up to half a step earlier or later in each turn.
        """
        sequence_time = self.beams / timing.pulse_rate
        beam_delays = np.arange(self.beams) * (sequence_time / self.beams)  # within the sequence, s
        if self.firing_times_us is not None:
            beam_delays = np.array(self.firing_times_us) * 1e-6
        firing_order = np.argsort(beam_delays, kind="stable")
        turn, pulse_in_turn = np.divmod(pulse, timing.pulses_per_line)
        sequence, place_in_sequence = np.divmod(pulse_in_turn, self.beams)
        beam = firing_order[place_in_sequence]
        time_in_turn = sequence * sequence_time + beam_delays[beam]
        step = sequence - timing.pulses_per_line / self.beams / 2.0  # from the forward direction
        turn_delay = timing.delays(turn)
        if turn_delay is not None:
            time_in_turn, step = time_in_turn + turn_delay * sequence_time, step + (turn_delay - 0.5)
        azimuth = step * timing.angle_step + beam_delays[beam] * (FULL_TURN * timing.lines_per_second)
        if self.azimuths_deg is not None:
            azimuth = azimuth + np.deg2rad(self.azimuths_deg)[beam]
        if self.azimuths_deg is not None or turn_delay is not None:
            azimuth = wrap_angle(azimuth)
        elevation = np.deg2rad(self.elevations_deg)
        vertical, horizontal = np.sin(elevation)[beam], np.cos(elevation)[beam]
        sine, cosine = np.sin(azimuth), np.cos(azimuth)
        time = turn / timing.lines_per_second + time_in_turn
        direction = np.stack([horizontal * cosine, -horizontal * sine, vertical])
        if not with_frame:
            return PulseRays(time, azimuth, direction, beam=beam)
        # Axes across the beam: to the right along the turn, and up.
        in_plane = np.stack([-sine, -cosine, np.zeros_like(sine)])
        across = np.stack([-vertical * cosine, vertical * sine, horizontal])
        return PulseRays(time, azimuth, direction, in_plane, across, beam)
