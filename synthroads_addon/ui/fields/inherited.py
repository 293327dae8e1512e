"""Values that settings follow while they aren't given: by fidelity, device, platform, design class. Shown greyed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, cast

from ...base.errors import InputError
from ...base.schema import note_of
from ...road.guidelines import LIMITS, STANDARD_CROSS_SECTIONS, StandardCrossSection
from ...scanning.devices.device import DeviceChoice, ScannerSetting, setting_of
from ...scanning.platforms.registry import PLATFORMS
from ...scanning.receiver import Receiver
from ...scenario.colour import USUAL_RANGE, ColourScenario
from ...scenario.scan import ScanScenario
from ...scenario.scenario import FIDELITIES
from .choices import BY_HAND, device_of
from .numbers import exact, numbers_in

Value = float | tuple[float, ...] | None
DEVICE_SETTINGS = tuple(
    name for name, info in DeviceChoice.model_fields.items() if (note_of(info, "inherits") or "").startswith("device.")
)
"""Fields of a scan that set its device."""
RECEIVER_SETTINGS = tuple(name for name, info in Receiver.model_fields.items() if note_of(info, "inherits"))
"""Numbers of a scan's receiver that are the device's while they aren't given."""


def section_of(settings: Any) -> StandardCrossSection | None:
    """Return the panel's cross-section, without changes of lanes and median; None if its lanes aren't numbers."""
    road = settings.road
    if road.cross_section != BY_HAND:
        return STANDARD_CROSS_SECTIONS[road.cross_section]
    part = road.cross_section_by_hand
    try:
        lanes = tuple(numbers_in(part.lanes))
    except ValueError:
        return None
    return StandardCrossSection(lanes, part.hard_shoulder, part.outer_edge_strip, part.inner_edge_strip, part.median)


def scanner_setting(settings: Any, without: str = "") -> ScannerSetting | None:
    """Return the panel's scanner setting, one number optionally left at its default; None if it is invalid."""
    device = device_of(settings.scan.device)
    if device is None:
        return None
    scan = settings.scan
    given = [name for name in DEVICE_SETTINGS if name != without and getattr(scan, f"own_{name}")]
    try:
        return setting_of(device, ScanScenario.from_dict({name: exact(getattr(scan, name), None) for name in given}))
    except InputError:
        return None


def _of_device(settings: Any, name: str) -> Value:
    setting = scanner_setting(settings, without=name)
    value = None if setting is None else _DEVICE[name](setting)
    return None if value is None else float(f"{value:.6g}")


def _of_fidelity(settings: Any, name: str) -> Value:
    return cast(Value, getattr(FIDELITIES[settings.fidelity], name))


def _of_section(settings: Any, name: str) -> Value:
    section = section_of(settings)
    return _SECTION[name](section) if section and section.lanes else None


def _of_design_class(settings: Any, name: str) -> Value:
    limits = LIMITS[settings.road.design_class]
    intervals = {
        "radius": (limits.drawn_radius_least, limits.drawn_radius_largest),
        "grade_percent": (-limits.grade_percent, limits.grade_percent),
    }
    return intervals[name] if name in intervals else float(getattr(limits, name))


def _of_images(settings: Any, name: str) -> Value:
    platform = settings.scan.platform
    model = PLATFORMS[platform.kind]
    height = {"height": float(platform.height)} if platform.own_height and "height" in model.model_fields else {}
    seen_from = model(**height).typical_range()
    colour = ColourScenario(lighting=settings.colour.lighting)
    return cast(Value, getattr(colour.settings(settings.fidelity, seen_from or USUAL_RANGE), name))


def _of_receiver(name: str, setting: ScannerSetting) -> float | None:
    return cast(float | None, getattr(setting.device.receiver, name))


_DEVICE: Mapping[str, Callable[[ScannerSetting], float | None]] = {
    "pulse_rate_khz": lambda setting: setting.pulse_rate / 1e3,
    "field_of_view_deg": lambda setting: math.degrees(setting.field_of_view),
    "lines_per_second": lambda setting: setting.lines_per_second,
    "angle_step_deg": lambda setting: math.degrees(setting.angle_step),
    "range_sigma": lambda setting: setting.device.range_sigma,
    **{name: partial(_of_receiver, name) for name in RECEIVER_SETTINGS},
}
_SECTION: Mapping[str, Callable[[StandardCrossSection], float]] = {
    "lanes": lambda section: len(section.lanes),
    "lane_width": lambda section: section.lanes[0],
    "median_width": lambda section: section.median,
}
SOURCES: Mapping[str, Callable[[Any, str], Value]] = {
    "fidelity": _of_fidelity,
    "device": _of_device,
    "section": _of_section,
    "design_class": _of_design_class,
    "images": _of_images,
}
"""Sources of inherited values, by the name that the schema's note ``inherits`` begins with."""
