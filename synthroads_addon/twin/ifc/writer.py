"""A road as IFC 4.3 (IFC4X3_ADD2): alignment, road parts, pavement, markings, furniture, structures, surroundings.

Coordinates are local (x east, y north, z up); an IfcMapConversion says where they lie on the map. `docs/twin-ifc.md`
has the table of what becomes what.
"""

from __future__ import annotations

from pathlib import Path

from ...base.errors import InputError
from ...road.geometry import RoadGeometry
from ...road.parameters import PointObject, RoadParameters
from ..surfaces import road_stations
from .alignment import write_alignment
from .barriers import write_barriers
from .bridges import write_overpasses
from .entities import IfcFile
from .furniture import write_furniture
from .gantries import write_gantries
from .markings import write_markings
from .project import write_project
from .road import write_carriageways, write_road
from .scene import Scene
from .surroundings import write_surroundings

_LONGEST = 200_000.0
"""Longest road that is written as one file, m: as long as scenarios can be."""
_SHORTEST = 1e-3
"""Shortest road, m: lengths have six decimals."""


def write_ifc(parameters: RoadParameters, path: Path, tolerance: float = 0.005) -> None:
    """Write a road as IFC 4.3. The same road gives the same bytes.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of the road's surfaces, m; their vertices are exact.

    Raises:
        InputError: ifcopenshell isn't installed, the map coordinate system is unknown, or the road is too long or too
            short.
    """
    if parameters.alignment.length < _SHORTEST:
        raise InputError("alignment: length", parameters.alignment.length, "an IFC file holds a millimetre or more")
    if parameters.alignment.length > _LONGEST:
        raise InputError("alignment: length", parameters.alignment.length, "an IFC file holds up to 200 km (200000 m)")
    ifc = IfcFile(parameters.metadata.identifier)
    site = write_project(ifc, parameters)
    geometry = RoadGeometry(parameters)
    scene = Scene(
        ifc=ifc,
        geometry=geometry,
        axis=write_alignment(ifc, geometry),
        tolerance=tolerance,
        stations=road_stations(geometry, tolerance),
        site=site,
        road=write_road(ifc, parameters, site),
    )
    scene.look_up((item.station, item.offset) for item in parameters.of_type(PointObject).values())
    write_carriageways(scene)
    write_markings(scene)
    write_barriers(scene)
    write_furniture(scene)
    write_gantries(scene)
    write_overpasses(scene)
    write_surroundings(scene)
    ifc.relate()
    ifc.write(path, parameters.metadata.identifier, parameters.metadata.generator)
