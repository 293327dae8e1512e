"""CityJSON 2.0: the road as Roads with their traffic areas and markings, furniture as bodies, overpasses as Bridges.

Around it the ground as TINRelief, plants one by one, and vehicles.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...base.maps.crs import EPSG_URI
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ..attributes import attributes_of
from ..faces import Faces, loft
from ..surfaces import road_stations
from ..things import Frame, PlacedThing, placed_things
from ..trace import Trace
from .model import CityGeometry, CityModel, CityObject, solid_geometry
from .road import road_objects
from .surroundings import add_surroundings


def write_cityjson(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road and its surroundings as CityJSON 2.0; return the trace of what became of each object.

    Vertices are whole tenths of millimetres from the parameter set's origin, which is the file's ``transform``.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curved surfaces, m, > 0.
    """
    geometry = RoadGeometry(parameters)
    trace = Trace(geometry, within=("rut",))
    model, stations = CityModel(parameters.transform.translate, trace), road_stations(geometry, tolerance)
    for item in road_objects(geometry, stations, tolerance):
        model.add(item)
    for item in furniture_objects(geometry, tolerance, trace):
        model.add(item)
    add_surroundings(model, geometry, stations, tolerance)
    road_metadata = parameters.metadata
    metadata = {"identifier": road_metadata.identifier, "referenceSystem": EPSG_URI.format(road_metadata.code)}
    if road_metadata.heightReferenceSystem:
        metadata["heightReferenceSystem"] = road_metadata.heightReferenceSystem
    if road_metadata.title:
        metadata["title"] = road_metadata.title
    model.write(path, metadata)
    return trace


_LOD = "3"
"""Level of detail of furniture and structures: true shapes without fittings."""


def furniture_objects(geometry: RoadGeometry, tolerance: float, trace: Trace) -> Iterator[CityObject]:
    """Yield the city objects of everything on and beside the road, a bridge's parts after the bridge.

    Args:
        geometry: the road.
        tolerance: chord error of what runs along the road, m.
        trace: it is told what is left out.
    """
    for placed in placed_things(geometry, tolerance):
        trace.record_omissions(placed)
        types, parts = placed.thing.twin(), _faces_of_parts(placed)
        attributes = attributes_of(placed.thing)
        if not types.cityjson_part:
            shapes = solid_geometry((face for faces in parts.values() for face in faces), _LOD) or _point(placed.frame)
            yield CityObject(placed.name, types.cityjson, attributes, shapes)
            continue
        names = {part: f"{placed.name}/{part}" for part in parts}
        yield CityObject(placed.name, types.cityjson, attributes, children=tuple(names.values()))
        for part, faces in parts.items():
            part_attributes = {"instance": placed.thing.instance, "class": placed.thing.semantic_class}
            part_attributes |= {"function": part.rstrip("-0123456789")}
            yield CityObject(
                names[part], types.cityjson_part, part_attributes, solid_geometry(faces, _LOD), parent=placed.name
            )


def _faces_of_parts(placed: PlacedThing) -> dict[str, list[Faces]]:
    """Return the closed bodies of a thing in local coordinates, by part name, without fittings."""
    parts: dict[str, list[Faces]] = {}
    for body in placed.bodies:
        if not body.detail:
            parts.setdefault(body.part, []).append(loft(placed.local_sections(body)))
    return parts


def _point(frame: Frame | None) -> tuple[CityGeometry, ...]:
    """Return a MultiPoint at a frame's origin for a thing whose shape isn't known; empty if the frame is None."""
    if frame is None:
        return ()
    point = Faces(frame.origin[None], np.zeros(1, np.int64), np.ones(1, np.int64))
    return (CityGeometry("MultiPoint", "0", (point,)),)
