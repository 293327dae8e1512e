"""A scanner's receiver: which echoes it detects, what number it makes of their power, and how well it ranges them.

**Detection.** The receiver's noise adds to the received power of an echo, and what then exceeds the threshold is a
return. With Gaussian noise of the standard deviation s and the threshold T, an echo of the power S is detected with the
probability

    P = Phi((S - T) / s) = Phi((T / s) (S / T - 1))

(Richmond and Cain 2010, Direct-Detection LADAR Systems, SPIE; McManamon 2019, LiDAR Technologies and Systems, SPIE):
one half at the threshold, the more abrupt the larger the threshold-to-noise ratio T / s. Real receivers have ratios of
4 to 7, as the rate of false alarms falls with exp(-(T / s)^2 / 2).

**Response.** See `response`. **Range.** See `range_noise` and `waveform`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ..base.arrays import Float, Float32, Index, UInt8
from ..base.schema import ClosedModel, notes, quantity

MOST_ECHOES = 32
"""Echoes of one pulse of which no two share a random number."""

FEWEST_FREEDOM = 3.0
"""Fewest degrees of freedom of the errors of the range: with 2 or fewer they have no standard deviation."""
Response = Literal["power", "linear", "range_compensated", "logarithmic", "over_threshold"]
EchoSeparation = Literal["resolution", "waveform"]


class Receiver(ClosedModel):
    """How a receiver detects, reads and ranges echoes. What a scenario's doesn't say is its device's."""

    threshold_to_noise: float | None = quantity(
        None,
        "1",
        "Detection threshold over the standard deviation of the receiver's noise, which makes detection a matter of "
        "chance near the threshold; 0: no noise, a hard threshold.",
        (0, 1000),
        title="Threshold to Noise",
        inherits="device.threshold_to_noise",
        unset="No noise",
    )
    overlap_begin: float | None = quantity(
        None,
        "m",
        "Range at which the fields of view of laser and receiver begin to overlap.",
        (0, 20_000),
        inherits="device.overlap_begin",
        unset="From the beginning",
    )
    overlap_full: float | None = quantity(
        None,
        "m",
        "Range from which on they overlap fully; nearer echoes are fainter. 0: everywhere.",
        (0, 20_000),
        inherits="device.overlap_full",
        unset="Everywhere",
    )
    response: Response | None = Field(
        None,
        description="Intensity value of an echo: the received power, or a share of the full scale.",
        json_schema_extra=notes(unset="The device's"),
    )
    bits: int | None = quantity(
        None, "1", "Bits of the number; 16 if device and scenario say nothing.", (1, 16), unset="The device's"
    )
    full_scale: float | None = quantity(
        None,
        "1",
        "Reflectance of a surface struck at a right angle that fills the scale of a range-compensated response; 1.",
        gt=0,
        le=1e4,
        title="Full-Scale Reflectance",
        unset="The device's",
    )
    pedestal: float | None = quantity(
        None,
        "1",
        "Power below which the number is 0, over the detection threshold; it is taken off before the number is made.",
        (0, 1e4),
        inherits="device.pedestal",
        unset="None",
    )
    compression: float | None = quantity(
        None,
        "1",
        "Exponent of a compressive response, to which the share of the full scale is raised; 1: in proportion.",
        (0.05, 1),
        inherits="device.compression",
        unset="In proportion",
    )
    lost_numbers: float | None = quantity(
        None,
        "1",
        "Share of the echoes with intensity 0, independent of their brightness.",
        (0, 1),
        inherits="device.lost_numbers",
        unset="None",
    )
    soft_saturation: float | None = quantity(
        None,
        "1",
        "Exponent of a gradual saturation, the smaller the more gradual; 0: clipped.",
        (0, 20),
        inherits="device.soft_saturation",
        unset="Clipped",
    )
    gain_sigma_db: float | None = quantity(
        None,
        "dB",
        "Standard deviation of the lasers' gains among each other.",
        (0, 10),
        title="Gain of Lasers (dB)",
        inherits="device.gain_sigma_db",
        unset="All alike",
    )
    faint_range_sigma: float | None = quantity(
        None,
        "m",
        "Additional standard deviation of the range of an echo at the detection threshold; less for stronger ones.",
        (0, 10),
        title="Range of Faint Echoes",
        inherits="device.faint_range_sigma",
        unset="None",
    )
    incidence_range_noise: float | None = quantity(
        None,
        "1",
        "Standard deviation of the range over the depth of the beam's footprint on an inclined surface.",
        (0, 2),
        title="Range at a Slant",
        inherits="device.incidence_range_noise",
        unset="None",
    )
    range_walk: float | None = quantity(
        None,
        "m/dB",
        "Decrease of the range for each dB by which speckle and the strip's gain make an echo brighter.",
        (0, 0.1),
        inherits="device.range_walk",
        unset="None",
    )
    range_tails: float | None = quantity(
        None,
        "1",
        "Degrees of freedom of Student's t, which the errors of the range follow; 0: normal ones.",
        (0, 1000),
        inherits="device.range_tails",
        unset="Gaussian",
    )
    range_delay: float | None = quantity(
        None,
        "1",
        "Share of the range's standard deviation that comes of delays, which are exponential: the longer trailing edge "
        "of real pulses. Ranges then are rather too long than too short.",
        (0, 0.95),
        inherits="device.range_delay",
        unset="None",
    )
    echo_separation: EchoSeparation | None = Field(
        None,
        description="Echoes are separated by range resolution only, or where the sum of their pulses has two peaks.",
        json_schema_extra=notes(unset="The device's"),
    )

    @model_validator(mode="after")
    def _check_tails(self) -> Self:
        """Raise ValueError if Student's t would have too few degrees of freedom for a standard deviation."""
        if self.range_tails is not None and 0.0 < self.range_tails < FEWEST_FREEDOM:
            raise ValueError(f"range_tails must be 0, or {FEWEST_FREEDOM:g} or more (not {self.range_tails:g})")
        return self

    def over(self, device: Self) -> Self:
        """Return a receiver that has this one's values where they are set, and the device's elsewhere."""
        set_values = {name: value for name in type(self).model_fields if (value := getattr(self, name)) is not None}
        return device.model_copy(update=set_values)

    def noise_sigma(self, threshold: float) -> float:
        """Return the standard deviation of the noise in the unit of the threshold; 0 without noise."""
        return threshold / self.threshold_to_noise if self.threshold_to_noise else 0.0


EchoValues = tuple[Float32, Float32]
"""Random numbers of a block's echoes: of the first of each pulse (P,), and of all later ones (L,)."""


def draw_values(draw: Callable[[int], Float32], pulses: int) -> EchoValues:
    """Return random numbers of a block's echoes: of the first echo of each pulse, and of all later ones.

    Args:
        draw: returns as many random numbers as it is asked for.
        pulses: number of pulses of the block.
    """
    values = draw(pulses + max(MOST_ECHOES, pulses))
    return values[:pulses], values[pulses:]


def values_of_echoes(values: EchoValues, pulse: Index, number: Index | UInt8) -> Float:
    """Return the random numbers of echoes (N,) out of a block's.

    The first echo of each pulse has a number of its own. The numbers of later echoes are taken from a second array, at
    a place that follows from the pulse; the third and fourth echo of a pulse take theirs a good part of that array away
    from the second one's: no two echoes of one pulse share a number, nor do those of neighbouring pulses.

    Args:
        values: the block's.
        pulse: (N,) within the block.
        number: (N,) of each echo in its pulse, from 1.
    """
    first_values, later_values = values
    result = np.take(first_values, pulse).astype(np.float64)
    later_rows = np.flatnonzero(number > 1)
    shift = (number[later_rows].astype(np.intp) - 2) * (len(later_values) // MOST_ECHOES)
    result[later_rows] = later_values[(pulse[later_rows] + shift) % len(later_values)]
    return result


def number_echoes(pulse: Index) -> Index:
    """Return the number (N,), from 1, that each echo has in its pulse; pulses (N,) are non-decreasing."""
    begins_pulse = np.ones(len(pulse), dtype=bool)
    begins_pulse[1:] = pulse[1:] != pulse[:-1]
    if begins_pulse.all():
        return np.ones(len(pulse), dtype=np.intp)
    starts = np.flatnonzero(begins_pulse)
    start_of_own_pulse = starts[np.cumsum(begins_pulse) - 1]
    return np.asarray(np.arange(len(pulse)) - start_of_own_pulse + 1)
