"""Where a scanner on its way is in a tunnel and has no GNSS."""

from __future__ import annotations

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.structures.tunnel import Tunnel
from ...scanning.platforms.path import Path, Strip
from ...scanning.strip_errors import Outage

_STEP = 0.05
"""Time between the places that are looked at, s: 1.5 m at 30 m/s. Chosen."""
_MOST = 200_000
"""Places that are looked at on one strip, at most."""


def outages_in_tunnels(road: RoadParameters | None, path: Path) -> tuple[Outage, ...]:
    """Return the stretches of a path's strips on which the scanner is in a tunnel of the road, in order."""
    if road is None or not road.of_type(Tunnel):
        return ()
    geometry = RoadGeometry(road)
    return tuple(outage for strip in path.strips for outage in _of_strip(geometry, path, strip))


def _of_strip(geometry: RoadGeometry, path: Path, strip: Strip) -> list[Outage]:
    """Return the outages of one strip."""
    count = int(np.clip(np.ceil(strip.duration / _STEP) + 1, 2, _MOST))
    time = strip.start_time + np.linspace(0.0, strip.duration, count)
    position, _ = path.pose(strip, time)
    station, offset = geometry.alignment.project(position[:, :2])
    edges = geometry.offsets(np.clip(station, 0.0, geometry.length))
    height = position[:, 2] - geometry.profile.elevation(np.clip(station, 0.0, geometry.length))
    outages = []
    for tunnel in geometry.tunnels.values():
        inside = (station > tunnel.start_station) & (station < tunnel.end_station) & (height < tunnel.height)
        inside &= (offset < edges[:, 0]) & (offset > edges[:, -1])
        borders = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
        for first, last in zip(borders[::2].tolist(), (borders[1::2] - 1).tolist(), strict=True):
            outages.append(Outage(strip.index, float(time[first]), float(time[last])))
    return sorted(outages, key=lambda outage: outage.start)
