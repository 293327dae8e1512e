"""Speed limits along a carriageway, and where it is in a town: as its signs say, each up to the next on the way."""

from collections.abc import Sequence
from typing import TypeVar

from ..road.geometry import RoadGeometry
from ..road.guidelines import GUIDELINE_OF_CLASS, LIMITS
from ..road.objects import Side
from ..road.things.sign import TrafficSign
from ..road.things.sign_catalogue import KILOMETRES_PER_HOUR

CLOSE = 1e-6
"""Length (m) up to which a stretch is none."""
ADVISORY = 130.0
"""Speed on motorways without a limit, km/h: the one that German law advises."""
_ENDS = ("278", "282")
"""Numbers of the German signs at which a limit ends."""
_Value = TypeVar("_Value")
_TOWN_BEGINS, _TOWN_ENDS = "310", "311"
"""German signs at which a built-up area begins and ends; the road's guideline may name others."""


class SpeedLimits:
    """Speed limits along one carriageway, km/h, as its traffic signs set them in the direction of traffic.

    Attributes:
        without: km/h where no sign says another.
        stretches: (start, end, km/h) in the order of the stations, m.
        towns: (start, end) of the stretches between signs at which a built-up area begins and ends, m.
    """

    def __init__(self, geometry: RoadGeometry, side: Side) -> None:
        self.without = LIMITS[geometry.parameters.design_class].unsigned_speed
        is_with_stations = geometry.sections[side].carriageway.traffic > 0
        changes = _changes(geometry, is_with_stations)
        speeds = [(station, speed) for station, speed, _ in changes]
        towns = [(station, is_town) for station, _, is_town in changes if is_town is not None]
        # Where the first of such signs is an end, the town has begun before the road.
        is_town_before = bool(towns) and not towns[0][1]
        self.stretches = _stretches(speeds, self.without, geometry.length, is_with_stations)
        rows = _stretches(towns, is_town_before, geometry.length, is_with_stations)
        self.towns = [(start, end) for start, end, is_town in rows if is_town]

    def limits_between(self, start: float, end: float) -> list[tuple[float, float]]:
        """Return (station in m, limit in km/h) where each limit begins between two stations, the first at the start."""
        limits: list[tuple[float, float]] = []
        for stretch_start, stretch_end, speed in self.stretches:
            limit_start, limit_end = max(stretch_start, start), min(stretch_end, end)
            if limit_end - limit_start > CLOSE and (not limits or limits[-1][1] != speed):
                limits.append((limit_start, speed))
        return limits


def _stretches(
    changes: Sequence[tuple[float, _Value]], before: _Value, length: float, is_with_stations: bool
) -> list[tuple[float, float, _Value]]:
    """Return (start, end, value) of the stretches between changes, in the order of the stations, m.

    Args:
        changes: station, m, and value from there on, in driving order.
        before: value up to the first change.
        length: of the road, m.
        is_with_stations: whether traffic drives with the stations.
    """
    values = [before, *(value for _, value in changes)]
    borders = [station for station, _ in changes]
    if not is_with_stations:
        values, borders = values[::-1], borders[::-1]
    rows = zip([0.0, *borders], [*borders, length], values, strict=True)
    return [(start, end, value) for start, end, value in rows if end - start > CLOSE]


def _changes(geometry: RoadGeometry, is_with_stations: bool) -> list[tuple[float, float, bool | None]]:
    """Return station, m, limit, km/h, and whether a town begins (or ends: False) of the signs, in driving order."""
    speeds: dict[float, tuple[float, bool | None]] = {}
    design_class = geometry.parameters.design_class
    roles, limits = GUIDELINE_OF_CLASS[design_class].sign_roles, LIMITS[design_class]
    begins = {_TOWN_BEGINS, roles.get("town_begin")}
    ends = {_TOWN_ENDS, roles.get("town_end")}
    for item in geometry.parameters.of_type(TrafficSign).values():
        with_stations = abs((item.rotation_deg + 180.0) % 360.0 - 180.0) <= 90.0
        if with_stations != is_with_stations or not 0.0 < item.station < geometry.length:
            continue
        signal = item.signals()["face"]
        if signal.speed is not None:
            speeds[item.station] = round(signal.speed * KILOMETRES_PER_HOUR[signal.speed_unit], 3), None
        elif item.code in begins:
            speeds[item.station] = limits.town_speed, True
        elif item.code in ends:
            speeds[item.station] = limits.unsigned_speed, False
        elif item.code.startswith(_ENDS):
            speeds[item.station] = limits.unsigned_speed, None
    rows = [(station, *change) for station, change in speeds.items()]
    return sorted(rows, key=lambda row: row[0], reverse=not is_with_stations)
