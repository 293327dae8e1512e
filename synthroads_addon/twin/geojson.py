"""GeoJSON in map coordinates: centreline, lanes, lane lines, boundaries, markings, and where furniture stands."""

from __future__ import annotations

from pathlib import Path

from ..base.schema import compact_json
from ..road.axes.centerline import centerline_geojson
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters
from .features import LEVEL, LOST, RoadFeatures
from .surfaces import road_stations
from .trace import Trace


def write_geojson(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's lines and points as GeoJSON in map coordinates; return the trace of what became of each object.

    Coordinates are those of the parameter set's reference system, named by the member ``crs`` (GeoJSON 2008): degrees
    of WGS 84, which RFC 7946 wants, would cost millimetres.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curved lines, m, > 0.
    """
    geometry = RoadGeometry(parameters)
    stations = road_stations(geometry, tolerance)
    trace = Trace(geometry, LEVEL, ("dash",), LOST)
    collection = centerline_geojson(geometry, stations) | {"level_of_detail": LEVEL}
    features = collection.pop("features")
    for feature in features:
        feature["properties"] = {"feature": "centerline", "object_type": "Alignment"} | feature["properties"]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(compact_json(collection)[:-1] + ',"features":[')
        separator = "\n"
        road_features = RoadFeatures(geometry, stations, tolerance, trace).features()
        for number, feature in enumerate((*features, *road_features)):
            trace.record_entity(feature["properties"]["instance"], feature=number)
            file.write(separator + compact_json(feature))
            separator = ",\n"
        file.write("\n]}\n")
    return trace
