"""A road as OpenDRIVE 1.8, a `road` for each carriageway or, where both directions share one, for both.

It has line, surface, lanes, road marks, objects and signals.

The elements are written by small functions of ours: the library `scenariogeneration` puts the time of day into the
header and knows neither its offset nor heights of lanes, skeletons and user data of lanes.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...base.maps.crs import wkt
from ...road.geometry import RoadGeometry
from ...road.guidelines import GUIDELINE_OF_CLASS, is_single
from ...road.instances import InstanceNumbers
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.section import Carriageway, LineMarking, Median, Turnout
from ...road.streets.street_side import StreetSide
from ...road.surroundings import Landscape, Terrain, Vegetation, Vehicle
from ..plants import PlacedPlant, placed_plants
from ..speeds import ADVISORY, SpeedLimits
from ..things import placed_things, standing_things
from ..trace import LEVEL, Trace
from .entities import LOST, trace_elements
from .junctions import write_cuts, write_junctions
from .lanes import write_lanes
from .local_projection import LocalProjection
from .marks import RoadMarks
from .network import write_network
from .numbers import FreeIds
from .objects import Objects
from .places import Ground
from .sections import RULES, LanePlan
from .signals import Face, signal_faces, write_signals
from .surface import (
    RoadFrame,
    edge_points,
    elevation_profile,
    header_bounds,
    lateral_profile,
    plan_view,
    road_frames,
)
from .xml import Element, Value, add_cdata, add_user_data, element, write_xml

REVISION = (1, 8)
_GROUND = 0.001
"""Largest distance (m) of barriers from the ground that they stand on, whatever the tolerance."""


def write_opendrive(parameters: RoadParameters, path: Path, tolerance: float, local_projection: bool = False) -> Trace:
    """Write a road as an OpenDRIVE 1.8 file; return the trace of what became of each object.

    Coordinates in it are local; the header's offset adds the map origin, and its ``geoReference`` names the map's
    coordinate system; or they are those of a projection about the map origin, without an offset. Each carriageway is a
    road of its own along the same line, with its own superelevation; both directions of a country road are one. Lanes,
    line and surface don't depend on the tolerance.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error (m) of lines that follow no lane.
        local_projection: whether coordinates are those of a `LocalProjection` about the map origin.

    Raises:
        InputError: an object stands beyond the road's end, or the coordinate system isn't known here.
    """
    geometry = RoadGeometry(parameters)
    root = element(None, "OpenDRIVE")
    translate = np.array(parameters.transform.translate, dtype=np.float64)
    local = LocalProjection.about(parameters.metadata.epsg, translate) if local_projection else None
    _header(root, geometry, local)
    ground = Ground(geometry, min(tolerance, _GROUND))
    numbers = FreeIds(parameters)
    trace = Trace(geometry, within=("dash",), reasons=LOST)
    plants = list(placed_plants(geometry))
    things_by_name = {placed.name: placed for placed in standing_things(geometry)}
    faces = signal_faces(things_by_name.values(), numbers)
    ramp_cuts = write_network(root, geometry, numbers)
    for frame in road_frames(geometry):
        name, number = _name_of_road(frame)
        road = element(root, "road", {"name": name, "id": number, **_attributes(geometry)})
        objects = Objects(element(None, "objects"), ground, frame, numbers, things_by_name)
        plan = _road(road, objects, faces, plants)
        trace.record_entity(parameters.alignment.instance, element="planView", road=number)
        if geometry.mouths and len(frame.sides) > 1:
            for piece in write_junctions(root, road, plan, numbers):
                trace.record_entity(parameters.alignment.instance, element="planView", road=piece)
        elif any(shape.joined for shape in frame.section.turnouts):
            cuts = [cut for cut in ramp_cuts if cut.side == frame.side]
            for piece in write_cuts(root, road, plan, numbers, [cut.place for cut in cuts]):
                trace.record_entity(parameters.alignment.instance, element="planView", road=piece)
    trace_elements(root, trace)
    _list_unwritten(root, parameters)
    if local:
        local.turn_plan(root, edge_points(geometry))
    write_xml(root, path)
    for plant in plants:
        trace.record_plant(plant)
    for name in dict.fromkeys(plant.stand for plant in plants):
        trace.record_loss(name, "a plant is the upright cylinder around it")
    for placed in placed_things(geometry, tolerance):
        trace.record_omissions(placed)
    return trace


def _name_of_road(frame: RoadFrame) -> tuple[str, int]:
    """Return the name and id of a `road` element: its carriageway's, or the centreline's with both directions."""
    parameters = frame.geometry.parameters
    kinds = Carriageway if len(frame.sides) == 1 else AlignmentObject
    own = frame.section.carriageway if len(frame.sides) == 1 else parameters.alignment
    return next((name, item.instance) for name, item in parameters.of_type(kinds).items() if item is own)


def _attributes(geometry: RoadGeometry) -> dict[str, Value]:
    """Return the attributes that the `road` elements of all carriageways have in common."""
    return {"junction": "-1", "length": geometry.length, "rule": RULES[geometry.parameters.traffic_side]}


def _road(road: Element, objects: Objects, faces: list[Face], plants: list[PlacedPlant]) -> LanePlan:
    """Fill in a `road` element: type, plan, profiles, lanes, objects, signals; return its lanes."""
    frame = objects.frame
    geometry, limits_by_side = frame.geometry, {side: SpeedLimits(frame.geometry, side) for side in frame.sides}
    limits = limits_by_side[frame.side]
    road_type = "rural" if is_single(geometry.parameters.design_class) else "motorway"
    country = GUIDELINE_OF_CLASS[geometry.parameters.design_class].country
    kind = element(road, "type", {"s": 0.0, "type": road_type, "country": country})
    if limits.without == ADVISORY:
        element(kind, "speed", {"max": "no limit", "unit": "km/h"})
    else:
        element(kind, "speed", {"max": limits.without, "unit": "km/h"})
    plan_view(road, geometry)
    elevation_profile(road, frame)
    lateral_profile(road, frame)
    plan = LanePlan(frame)
    marks = RoadMarks(plan)
    write_lanes(road, plan, limits_by_side, marks)
    road.append(objects.parent)
    objects.write(marks.loose)
    objects.plants(plants)
    objects.underpasses()
    objects.bridges()
    write_signals(element(road, "signals"), objects.ground, frame, faces)
    add_user_data(road, "instance", road.get("id"))
    add_user_data(road, "side", frame.side if len(frame.sides) == 1 else "both")
    return plan


def _header(root: Element, geometry: RoadGeometry, local: LocalProjection | None) -> None:
    """Add the `header` element, without a date so that the same road gives the same bytes.

    Args:
        root: of the file.
        geometry: the road.
        local: projection that takes the place of the map's system and the offset; None for these.
    """
    parameters = geometry.parameters
    metadata = parameters.metadata
    attributes: dict[str, Value] = {
        "revMajor": REVISION[0],
        "revMinor": REVISION[1],
        "name": metadata.identifier,
        "version": "1",
    }
    header = element(root, "header", {**attributes, **header_bounds(geometry), "vendor": metadata.generator})
    add_cdata(header, "geoReference", local.text if local else geo_reference(metadata.epsg))
    if local is None:
        x, y, z = parameters.transform.translate
        element(header, "offset", {"x": float(x), "y": float(y), "z": float(z), "hdg": 0.0})
    add_user_data(header, "epsg", metadata.epsg)
    if metadata.height_epsg is not None:
        add_user_data(header, "height_epsg", metadata.height_epsg)
    add_user_data(header, "title", metadata.title)
    add_user_data(header, "level_of_detail", LEVEL)


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
    """Return a PROJ string for a plain Transverse Mercator coordinate system, else its WKT.

    A datum other than WGS 84's or ETRS89's has no PROJ string that would say it exactly: WKT names it.

    Raises:
        InputError: the code is unknown.
    """
    text = wkt(epsg)
    parameter_texts = dict(re.findall(r'PARAMETER\["(\w+)",([-0-9.]+)\]', text))
    spheroid = re.search(r'SPHEROID\["([^"]+)"', text)
    datum = re.search(r'DATUM\["([^"]+)"', text)
    is_transverse_mercator = (
        text.startswith("PROJCS") and 'PROJECTION["Transverse_Mercator"]' in text and set(parameter_texts) == set(_PROJ)
    )
    if not (is_transverse_mercator and spheroid and datum and datum[1] in _PLAIN_DATUMS):
        return text
    values = " ".join(f"+{key}={parameter_texts[name]}" for name, key in _PROJ.items())
    return f"+proj=tmerc {values} +ellps={_ELLIPSOIDS[spheroid[1]]} +units=m +vunits=m +no_defs"


def _list_unwritten(root: Element, parameters: RoadParameters) -> None:
    """Add user data to the root for objects without an element: centreline, owners of lanes, ground, traffic."""
    numbers = InstanceNumbers(parameters)
    of_the_road = (AlignmentObject, Carriageway, Median, Turnout, StreetSide, LineMarking)
    kinds = (*of_the_road, Terrain, Vegetation, Vehicle, Landscape)
    for name, item in parameters.objects.items():
        if isinstance(item, kinds):
            entry = element(root, "userData", {"code": "instance", "value": item.instance})
            part_numbers = numbers.part_attributes(item.instance)
            element(
                entry,
                "parameterObject",
                {"id": name, "type": type(item).__name__, "instance": item.instance, **part_numbers},
            )
