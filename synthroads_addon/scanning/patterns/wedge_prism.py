"""Rotating glass wedges."""

import math
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.schema import Model, quantity
from .base import FULL_TURN, Numbers, Pattern, PulseRays, PulseTiming


class Wedge(Model):
    """A rotating glass wedge: light enters through the face across the axis and leaves through the inclined one."""

    angle_deg: float = quantity(..., "deg", "Angle between the two faces.", gt=0, le=60)
    refractive_index: float = quantity(..., "1", "Refractive index at the wavelength.", gt=1, le=4)
    turns: int = quantity(..., "1", "Turns, to the right, in the time of the other's turns.", (-1_000_000, 1_000_000))

    @model_validator(mode="after")
    def _check_turns(self) -> Self:
        """Raise ValueError if the wedge doesn't turn."""
        if self.turns == 0:
            raise ValueError("turns must not be 0")
        return self


class WedgePrism(Pattern):
    """One wedge (a cone) or two (a rosette) about an axis that points to the nadir.

    A line is a turn of the first wedge. The pulses follow each other without pause.
    """

    order: ClassVar[int] = 5
    type: Literal["wedge_prism"] = "wedge_prism"
    fixed_view: ClassVar[bool] = True
    wedges: tuple[Wedge, ...] = Field(min_length=1, max_length=2, description="Wedges in the order of the light.")

    @property
    def cycle_lines(self) -> int:
        """Return 0: the directions don't repeat."""
        return 0

    def sweep(self, field_of_view: float) -> float:
        """Return the angle that the first wedge turns by per line, rad: a full turn."""
        return FULL_TURN

    def largest_deflection(self) -> float:
        """Return the largest angle between beam and axis, rad, all wedges deflecting alike; NaN at total reflection.

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
        """Return a message if the wedges let no beam through or have another field of view, else an empty string."""
        view = 2.0 * math.degrees(self.largest_deflection())
        if not view < 180.0:
            return "can't be seen through these wedges: they reflect the beam or turn it back"
        if not math.isclose(view, field_of_view_deg, abs_tol=0.05):
            return f"isn't that of the wedges, {view:.2f} deg"
        return ""

    def rays(self, timing: PulseTiming, pulse: Numbers, with_frame: bool) -> PulseRays:
        """Return times and directions of pulses by their numbers (P,), behind one or two rotating wedges.

        Pulse p is fired at p / pulse rate. Wedge i has then turned by p x lines/s x turns_i / (turns_1 x pulse rate)
        turns.
        """
        first_turns = self.wedges[0].turns
        forward, right = np.zeros(len(pulse)), np.zeros(len(pulse))
        for wedge in self.wedges:
            turns = pulse * (timing.lines_per_second * wedge.turns / first_turns / timing.pulse_rate)
            # Only the fraction counts: the sine of a large angle would lose what the product still has.
            phase = FULL_TURN * (turns - np.floor(turns))
            forward, right = _refract(forward, right, phase, math.radians(wedge.angle_deg), wedge.refractive_index)
        down = np.sqrt(1.0 - forward * forward - right * right)
        time, angle = pulse / timing.pulse_rate, np.arctan2(right, down)
        direction = np.stack([forward, -right, -down])
        if not with_frame:
            return PulseRays(time, angle, direction)
        return PulseRays(time, angle, direction, *_carry_axes(forward, right, down))


def _refract(forward: Float, right: Float, phase: Float, apex: float, index: float) -> tuple[Float, Float]:
    """Return the components across the axis (forward, right) of unit vectors after refraction by a rotated wedge.

    Snell's law in vector form: at a face with unit normal N (along the light), u in a medium of index n1 becomes v with
    n2 v = n1 u + k N, k = sqrt(n2^2 - n1^2 + (n1 u.N)^2) - n1 u.N. The first face lies across the axis, so that the
    components across the axis, times the index, stay as they are; the second one's normal leans by the apex angle away
    from the thick side, to which the light is bent. ``phase`` is the thick side's direction, from forward to the right.
    """
    lean_forward, lean_right = -math.sin(apex) * np.cos(phase), -math.sin(apex) * np.sin(phase)
    along_axis = np.sqrt(index * index - forward * forward - right * right)
    along_normal = forward * lean_forward + right * lean_right + math.cos(apex) * along_axis
    push = np.sqrt(1.0 - index * index + along_normal * along_normal) - along_normal
    return forward + push * lean_forward, right + push * lean_right


def _carry_axes(forward: Float, right: Float, down: Float) -> tuple[Float, Float]:
    """Return the right and the forward axis (3, P), rotated from the nadir to each beam by the shortest turn.

    A wedge deflects a beam without turning its cross-section. A vector e across the axis a becomes
    e - (e.d) / (1 + a.d) (a + d) for the direction d.
    """
    share_right, share_forward = right / (1.0 + down), forward / (1.0 + down)
    in_plane = np.stack([-share_right * forward, share_right * right - 1.0, share_right * (1.0 + down)])
    across = np.stack([1.0 - share_forward * forward, share_forward * right, share_forward * (1.0 + down)])
    return in_plane, across
