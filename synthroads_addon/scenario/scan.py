"""`ScanScenario`: how a scene is scanned: device, platform, beam, radiometry, noise."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..base.schema import quantity
from .road import Finite, ScenarioModel

PlatformKind = Literal["uav", "vehicle", "tripod", "airborne", "trajectory"]


class Platform(ScenarioModel):
    """What carries the scanner, and where. What isn't given is usual for its kind (`scanning.platforms.base.USUAL`)."""

    kind: PlatformKind = Field("uav", description="Platform.")
    height: float | None = quantity(
        None, ge=0.1, le=5000, unit="m", description="Height above the road, or above the ground below a tripod."
    )
    speed: float | None = quantity(None, ge=0.1, le=150, unit="m/s", description="Speed over ground.")
    lateral_offsets: tuple[Finite, ...] | None = Field(
        None, min_length=1, max_length=64, description="Offset of each strip from the centreline, m."
    )
    there_and_back: bool = Field(
        True, description="Every second strip against the stations; a vehicle always drives with the traffic."
    )
    path: Literal["direct", "smoothed", "zigzag"] = Field(
        "direct", description="Along the centreline, along a polynomial fitted to it, or swaying about it."
    )
    polynomial_degree: int = quantity(
        3, ge=1, le=9, unit="1", description="Degree of the smoothed path's polynomials."
    )
    zigzag_amplitude: float = quantity(5.0, ge=0, le=500, unit="m", description="Sway to either side.")
    zigzag_wavelength: float = quantity(100.0, ge=5, le=5000, unit="m", description="Length of a sway.")
    stations: tuple[Finite, ...] | None = Field(
        None, min_length=1, max_length=1000, description="Stations of a tripod's positions, m."
    )
    station_spacing: float = quantity(
        80.0, ge=1, le=5000, unit="m", description="Spacing of a tripod's positions where no stations are given."
    )
    turn_seconds: float = quantity(
        60.0, gt=0, le=3600, unit="s", description="Time in which a tripod turns the scanner at each position."
    )
    turn_deg: float = quantity(
        360.0, ge=0, le=360, unit="deg", description="Angle of that turn; 0 for a head that turns by itself."
    )
    file: str | None = Field(None, description="CSV with time, x, y, z, roll, pitch, heading of a trajectory.")
    roll_deg: float = quantity(
        0.0, ge=-180, le=180, unit="deg", description="Mounting of the scanner: about the forward axis."
    )
    pitch_deg: float = quantity(
        0.0, ge=-90, le=90, unit="deg", description="Mounting of the scanner: nose up."
    )
    yaw_deg: float = quantity(
        0.0, ge=-180, le=180, unit="deg", description="Mounting of the scanner: counter-clockwise from above."
    )


class Noise(ScenarioModel):
    """Random errors of the measurement, one sigma each; 0 is none."""

    range_bias: float = quantity(0.0, ge=-1, le=1, unit="m", description="Systematic error of the range.")
    range_sigma: float | None = quantity(
        None, ge=0, le=1, unit="m", description="Standard deviation of the range; the device's if not given."
    )
    angle_sigma_mrad: float = quantity(0.0, ge=0, le=20, unit="mrad", description="Pointing error, each axis.")
    position_sigma: float = quantity(0.0, ge=0, le=10, unit="m", description="Platform's position, each axis.")
    attitude_sigma_deg: float = quantity(0.0, ge=0, le=5, unit="deg", description="Platform's roll and pitch.")
    heading_sigma_deg: float = quantity(0.0, ge=0, le=5, unit="deg", description="Platform's heading.")
    correlation_time: float = quantity(
        30.0, gt=0, le=10_000, unit="s", description="Time in which a platform's errors fall to 1/e of correlation."
    )
    dropout: float = quantity(0.0, ge=0, le=1, unit="1", description="Share of the returns that is lost at random.")


class Weather(ScenarioModel):
    """What attenuates the beam, in place of the road's own weather."""

    condition: Literal["clear", "haze", "fog", "rain", "snow", "dust"] = Field("clear", description="Weather.")
    visibility: float | None = quantity(
        None, ge=20, le=200_000, unit="m", description="Visibility; usual for the condition if not given."
    )
    rate_mm_h: float | None = quantity(
        None, gt=0, le=200, unit="mm/h", description="Rain, or snow as water; instead of the visibility."
    )

    @model_validator(mode="after")
    def _one_measure(self) -> Weather:
        if self.rate_mm_h is not None and self.condition not in ("rain", "snow"):
            raise ValueError(f"rate_mm_h can't be given for {self.condition}")
        if self.rate_mm_h is not None and self.visibility is not None:
            raise ValueError("rate_mm_h and visibility can't both be given")
        return self


_RingRays = Annotated[int, Field(ge=3, le=60)]


class ScanScenario(ScenarioModel):
    """How the road is scanned. What isn't given is the device's own value."""

    device: str = Field("riegl-minivux-3uav", description="Device preset or file.")
    pulse_rate_khz: float | None = quantity(None, gt=0, le=5000, unit="kHz", description="Pulse repetition rate.")
    field_of_view_deg: float | None = quantity(None, gt=0, le=360, unit="deg", description="Field of view.")
    lines_per_second: float | None = quantity(None, gt=0, le=1000, unit="1/s", description="Scan lines per second.")
    angle_step_deg: float | None = quantity(
        None, gt=0, le=90, unit="deg", description="Angle between two pulses; instead of the lines per second."
    )
    platform: Platform = Field(Platform(), description="Platform and path.")
    noise: Noise = Field(Noise(), description="Measurement noise.")
    relief: float = quantity(
        1.0, ge=0, le=100, unit="1", description="Strength of the surfaces' micro-relief in the cloud; 0 is none."
    )
    relief_octaves: int | None = quantity(
        None, ge=1, le=8, unit="1", description="Octaves of the micro-relief; the fidelity's if not given."
    )
    reflection: Literal["lambert", "oren_nayar"] = Field("lambert", description="How rough surfaces reflect.")
    attenuation: float | None = quantity(
        None, ge=0, le=1, unit="1/m", description="Attenuation per metre of range (there and back); else the weather's."
    )
    weather: Weather | None = Field(None, description="Weather; the road's own if not given.")
    rays_per_pulse: Literal[1, 7, 19, 37, 61] | None = Field(
        None, description="Rays that sample a pulse's footprint; the fidelity's if not given."
    )
    beam_rings: tuple[_RingRays, ...] | None = Field(
        None, max_length=6, description="Rays on each ring around the beam's axis, instead of rays_per_pulse."
    )
    beam: Literal["conical", "cylindrical"] = Field(
        "conical", description="Rays diverge from the aperture, or run parallel over the footprint at the first hit."
    )
    traffic_speed_factor: float = quantity(
        1.0, ge=0, le=10, unit="1", description="Factor on the vehicles' speeds; 0 stops the traffic."
    )
    section_length: float | None = quantity(
        None,
        ge=20,
        le=1e6,
        unit="m",
        description="Roads longer than two of these are built and scanned section by section; if not given, roads of "
        "more than 5 km by sections of 500 m.",
    )
    caster: Literal["auto", "embree", "bvhtree"] = Field("auto", description="How rays are cast.")
    threads: int = quantity(0, ge=0, le=1024, unit="1", description="Threads; 0 uses every core.")

    @model_validator(mode="before")
    @classmethod
    def _one_of_each(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for a, b in (("rays_per_pulse", "beam_rings"), ("attenuation", "weather")):
                if data.get(a) is not None and data.get(b) is not None:
                    raise ValueError(f"{a} and {b} can't both be given")
        return data
