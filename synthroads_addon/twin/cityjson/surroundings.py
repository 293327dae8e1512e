"""Surroundings of the road in CityJSON: ground, trees and shrubs one by one, strips of grass, vehicles."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.surroundings import Landscape, Terrain, Vegetation
from ...road.things.plant_shape import PlantShape
from ..attributes import attributes_of
from ..faces import Faces, Float, loft, upward_triangles
from ..ground import GroundMesh, swales, triangulate_ground
from ..plants import PlacedPlant, grass_strips, placed_plants
from ..trace import NO_LAND
from ..vehicles import placed_vehicles
from .model import SCALE, CityGeometry, CityModel, CityObject, solid_geometry

_GROUND, _PLANTS, _BOXES = "2", "2", "1"
"""Levels of detail: surfaces, plants as trunk and crown, boxes around vehicles."""


def add_surroundings(model: CityModel, geometry: RoadGeometry, stations: Float, tolerance: float) -> None:
    """Add terrain, plants, vehicles and the landscape's parameters to the city model; plants need a terrain.

    Args:
        model: the objects of the file.
        geometry: the road.
        stations: (N,) stations at which its surface is sampled.
        tolerance: chord error of its surface, m.
    """
    for name, terrain in geometry.parameters.of_type(Terrain).items():
        ground = triangulate_ground(geometry, terrain, stations, tolerance)
        model.add(_terrain(name, terrain, ground))
        for swale, faces in swales(name, terrain, ground):
            model.add(_swale(swale, terrain, faces))
        _add_plants(model, geometry, ground)
    for name, landscape in geometry.parameters.of_type(Landscape).items():
        model.trace.record_loss(name, NO_LAND)
        model.add(CityObject(name, "GenericCityObject", attributes_of(landscape) | {"class": "ground"}))
    for item in _vehicles(geometry, model):
        model.add(item)


def _terrain(name: str, terrain: Terrain, ground: GroundMesh) -> CityObject:
    """Return the terrain as a TINRelief: the triangulated ground on both sides of the road as composite surfaces.

    The file rounds vertices to multiples of `SCALE`, by which the thinnest triangles can turn over. So the triangles
    are filtered after this rounding: only those whose corners still run anticlockwise from above are written.
    """
    attributes = attributes_of(terrain) | {"class": terrain.points_class, "deviation": round(ground.deviation, 4)}
    quantized = ((np.rint(faces.points / SCALE) * SCALE, faces.corners.reshape(-1, 3)) for faces in ground.faces)
    faces_from_above = (upward_triangles(points, corners) for points, corners in quantized)
    shapes = (CityGeometry("CompositeSurface", _GROUND, (faces,)) for faces in faces_from_above if len(faces))
    return CityObject(name, "TINRelief", attributes, tuple(shapes))


def _swale(name: str, terrain: Terrain, faces: Faces) -> CityObject:
    """Return the swales beside one side's verge as a LandUse, whose surface is the terrain's too."""
    attributes = {"instance": terrain.instance, "class": terrain.points_class, "function": "swale"}
    attributes |= {"side": name.rpartition("-")[2], "width": terrain.swale_width, "depth": terrain.swale_depth}
    return CityObject(name, "LandUse", attributes, (CityGeometry("MultiSurface", _GROUND, (faces,)),))


def _add_plants(model: CityModel, geometry: RoadGeometry, ground: GroundMesh) -> None:
    """Add every plant and every strip of grass, and for each stand a CityObjectGroup of them."""
    members: dict[str, list[str]] = {name: [] for name in geometry.parameters.of_type(Vegetation)}
    for plant in placed_plants(geometry):
        model.trace.record_plant(plant)
        members[plant.stand].append(plant.name)
        model.add(_plant(model, plant))
    for strip in grass_strips(geometry, ground):
        members[strip.stand].append(strip.name)
        shape = CityGeometry("MultiSurface", _GROUND, (strip.faces,))
        model.add(CityObject(strip.name, "PlantCover", strip.attributes(), (shape,), parent=strip.stand))
    for name, stand in geometry.parameters.of_type(Vegetation).items():
        model.trace.record_loss(name, "grass is its strips, without its tufts" if stand.kind == "grass" else _SHAPE)
        attributes = attributes_of(stand) | {"class": stand.points_class}
        model.add(CityObject(name, "CityObjectGroup", attributes, children=tuple(members[name])))


_SHAPE = "a plant is its trunk and its crown's outline, upright, without branches and leaves"


def _plant(model: CityModel, plant: PlacedPlant) -> CityObject:
    """Return a plant as a scaled instance of its species' template, standing at its foot."""
    key = plant.vegetation.kind, plant.vegetation.species, plant.variant
    template = model.template_index(key, partial(_plant_template, plant.shape))
    foot = Faces(plant.foot[None], np.zeros(1, np.int64), np.ones(1, np.int64))
    shape = CityGeometry("GeometryInstance", _PLANTS, (foot,), template=template, scale=plant.scale)
    return CityObject(plant.name, "SolitaryVegetationObject", plant.attributes(), (shape,), parent=plant.stand)


def _plant_template(shape: PlantShape) -> CityGeometry:
    """Return trunk and crown of a plant of height 1 as closed bodies, for a geometry template."""
    bodies = [loft(sections) for sections in (shape.trunk(), shape.crown()) if sections is not None]
    return solid_geometry(bodies, _PLANTS)[0]


def _vehicles(geometry: RoadGeometry, model: CityModel) -> Iterator[CityObject]:
    """Yield every vehicle at time 0 as its bounding box, and record the loss of detail in the model's trace."""
    for placed in placed_vehicles(geometry):
        model.trace.record_box(placed)
        attributes: dict[str, Any] = attributes_of(placed.vehicle) | {"class": placed.vehicle.points_class}
        attributes |= geometry.numbers.part_attributes(placed.vehicle.instance)
        yield CityObject(placed.name, "GenericCityObject", attributes, solid_geometry([loft(placed.box())], _BOXES))
