"""Speed limits along a carriageway: those of its traffic signs, each up to the next one that the traffic passes."""

from ...road.geometry import RoadGeometry
from ...road.guidelines import GUIDELINE_OF_CLASS, LIMITS
from ...road.objects import Side
from ...road.things.sign import TrafficSign
from .pieces import CLOSE

ADVISORY = 130.0
"""Speed on motorways without a limit, km/h: the one that German law advises."""
_KILOMETRES_PER_HOUR = {"km/h": 1.0, "mph": 1.609344}
"""Unit of a speed -> km/h."""
_ENDS = ("278", "282")
"""Numbers of the German signs at which a limit ends."""
_TOWN_BEGINS, _TOWN_ENDS = "310", "311"
"""German signs at which a built-up area begins and ends; the road's guideline may name others."""


class SpeedLimits:
    """Speed limits along one carriageway, km/h, as its traffic signs set them in the direction of traffic.

    Attributes:
        without: km/h where no sign says another.
        stretches: (start, end, km/h) in the order of the stations, m.
    """

    def __init__(self, geometry: RoadGeometry, side: Side) -> None:
        self.without = LIMITS[geometry.parameters.design_class].unsigned_speed
        is_with_stations = geometry.sections[side].carriageway.traffic > 0
        changes = _changes(geometry, is_with_stations)
        if not is_with_stations:
            changes = changes[::-1]
        # With the stations a sign holds from its place on, against them up to it.
        borders = [0.0, *(station for station, _ in changes), geometry.length]
        speeds = (
            [self.without, *(speed for _, speed in changes)]
            if is_with_stations
            else [*(v for _, v in changes), self.without]
        )
        rows = zip(borders[:-1], borders[1:], speeds, strict=True)
        self.stretches = [(start, end, speed) for start, end, speed in rows if end - start > CLOSE]

    def limits_between(self, start: float, end: float) -> list[tuple[float, float]]:
        """Return (station in m, limit in km/h) where each limit begins between two stations, the first at the start."""
        limits: list[tuple[float, float]] = []
        for stretch_start, stretch_end, speed in self.stretches:
            limit_start, limit_end = max(stretch_start, start), min(stretch_end, end)
            if limit_end - limit_start > CLOSE and (not limits or limits[-1][1] != speed):
                limits.append((limit_start, speed))
        return limits


def _changes(geometry: RoadGeometry, is_with_stations: bool) -> list[tuple[float, float]]:
    """Return (station in m, limit in km/h) of the signs that change the limit, in driving order."""
    speeds: dict[float, float] = {}
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
            speeds[item.station] = round(signal.speed * _KILOMETRES_PER_HOUR[signal.speed_unit], 3)
        elif item.code in begins:
            speeds[item.station] = limits.town_speed
        elif item.code.startswith(_ENDS) or item.code in ends:
            speeds[item.station] = limits.unsigned_speed
    return sorted(speeds.items(), reverse=not is_with_stations)
