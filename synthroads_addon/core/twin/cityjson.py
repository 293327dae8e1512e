"""CityJSON 2.0: the road as Roads with their traffic areas and markings, furniture as bodies, overpasses as Bridges."""

from __future__ import annotations

from pathlib import Path

from ..parameters.geometry import RoadGeometry
from ..parameters.model import RoadParameters
from .cityjson_furniture import furniture_objects
from .cityjson_model import CityModel
from .cityjson_road import road_objects
from .surfaces import road_stations


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
