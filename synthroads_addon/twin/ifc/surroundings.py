"""Surroundings of the road in IFC 4.3: terrain, vegetation, vehicles."""

from __future__ import annotations

import math

import numpy as np

from ...road.alignment import clip_offset
from ...road.lane_lines import lane_of
from ...road.surroundings import Terrain, Vegetation, Vehicle
from ...road.things.body import box, turned
from ...road.things.vehicles import CHASSIS, VEHICLE_TYPES
from .entities import Entity
from .scene import Scene, grid_triangles
from .solids import give_bodies

_SPACINGS = ((12.0, 1.0), (40.0, 4.0), (math.inf, 10.0))
"""Up to a distance from the road's edge (m) the terrain has a column every so many metres."""
_ROW_SPACING = 8.0


def write_surroundings(scene: Scene) -> None:
    """Add terrain, vegetation and vehicles."""
    for name, item in scene.geometry.parameters.objects.items():
        if isinstance(item, Terrain):
            _terrain(scene, name, item)
        elif isinstance(item, Vegetation):
            made = _geographic(scene, name, "VEGETATION", None, f"{item.kind} {item.species}")
            scene.describe(made, item)
    _vehicles(scene)


def _geographic(scene: Scene, name: str, kind: str, shape: Entity | None, about: str | None = None) -> Entity:
    made = scene.ifc.product("IfcGeographicElement", name, kind, about, Representation=shape)
    scene.ifc.gather("IfcRelContainedInSpatialStructure", scene.site, [made])
    return made


def _terrain(scene: Scene, name: str, item: Terrain) -> None:
    """Add the ground beside the road, batter included, as a grid of points on it."""
    geometry, ifc = scene.geometry, scene.ifc
    count = max(2, math.ceil(geometry.length / _ROW_SPACING) + 1)
    station = np.linspace(0.0, geometry.length, count)
    edges, bend = geometry.offsets(station), geometry.alignment.curvature(station)
    share = _columns(item.half_width)
    meshes = []
    for side, edge in ((1.0, edges[:, 0]), (-1.0, edges[:, -1])):
        reach = np.maximum(item.half_width - side * edge, 0.0)
        offset = clip_offset(edge[:, None] + side * reach[:, None] * share, bend[:, None])
        every = np.repeat(station, len(share))
        points = scene.points(every, offset.ravel())
        meshes.append(ifc.mesh(points, grid_triangles(count, len(share), flip=side < 0.0), False))
    made = _geographic(scene, name, "TERRAIN", ifc.shape(meshes, "Tessellation"))
    ifc.made_of(made, "grass_ground")
    scene.describe(made, item)


def _columns(half_width: float) -> np.ndarray:
    """Return the shares (K,), from 0 to 1, of the way from the road's edge outwards at which the terrain is sampled."""
    distance, distances = 0.0, [0.0]
    while distance < half_width:
        spacing = next(spacing for limit, spacing in _SPACINGS if distance < limit)
        distance = min(distance + spacing, half_width)
        distances.append(distance)
    return np.array(distances) / half_width


def _vehicles(scene: Scene) -> None:
    """Add every vehicle as the box around it, where it is at the time 0: on its lane's line, along it."""
    vehicles = scene.geometry.parameters.of_type(Vehicle)
    places = {}
    for name, item in vehicles.items():
        line, station = lane_of(scene.geometry, item), np.array([item.station])
        turn = float(line.turn(station, CHASSIS[item.model].wheel_base / 2.0)[0])
        facing = turn if line.carriageway.traffic > 0 else math.pi + turn
        places[name] = (float(line.offset(station)[0]), facing)
    scene.look_up((item.station, places[name][0]) for name, item in vehicles.items())
    for name, item in vehicles.items():
        _vehicle(scene, name, item, *places[name])


def _vehicle(scene: Scene, name: str, item: Vehicle, offset: float, turn: float) -> None:
    ifc, kind = scene.ifc, VEHICLE_TYPES[item.model]
    made = ifc.product("IfcVehicle", name, "VEHICLEWHEELED", item.model, scene.place(item.station, offset).placement)
    around = box((kind.length, kind.width, kind.height), (0.0, 0.0, kind.height / 2.0))
    give_bodies(ifc, made, [(turned(around, turn), "car_paint")])
    scene.describe(made, item)
    scene.stand(made, scene.container(item.station, offset))
