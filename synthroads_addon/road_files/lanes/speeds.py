"""Speed limits of an OpenDRIVE road: the one that holds for most of it, and what becomes of all records.

ASAM OpenDRIVE 1.8.1, 10.4 (`type`, `speed`) and 11.9.5 (`speed` of lanes).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

from ...base.errors import InputError
from ..xml_text import child, children, finite, local_name, number
from .loss import Loss
from .records import FileRoad
from .signals import kilometres_per_hour

_NO_LIMIT = ("no limit", "undefined")


def speed_limit(roads: Sequence[FileRoad], loss: Loss) -> float | None:
    """Return the speed limit (km/h) that most of the length of some roads has by their types, None without any.

    What else the records say is added to what is left out.
    """
    lengths: dict[float, float] = defaultdict(float)
    record_count = lane_speeds = unreadable = 0
    for road in roads:
        types = sorted(children(road.element, "type"), key=lambda row: number(row, "s", 0.0))
        starts = [number(row, "s", 0.0) for row in types]
        for row, start, end in zip(types, starts, [*starts[1:], road.length], strict=False):
            speed = child(row, "speed")
            if speed is None:
                continue
            value = _value(speed)
            unreadable += value is None and speed.get("max", "").strip() not in _NO_LIMIT
            if value is not None:
                record_count += 1
                lengths[value] += max(end - start, 0.0)
        lane_speeds += sum(local_name(item) == "speed" for lane in road.element.iter() if local_name(lane) == "lane"
                     for item in lane)  # fmt: skip
    limit = max(lengths, key=lambda value: lengths[value]) if lengths else None
    if limit is not None:
        loss.read["speed limits of the road"] += record_count
    if len(lengths) > 1:
        loss.leave_out("speed limits of the road", f"cars drive at most {limit:g} km/h all along", len(lengths) - 1)
    if unreadable:
        loss.leave_out("speed limits of the road", "their number or unit isn't known", unreadable)
    if lane_speeds:
        loss.leave_out("speed limits of lanes", "in a parameter set signs alone say them", lane_speeds)
    return limit


def _value(speed: Element) -> float | None:
    """Return a record's speed, km/h; None where it sets no limit, or its number or unit is unknown."""
    text = speed.get("max", "").strip()
    try:
        value = kilometres_per_hour(finite("speed max", text), speed.get("unit", ""))
    except InputError:
        return None
    return value if value is not None and value > 0.0 else None
