"""Signals of an OpenDRIVE road as traffic signs and lights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ...base.schema import round_value
from ...road.objects import RoadObject
from ...road.things.sign import TrafficSign
from ...road.things.sign_catalogue import sign_catalogue
from ...road.things.traffic_light import TrafficLight
from ..xml_text import number
from .loss import Loss
from .places import Places

_LIGHTS = ("1000001", "1000002", "1000009", "1000010", "1000011", "1000012")
"""Types of traffic lights in the standard's own catalogue (OpenDRIVE)."""
_SPEED = "274"
PER_HOUR = {"m/s": 3.6, "km/h": 1.0, "kmh": 1.0, "kph": 1.0, "mph": 1.609344}
"""Units of speeds -> km/h; one without a unit is in m/s."""
_NO_UNIT = "m/s"


def kilometres_per_hour(value: float, unit: str) -> float | None:
    """Return a speed in km/h; None for a unit that isn't known."""
    factor = PER_HOUR.get(unit.strip().lower() or _NO_UNIT)
    return None if factor is None else value * factor


def sign_of(signal: Element, places: Places, loss: Loss) -> Iterator[tuple[str, RoadObject]]:
    """Yield the id and the sign or light that a signal becomes; one without either is noted as left out."""
    kind, subtype = signal.get("type", "-1").strip(), signal.get("subtype", "-1").strip()
    station, offset = places.at(*(np.array([number(signal, name, 0.0)]) for name in ("s", "t", "zOffset")))
    turn = number(signal, "hOffset", 0.0) + (math.pi if signal.get("orientation", "+").strip() == "-" else 0.0)
    common: dict[str, Any] = {
        "instance": 1,
        "station": round_value(max(float(station[0]), 0.0), 6),
        "offset": round_value(float(offset[0]), 6),
        "rotation_deg": round_value(math.degrees(math.remainder(turn, math.tau)), 6),
    }
    name = signal.get("name") or f"signal-{signal.get('id', '')}"
    if not abs(common["offset"]) <= 100.0:
        loss.leave_out("signals", "they stand more than 100 m from the line")
        return
    if kind in _LIGHTS:
        yield name, TrafficLight(**common)
        return
    code = _code(signal, kind, subtype)
    entry = sign_catalogue().signs.get(code)
    if entry is None:
        loss.leave_out("signals", f"the catalogue of signs has none of the code {kind}.{subtype}")
        return
    fields: dict[str, Any] = entry.fields()
    width, height = number(signal, "width", 0.0), number(signal, "height", 0.0)
    if 0.0 < width <= 12.0 and 0.0 < height <= 8.0:
        fields |= {"width": width, "height": height}
    text = tuple(line for line in signal.get("text", "").splitlines() if line)[:6]
    yield name, TrafficSign(**common, **fields, code=code, text=text or _text(code, entry.text))


def _code(signal: Element, kind: str, subtype: str) -> str:
    """Return a signal's number in the catalogue: with its subtype, its speed, or without both; with a foreign country.

    A number of another country begins with it, where the catalogue has that sign.
    """
    signs, country = sign_catalogue().signs, signal.get("country", "").strip().upper()
    for foreign_code in (f"{country}.{kind}-{subtype}", f"{country}.{kind}"):
        if foreign_code in signs:
            return foreign_code
    if kind == _SPEED and signal.get("value"):
        speed = kilometres_per_hour(number(signal, "value"), signal.get("unit", ""))
        if speed is not None and f"{kind}-{round(speed)}" in signs:
            return f"{kind}-{round(speed)}"
    return f"{kind}-{subtype}" if f"{kind}-{subtype}" in signs or kind not in signs else kind


def _text(code: str, lines: tuple[str, ...]) -> tuple[str, ...]:
    """Return a sign's usual lines of text without those that depend on its place, which have a field in braces."""
    return tuple(line for line in lines if "{" not in line)
