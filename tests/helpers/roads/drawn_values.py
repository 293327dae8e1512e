"""Values of a sampled road for its scenario's intervals, and for every choice that a class offers: for statistics."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin

import numpy as np

from synthroads_addon.base.schema import ClosedModel, Model
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import LIMITS
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import MaterialVariation
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.road.things.vehicles import VEHICLE_TYPES
from synthroads_addon.sampling.forest import MANTLE
from synthroads_addon.sampling.pavement_damage import CRACKS_PER_KM
from synthroads_addon.sampling.section import SHARPEST_RIDGE
from synthroads_addon.scenario.road import RoadScenario

Objects = dict[str, list[Any]]
"""The objects of a set by type."""
Extractor = Callable[[Objects, RoadParameters], Iterator[float]]

LONG, VERY_LONG = 2500.0, 5000.0
"""Only roads of this length (m) tell how many of a thing there are per km: of many things, and of few."""


def objects_by_type(parameters: RoadParameters) -> Objects:
    found: Objects = defaultdict(list)
    for item in parameters.objects.values():
        found[item.type].append(item)
    return found


def intervals_of(model: type[Model], path: str = "") -> Iterator[str]:
    """Yield the dotted path of every interval of a scenario's class."""
    for name, field in model.model_fields.items():
        if Interval in (field.annotation, *get_args(field.annotation)):
            yield path + name
        elif isinstance(field.default, ClosedModel):
            yield from intervals_of(type(field.default), f"{path}{name}.")


def interval_at(scenario: RoadScenario, path: str) -> tuple[float, float]:
    """Return the limits of an interval; those that the design class gives where the scenario doesn't."""
    value: Any = scenario
    for name in path.split("."):
        value = getattr(value, name)
    if value is None:
        limits = LIMITS[scenario.design_class]
        grade = limits.grade_percent
        return {"radius": (limits.radius, 5000.0), "grade_percent": (-grade, grade)}[path]
    return value.minimum, value.maximum


# --- one extractor for each interval -------------------------------------------------------------------------------


def _field(type_: str, *names: str, kind: str = "") -> Extractor:
    """Return the extractor of a field, or several, of the objects of a type, and of a kind if one is given."""

    def extract(objects: Objects, _: RoadParameters) -> Iterator[float]:
        for item in objects[type_]:
            if not kind or item.kind == kind:
                yield from (getattr(item, name) for name in names)

    return extract


def _turnout(read: Callable[[Any], float], bay: bool = False) -> Extractor:
    def extract(objects: Objects, _: RoadParameters) -> Iterator[float]:
        return (read(item) for item in objects["Turnout"] if (item.ramp is None) == bay)

    return extract


def _damage(kind: str, *names: str) -> Extractor:
    def extract(objects: Objects, _: RoadParameters) -> Iterator[float]:
        for road in objects["Carriageway"]:
            yield from (getattr(item, name) for item in getattr(road.pavement, kind) for name in names)

    return extract


def _of_pavement(name: str) -> Extractor:
    return lambda objects, _: (getattr(road.pavement, name) for road in objects["Carriageway"])


def _of_scene(part: str, name: str) -> Extractor:
    return lambda _, parameters: iter([getattr(getattr(parameters, part), name)])


def _lane_tapers(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for road in objects["Carriageway"]:
        for lane in road.lanes:
            if isinstance(lane.width, tuple):
                yield from (b.station - a.station for a, b in pairwise(lane.width) if a.width != b.width)


def _damages(kind: str, length: float) -> Extractor:
    """Return what gives how many damages of a kind there are in a length (m) of each carriageway."""

    def per_length(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
        if parameters.alignment.length > LONG:
            for road in objects["Carriageway"]:
                yield len(getattr(road.pavement, kind)) / parameters.alignment.length * length

    return per_length


def _cabinets_per_km(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    if parameters.alignment.length > VERY_LONG:
        yield sum(item.kind == "utility" for item in objects["Cabinet"]) / parameters.alignment.length * 1000.0


def _per_side(kind: str) -> Extractor:
    """Return what gives how many things of a type there are in a km of each side of a very long road."""

    def per_km(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
        if parameters.alignment.length > LONG:
            for sign in (-1.0, 1.0):
                yield sum(item.offset * sign > 0.0 for item in objects[kind]) / parameters.alignment.length * 1000.0

    return per_km


def _heights(kind: str) -> Extractor:
    """Return what gives the heights of stands of a kind that aren't of a forest edge."""

    def extract(objects: Objects, _: RoadParameters) -> Iterator[float]:
        for item in objects["Vegetation"]:
            if item.kind == kind and item.side == "both":
                yield from (item.height_min, item.height_max)

    return extract


def forests(objects: Objects) -> list[Any]:
    """Return the stands of trees of forest edges."""
    return [item for item in objects["Vegetation"] if item.kind == "tree" and item.side != "both"]


def _forest_edges_per_km(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    if parameters.alignment.length > LONG:
        for side in ("left", "right"):
            number = sum(item.side == side for item in forests(objects))
            yield number / parameters.alignment.length * 1000.0


def _parked_per_building(objects: Objects, _: RoadParameters) -> Iterator[float]:
    if objects["Building"]:
        yield len(objects["ParkedVehicle"]) / len(objects["Building"])


def _in_landscape(name: str) -> Extractor:
    return lambda objects, _: (float(len(getattr(item, name))) for item in objects["Landscape"])


def _pole_spacing(objects: Objects, _: RoadParameters) -> Iterator[float]:
    stations = sorted({item.station for item in objects["Pole"] if item.kind == "lighting"})
    if len(stations) >= 10:  # of which two follow each other, though some may be left out
        yield min(b - a for a, b in pairwise(stations))


def _ramp_falls(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    """Yield how much ramps fall outwards, as drawn: those that the main road's crossfall limited are left out."""
    sections = RoadGeometry(parameters).sections
    for section in sections.values():
        sign, points = section.carriageway.sign, section.carriageway.crossfall
        for shape in section.turnouts:
            if (ramp := shape.turnout.ramp) is not None:
                assert ramp.crossfall_percent is not None
                there = np.interp(
                    shape.nose_station(), [p.station for p in points], [p.crossfall_percent for p in points]
                )
                if abs(ramp.crossfall_percent - there) < SHARPEST_RIDGE - 1e-6:
                    yield -sign * ramp.crossfall_percent


def _shaft_spacing(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for sign in (-1.0, 1.0):
        stations = sorted(item.station for item in objects["Shaft"] if item.offset * sign > 0.0)
        apart = Counter(round(b - a, 6) for a, b in pairwise(stations)).most_common(1)
        if apart and apart[0][1] > 2:  # some are moved for what stands there
            yield apart[0][0]


def _construction_length(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for sign in (-1.0, 1.0):
        stations = [item.station for item in objects["ConstructionBeacon"] if item.offset * sign > 0.0]
        if stations:
            yield max(stations) - min(stations)


def _vehicles(objects: Objects) -> Iterator[list[Any]]:
    for name in {item.carriageway for item in objects["Vehicle"]}:
        yield [item for item in objects["Vehicle"] if item.carriageway == name]


def _vehicles_per_km(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    if parameters.alignment.length > LONG:
        yield from (len(queue) / parameters.alignment.length * 1000.0 for queue in _vehicles(objects))


def truck_shares(objects: Objects) -> Iterator[tuple[float, int]]:
    """Yield the share of heavy vehicles of each carriageway with many vehicles, and their number."""
    for queue in _vehicles(objects):
        if len(queue) >= 30:
            yield sum(VEHICLE_TYPES[item.model].heavy for item in queue) / len(queue), len(queue)


def _speeds(objects: Objects, _: RoadParameters) -> Iterator[float]:
    return (item.speed for item in objects["Vehicle"] if not VEHICLE_TYPES[item.model].heavy)


def _radii(objects: Objects, _: RoadParameters) -> Iterator[float]:
    return (1.0 / abs(e.curvature_start) for e in objects["Alignment"][0].horizontal if e.kind == "arc")


def _grades(objects: Objects, _: RoadParameters) -> Iterator[float]:
    points = objects["Alignment"][0].vertical
    return (100.0 * (b.elevation - a.elevation) / (b.station - a.station) for a, b in pairwise(points))


def _wetness(_: Objects, parameters: RoadParameters) -> Iterator[float]:
    return iter([parameters.environment.wetness] if parameters.environment.wetness else [])


EXTRACTORS: dict[str, Extractor] = {
    "radius": _radii,
    "grade_percent": _grades,
    "lane_changes.taper_length": _lane_tapers,
    "turnouts.lane_length": _turnout(lambda item: item.lane_length),
    "turnouts.taper_length": _turnout(lambda item: max(item.taper_in_length, item.taper_out_length)),
    "turnouts.lane_width": _turnout(lambda item: item.lane_width),
    "turnouts.shoulder_width": _turnout(lambda item: item.shoulder_width),
    "turnouts.ramp_length": _turnout(lambda item: item.ramp.length),
    "turnouts.ramp_clothoid": _turnout(lambda item: item.ramp.clothoid_parameter),
    "turnouts.ramp_crossfall": _ramp_falls,
    "turnouts.ramp_grade": _turnout(lambda item: item.ramp.grade_percent),
    "turnouts.bay_length": _turnout(lambda item: item.lane_length, bay=True),
    "turnouts.bay_taper_length": _turnout(lambda item: item.taper_in_length, bay=True),
    "turnouts.bay_width": _turnout(lambda item: item.lane_width, bay=True),
    "pavement.rut_depth": _damage("ruts", "depth"),
    "pavement.rut_width": _damage("ruts", "width"),
    "pavement.wheel_track_depth": _of_pavement("wheel_track_depth"),
    "pavement.joint_depth": _of_pavement("joint_depth"),
    "pavement.unevenness": _of_pavement("unevenness"),
    "pavement.potholes_per_km": _damages("potholes", 1000.0),
    "pavement.pothole_size": _damage("potholes", "length", "width"),
    "pavement.pothole_depth": _damage("potholes", "depth"),
    "markings.film_thickness": _field("LineMarking", "film_thickness"),
    "barriers.guardrail_height": _field("Guardrail", "height"),
    "barriers.noise_barrier_height": _field("NoiseBarrier", "height"),
    "barriers.noise_barrier_length": lambda o, _: (i.end_station - i.start_station for i in o["NoiseBarrier"]),
    "furniture.gantry_clearance": _field("Gantry", "clearance"),
    "furniture.lighting_spacing": _pole_spacing,
    "furniture.lighting_height": _field("Pole", "height", kind="lighting"),
    "furniture.surveillance_height": _field("Pole", "height", kind="surveillance"),
    "furniture.cabinets_per_km": _cabinets_per_km,
    "furniture.shaft_spacing": _shaft_spacing,
    "furniture.shaft_size": _field("Shaft", "size"),
    "furniture.overpass_clearance": _field("Overpass", "clearance"),
    "furniture.overpass_width": _field("Overpass", "width"),
    "furniture.construction_length": _construction_length,
    "roadside.fence_height": _field("Fence", "height"),
    "roadside.hedges_per_km": _per_side("Hedge"),
    "roadside.hedge_length": lambda o, _: (i.end_station - i.start_station for i in o["Hedge"]),
    "roadside.hedge_height": _field("Hedge", "height"),
    "roadside.hedge_width": _field("Hedge", "width"),
    "roadside.buildings_per_km": _per_side("Building"),
    "roadside.wall_height": _field("Wall", "height"),
    "roadside.parked_per_building": _parked_per_building,
    "roadside.pylon_height": _field("PowerLine", "height"),
    **{
        f"landscape.{name}": _field("Landscape", name)
        for name in ("hill_height", "hill_length", "parcel_size", "forest_share", "meadow_share")
    },
    "landscape.villages": _in_landscape("villages"),
    "landscape.turbines": _in_landscape("turbines"),
    "vehicles.per_km": _vehicles_per_km,
    "vehicles.trucks": lambda objects, _: (share for share, _ in truck_shares(objects)),
    "vehicles.speed": _speeds,
    "embankment_height": _field("Terrain", "embankment_height"),
    "undulation": _field("Terrain", "undulation"),
    "wavelength": _field("Terrain", "wavelength"),
    "batter_slope": _field("Terrain", "batter_slope"),
    **{name: _field("Terrain", name) for name in ("crest_length", "rounding_length", "swale_width", "ditch_width")},
    "vegetation.tree_height": _heights("tree"),
    "vegetation.shrub_height": _heights("shrub"),
    "vegetation.grass_height": _field("Vegetation", "height_min", "height_max", kind="grass"),
    "vegetation.mown_width": _field("Vegetation", "mown_width", kind="grass"),
    "vegetation.forest_edges_per_km": _forest_edges_per_km,
    "vegetation.forest_edge_length": lambda objects, _: (
        item.end_station - item.start_station for item in forests(objects)
    ),
    "vegetation.forest_depth": lambda objects, _: (
        item.band_end - item.band_start + MANTLE / 2.0 for item in forests(objects)
    ),
    "vegetation.forest_height": lambda objects, _: (
        height for item in forests(objects) for height in (item.height_min, item.height_max)
    ),
    "environment.sun_azimuth_deg": _of_scene("environment", "sun_azimuth_deg"),
    "environment.sun_elevation_deg": _of_scene("environment", "sun_elevation_deg"),
    "environment.cloud_cover": _of_scene("environment", "cloud_cover"),
    "environment.wetness": _wetness,
    **{
        f"materials.{name}": _of_scene("materials", name)
        for name in MaterialVariation.model_fields.keys() - {"textures"}
    },
    "materials.patch_density": _damages("patches", 100.0),
    "materials.crack_density": _damages("cracks", 1000.0 / CRACKS_PER_KM),
}
"""Path of an interval -> the values of a road that were drawn from it."""
COUNTED = {
    "pavement.potholes_per_km",
    "furniture.cabinets_per_km",
    "roadside.hedges_per_km",
    "roadside.buildings_per_km",
    "roadside.parked_per_building",
    "vegetation.forest_edges_per_km",
    "landscape.villages",
    "landscape.turbines",
    "vehicles.per_km",
    "vehicles.trucks",
    "materials.patch_density",
    "materials.crack_density",
}
"""Intervals whose values only show in how many there are, so not exactly."""


# --- choices -------------------------------------------------------------------------------------------------------


@cache
def _plan(model: type[Model]) -> tuple[list[str], list[str]]:
    """Return the fields of a class that are choices, and those that hold other models."""
    choices, inner = [], []
    for name, field in model.model_fields.items():
        if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) > 1:
            choices.append(name)
        elif any(isinstance(kind, type) and issubclass(kind, Model) for kind in _kinds(field.annotation)):
            inner.append(name)
    return choices, inner


def _kinds(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def models_of(model: type[Model]) -> set[type[Model]]:
    """Return a class and those of its fields, at any depth."""
    _, inner = _plan(model)
    kinds = {kind for name in inner for kind in _kinds(model.model_fields[name].annotation)}
    found = {model}
    for kind in kinds:
        if isinstance(kind, type) and issubclass(kind, Model):
            found |= models_of(kind)
    return found


def choices_of(model: type[Model]) -> set[tuple[str, str, str]]:
    """Return (class, field, choice) of everything that a class, or one in it, can be."""
    return {
        (kind.__name__, name, choice)
        for kind in models_of(model)
        for name in _plan(kind)[0]
        for choice in get_args(kind.model_fields[name].annotation)
    }


def choices_in(item: Model, found: set[tuple[str, str, str]]) -> None:
    """Add (class, field, choice) of what an object, and what it holds, is."""
    choices, inner = _plan(type(item))
    own = type(item).__name__
    found.update((own, name, getattr(item, name)) for name in choices)
    for name in inner:
        value = getattr(item, name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Model):
                choices_in(part, found)


def turns(parameters: RoadParameters) -> np.ndarray:
    """Return the lengths (2,) of arcs to the left and to the right, m."""
    arcs = [e for e in parameters.alignment.horizontal if e.kind == "arc"]
    return np.array([sum(e.length for e in arcs if e.curvature_start * sign > 0.0) for sign in (1.0, -1.0)])


def joints(parameters: RoadParameters) -> set[str]:
    """Return what clothoids join: straight and arc, arc and straight, an egg curve or an S-curve."""
    kinds = "".join(e.kind[0] for e in parameters.alignment.horizontal)
    return {joint for joint in ("lca", "acl", "aca", "acca") if joint in kinds}
