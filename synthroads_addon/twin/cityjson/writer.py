"""CityJSON 2.0: the road as Roads with their traffic areas and markings, furniture as bodies, overpasses as Bridges."""

from __future__ import annotations

from pathlib import Path

from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ..surfaces import road_stations
from .furniture import furniture_objects
from .model import CityModel
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
