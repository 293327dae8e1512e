"""Inventory of a road's things by station, as CSV: what road authorities keep of their furniture."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..road.geometry import RoadGeometry
from ..road.objects import LineObject, PointObject
from ..road.parameters import RoadParameters
from ..road.things.thing import Thing
from .attributes import attributes_of
from .surfaces import surface_points
from .trace import Trace

_LEVEL = "a row for each thing, without its shape"
_NO_ROW = "it is no thing: the inventory has what stands on and beside the road"
_LOST = dict.fromkeys(
    ("RoadObject", "dash", "strip", "rut", "pothole", "patch", "crack", "removed", "tree", "shrub"), _NO_ROW
)
"""Type of object, or kind of part -> why the file has none."""
_HEAD = (
    *("station", "end_station", "offset", "side", "object_type", "class", "id", "instance"),
    *("x", "y", "z", "attributes"),
)
_DIGITS = 4
"""Decimals of stations, offsets and coordinates: 0.1 mm."""


def write_inventory(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's things as rows of a CSV file, by station; return the trace of what became of each object.

    Coordinates are map coordinates of a thing's foot, or of the first point of one along the road. What else its
    parameters say is JSON in the last column.

    Args:
        parameters: the road.
        path: the file.
        tolerance: without effect: there are no lines.
    """
    geometry = RoadGeometry(parameters)
    trace = Trace(geometry, _LEVEL, (), _LOST)
    things = [(name, item) for name, item in parameters.objects.items() if isinstance(item, Thing)]
    rows = [_row(geometry, name, item) for name, item in things]
    rows.sort(key=lambda row: (row["station"], row["instance"]))
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _HEAD, lineterminator="\n")
        writer.writeheader()
        for number, row in enumerate(rows, 1):
            trace.record_entity(row["instance"], row=number)
            writer.writerow(row)
    return trace


def _row(geometry: RoadGeometry, name: str, item: Thing) -> dict[str, Any]:
    """Return the row of one thing."""
    attributes = attributes_of(item)
    row = {key: attributes.pop(key) for key in ("instance", "object_type", "class")} | {"id": name}
    if isinstance(item, LineObject):
        station, end_station = item.start_station, item.end_station
        offset = float(np.asarray(item.offset_at(np.array([station]))).ravel()[0])
    else:
        assert isinstance(item, PointObject)
        station, end_station, offset = item.station, None, item.offset
    for key in ("station", "start_station", "end_station", "offset"):
        attributes.pop(key, None)
    place = surface_points(geometry, np.array([station]), np.array([offset]))[0]
    place[2] += getattr(item, "elevation", 0.0)
    x, y, z = np.round(place + np.array(geometry.parameters.transform.translate), _DIGITS).tolist()
    row |= {"station": round(station, _DIGITS), "offset": round(offset, _DIGITS), "x": x, "y": y, "z": z}
    row |= {"end_station": None if end_station is None else round(end_station, _DIGITS)}
    side = "middle" if offset == 0.0 else "left" if offset > 0.0 else "right"
    return row | {"side": side, "attributes": json.dumps(attributes, sort_keys=True, ensure_ascii=False)}
