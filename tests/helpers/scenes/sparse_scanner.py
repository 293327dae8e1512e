"""A scanner with few pulses, for what needs a long road and not a dense cloud."""

from __future__ import annotations

import json
from pathlib import Path

from synthroads_addon.scanning.devices.device import DEVICES


def sparse_scanner(folder: Path, kilohertz: float) -> str:
    """Write the generic polygon scanner with another pulse rate and without range noise; return the file's name."""
    data = json.loads((DEVICES / "generic-polygon.json").read_text(encoding="utf-8"))
    data["range_sigma"] = 0.0
    data["modes"] = [{"pulse_rate_khz": kilohertz, "field_of_view_deg": 60.0, "maximum_range": 500.0}]
    path = folder / f"sparse-{kilohertz:g}.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    return str(path)
