"""Settings of a scenario that give way to changes: a new device can't keep the pulse rate of the old one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Any

from ..base.errors import InputError
from ..road.guidelines import SECTIONS_OF_CLASS
from .scan import ScanScenario, scanner_setting

_CLASS_AND_SECTION = ("design_class", "cross_section")
_KINDS = (("platform", "kind", ("roll_deg", "pitch_deg", "yaw_deg")), ("weather", "condition", ()))
"""Parts of a scan of one kind or another, the field that says which, and fields that stay with another kind."""
_DEVICE_SETTINGS = ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")


def without_what_gives_way(data: dict[str, Any], before: Mapping[str, Any], named: AbstractSet[str]) -> dict[str, Any]:
    """Return a changed scenario's JSON data without what it said itself and doesn't fit the changes any more.

    Of a design class and a standard cross-section that don't fit each other, the one that no change names is left out;
    and of a device that a change names, the settings that it can't do and no change names. What the changes name stays,
    and is refused later where it contradicts itself. A platform or weather of another kind than before begins anew: it
    only keeps the scanner's mounting.

    Args:
        data: after the changes.
        before: without them.
        named: paths of the changed fields, e.g. ``road.design_class``.
    """
    road = data.get("road")
    if isinstance(road, dict):
        data = data | {"road": _without(road, _misfit_of_road(road, named))}
    for part, tag, kept in _KINDS:  # first: a scan with fields of another platform can't tell what its device can't do
        data = _begin_anew(data, before, named, part, tag, kept)
    scan = data.get("scan")
    if isinstance(scan, dict) and "scan.device" in named:
        data = data | {"scan": _without(scan, *_misfits_of_device(scan, named))}
    return data


def _begin_anew(
    data: dict[str, Any], before: Mapping[str, Any], named: AbstractSet[str], part: str, tag: str, kept: Sequence[str]
) -> dict[str, Any]:
    """Return data in which a part of another kind than before has only what is kept or what the changes name."""
    scan = data.get("scan")
    given = scan.get(part) if isinstance(scan, dict) else None
    path = f"scan.{part}"
    if not isinstance(given, dict) or f"{path}.{tag}" not in named or given.get(tag) == _kind(before, part, tag):
        return data
    changed = {name: value for name, value in given.items() if f"{path}.{name}" in named or name in kept}
    return data | {"scan": data["scan"] | {part: changed}}


def _kind(data: Mapping[str, Any], part: str, tag: str) -> Any:
    parts = (data.get("scan") or {}).get(part) or {}
    return parts.get(tag) if isinstance(parts, dict) else None


def _misfit_of_road(road: dict[str, Any], named: AbstractSet[str]) -> str | None:
    """Return design class or cross-section, whichever gives way to the other; None if neither does."""
    others = [name for name in _CLASS_AND_SECTION if not any(path.startswith(f"road.{name}") for path in named)]
    section = road.get("cross_section")
    if len(others) != 1 or not isinstance(section, str):
        return None
    return None if section in SECTIONS_OF_CLASS.get(str(road.get("design_class")), ()) else others[0]


def _misfits_of_device(scan: dict[str, Any], named: AbstractSet[str]) -> list[str]:
    """Return the settings of a scan that its device can't do and no change names."""
    misfits: list[str] = []
    try:
        ScanScenario.from_dict(scan)
    except InputError:
        return misfits
    while True:
        try:
            scanner_setting(ScanScenario.from_dict(_without(scan, *misfits)))
        except InputError as error:
            name = error.field.removeprefix("scan.")
            if name in _DEVICE_SETTINGS and name not in misfits and error.field not in named and name in scan:
                misfits.append(name)
                continue
        return misfits


def _without(data: dict[str, Any], *names: str | None) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name not in names}
