"""The road as CityJSON's Road objects: centreline, carriageways, median and turnouts with semantic surfaces."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.network.patches import FILM
from ...road.objects import RoadObject
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad, OwnAxis
from ...road.pavement.cover import MarkingFilms
from ...road.pavement.joints import joint_width, joints_of
from ...road.section import Arrow, Carriageway, Crack, Hatching, LineMarking, Median, Patch, RemovedMarking, Turnout
from ...road.side_roads.mouth import Mouth
from ...road.side_roads.side_road import SideRoad
from ...road.streets.street_side import StreetSide
from ..attributes import attributes_of
from ..faces import Faces, Int, join_faces
from ..network import PARTS, NetworkRoad, network_roads
from ..side_roads import side_road_faces, side_road_paint_faces
from ..strips import StripSurface, strip_surfaces
from ..surfaces import damaged_surface, dash_surfaces, joint_surface, painted_surface, pothole_surface
from .model import CityGeometry, CityObject, line_faces

Float = NDArray[np.float64]
Surface = tuple[dict[str, Any], Faces]
"""A semantic surface and its polygons."""

LOD = "3"
_FUNCTIONS = {
    "median": "median",
    "lane": "driving lane",
    "turnout_lane": "driving lane",
    "bay": "emergency bay",
    "hard_shoulder": "hard shoulder",
    "turnout_shoulder": "hard shoulder",
    "inner_edge_strip": "edge strip",
    "outer_edge_strip": "edge strip",
    "turnout_edge_strip": "edge strip",
    "ramp_inner_strip": "edge strip",
    "gore": "gore",
    "island": "traffic island",
    "gutter": "gutter",
    "parking_bay": "parking bay",
    "kerb_face": "kerb",
    "kerb": "kerb",
    "footway": "footway",
    "verge": "soft shoulder",
}
"""Kind of strip -> what it is for."""
_GRASS = ("verge", "island", "median")
_LANES = {"exit": "deceleration lane", "entry": "acceleration lane"}
_TRAFFIC = ("lane", "turnout_lane", "parking_bay", "footway")
"""Strips that vehicles or people move on; the others are auxiliary."""
_DAMAGE_FUNCTIONS = {Patch: "patch", Crack: "crack", RemovedMarking: "removed marking"}


def road_objects(geometry: RoadGeometry, stations: Float, tolerance: float) -> Iterator[CityObject]:
    """Yield the CityJSON Road objects: the centreline's, then one per carriageway, median, turnout and
    street side.

    Args:
        geometry: the road.
        stations: (N,) stations at which its surface is sampled.
        tolerance: chord error within damage, m.
    """
    parameters = geometry.parameters
    xy = geometry.alignment.position(stations)
    axis = line_faces([np.column_stack([xy, geometry.profile.elevation(stations)])])
    name = next(name for name, item in parameters.objects.items() if item is parameters.alignment)
    attributes = attributes_of(parameters.alignment) | {
        "class": "motorway",
        "function": "centreline",
        "design_class": parameters.design_class,
        "length": round(geometry.length, 6),
    }
    yield CityObject(name, "Road", attributes, (CityGeometry("MultiLineString", "0", (axis,)),))
    surfaces = _surfaces(geometry, stations, tolerance)
    for name, item in parameters.objects.items():
        if isinstance(item, Carriageway | Median | Turnout | SideRoad | StreetSide | OwnAxis):
            yield _road(geometry, name, item, surfaces.pop(item.instance, []))


def _road(geometry: RoadGeometry, name: str, item: RoadObject, surfaces: list[Surface]) -> CityObject:
    """Return the CityJSON Road of a part of the road, with its semantic surfaces as one MultiSurface."""
    names = {Carriageway: "carriageway", Median: "median", SideRoad: "side road", StreetSide: "street side"}
    names |= {CrossingRoad: "crossing road", ConnectingRamp: "ramp"}
    function = names.get(type(item), "turnout")
    if isinstance(item, Turnout):
        function = item.kind.replace("_", " ")
    attributes = attributes_of(item) | {"class": "motorway", "function": function}
    if isinstance(item, Carriageway):
        attributes["direction"] = "with stations" if item.traffic > 0 else "against stations"
        if ruts := item.pavement.ruts:
            attributes["rut_instances"] = dict(geometry.numbers.part(name, number) for number in range(len(ruts)))
    if not surfaces:
        return CityObject(name, "Road", attributes)
    faces_of_surfaces = [surface_faces for _, surface_faces in surfaces]
    values = np.repeat(np.arange(len(surfaces)), [len(surface_faces) for surface_faces in faces_of_surfaces])
    semantics = tuple(attributes_of_surface for attributes_of_surface, _ in surfaces)
    shape = CityGeometry("MultiSurface", LOD, (join_faces(faces_of_surfaces),), semantics, values)
    return CityObject(name, "Road", attributes, (shape,))


def _surfaces(geometry: RoadGeometry, stations: Float, tolerance: float) -> dict[int, list[Surface]]:
    """Return the semantic surfaces of each Road by its instance number: strips, markings and damage with an area."""
    by_road: dict[int, list[Surface]] = {}
    for surface in strip_surfaces(geometry, stations, tolerance):
        by_road.setdefault(surface.instance, []).append((_strip_semantics(geometry, surface), surface.faces))
    for name, item in geometry.parameters.objects.items():
        if isinstance(item, LineMarking | Hatching | Arrow):
            owner = geometry.parameters.objects[item.turnout if isinstance(item, Hatching) else item.carriageway]
            by_road.setdefault(owner.instance, []).extend(_marking(geometry, name, item, stations))
    for mouth in geometry.mouths.values():
        by_road[mouth.side_road.instance] = _side_road(geometry, mouth)
    for road in network_roads(geometry):
        by_road[road.item.instance] = _network_road(road)
    for name, carriageway in geometry.parameters.of_type(Carriageway).items():
        surfaces = by_road.setdefault(carriageway.instance, [])
        for number, pothole in enumerate(carriageway.pavement.potholes, len(carriageway.pavement.ruts)):
            part, instance = geometry.numbers.part(name, number)
            semantics = {"type": "TransportationHole", "function": "pothole", "id": part, "instance": instance}
            semantics |= pothole.model_dump()
            surfaces.append((semantics, pothole_surface(geometry, pothole, tolerance)))
        pavement = carriageway.pavement
        first_number, films = len(pavement.ruts) + len(pavement.potholes), MarkingFilms(geometry, carriageway.side)
        surface_damages: list[Patch | Crack | RemovedMarking] = [
            *pavement.patches,
            *pavement.cracks,
            *pavement.removed_markings,
        ]
        for number, damage in enumerate(surface_damages, first_number):
            part, instance = geometry.numbers.part(name, number)
            semantics = {"type": "+PavementDamage", "function": _DAMAGE_FUNCTIONS[type(damage)], "id": part}
            semantics |= {"instance": instance} | damage.model_dump(exclude={"outline", "lines"})
            surfaces.append((semantics, damaged_surface(geometry, damage, carriageway.side, stations, films)))
        surfaces += _joints(geometry, name, carriageway, stations)
    return {instance: [pair for pair in pairs if len(pair[1])] for instance, pairs in by_road.items()}


def _side_road(geometry: RoadGeometry, mouth: Mouth) -> list[Surface]:
    """Return the semantic surfaces of a side road: pavement, verges and markings."""
    carriageway = mouth.section.carriageway
    shared = {"instance": mouth.side_road.instance, "side": carriageway.side}
    pavement = {"type": "TrafficArea", "function": "driving lane", "surfaceMaterial": [carriageway.pavement.kind]}
    verge = {"type": "AuxiliaryTrafficArea", "function": "soft shoulder", "surfaceMaterial": ["grass"]}
    marking = {"type": "TransportationMarking", "function": "line", "film_thickness": FILM, "color": "white"}
    return [
        (pavement | {"strip": "side_road"} | shared, side_road_faces(geometry, mouth, "pavement")),
        (verge | {"strip": "verge"} | shared, side_road_faces(geometry, mouth, "verge")),
        (marking | shared, side_road_paint_faces(geometry, mouth)),
    ]


def _network_road(road: NetworkRoad) -> list[Surface]:
    """Return the semantic surfaces of a crossing road or a ramp: pavement, verges and markings."""
    shared = {"instance": road.item.instance}
    strip = "crossing_road" if isinstance(road.item, CrossingRoad) else "ramp"
    pavement = {"type": "TrafficArea", "function": "driving lane", "surfaceMaterial": ["asphalt"], "strip": strip}
    verge = {
        "type": "AuxiliaryTrafficArea",
        "function": "soft shoulder",
        "surfaceMaterial": ["grass"],
        "strip": "verge",
    }
    marking = {"type": "TransportationMarking", "function": "line", "film_thickness": FILM, "color": "white"}
    parts: list[dict[str, Any]] = [pavement, verge, marking]
    return [(item | shared, road.faces[kind]) for kind, item in zip(PARTS, parts, strict=True)]


def _joints(geometry: RoadGeometry, name: str, carriageway: Carriageway, stations: Float) -> Iterator[Surface]:
    """Yield the semantic surfaces of a carriageway's joints, one each."""
    section, pavement = geometry.sections[carriageway.side], carriageway.pavement
    shared = {"instance": carriageway.instance, "width": joint_width(section), "depth": pavement.joint_depth}
    for number, joint in enumerate(joints_of(section, stations)):
        semantics = {"type": "+PavementJoint", "function": f"{joint.kind} joint", "id": f"{name}/joint-{number}"}
        yield semantics | shared | {"sealed": pavement.is_concrete}, joint_surface(geometry, joint, stations)


def _strip_semantics(geometry: RoadGeometry, surface: StripSurface) -> dict[str, Any]:
    """Return the CityJSON semantics of a strip's surface: type, function, material, lane, instance number."""
    strip = surface.strip
    semantics: dict[str, Any] = {
        "type": "TrafficArea" if strip.kind in _TRAFFIC else "AuxiliaryTrafficArea",
        "function": _FUNCTIONS[strip.kind],
        "surfaceMaterial": ["grass" if strip.kind in _GRASS else geometry.material(strip, surface.instance)],
        "strip": strip.kind,
        "instance": surface.instance,
    }
    if strip.side:
        semantics["side"] = strip.side
        section = geometry.sections[strip.side]
        if surface.lane is not None:
            semantics |= {"lane": surface.lane, "lane_kind": section.carriageway.lanes[surface.lane].kind}
        for shape in section.turnouts if strip.kind == "turnout_lane" else ():
            if shape.turnout.instance == surface.instance:
                semantics["function"] = _LANES.get(shape.turnout.kind, semantics["function"])
    return semantics


def _marking(
    geometry: RoadGeometry, name: str, item: LineMarking | Hatching | Arrow, stations: Float
) -> Iterator[Surface]:
    """Yield the semantic surfaces of a marking: one for each dash of a line, one for a hatching or an arrow."""
    function = "line" if isinstance(item, LineMarking) else item.type.lower()
    semantics = {"type": "TransportationMarking", "function": function, "id": name, "instance": item.instance}
    semantics |= {"color": item.color, "film_thickness": item.film_thickness}
    if not isinstance(item, LineMarking):
        kind = {"kind": item.kind} if isinstance(item, Arrow) else {}
        yield semantics | kind, painted_surface(geometry, item, stations)
        return
    semantics |= {"kind": item.kind, "width": item.width}
    dashes, faces, owner = dash_surfaces(geometry, item, stations)
    starts = np.cumsum(faces.sizes) - faces.sizes
    for number, (start, end) in enumerate(dashes.tolist()):
        polygons = np.flatnonzero(owner == number)
        dash: dict[str, Any] = {"start_station": round(start, 6), "end_station": round(end, 6)}
        if item.dash_length:
            dash["id"], dash["instance"] = geometry.numbers.part(name, number)
        yield semantics | dash, _polygon_range(faces, starts, polygons)


def _polygon_range(faces: Faces, starts: Int, polygons: Int) -> Faces:
    """Return a contiguous range of polygons with only the points in the range of their indices.

    Args:
        faces: all polygons.
        starts: (F,) index of each polygon's first corner in ``faces.corners``.
        polygons: the consecutive numbers of the wanted polygons.
    """
    begin, end = int(starts[polygons[0]]), int(starts[polygons[-1]] + faces.sizes[polygons[-1]])
    corners = faces.corners[begin:end]
    first_point, end_point = int(corners.min()), int(corners.max()) + 1
    return Faces(faces.points[first_point:end_point], corners - first_point, faces.sizes[polygons])
