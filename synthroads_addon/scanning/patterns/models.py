"""How a scanner deflects its beam: the part of a device preset that each scan pattern needs.

Angles of a line are counted from the nadir, positive to the right of the forward direction; azimuths of a rotating head
from the forward direction, positive to the right. The functions of `scanning.patterns` turn a model into directions.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from ...base.schema import Model, quantity

FULL_TURN = 2.0 * math.pi


class _Pattern(Model):
    """What every pattern says of itself.

    Attributes:
        beams: pulses that share one step of the mirror or of the head.
        fixed_view: the optics alone decide on the field of view: it can't be narrowed.
    """

    fixed_view: ClassVar[bool] = False

    @property
    def beams(self) -> int:
        return 1

    def sweep(self, field_of_view: float) -> float:
        """Return the angle (rad) swept per line at the speed of the line's middle: step = sweep x lines/s / rate."""
        raise NotImplementedError

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the time, 0 to 1, in which the laser fires."""
        return 1.0

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Return why the pattern can't have a field of view (deg) and a pulse rate (1/s), or an empty string."""
        return ""


class _Line(_Pattern):
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


class RotatingMirror(_Line):
    """A mirror that turns at a constant rate; the laser fires only while the beam is within the field of view.

    With one face the beam turns by 360 degrees from one line to the next. A mirror with several faces turns it by less:
    a share field of view / turn per line of all pulses is fired.
    """

    type: Literal["rotating_mirror"] = "rotating_mirror"
    turn_per_line_deg: float = quantity(
        360.0, gt=0, le=360, unit="deg", description="Angle by which the beam turns from one line to the next."
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the turn per line."""
        return math.radians(self.turn_per_line_deg)

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the turn that lies within the field of view."""
        return field_of_view / math.radians(self.turn_per_line_deg)

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Refuse a field of view wider than the turn."""
        if field_of_view_deg > self.turn_per_line_deg + 1e-9:
            return f"is wider than the {self.turn_per_line_deg:g} deg that the beam turns per line"
        return super().fault(field_of_view_deg, pulse_rate)


class PolygonMirror(_Line):
    """A polygon of mirrors, each of whose facets sweeps the whole field of view with every pulse."""

    type: Literal["polygon_mirror"] = "polygon_mirror"


class OscillatingMirror(_Line):
    """A mirror that swings to and fro; a line is one swing, so that two lines are a period of the motion."""

    type: Literal["oscillating_mirror"] = "oscillating_mirror"
    motion: Literal["triangular", "sinusoidal"] = Field(
        "triangular", description="At a constant rate, turning back at once; or as a sine of time."
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the field of view; a sine is pi / 2 times as fast in the middle as on average."""
        return field_of_view * (0.5 * math.pi if self.motion == "sinusoidal" else 1.0)


class Grid(_Line):
    """Rows of equal angle steps, one after the other: a line is a row, whose plane is tilted forward row by row."""

    type: Literal["grid"] = "grid"
    rows: int = quantity(ge=1, le=100_000, unit="1", description="Rows of a frame, from the rearmost to the foremost.")
    along_field_deg: float = quantity(
        ge=0, le=170, unit="deg", description="Field of view along the forward direction, centred on the nadir."
    )


class Wedge(Model):
    """A rotating glass wedge: light enters through the face across the axis and leaves through the inclined one."""

    angle_deg: float = quantity(gt=0, le=60, unit="deg", description="Angle between the two faces.")
    refractive_index: float = quantity(gt=1, le=4, unit="1", description="Refractive index at the wavelength.")
    turns: int = quantity(
        ge=-1_000_000, le=1_000_000, unit="1", description="Turns, to the right, in the time of the other's turns."
    )

    @model_validator(mode="after")
    def _turning(self) -> Wedge:
        if self.turns == 0:
            raise ValueError("turns must not be 0")
        return self


class WedgePrism(_Pattern):
    """One wedge (a cone) or two (a rosette) about an axis that points to the nadir.

    A line is a turn of the first wedge. The pulses follow each other without pause.
    """

    type: Literal["wedge_prism"] = "wedge_prism"
    fixed_view: ClassVar[bool] = True
    wedges: tuple[Wedge, ...] = Field(min_length=1, max_length=2, description="Wedges in the order of the light.")

    def sweep(self, field_of_view: float) -> float:
        """Return a turn of the first wedge."""
        return FULL_TURN

    def largest_deflection(self) -> float:
        """Return the largest angle (rad) between beam and axis: all wedges deflect to the same side; NaN if none does.

        In that plane, with a wedge's angle a and index n, a beam at d to the axis leaves at
        asin(n sin(a + asin(sin d / n))) - a (Snell's law at both faces).
        """
        deflection = 0.0
        for wedge in self.wedges:
            apex, index = math.radians(wedge.angle_deg), wedge.refractive_index
            sine = index * math.sin(apex + math.asin(math.sin(deflection) / index))
            if sine >= 1.0:
                return math.nan
            deflection = math.asin(sine) - apex
        return deflection

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Refuse total reflection, beams beyond the horizon, and a field of view that isn't the wedges'."""
        view = 2.0 * math.degrees(self.largest_deflection())
        if not view < 180.0:
            return "can't be seen through these wedges: they reflect the beam or turn it back"
        if not math.isclose(view, field_of_view_deg, abs_tol=0.05):
            return f"isn't that of the wedges, {view:.2f} deg"
        return ""


_Elevation = Annotated[float, Field(strict=True, gt=-90, lt=90)]
_Microseconds = Annotated[float, Field(strict=True, ge=0, le=1e6)]


class RotatingHead(_Pattern):
    """Several beams, each at its elevation, on a head that turns about the body's vertical axis, to the right.

    A line is a turn of the head. All beams fire once per firing sequence, which lasts beams / pulse rate.
    """

    type: Literal["rotating_head"] = "rotating_head"
    elevations_deg: tuple[_Elevation, ...] = Field(
        min_length=1,
        max_length=256,
        description="Elevation of each beam above the horizon; its place in the list is its channel.",
        json_schema_extra={"unit": "deg"},
    )
    firing_times_us: tuple[_Microseconds, ...] | None = Field(
        None,
        description="When each beam fires within the sequence; one after the other at equal intervals if not given.",
        json_schema_extra={"unit": "us"},
    )

    @model_validator(mode="after")
    def _a_time_for_each(self) -> RotatingHead:
        if self.firing_times_us is not None and len(self.firing_times_us) != len(self.elevations_deg):
            raise ValueError(f"firing_times_us must be {len(self.elevations_deg)} times, one for each beam")
        return self

    @property
    def beams(self) -> int:
        """Return the number of beams, each of which fires once per step."""
        return len(self.elevations_deg)

    def sweep(self, field_of_view: float) -> float:
        """Return a turn for each beam, as the pulses of a sequence share a step."""
        return FULL_TURN * self.beams

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the turn that lies within the field of view."""
        return field_of_view / FULL_TURN

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Refuse firing times that don't fit into the sequence."""
        sequence = self.beams / pulse_rate * 1e6
        if self.firing_times_us and max(self.firing_times_us) >= sequence:
            return f"goes with a firing sequence of {sequence:.4g} us: a beam fires after its end"
        return ""


PatternModel = Annotated[
    RotatingMirror | PolygonMirror | OscillatingMirror | Grid | WedgePrism | RotatingHead, Field(discriminator="type")
]
