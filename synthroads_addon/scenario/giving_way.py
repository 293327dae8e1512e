"""Settings of a scenario that give way to changes: a new device can't keep the pulse rate of the old one."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from typing import Any

from ..base.errors import InputError
from ..road.guidelines import SECTIONS_OF_CLASS
from .scan import ScanScenario, scanner_setting

_CLASS_AND_SECTION = ("design_class", "cross_section")
_DEVICE_SETTINGS = ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")


def without_what_gives_way(data: dict[str, Any], named: AbstractSet[str]) -> dict[str, Any]:
    """Return a changed scenario's JSON data without what it said itself and doesn't fit the changes any more.

    Of a design class and a standard cross-section that don't fit each other, the one that no change names is left out;
    and of a device that a change names, the settings that it can't do and no change names. What the changes name stays,
    and is refused later where it contradicts itself.

    Args:
        data: after the changes.
        named: paths of the changed fields, e.g. ``road.design_class``.
    """
    road, scan = data.get("road"), data.get("scan")
    if isinstance(road, dict):
        data = data | {"road": _without(road, _misfit_of_road(road, named))}
    if isinstance(scan, dict) and "scan.device" in named:
        data = data | {"scan": _without(scan, *_misfits_of_device(scan, named))}
    return data


def _misfit_of_road(road: dict[str, Any], named: AbstractSet[str]) -> str | None:
    """Return design class or cross-section, whichever gives way to the other; None if neither does."""
    others = [name for name in _CLASS_AND_SECTION if not any(path.startswith(f"road.{name}") for path in named)]
    section = road.get("cross_section")
    if len(others) != 1 or not isinstance(section, str):
        return None
    return None if section in SECTIONS_OF_CLASS.get(str(road.get("design_class")), ()) else others[0]


def _misfits_of_device(scan: dict[str, Any], named: AbstractSet[str]) -> list[str]:
    """Return the settings of a scan that its device can't do and no change names."""
    found: list[str] = []
    try:
        ScanScenario.from_dict(scan)
    except InputError:
        return found
    while True:
        try:
            scanner_setting(ScanScenario.from_dict(_without(scan, *found)))
        except InputError as error:
            name = error.field.removeprefix("scan.")
            if name in _DEVICE_SETTINGS and name not in found and error.field not in named and name in scan:
                found.append(name)
                continue
        return found


def _without(data: dict[str, Any], *names: str | None) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name not in names}
