"""Surroundings of the road in IFC 4.3: ground, trees and shrubs one by one, strips of grass, vehicles."""

from __future__ import annotations

from ...base.progress import Progress, part_of
from ...road.surroundings import Landscape, Terrain, Vegetation
from ...road.things.plant_shape import PlantShape
from ..faces import Faces, loft, triangulate
from ..ground import GroundMesh, swales, triangulate_ground
from ..plants import GrassStrip, PlacedPlant, grass_strips, placed_plants
from ..trace import NO_LAND
from ..vehicles import PlacedVehicle, placed_vehicles
from .entities import Entity
from .scene import STAGE, Scene
from .solids import assign_bodies

_MEASURES = ("height", "crownDiameter", "crownBottom", "trunkDiameter", "averageHeight")
"""Measures of plants, in metres."""

_OF_GROUND = 0.3
"""Share of the surroundings' time that the ground takes."""


def write_surroundings(scene: Scene, progress: Progress) -> None:
    """Add the terrain, its vegetation, the landscape's parameters and the vehicles at time 0 to the IFC file."""
    for name, item in scene.geometry.parameters.of_type(Terrain).items():
        ground = triangulate_ground(scene.geometry, item, scene.stations, scene.tolerance)
        _write_ground(scene, name, item, ground)
        _write_plants(scene, ground, part_of(progress, _OF_GROUND, 1.0))
    for name, landscape in scene.geometry.parameters.of_type(Landscape).items():
        scene.ifc.trace.record_loss(name, NO_LAND)
        scene.add_parameters(_geographic(scene, name, "USERDEFINED", None, "Landscape"), landscape)
    vehicles = list(placed_vehicles(scene.geometry))
    scene.cache_surface((placed.station, placed.offset) for placed in vehicles)
    for placed in vehicles:
        _write_vehicle(scene, placed)


def _geographic(scene: Scene, name: str, kind: str, shape: Entity | None, object_type: str | None = None) -> Entity:
    """Add an IfcGeographicElement of a predefined type to the site, and return it."""
    element = scene.ifc.add_product("IfcGeographicElement", name, kind, object_type, Representation=shape)
    scene.ifc.note_relation("IfcRelContainedInSpatialStructure", scene.site, [element])
    return element


def _add_open_mesh(scene: Scene, faces: Faces) -> Entity | None:
    """Add and return triangles as an open face set; None if all are degenerate."""
    return scene.ifc.mesh(faces.points, faces.corners.reshape(-1, 3), False)


def _write_ground(scene: Scene, name: str, item: Terrain, ground: GroundMesh) -> None:
    """Add the terrain beside the road, batters included, as an IfcGeographicElement."""
    meshes = [_add_open_mesh(scene, faces) for faces in ground.faces if len(faces)]
    element = _geographic(scene, name, "TERRAIN", scene.ifc.shape(meshes, "Tessellation"))
    scene.ifc.assign_material(element, "grass_ground")
    scene.add_parameters(element, item)
    for swale, faces in swales(name, item, ground):
        _write_swale(scene, swale, item, faces)


def _write_swale(scene: Scene, name: str, item: Terrain, faces: Faces) -> None:
    """Add the swales of one side to its roadside, as a surface that is the terrain's too."""
    ifc = scene.ifc
    shape = ifc.shape([_add_open_mesh(scene, faces)], "Tessellation")
    element = ifc.add_product("IfcGeographicElement", name, "USERDEFINED", "Swale", Representation=shape)
    scene.contain(element, scene.parts[f"roadside-{name.rpartition('-')[2]}"])
    ifc.assign_material(element, "grass_ground")
    values = {"instance": ifc.value(item.instance), "class": ifc.value(item.points_class)}
    values |= {name: ifc.value(getattr(item, f"swale_{name}"), "m") for name in ("width", "depth")}
    ifc.add_properties(element, "SynthRoads", values)


# --- plants ---------------------------------------------------------------------------------------------------------


def _write_plants(scene: Scene, ground: GroundMesh, progress: Progress) -> None:
    """Add every stand as an element that aggregates its plants or strips of grass."""
    stands = {}
    for name, item in scene.geometry.parameters.of_type(Vegetation).items():
        stands[name] = _geographic(scene, name, "VEGETATION", None, f"{item.kind} {item.species}")
        scene.add_parameters(stands[name], item)
        grass = "grass is its strips, without its tufts"
        trees = "a plant is its trunk and its crown's outline, upright, without branches and leaves"
        scene.ifc.trace.record_loss(name, grass if item.kind == "grass" else trees)
    numbers = scene.geometry.numbers.parts
    count = sum(numbers[name].count for name in stands if name in numbers)
    for number, plant in enumerate(placed_plants(scene.geometry)):
        progress(STAGE, min(1.0, number / max(count, 1)))
        scene.ifc.trace.record_plant(plant)
        _write_plant(scene, plant, stands[plant.stand])
    for strip in grass_strips(scene.geometry, ground):
        _write_strip(scene, strip, stands[strip.stand])


def _write_plant(scene: Scene, plant: PlacedPlant, stand: Entity) -> None:
    """Add a tree or shrub to its stand: the shared shape of its kind, scaled to its size."""
    ifc, vegetation = scene.ifc, plant.vegetation
    # Readers want parts of a whole to be placed relative to it.
    axes = ifc.add("IfcAxis2Placement3D", ifc.point(*plant.foot), None, None)
    placement = ifc.add("IfcLocalPlacement", ifc.local_frame, axes)
    body = ifc.scaled_shape(
        (vegetation.kind, vegetation.species, plant.variant),
        lambda: _plant_items(scene, plant.shape, vegetation.species),
        plant.scale,
    )
    kind = f"{vegetation.kind} {vegetation.species}"
    element = ifc.add_product("IfcGeographicElement", plant.name, "VEGETATION", kind, placement, Representation=body)
    ifc.note_relation("IfcRelAggregates", stand, [element])
    _describe(scene, element, plant)


def _plant_items(scene: Scene, shape: PlantShape, species: str) -> list[Entity]:
    """Add and return the closed meshes of trunk and crown of a plant of height 1, with their materials' colours."""
    bodies = ((shape.trunk(), f"{species}_bark"), (shape.crown(), f"{species}_leaves"))
    items = []
    for sections, material in bodies:
        if sections is not None:
            faces = loft(sections)
            items.append(scene.ifc.mesh(faces.points, triangulate(faces), True))
            scene.ifc.assign_style(items[-1], material)
    return items


def _write_strip(scene: Scene, strip: GrassStrip, stand: Entity) -> None:
    """Add a strip of grass to its stand, as a surface at the grass's mean height."""
    ifc = scene.ifc
    shape = ifc.shape([_add_open_mesh(scene, strip.faces)], "Tessellation")
    kind = f"grass {strip.vegetation.species}"
    element = ifc.add_product("IfcGeographicElement", strip.name, "VEGETATION", kind, Representation=shape)
    ifc.note_relation("IfcRelAggregates", stand, [element])
    ifc.assign_material(element, strip.vegetation.species)
    _describe(scene, element, strip)


def _describe(scene: Scene, element: Entity, plant: PlacedPlant | GrassStrip) -> None:
    """Give an element the property set `SynthRoads` with the attributes of its plant or strip of grass."""
    values = {key: scene.ifc.value(value, "m" if key in _MEASURES else "") for key, value in plant.attributes().items()}
    scene.ifc.add_properties(element, "SynthRoads", values)


# --- vehicles -------------------------------------------------------------------------------------------------------


def _write_vehicle(scene: Scene, placed: PlacedVehicle) -> None:
    """Add a vehicle at time 0 as its bounding box on the road."""
    ifc, item = scene.ifc, placed.vehicle
    place = scene.place(placed.station, placed.offset)
    element = ifc.add_product("IfcVehicle", placed.name, "VEHICLEWHEELED", item.model, place.placement)
    # The road's surface at a place of its lane: a pothole isn't part of where it stands.
    assign_bodies(ifc, element, [(place.to_frame(placed.box()), "car_paint")])
    scene.add_parameters(element, item)
    scene.contain(element, scene.container(placed.station, placed.offset))
    ifc.trace.record_box(placed)
