"""Laser scanners: what a device can do, read from its preset, and the one setting that a scan uses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import Field

from ..errors import InputError, nearest_name
from ..scenario import ScanScenario
from ..schema import Model, quantity, read_json

DEVICES = Path(__file__).parents[2] / "presets" / "devices"
SPEED_OF_LIGHT = 299_792_458.0


class PulseMode(Model):
    """A pulse repetition rate and the field of view that goes with it."""

    pulse_rate_khz: float = quantity(gt=0, le=5000, unit="kHz", description="Pulse repetition rate.")
    field_of_view_deg: float = quantity(gt=0, le=360, unit="deg", description="Largest field of view.")
    maximum_range: float = quantity(gt=0, le=20_000, unit="m", description="Farthest a 20 % target is detected.")


class Device(Model):
    """A laser scanner, from its data sheet."""

    type: Literal["Device"] = "Device"
    version: Literal["1.0"] = "1.0"
    title: str = Field(description="Maker and model.")
    source: str = Field(description="Where the numbers come from, and which of them are assumptions.")
    pattern: Literal["rotating_mirror"] = Field(description="How the beam is deflected.")
    wavelength_nm: float = quantity(ge=300, le=2500, unit="nm", description="Wavelength.")
    divergence_mrad: tuple[float, float] = Field(
        description="Full angle of the beam at 1/e^2 of its peak: in the scan plane, and across it.",
        json_schema_extra={"unit": "mrad"},
    )
    pulse_length_ns: float = quantity(gt=0, le=100, unit="ns", description="Pulse length (full width, half height).")
    maximum_returns: int = quantity(ge=1, le=15, unit="1", description="Most returns recorded of one pulse.")
    minimum_range: float = quantity(ge=0, unit="m", description="Nothing nearer is recorded.")
    range_sigma: float = quantity(ge=0, le=1, unit="m", description="Precision of the range (one sigma).")
    lines_per_second: tuple[float, float] = Field(
        description="Slowest and fastest scan.", json_schema_extra={"unit": "1/s"}
    )
    finest_angle_deg: float = quantity(gt=0, le=10, unit="deg", description="Smallest angle between two pulses.")
    modes: tuple[PulseMode, ...] = Field(min_length=1, description="Pulse rates that can be chosen.")


@dataclass(frozen=True)
class ScannerSetting:
    """A device as it is set for one scan; all angles in radians.

    Attributes:
        pulse_rate: pulses per second while the laser fires.
        lines_per_second: revolutions of the mirror per second.
        field_of_view: angle within which it fires, centred on the nadir.
        divergence: full beam angles at 1/e^2, in the scan plane and across it.
        range_resolution: echoes closer than this (m) merge into one return: half the pulse's length in air.
        threshold: smallest detected intensity, of an ideal white target at 1 m being 1.
    """

    device: Device
    pulse_rate: float
    lines_per_second: float
    field_of_view: float
    divergence: tuple[float, float]
    range_resolution: float
    minimum_range: float
    maximum_range: float
    threshold: float
    range_sigma: float

    @property
    def angle_step(self) -> float:
        """Return the angle between two pulses, rad: a revolution times lines per second over the pulse rate."""
        return 2.0 * math.pi * self.lines_per_second / self.pulse_rate

    @property
    def pulses_per_line(self) -> int:
        """Return how many pulses fit into the field of view."""
        return max(1, math.floor(self.field_of_view / self.angle_step + 1e-9))


def device_names() -> list[str]:
    """Return the names of the device presets."""
    return sorted(path.stem for path in DEVICES.glob("*.json"))


def load_device(name_or_file: str) -> Device:
    """Load a preset or a file; raise `InputError` if there is no such device or it is inconsistent."""
    path = DEVICES / f"{name_or_file}.json" if name_or_file in device_names() else Path(name_or_file)
    if path.suffix != ".json":
        hint = nearest_name(name_or_file, device_names())
        raise InputError(
            "scan.device", name_or_file, f"must be a .json file or one of {', '.join(device_names())}{hint}"
        )
    return Device.from_dict(read_json(path), source=str(name_or_file))


def scanner_setting(scan: ScanScenario) -> ScannerSetting:
    """Return the device as the scenario sets it; refuse what the device can't do or what contradicts itself."""
    device = load_device(scan.device)
    mode = _mode(device, scan.pulse_rate_khz)
    slowest, fastest = device.lines_per_second
    lines = fastest if scan.lines_per_second is None else scan.lines_per_second
    if not slowest <= lines <= fastest:
        raise InputError("scan.lines_per_second", lines, f"{device.title} scans {slowest} to {fastest} lines/s")
    view = mode.field_of_view_deg if scan.field_of_view_deg is None else scan.field_of_view_deg
    if view > mode.field_of_view_deg:
        allowed = f"{device.title} sees {mode.field_of_view_deg} deg at {mode.pulse_rate_khz} kHz"
        raise InputError("scan.field_of_view_deg", view, allowed)
    step = 360.0 * lines / (mode.pulse_rate_khz * 1e3)
    if step < device.finest_angle_deg * (1 - 1e-9):
        allowed = (
            f"gives an angle step of {step:.4g} deg at {mode.pulse_rate_khz} kHz; "
            f"{device.title} steps {device.finest_angle_deg} deg at the finest"
        )
        raise InputError("scan.lines_per_second", lines, allowed)
    sigma = device.range_sigma if scan.noise.range_sigma is None else scan.noise.range_sigma
    return ScannerSetting(
        device=device,
        pulse_rate=mode.pulse_rate_khz * 1e3,
        lines_per_second=lines,
        field_of_view=math.radians(view),
        divergence=(device.divergence_mrad[0] * 1e-3, device.divergence_mrad[1] * 1e-3),
        range_resolution=SPEED_OF_LIGHT * device.pulse_length_ns * 1e-9 / 2.0,
        minimum_range=device.minimum_range,
        maximum_range=_farthest(mode),
        threshold=0.2 / mode.maximum_range**2,
        range_sigma=sigma,
    )


def _mode(device: Device, pulse_rate_khz: float | None) -> PulseMode:
    if pulse_rate_khz is None:
        return device.modes[0]
    for mode in device.modes:
        if math.isclose(mode.pulse_rate_khz, pulse_rate_khz):
            return mode
    rates = ", ".join(f"{mode.pulse_rate_khz:g}" for mode in device.modes)
    raise InputError("scan.pulse_rate_khz", pulse_rate_khz, f"{device.title} fires at {rates} kHz")


def _farthest(mode: PulseMode) -> float:
    """Return the range (m) beyond which not even a mirror-bright target (R = 4) passes the threshold."""
    return mode.maximum_range * math.sqrt(4.0 / 0.2)
