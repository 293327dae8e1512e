"""A road as OpenDRIVE 1.8, a road per carriageway: line, surface, lanes, road marks, objects and signals.

The elements are written by small functions of ours: the library `scenariogeneration` puts the time of day into the
header and knows neither its offset nor heights of lanes, skeletons and user data of lanes.
"""

from __future__ import annotations

import re
from pathlib import Path

from ...base.crs import wkt
from ...road.geometry import RoadGeometry
from ...road.instances import InstanceNumbers
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.section import Carriageway, LineMarking, Median, Turnout
from ...road.surroundings import Terrain, Vegetation, Vehicle
from ..plants import PlacedPlant, placed_plants
from ..things import placed_things, standing_things
from ..trace import LEVEL, Trace
from .entities import LOST, trace_elements
from .lanes import lanes
from .marks import RoadMarks
from .numbers import Numbers
from .objects import Objects
from .places import Ground
from .sections import LanePlan
from .signals import Face, faces_of, write_signals
from .speeds import ADVISORY, SpeedLimits
from .surface import RoadFrame, bounds, elevation_profile, lateral_profile, plan_view
from .xml import Element, Value, element, note, verbatim, write

REVISION = (1, 8)
_GROUND = 0.001
"""Largest distance (m) of barriers from the ground that they stand on, whatever the tolerance."""


def write_opendrive(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's geometric-semantic model as an OpenDRIVE file; return what became of its objects.

    Coordinates in it are local; the header's offset adds the map origin, and its ``geoReference`` names the map's
    coordinate system. Each carriageway is a road of its own along the same line, with its own superelevation. Lanes,
    line and surface don't depend on the tolerance.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error (m) of lines that follow no lane.

    Raises:
        InputError: an object stands beyond the road's end, or the coordinate system isn't known here.
    """
    geometry = RoadGeometry(parameters)
    root = element(None, "OpenDRIVE")
    _header(root, geometry)
    ground = Ground(geometry, min(tolerance, _GROUND))
    numbers = Numbers(parameters)
    trace = Trace(geometry, within=("dash",), reasons=LOST)
    plants = list(placed_plants(geometry))
    standing = {placed.name: placed for placed in standing_things(geometry)}
    faces = faces_of(standing.values(), numbers)
    for name, item in parameters.of_type(Carriageway).items():
        road = element(root, "road", {"name": name, "id": item.instance, **_attributes(geometry)})
        frame = RoadFrame(geometry, item.side)
        objects = Objects(element(None, "objects"), ground, frame, numbers, standing)
        _road(road, objects, faces, plants)
        trace.found(parameters.alignment.instance, element="planView", road=item.instance)
    trace_elements(root, trace)
    _list_rest(root, parameters)
    write(root, path)
    for plant in plants:
        trace.grow(plant)
    for name in dict.fromkeys(plant.stand for plant in plants):
        trace.reduce(name, "a plant is the upright cylinder around it")
    for placed in placed_things(geometry, tolerance):
        trace.leave_out(placed)
    return trace


def _attributes(geometry: RoadGeometry) -> dict[str, Value]:
    return {"junction": "-1", "length": geometry.length, "rule": "RHT"}


def _road(road: Element, objects: Objects, faces: list[Face], plants: list[PlacedPlant]) -> None:
    """Fill in the road of one carriageway."""
    frame = objects.frame
    geometry, limits = frame.geometry, SpeedLimits(frame.geometry, frame.side)
    kind = element(road, "type", {"s": 0.0, "type": "motorway", "country": "DE"})
    if limits.without == ADVISORY:
        element(kind, "speed", {"max": "no limit"})
    else:
        element(kind, "speed", {"max": limits.without, "unit": "km/h"})
    plan_view(road, geometry)
    elevation_profile(road, frame)
    lateral_profile(road, frame)
    plan = LanePlan(frame)
    marks = RoadMarks(plan)
    lanes(road, plan, limits, marks)
    road.append(objects.parent)
    objects.write(marks.loose)
    objects.plants(plants)
    objects.underpasses()
    write_signals(element(road, "signals"), objects.ground, frame, faces)
    note(road, "instance", frame.section.carriageway.instance)
    note(road, "side", frame.side)


def _header(root: Element, geometry: RoadGeometry) -> None:
    """Add the header, without a date: the same road has the same bytes."""
    parameters = geometry.parameters
    metadata = parameters.metadata
    attributes: dict[str, Value] = {
        "revMajor": REVISION[0],
        "revMinor": REVISION[1],
        "name": metadata.identifier,
        "version": "1",
    }
    header = element(root, "header", {**attributes, **bounds(geometry), "vendor": metadata.generator})
    verbatim(header, "geoReference", geo_reference(metadata.epsg))
    x, y, z = parameters.transform.translate
    element(header, "offset", {"x": float(x), "y": float(y), "z": float(z), "hdg": 0.0})
    note(header, "epsg", metadata.epsg)
    note(header, "title", metadata.title)
    note(header, "level_of_detail", LEVEL)


_PROJ = {
    "latitude_of_origin": "lat_0",
    "central_meridian": "lon_0",
    "scale_factor": "k",
    "false_easting": "x_0",
    "false_northing": "y_0",
}
_ELLIPSOIDS = {"GRS 1980": "GRS80", "WGS 84": "WGS84"}
_PLAIN_DATUMS = ("European_Terrestrial_Reference_System_1989", "WGS_1984")


def geo_reference(epsg: int) -> str:
    """Return a coordinate system as a PROJ string if it is a plain Transverse Mercator one, else as WKT.

    A datum other than WGS 84's or ETRS89's has no PROJ string that would say it exactly: WKT names it.

    Raises:
        InputError: the code is unknown, or it isn't shipped and `pyproj` isn't installed.
    """
    text = wkt(epsg)
    number = dict(re.findall(r'PARAMETER\["(\w+)",([-0-9.]+)\]', text))
    spheroid = re.search(r'SPHEROID\["([^"]+)"', text)
    datum = re.search(r'DATUM\["([^"]+)"', text)
    plain = text.startswith("PROJCS") and 'PROJECTION["Transverse_Mercator"]' in text and set(number) == set(_PROJ)
    if not (plain and spheroid and datum and datum[1] in _PLAIN_DATUMS):
        return text
    values = " ".join(f"+{key}={number[name]}" for name, key in _PROJ.items())
    return f"+proj=tmerc {values} +ellps={_ELLIPSOIDS[spheroid[1]]} +units=m +vunits=m +no_defs"


def _list_rest(root: Element, parameters: RoadParameters) -> None:
    """Name what has no element of its own: centreline, parts whose lanes bear their number, ground, plants, traffic."""
    numbers = InstanceNumbers(parameters)
    kinds = (AlignmentObject, Carriageway, Median, Turnout, LineMarking, Terrain, Vegetation, Vehicle)
    for name, item in parameters.objects.items():
        if isinstance(item, kinds):
            entry = element(root, "userData", {"code": "instance", "value": item.instance})
            first = numbers.part_attributes(item.instance)
            element(
                entry,
                "parameterObject",
                {"id": name, "type": type(item).__name__, "instance": item.instance, **first},
            )
