"""Values that settings follow while they aren't given: by fidelity, device, platform, design class. Shown greyed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ...base.errors import InputError
from ...road.guidelines import LIMITS, STANDARD_CROSS_SECTIONS, StandardCrossSection
from ...sampling.alignment import WIDEST_RADIUS
from ...sampling.markings import LANE_DASH, LANE_GAP
from ...scanning.devices.device import ScannerSetting, setting_of
from ...scanning.platforms.path import USUAL
from ...scanning.weather.registry import WEATHERS
from ...scenario.colour import USUAL_RANGE, ColourScenario
from ...scenario.scan import ScanScenario
from ...scenario.scenario import FIDELITIES
from .choices import device_of
from .groups import BY_HAND
from .numbers import exact, list_as_text, numbers_in
from .wording import written_unit

Value = float | tuple[float, ...] | None


def inherited_value(settings: Any, path: str) -> Value:
    """Return the number, the numbers or the interval that a field has while it isn't given; None if there is none."""
    return _VALUES[path](settings) if path in _VALUES else None


def inherited_text(settings: Any, path: str, unit: str) -> str:
    """Return in words what a field has while it isn't given."""
    value = inherited_value(settings, path)
    if value is None:
        return _WORDS.get(path, "Automatic")
    suffix = "" if unit in ("", "1") else f" {written_unit(unit)}"
    if not isinstance(value, tuple):
        return f"{value:.4g}{suffix}"
    return f"{value[0]:g} – {value[1]:g}{suffix}" if path in _INTERVALS else f"{list_as_text(value)}{suffix}"


def begin_with_inherited(path: str) -> Callable[[Any, Any], None]:
    """Return what Blender calls when the checkbox of a field is ticked: it begins with what it had before."""
    name = path.rpartition(".")[2]

    def begin(group: Any, context: Any) -> None:
        value = inherited_value(group.id_data.synthroads, path)
        if value is None or not getattr(group, f"own_{name}"):
            return
        if not isinstance(value, tuple):
            setattr(group, name, type(getattr(group, name))(value))
        elif path in _INTERVALS:
            setattr(group, f"{name}_minimum", value[0])
            setattr(group, f"{name}_maximum", value[1])

    return begin


def section_of(settings: Any) -> StandardCrossSection | None:
    """Return the chosen cross-section before lanes and median are changed; None if it is none."""
    road = settings.road
    if road.cross_section != BY_HAND:
        return STANDARD_CROSS_SECTIONS[road.cross_section]
    own = road.cross_section_by_hand
    try:
        lanes = tuple(numbers_in(own.lanes))
    except ValueError:
        return None
    return StandardCrossSection(lanes, own.hard_shoulder, own.outer_edge_strip, own.inner_edge_strip, own.median)


def scanner_setting(settings: Any, without: str = "") -> ScannerSetting | None:
    """Return how the device is set, `without` one of its numbers; None if it can't be read or set so."""
    device = device_of(settings.scan.device)
    if device is None:
        return None
    scan, names = settings.scan, ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")
    own = [name for name in names if name != without and getattr(scan, f"own_{name}")]
    try:
        return setting_of(device, ScanScenario.from_dict({name: exact(getattr(scan, name), None) for name in own}))
    except InputError:
        return None


def _of_device(name: str, pick: Callable[[ScannerSetting], float]) -> Callable[[Any], Value]:
    def value(settings: Any) -> Value:
        setting = scanner_setting(settings, without=name)
        return None if setting is None else float(f"{pick(setting):.6g}")

    return value


def _of_fidelity(name: str) -> Callable[[Any], Value]:
    return lambda settings: getattr(FIDELITIES[settings.fidelity], name)


def _of_section(pick: Callable[[StandardCrossSection], float]) -> Callable[[Any], Value]:
    def value(settings: Any) -> Value:
        section = section_of(settings)
        return pick(section) if section and section.lanes else None

    return value


def _of_platform(name: str) -> Callable[[Any], Value]:
    def value(settings: Any) -> Value:
        usual = USUAL.get(settings.scan.platform.kind)
        return getattr(usual, name) if usual else None

    return value


def _of_images(name: str) -> Callable[[Any], Value]:
    def value(settings: Any) -> Value:
        platform = settings.scan.platform
        usual = USUAL.get(platform.kind)
        height = platform.height if platform.own_height else usual.height if usual else USUAL_RANGE
        seen_from = usual.seen_from(height) if usual else height
        colour = ColourScenario(lighting=settings.colour.lighting)
        return getattr(colour.settings(settings.fidelity, seen_from), name)

    return value


def _visibility(settings: Any) -> Value:
    return WEATHERS[settings.scan.weather.condition].usual_visibility


def _steepest(settings: Any) -> Value:
    grade = LIMITS[settings.road.design_class].grade_percent
    return -grade, grade


_VALUES: dict[str, Callable[[Any], Value]] = {
    "geometric_tolerance": _of_fidelity("tolerance"),
    "vegetation_detail": _of_fidelity("vegetation_detail"),
    "scan.rays_per_pulse": _of_fidelity("rays_per_pulse"),
    "scan.relief_octaves": _of_fidelity("relief_octaves"),
    "road.lanes": _of_section(lambda section: len(section.lanes)),
    "road.lane_width": _of_section(lambda section: section.lanes[0]),
    "road.median_width": _of_section(lambda section: section.median),
    "road.radius": lambda settings: (LIMITS[settings.road.design_class].radius, WIDEST_RADIUS),
    "road.grade_percent": _steepest,
    "road.markings.lane_dash": lambda settings: LANE_DASH,
    "road.markings.lane_gap": lambda settings: LANE_GAP,
    "scan.pulse_rate_khz": _of_device("pulse_rate_khz", lambda setting: setting.pulse_rate / 1e3),
    "scan.field_of_view_deg": _of_device("field_of_view_deg", lambda setting: math.degrees(setting.field_of_view)),
    "scan.lines_per_second": _of_device("lines_per_second", lambda setting: setting.lines_per_second),
    "scan.angle_step_deg": _of_device("angle_step_deg", lambda setting: math.degrees(setting.angle_step)),
    "scan.platform.height": _of_platform("height"),
    "scan.platform.speed": _of_platform("speed"),
    "scan.platform.lateral_offsets": _of_platform("lateral_offsets"),
    "scan.noise.range_sigma": _of_device("range_sigma", lambda setting: setting.device.range_sigma),
    "scan.weather.visibility": _visibility,
    "colour.image_spacing": _of_images("image_spacing"),
    "colour.ground_sampling_distance": _of_images("ground_sampling_distance"),
    "colour.samples": _of_images("samples"),
}
"""Path -> what the field has while it isn't given."""
_INTERVALS = ("road.radius", "road.grade_percent")
_WORDS = {
    "road.furniture.gantry_spacing": "Single ones",
    "scan.platform.lateral_offsets": "In the lanes",
    "scan.platform.height": "The file's",
    "scan.platform.speed": "The file's",
    "scan.platform.stations": "By the spacing",
    "scan.beam_rings": "By the rays",
    "scan.attenuation": "The weather's",
    "scan.section_length": "500 m beyond 5 km",
    "scan.weather": "The road's",
    "scan.weather.rate_mm_h": "By the visibility",
    "cloud.point_spacing": "All points",
    "cloud.intensity_scale": "By the range",
    "road.elevation_model": "Generated",
    "materials_table": "The shipped ones",
}
"""Path -> what is said where that is no number."""
BEGINNINGS = tuple(_VALUES)
"""Paths whose checkboxes begin with what the field had before."""
