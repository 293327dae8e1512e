"""The centreline as GeoJSON in map coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import RoadGeometry


def centerline_geojson(geometry: RoadGeometry, stations: NDArray[np.float64]) -> dict[str, Any]:
    """Return a FeatureCollection with the centreline through the given stations (N,), elevations included.

    Coordinates are those of the parameter set's reference system, named by the member ``crs`` (GeoJSON 2008); 0.1 mm.
    """
    metadata = geometry.parameters.metadata
    plan = geometry.alignment.position(stations)
    local = np.column_stack([plan, geometry.profile.elevation(stations)])
    points = np.round(local + np.array(geometry.parameters.transform.translate), 4)
    properties = {
        "id": "alignment",
        "instance": geometry.parameters.alignment.instance,
        "length": round(geometry.length, 6),
        "stations": np.round(stations, 4).tolist(),
    }
    line = {"type": "LineString", "coordinates": points.tolist()}
    return {
        "type": "FeatureCollection",
        "name": metadata.identifier,
        "crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{metadata.epsg}"}},
        "features": [{"type": "Feature", "properties": properties, "geometry": line}],
    }
