"""The road as CityJSON's Road objects: centreline, carriageways, median and turnouts with semantic surfaces."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject
from ...road.pavement.cover import MarkingFilms
from ...road.pavement.joints import joint_width, joints_of
from ...road.section import Arrow, Carriageway, Crack, Hatching, LineMarking, Median, Patch, RemovedMarking, Turnout
from ..attributes import attributes_of
from ..faces import Faces, Int, join_faces
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
    "verge": "soft shoulder",
}
"""Kind of strip -> what it is for."""
_LANES = {"exit": "deceleration lane", "entry": "acceleration lane"}
_DRIVEN = ("lane", "turnout_lane")
_DAMAGE_FUNCTIONS = {Patch: "patch", Crack: "crack", RemovedMarking: "removed marking"}


def road_objects(geometry: RoadGeometry, stations: Float, tolerance: float) -> Iterator[CityObject]:
    """Yield the CityJSON Road objects: the centreline's, then one per carriageway, median and turnout.

    Args:
        geometry: the road.
        stations: (N,) stations at which its surface is sampled.
        tolerance: chord error within damage, m.
    """
    parameters = geometry.parameters
    plan = geometry.alignment.position(stations)
    axis = line_faces([np.column_stack([plan, geometry.profile.elevation(stations)])])
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
        if isinstance(item, Carriageway | Median | Turnout):
            yield _road(geometry, name, item, surfaces.pop(item.instance, []))


def _road(geometry: RoadGeometry, name: str, item: RoadObject, surfaces: list[Surface]) -> CityObject:
    function = {Carriageway: "carriageway", Median: "median"}.get(type(item), "turnout")
    if isinstance(item, Turnout):
        function = item.kind.replace("_", " ")
    attributes = attributes_of(item) | {"class": "motorway", "function": function}
    if isinstance(item, Carriageway):
        attributes["direction"] = "with stations" if item.traffic > 0 else "against stations"
        if ruts := item.pavement.ruts:
            attributes["rut_instances"] = dict(geometry.numbers.part(name, number) for number in range(len(ruts)))
    if not surfaces:
        return CityObject(name, "Road", attributes)
    faces = [part for _, part in surfaces]
    values = np.repeat(np.arange(len(surfaces)), [len(part) for part in faces])
    semantics = tuple(about for about, _ in surfaces)
    shape = CityGeometry("MultiSurface", LOD, (join_faces(faces),), semantics, values)
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
    for name, carriageway in geometry.parameters.of_type(Carriageway).items():
        surfaces = by_road.setdefault(carriageway.instance, [])
        for number, pothole in enumerate(carriageway.pavement.potholes, len(carriageway.pavement.ruts)):
            part, instance = geometry.numbers.part(name, number)
            about = {"type": "TransportationHole", "function": "pothole", "id": part, "instance": instance}
            about |= pothole.model_dump()
            surfaces.append((about, pothole_surface(geometry, pothole, tolerance)))
        pavement = carriageway.pavement
        first, films = len(pavement.ruts) + len(pavement.potholes), MarkingFilms(geometry, carriageway.side)
        laid: list[Patch | Crack | RemovedMarking] = [*pavement.patches, *pavement.cracks, *pavement.removed_markings]
        for number, damage in enumerate(laid, first):
            part, instance = geometry.numbers.part(name, number)
            about = {"type": "+PavementDamage", "function": _DAMAGE_FUNCTIONS[type(damage)], "id": part}
            about |= {"instance": instance} | damage.model_dump(exclude={"outline", "lines"})
            surfaces.append((about, damaged_surface(geometry, damage, carriageway.side, stations, films)))
        surfaces += _joints(geometry, name, carriageway, stations)
    return {instance: [pair for pair in pairs if len(pair[1])] for instance, pairs in by_road.items()}


def _joints(geometry: RoadGeometry, name: str, carriageway: Carriageway, stations: Float) -> Iterator[Surface]:
    """Yield the semantic surfaces of a carriageway's joints, one each."""
    section, pavement = geometry.sections[carriageway.side], carriageway.pavement
    same = {"instance": carriageway.instance, "width": joint_width(section), "depth": pavement.joint_depth}
    for number, joint in enumerate(joints_of(section, stations)):
        about = {"type": "+PavementJoint", "function": f"{joint.kind} joint", "id": f"{name}/joint-{number}"}
        yield about | same | {"sealed": pavement.is_concrete}, joint_surface(geometry, joint, stations)


def _strip_semantics(geometry: RoadGeometry, surface: StripSurface) -> dict[str, Any]:
    """Return the CityJSON semantics of a strip's surface: type, function, material, lane, instance number."""
    strip = surface.strip
    about: dict[str, Any] = {
        "type": "TrafficArea" if strip.kind in _DRIVEN else "AuxiliaryTrafficArea",
        "function": _FUNCTIONS[strip.kind],
        "surfaceMaterial": [strip.material if strip.class_name == "road" else "grass"],
        "strip": strip.kind,
        "instance": surface.instance,
    }
    if strip.side:
        about["side"] = strip.side
        section = geometry.sections[strip.side]
        if surface.lane is not None:
            about |= {"lane": surface.lane, "lane_kind": section.carriageway.lanes[surface.lane].kind}
        for shape in section.turnouts if strip.kind == "turnout_lane" else ():
            if shape.turnout.instance == surface.instance:
                about["function"] = _LANES.get(shape.turnout.kind, about["function"])
    return about


def _marking(
    geometry: RoadGeometry, name: str, item: LineMarking | Hatching | Arrow, stations: Float
) -> Iterator[Surface]:
    """Yield the semantic surfaces of a marking: one for each dash of a line, one for a hatching or an arrow."""
    function = "line" if isinstance(item, LineMarking) else item.type.lower()
    about = {"type": "TransportationMarking", "function": function, "id": name, "instance": item.instance}
    about |= {"color": item.color, "film_thickness": item.film_thickness}
    if not isinstance(item, LineMarking):
        kind = {"kind": item.kind} if isinstance(item, Arrow) else {}
        yield about | kind, painted_surface(geometry, item, stations)
        return
    about |= {"kind": item.kind, "width": item.width}
    dashes, faces, owner = dash_surfaces(geometry, item, stations)
    starts = np.cumsum(faces.sizes) - faces.sizes
    for number, (start, end) in enumerate(dashes.tolist()):
        polygons = np.flatnonzero(owner == number)
        dash: dict[str, Any] = {"start_station": round(start, 6), "end_station": round(end, 6)}
        if item.dash_length:
            dash["id"], dash["instance"] = geometry.numbers.part(name, number)
        yield about | dash, _polygon_range(faces, starts, polygons)


def _polygon_range(faces: Faces, starts: Int, chosen: Int) -> Faces:
    """Return a contiguous range of polygons with only the points in the range of their indices."""
    begin, end = int(starts[chosen[0]]), int(starts[chosen[-1]] + faces.sizes[chosen[-1]])
    corners = faces.corners[begin:end]
    low, high = int(corners.min()), int(corners.max()) + 1
    return Faces(faces.points[low:high], corners - low, faces.sizes[chosen])
