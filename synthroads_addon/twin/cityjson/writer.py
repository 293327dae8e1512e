"""CityJSON 2.0: the road as Roads with their traffic areas and markings, furniture as bodies, overpasses as Bridges."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.objects import LineObject, PointObject
from ...road.parameters import RoadParameters
from ...road.section import Arrow
from ...road.things.asset import Asset
from ...road.things.overpass import Overpass
from ..attributes import attributes_of
from ..bodies.along import bodies_along
from ..bodies.at import Place, bodies_at, bridge_bodies, places_of
from ..faces import Faces
from ..surfaces import road_stations
from .model import CityGeometry, CityModel, CityObject, solids
from .road import road_objects


def write_cityjson(parameters: RoadParameters, path: Path, tolerance: float) -> None:
    """Write a road as CityJSON 2.0.

    Vertices are whole tenths of millimetres from the parameter set's origin, which is the file's ``transform``.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curved surfaces, m, > 0.
    """
    geometry = RoadGeometry(parameters)
    model = CityModel(parameters.transform.translate)
    for item in road_objects(geometry, road_stations(geometry, tolerance), tolerance):
        model.add(item)
    for item in furniture_objects(geometry, tolerance):
        model.add(item)
    about = parameters.metadata
    metadata = {"identifier": about.identifier, "referenceSystem": about.referenceSystem}
    if about.title:
        metadata["title"] = about.title
    model.write(path, metadata)


_LOD = "2"


def furniture_objects(geometry: RoadGeometry, tolerance: float) -> Iterator[CityObject]:
    """Yield everything that stands on and beside the road, in the order of the parameter set.

    Args:
        geometry: the road.
        tolerance: chord error of what runs along the road, m.
    """
    objects = geometry.parameters.objects
    standing = {name: item for name, item in objects.items() if isinstance(item, PointObject) and not _is_painted(item)}
    places = dict(zip(standing, places_of(geometry, list(standing.values())), strict=True))
    for name, item in objects.items():
        if isinstance(item, Overpass):
            yield from _bridge(places[name], name, item)
        elif isinstance(item, LineObject):
            bodies = solids(bodies_along(geometry, item, tolerance), _LOD)
            yield CityObject(name, "CityFurniture", attributes_of(item), bodies)
        elif isinstance(item, Asset):
            yield CityObject(name, "CityFurniture", attributes_of(item), _point(places[name]))
        elif name in standing and isinstance(item, PointObject):
            bodies = solids(bodies_at(places[name], item), _LOD)
            yield CityObject(name, "CityFurniture", attributes_of(item), bodies)


def _is_painted(item: PointObject) -> bool:
    return isinstance(item, Arrow)


def _point(place: Place) -> tuple[CityGeometry, ...]:
    """Return a free asset's place: what it looks like is its library's."""
    point = Faces(place.origin[None], np.zeros(1, np.int64), np.ones(1, np.int64))
    return (CityGeometry("MultiPoint", "0", (point,)),)


def _bridge(place: Place, name: str, bridge: Overpass) -> Iterator[CityObject]:
    """Yield a Bridge, which has no geometry itself, and its constructive elements."""
    parts = {f"{name}/{part}": body for part, body in bridge_bodies(place, bridge).items()}
    yield CityObject(name, "Bridge", attributes_of(bridge), children=tuple(parts))
    for part, body in parts.items():
        function = part.rpartition("/")[2].rstrip("-0123456789")
        about = {"instance": bridge.instance, "class": "bridge", "function": function}
        yield CityObject(part, "BridgeConstructiveElement", about, solids([body], _LOD), parent=name)
