"""Consequences of a change in the panel: settings that belonged to the choice before, or exclude each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...road.guidelines import SECTIONS_OF_CLASS, design_class_of
from .choices import BY_HAND
from .fields import AUTOMATIC, checkbox_path
from .inherited import DEVICE_SETTINGS

Hook = Callable[[Any, Any], None]


def _clear(*names: str) -> Hook:
    """Return an update hook that resets the named properties to their type's empty value."""

    def clear(group: Any, context: Any) -> None:
        for name in names:
            setattr(group, name, type(getattr(group, name))())

    return clear


def _clear_others(name: str, *others: str) -> Hook:
    """Return an update hook that resets other properties when the property `name` is set."""

    def instead(group: Any, context: Any) -> None:
        if getattr(group, name):
            _clear(*others)(group, context)

    return instead


def _class_for_section(road: Any, context: Any) -> None:
    if road.cross_section != BY_HAND:
        fitting = design_class_of(road.cross_section, road.design_class)
        if fitting != road.design_class:
            road.design_class = fitting


def _section_for_class(road: Any, context: Any) -> None:
    allowed = SECTIONS_OF_CLASS[road.design_class]
    if road.cross_section not in (*allowed, BY_HAND):
        road.cross_section = allowed[0]


def _no_samples(colour: Any, context: Any) -> None:
    if colour.lighting == "direct":
        colour.own_samples = False


def _no_rings(scan: Any, context: Any) -> None:
    if scan.rays_per_pulse != AUTOMATIC and scan.beam_rings:
        scan.beam_rings = ""


def _no_rays(scan: Any, context: Any) -> None:
    if scan.beam_rings:
        scan.rays_per_pulse = AUTOMATIC


HOOKS: dict[str, Hook] = {
    "road.cross_section": _class_for_section,
    "road.design_class": _section_for_class,
    # A pulse rate and angles are those of one device, strips and heights those of one platform.
    "scan.device": _clear(*map(checkbox_path, DEVICE_SETTINGS)),
    "scan.platform.kind": _clear("own_height", "own_speed", "lateral_offsets", "stations", "file"),
    "scan.own_weather": _clear_others("own_weather", "own_attenuation"),
    "scan.own_attenuation": _clear_others("own_attenuation", "own_weather"),
    "scan.weather.own_rate_mm_h": _clear_others("own_rate_mm_h", "own_visibility"),
    "scan.weather.own_visibility": _clear_others("own_visibility", "own_rate_mm_h"),
    "scan.beam_rings": _no_rays,
    "scan.rays_per_pulse": _no_rings,
    "colour.lighting": _no_samples,
}
"""Path of a property -> what Blender calls when it has changed."""
