"""Values that settings follow while they aren't given: by fidelity, device, platform, design class. Shown greyed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

from ...base.errors import InputError
from ...base.schema import note_of
from ...road.guidelines import LIMITS, STANDARD_CROSS_SECTIONS, StandardCrossSection
from ...sampling.alignment import WIDEST_RADIUS
from ...sampling.markings import LANE_DASH, LANE_GAP
from ...scanning.devices.device import ScannerSetting, setting_of
from ...scanning.platforms.registry import PLATFORMS
from ...scenario.colour import USUAL_RANGE, ColourScenario
from ...scenario.scan import ScanScenario
from ...scenario.scenario import FIDELITIES
from .choices import device_of
from .declared import BY_HAND, declaration
from .numbers import exact, list_as_text, numbers_in
from .wording import written_unit

Value = float | tuple[float, ...] | None


def inherited_value(settings: Any, path: str) -> Value:
    """Return the number, the numbers or the interval that a field has while it isn't given; None if there is none.

    The schema says where it comes from: the chosen kind of its part has ``usual`` values, others are named in the
    field's note ``inherits``, a source out of `SOURCES` and what is taken of it.
    """
    declared = declaration(settings, path)
    if declared is None:
        return None
    name, usual = path.rpartition(".")[2], getattr(declared.model, "usual", {})
    if name in usual:
        return cast(Value, usual[name])
    source, _, taken = (note_of(declared.info, "inherits") or "").partition(".")
    return SOURCES[source](settings, taken) if source else None


def inherited_text(settings: Any, path: str, unit: str) -> str:
    """Return in words what a field has while it isn't given."""
    declared, value = declaration(settings, path), inherited_value(settings, path)
    if declared is None or value is None:
        return str((declared and note_of(declared.info, "unset")) or "Automatic")
    suffix = "" if unit in ("", "1") else f" {written_unit(unit)}"
    if not isinstance(value, tuple):
        return f"{value:.4g}{suffix}"
    return f"{value[0]:g} – {value[1]:g}{suffix}" if declared.is_interval else f"{list_as_text(value)}{suffix}"


def begin_with_inherited(path: str) -> Callable[[Any, Any], None]:
    """Return a hook for the checkbox of a field: once ticked, the field begins with what it had before."""
    name = path.rpartition(".")[2]

    def begin(group: Any, context: Any) -> None:
        value = inherited_value(group.id_data.synthroads, path)
        if value is None or not getattr(group, f"own_{name}"):
            return
        if not isinstance(value, tuple):
            setattr(group, name, type(getattr(group, name))(value))
        elif hasattr(group, f"{name}_minimum"):
            setattr(group, f"{name}_minimum", value[0])
            setattr(group, f"{name}_maximum", value[1])

    return begin


def section_of(settings: Any) -> StandardCrossSection | None:
    """Return the chosen cross-section before lanes and median are changed; None if it is none."""
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
    """Return how the device is set, `without` one of its numbers; None if it can't be read or set so."""
    device = device_of(settings.scan.device)
    if device is None:
        return None
    scan, names = settings.scan, ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")
    given = [name for name in names if name != without and getattr(scan, f"own_{name}")]
    try:
        return setting_of(device, ScanScenario.from_dict({name: exact(getattr(scan, name), None) for name in given}))
    except InputError:
        return None


def _of_device(settings: Any, name: str) -> Value:
    setting = scanner_setting(settings, without=name)
    return None if setting is None else float(f"{_DEVICE[name](setting):.6g}")


def _of_fidelity(settings: Any, name: str) -> Value:
    return cast(Value, getattr(FIDELITIES[settings.fidelity], name))


def _of_section(settings: Any, name: str) -> Value:
    section = section_of(settings)
    return _SECTION[name](section) if section and section.lanes else None


def _of_design_class(settings: Any, name: str) -> Value:
    limits = LIMITS[settings.road.design_class]
    grade = limits.grade_percent
    return {"radius": (limits.radius, WIDEST_RADIUS), "grade_percent": (-grade, grade)}[name]


def _of_images(settings: Any, name: str) -> Value:
    platform = settings.scan.platform
    model = PLATFORMS[platform.kind]
    height = {"height": float(platform.height)} if platform.own_height and "height" in model.model_fields else {}
    seen_from = model(**height).typical_range()
    colour = ColourScenario(lighting=settings.colour.lighting)
    return cast(Value, getattr(colour.settings(settings.fidelity, seen_from or USUAL_RANGE), name))


_DEVICE: Mapping[str, Callable[[ScannerSetting], float]] = {
    "pulse_rate_khz": lambda setting: setting.pulse_rate / 1e3,
    "field_of_view_deg": lambda setting: math.degrees(setting.field_of_view),
    "lines_per_second": lambda setting: setting.lines_per_second,
    "angle_step_deg": lambda setting: math.degrees(setting.angle_step),
    "range_sigma": lambda setting: setting.device.range_sigma,
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
    "rms": lambda settings, name: {"lane_dash": LANE_DASH, "lane_gap": LANE_GAP}[name],
}
"""Sources of inherited values, by the name that the schema's note ``inherits`` begins with."""
