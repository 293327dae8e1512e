"""Laser scanners: what a device can do, read from its preset, and the one setting that a scan uses."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ...base.errors import InputError
from ...base.files import PRESETS, preset_names, preset_path
from ...base.schema import ClosedModel, Model, first_repeated, notes, quantity, read_json
from ..patterns.base import PulseTiming
from ..patterns.registry import PatternModel
from ..receiver import Receiver

DEVICES = PRESETS / "devices"
"""Folder of the shipped devices."""
SPEED_OF_LIGHT = 299_792_458.0
"""In vacuum, m/s: exact by the definition of the metre (SI)."""

BRIGHTEST = 1000.0
"""Largest effective reflectance looked for: of retro-reflective sheeting at a right angle (a white target: 1). Chosen:
bounds the search for a device's range."""

_Divergence = Annotated[float, Field(strict=True, ge=0, le=100)]
MirrorClock = Literal["locked", "free"]
_Lines = Annotated[float, Field(strict=True, gt=0, le=10_000)]


class DeviceChoice(ClosedModel):
    """Choice of a laser scanner and its settings; a setting that isn't given is the device's own."""

    device: str = Field("riegl-minivux-3uav", description="Device preset or file.")
    pulse_rate_khz: float | None = quantity(
        None, "kHz", "Pulse repetition rate.", gt=0, le=5000, inherits="device.pulse_rate_khz"
    )
    field_of_view_deg: float | None = quantity(
        None, "deg", "Field of view.", gt=0, le=360, inherits="device.field_of_view_deg"
    )
    lines_per_second: float | None = quantity(
        None, "1/s", "Scan lines per second.", gt=0, le=1000, inherits="device.lines_per_second"
    )
    angle_step_deg: float | None = quantity(
        None,
        "deg",
        "Angle between two pulses; instead of the lines per second.",
        gt=0,
        le=90,
        inherits="device.angle_step_deg",
    )
    mirror_clock: MirrorClock | None = Field(
        None,
        description="Whether the mirror turns in step with the pulses, so that lines begin at the same angle, or by "
        "a clock of its own.",
        json_schema_extra=notes(unset="The device's", labels={"locked": "In step", "free": "Free"}),
    )
    receiver: Receiver = Field(Receiver(), description="How echoes are detected.")


class PulseMode(Model):
    """A pulse repetition rate, with the field of view and the maximum range that go with it.

    The pulse rate counts every pulse of one head: a rotating head's beams together. Each head of a device with
    several fires at this rate, so that a scan has heads x pulse rate pulses per second.
    """

    pulse_rate_khz: float = quantity(..., "kHz", "Pulse repetition rate of each head.", gt=0, le=5000)
    field_of_view_deg: float = quantity(..., "deg", "Largest field of view.", gt=0, le=360)
    maximum_range: float = quantity(..., "m", "Farthest a 20 % target is detected.", gt=0, le=20_000)


class Head(Model):
    """Mounting angles of one of several equal scanning heads: roll (left side up), pitch (nose up), then yaw."""

    roll_deg: float = quantity(0.0, "deg", "About the forward axis.", (-180, 180))
    pitch_deg: float = quantity(0.0, "deg", "Nose up.", (-90, 90))
    yaw_deg: float = quantity(0.0, "deg", "Counter-clockwise from above.", (-180, 180))


class Device(Model):
    """Specification of a laser scanner, from its data sheet."""

    type: Literal["Device"] = "Device"
    version: Literal["1.0"] = "1.0"
    title: str = Field(description="Maker and model.")
    source: str = Field(description="Where the numbers come from, and which of them are assumptions.")
    pattern: PatternModel = Field(description="How the beam is deflected.")
    heads: tuple[Head, ...] = Field(
        (Head(),), min_length=1, max_length=16, description="Scanning heads; they fire in turn."
    )
    wavelength_nm: float = quantity(..., "nm", "Wavelength.", (300, 2500))
    divergence_mrad: tuple[_Divergence, _Divergence] = Field(
        description="Full angle of the beam at 1/e^2 of its peak: in the scan plane, and across it.",
        json_schema_extra={"unit": "mrad"},
    )
    pulse_length_ns: float = quantity(..., "ns", "Pulse length (full width, half height).", gt=0, le=100)
    maximum_returns: int = quantity(..., "1", "Most returns recorded of one pulse.", (1, 15))
    minimum_range: float = quantity(..., "m", "Nothing nearer is recorded.", (0, None))
    farthest_range: float | None = quantity(
        None, "m", "Nothing farther is recorded, however bright; as far as it is unambiguous if not given.", gt=0
    )
    range_sigma: float = quantity(..., "m", "Precision of the range (one sigma).", (0, 1))
    dynamic_range_db: float = quantity(
        45.0,
        "dB",
        "Ratio of the optical power that saturates the receiver to the weakest detected; 45 is assumed.",
        gt=0,
        le=150,
    )
    pulses_in_air: int = quantity(1, "1", "Pulses of a beam that may be under way without being confused.", (1, 100))
    lines_per_second: tuple[_Lines, _Lines] = Field(
        description="Slowest and fastest scan.", json_schema_extra={"unit": "1/s"}
    )
    mirror_clock: MirrorClock = Field(
        "locked",
        description="Whether mirror or head turn in step with the pulses (locked), or by a clock of their own (free).",
    )
    receiver: Receiver = Field(Receiver(), description="How echoes are detected.")
    finest_angle_deg: float = quantity(..., "deg", "Smallest angle between two pulses.", gt=0, le=10)
    modes: tuple[PulseMode, ...] = Field(
        min_length=1, description="Pulse rates that can be chosen; the first is the default."
    )

    @property
    def channels(self) -> int:
        """Return the number of beams of all heads."""
        return len(self.heads) * self.pattern.beams

    def unambiguous_range(self, pulse_rate: float) -> float:
        """Return the unambiguous range, m, at a head's pulse rate, 1/s: beyond, a return counts as a later pulse's.

        c / 2 x the time between two pulses of the same beam x the pulses that may be in the air.
        """
        return 0.5 * SPEED_OF_LIGHT * self.pulses_in_air * self.pattern.beams / pulse_rate

    @model_validator(mode="after")
    def _check_modes(self) -> Self:
        """Raise ValueError if lines, beams or modes contradict each other or the pattern."""
        slowest, fastest = self.lines_per_second
        if slowest > fastest:
            raise ValueError(
                f"lines_per_second must be slowest and fastest, in this order (not {slowest:g}, {fastest:g})"
            )
        if self.channels > 256:
            raise ValueError(f"must have 256 beams at most, all heads together (not {self.channels})")
        if first_repeated([mode.pulse_rate_khz for mode in self.modes]) is not None:
            raise ValueError("modes must not have the same pulse_rate_khz twice")
        for number, mode in enumerate(self.modes):
            rate = mode.pulse_rate_khz * 1e3
            if self.farthest_range is not None and mode.maximum_range > self.farthest_range:
                raise ValueError(
                    f"modes.{number}.maximum_range {mode.maximum_range:g} must be at most the farthest_range "
                    f"{self.farthest_range:g}"
                )
            if fault := self.pattern.fault(mode.field_of_view_deg, rate):
                raise ValueError(f"modes.{number}.field_of_view_deg {mode.field_of_view_deg:g} {fault}")
            reach = self.unambiguous_range(rate)
            if not self.minimum_range < mode.maximum_range <= reach:
                raise ValueError(
                    f"modes.{number}.maximum_range {mode.maximum_range:g} must be more than the minimum range and "
                    f"at most {reach:.4g} m, unambiguous with {self.pulses_in_air} pulses in the air"
                )
        return self


@dataclass(frozen=True)
class ScannerSetting:
    """A device as it is set for one scan; SI units, all angles in radians.

    Attributes:
        pulse_rate: pulses per second of each head (all of its beams together) while the laser fires.
        lines_per_second: lines of each head: turns of a mirror with one face, swings of an oscillating mirror, rows
            of a grid, turns of the first wedge or of a rotating head.
        field_of_view: angle within which it fires, centred as the pattern says; a wedge prism's full cone.
        divergence: full beam angles at 1/e^2, in the scan plane and across it; 0 is a ray.
        range_resolution: echoes closer than this (m) merge into one return: half the pulse's length in air.
        minimum_range: nothing nearer is recorded, m.
        maximum_range: nothing farther is recorded, m: the device doesn't, returns would be taken for a later pulse's,
            or not even retro-reflective sheeting (`BRIGHTEST`) passes the threshold.
        threshold: smallest detected intensity, of an ideal white target at 1 m being 1: that of a 20 % target at a
            right angle at the mode's maximum range, without attenuation.
        saturation: the intensity above which the receiver saturates: threshold x 10^(dynamic range / 10 dB).
        range_sigma: standard deviation of the range, m.
        free_mirror: whether mirror and pulses go by clocks of their own.
        receiver: how echoes are detected.
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
    saturation: float
    range_sigma: float
    free_mirror: bool = False
    receiver: Receiver = Receiver()  # noqa: RUF009 (frozen)

    @property
    def shot_rate(self) -> float:
        """Return the pulses per second of all heads together, while they fire."""
        return self.pulse_rate * len(self.device.heads)

    @property
    def beam_angle(self) -> float:
        """Return the beam's full angle at 1/e^2, rad: the root mean square of both axes."""
        return math.sqrt((self.divergence[0] ** 2 + self.divergence[1] ** 2) / 2.0)

    @property
    def angle_step(self) -> float:
        """Return the angle between two pulses, rad: sweep of a line x lines per second / pulse rate.

        A rotating head's: the azimuth between two firing sequences; a wedge prism's: the first wedge's turn between
        two pulses; that of a mirror with sinusoidal motion: in the middle of the line, where it is largest.
        """
        return self.device.pattern.sweep(self.field_of_view) * self.lines_per_second / self.pulse_rate

    @property
    def pulses_per_line(self) -> int:
        """Return how many pulses a head fires per line: a whole number of firing sequences."""
        pattern = self.device.pattern
        share = pattern.firing_share(self.field_of_view)
        sequences = math.floor(share * self.pulse_rate / (self.lines_per_second * pattern.beams) + 1e-9)
        return sequences * pattern.beams

    @property
    def timing(self) -> PulseTiming:
        """Return one head's pulse timing: pulse rate, lines per second, field of view, angle step, pulses per line."""
        lines, view = self.lines_per_second, self.field_of_view
        return PulseTiming(self.pulse_rate, lines, view, self.angle_step, self.pulses_per_line, self.free_mirror)


def device_names() -> list[str]:
    """Return the names of the device presets."""
    return preset_names(DEVICES)


def load_device(name_or_file: str) -> Device:
    """Return the device of a preset's name or of a file; raise `InputError` if there is none or it is inconsistent.

    Example:
        >>> device = load_device("riegl-vux-1uav22")
        >>> device.wavelength_nm, device.maximum_returns
        (1550.0, 15)
    """
    path = preset_path(DEVICES, name_or_file, "scan.device")
    return Device.from_dict(read_json(path), source=str(name_or_file))


def setting_of(device: Device, scan: DeviceChoice, range_sigma: float | None = None) -> ScannerSetting:
    """Return a device's setting for a scan, in SI units and rad; the device named by the choice is ignored.

    What the choice leaves open is the device's: its first mode, the mode's field of view, the fastest scan.

    Args:
        device: that is set.
        scan: the settings.
        range_sigma: standard deviation of the range, m; the device's own if None.

    Raises:
        InputError: the device can't do it, or values contradict each other; names field, value and what is allowed.

    Example:
        >>> setting = setting_of(load_device("riegl-vux-1uav22"), DeviceChoice(pulse_rate_khz=600.0))
        >>> round(setting.pulse_rate)  # 1/s
        600000
    """
    mode = _mode(device, scan.pulse_rate_khz)
    view = _field_of_view(device, mode, scan.field_of_view_deg)
    lines = _lines_per_second(device, mode, math.radians(view), scan)
    rate = mode.pulse_rate_khz * 1e3
    threshold = 0.2 / mode.maximum_range**2
    setting = ScannerSetting(
        device=device,
        pulse_rate=rate,
        lines_per_second=lines,
        field_of_view=math.radians(view),
        divergence=(device.divergence_mrad[0] * 1e-3, device.divergence_mrad[1] * 1e-3),
        range_resolution=SPEED_OF_LIGHT * device.pulse_length_ns * 1e-9 / 2.0,
        minimum_range=device.minimum_range,
        maximum_range=min(
            math.sqrt(BRIGHTEST / threshold), device.unambiguous_range(rate), device.farthest_range or math.inf
        ),
        threshold=threshold,
        saturation=threshold * 10.0 ** (device.dynamic_range_db / 10.0),
        range_sigma=device.range_sigma if range_sigma is None else range_sigma,
        free_mirror=(scan.mirror_clock or device.mirror_clock) == "free",
        receiver=scan.receiver.over(device.receiver),
    )
    _check_step(setting, scan)
    return setting


def _mode(device: Device, pulse_rate_khz: float | None) -> PulseMode:
    """Return the mode of a pulse rate, the first one for None; raise `InputError` if the device lacks it."""
    if pulse_rate_khz is None:
        return device.modes[0]
    for mode in device.modes:
        if math.isclose(mode.pulse_rate_khz, pulse_rate_khz):
            return mode
    rates = ", ".join(f"{mode.pulse_rate_khz:g}" for mode in device.modes)
    raise InputError("scan.pulse_rate_khz", pulse_rate_khz, f"{device.title} fires at {rates} kHz")


def _field_of_view(device: Device, mode: PulseMode, view: float | None) -> float:
    """Return the field of view, deg: the chosen one if there is one, else the mode's.

    Raises:
        InputError: the device doesn't see the chosen one.
    """
    if view is None:
        return mode.field_of_view_deg
    if device.pattern.fixed_view and not math.isclose(view, mode.field_of_view_deg):
        requirement = f"{device.title} always sees {mode.field_of_view_deg:g} deg: its optics are fixed"
        raise InputError("scan.field_of_view_deg", view, requirement)
    if view > mode.field_of_view_deg:
        requirement = f"{device.title} sees {mode.field_of_view_deg:g} deg at {mode.pulse_rate_khz:g} kHz"
        raise InputError("scan.field_of_view_deg", view, requirement)
    return view


def _lines_per_second(device: Device, mode: PulseMode, view: float, scan: DeviceChoice) -> float:
    """Return the scan lines per second: as chosen, else from the chosen angle step, else the device's fastest.

    Args:
        device: the device.
        mode: its pulse rate.
        view: the field of view, rad.
        scan: what is chosen.

    Raises:
        InputError: the device doesn't scan so fast or slowly, or lines and angle step contradict each other.
    """
    slowest, fastest = device.lines_per_second
    step_of_a_line = math.degrees(device.pattern.sweep(view)) / (mode.pulse_rate_khz * 1e3)
    rate_text = f"at {mode.pulse_rate_khz:g} kHz"
    if scan.lines_per_second is None and scan.angle_step_deg is not None:
        lines = scan.angle_step_deg / step_of_a_line
        # A data sheet's angle is rounded, and may miss a limit by that.
        for limit in device.lines_per_second:
            lines = limit if math.isclose(lines, limit, rel_tol=1e-3) else lines
        if not slowest <= lines <= fastest:
            requirement = (
                f"{device.title} scans {slowest:g} to {fastest:g} lines/s, "
                f"that is {slowest * step_of_a_line:.4g} to {fastest * step_of_a_line:.4g} deg {rate_text}"
            )
            raise InputError("scan.angle_step_deg", scan.angle_step_deg, requirement)
        return lines
    lines = fastest if scan.lines_per_second is None else scan.lines_per_second
    if not slowest <= lines <= fastest:
        raise InputError("scan.lines_per_second", lines, f"{device.title} scans {slowest:g} to {fastest:g} lines/s")
    step = step_of_a_line * lines
    if scan.angle_step_deg is not None and not math.isclose(scan.angle_step_deg, step, rel_tol=1e-3):
        requirement = f"{lines:g} lines/s {rate_text} give {step:.6g} deg: leave one of the two out"
        raise InputError("scan.angle_step_deg", scan.angle_step_deg, requirement)
    return lines


def _check_step(setting: ScannerSetting, scan: DeviceChoice) -> None:
    """Raise `InputError` if the angle step is too fine for the device or a line holds no pulse."""
    device, step = setting.device, math.degrees(setting.angle_step)
    by_angle = scan.lines_per_second is None and scan.angle_step_deg is not None
    field = "scan.angle_step_deg" if by_angle else "scan.lines_per_second"
    value = scan.angle_step_deg if by_angle else setting.lines_per_second
    gives = f"gives an angle step of {step:.4g} deg at {setting.pulse_rate / 1e3:g} kHz"
    if step < device.finest_angle_deg * (1 - 1e-9):
        raise InputError(field, value, f"{gives}; {device.title} steps {device.finest_angle_deg:g} deg at the finest")
    if setting.pulses_per_line < 1:
        view = math.degrees(setting.field_of_view)
        raise InputError(field, value, f"{gives}, which leaves no pulse in the field of view of {view:g} deg")
