"""`Platform`: what carries a scanner, and where."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ...base.schema import ClosedModel, Finite, quantity

PlatformKind = Literal["uav", "vehicle", "tripod", "airborne", "trajectory"]


class Platform(ClosedModel):
    """Carrier of the scanner and its place. What is left out is usual for the kind (`platforms.base.USUAL`)."""

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
