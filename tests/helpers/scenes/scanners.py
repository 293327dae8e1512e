"""Scanner settings for tests: of presets, and of devices that no preset is."""

from __future__ import annotations

import math
from typing import Any

from synthroads_addon.scanning.devices.device import Device, ScannerSetting, load_device, setting_of
from synthroads_addon.scanning.patterns.wedge_prism import WedgePrism
from synthroads_addon.scenario.scan import ScanScenario, scanner_setting


def preset(name: str, **scan: Any) -> ScannerSetting:
    """Return the setting of a preset."""
    return scanner_setting(ScanScenario.from_dict({"device": name, **scan}))


def device(name: str = "generic-polygon", **changes: Any) -> Device:
    """Return a preset with other values."""
    return Device.from_dict(load_device(name).to_dict() | changes)


def custom(pattern: dict[str, Any], scan: dict[str, Any] | None = None, **changes: Any) -> ScannerSetting:
    """Return the setting of a device with another pattern, generic in everything else."""
    return setting_of(device(pattern=pattern, **changes), ScanScenario.from_dict(scan or {}))


def mode(rate_khz: float, view_deg: float, reach: float = 50.0) -> dict[str, float]:
    """Return one mode of a device."""
    return {"pulse_rate_khz": rate_khz, "field_of_view_deg": view_deg, "maximum_range": reach}


def wedges(*wedge: tuple[float, float, int], rate_khz: float = 100.0, lines: float = 50.0) -> ScannerSetting:
    """Return the setting of a wedge prism by angle in degrees, index and turns; its field of view is its own."""
    pattern = {
        "type": "wedge_prism",
        "wedges": [{"angle_deg": a, "refractive_index": n, "turns": t} for a, n, t in wedge],
    }
    view = 2.0 * math.degrees(WedgePrism.from_dict(pattern).largest_deflection())
    return custom(pattern, modes=[mode(rate_khz, view)], lines_per_second=[lines, lines], finest_angle_deg=1e-4)
