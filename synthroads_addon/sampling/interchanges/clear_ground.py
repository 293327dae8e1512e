"""Leaves out a road's furniture that would stand on the ramps or the crossing road of its interchange."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.network.network import network_of
from ...road.objects import LineObject, PointObject
from ...road.other_roads.parts import OwnAxis
from ...road.section import Arrow
from ...road.things.overpass import Overpass
from ..placing.site import PlacementSite

_BESIDE = 0.5
"""Distance (m) from a ramp's pavement up to which nothing of the main road stands; chosen."""
_STEP = 1.0
"""Distance (m) at which what runs along the road is looked at."""


def clear_of_interchange(site: PlacementSite, objects: dict[str, Any]) -> dict[str, Any]:
    """Return a road's objects without those that stand on another road's pavement, or too near it.

    Args:
        site: the road.
        objects: by id.
    """
    geometry: RoadGeometry = site.geometry
    network = network_of(geometry)

    def is_clear(item: Any) -> bool:
        """Return whether an object keeps clear of all other roads; markings and bridges do."""
        if isinstance(item, Overpass | Arrow | OwnAxis):
            return True
        if isinstance(item, PointObject):
            station, offset = np.array([item.station]), np.array([item.offset])
        elif isinstance(item, LineObject):
            count = max(2, int((item.end_station - item.start_station) / _STEP) + 1)
            station = np.linspace(item.start_station, item.end_station, count)
            offset = item.offset_at(station)
        else:
            return True
        boundaries = geometry.offsets(station)
        beside = (offset > boundaries[:, 0]) | (offset < boundaries[:, -1])
        places = geometry.alignment.place(station, offset)
        return not bool((network.paves(places, _BESIDE) & beside).any())

    return {name: item for name, item in objects.items() if is_clear(item)}
