"""Surroundings of the road in IFC 4.3: ground, trees and shrubs one by one, strips of grass, vehicles."""

from __future__ import annotations

from ...road.surroundings import Terrain, Vegetation
from ...road.vegetation.species import PlantShape
from ..faces import Faces, loft, strip_triangles
from ..ground import GroundMesh, ground_beside
from ..plants import GrassStrip, PlacedPlant, grass_strips, placed_plants
from ..vehicles import PlacedVehicle, placed_vehicles
from .entities import Entity
from .scene import Scene
from .solids import give_bodies

_MEASURES = ("height", "crownDiameter", "crownBottom", "trunkDiameter", "averageHeight")
"""Measures of plants, in metres."""


def write_surroundings(scene: Scene) -> None:
    """Add ground, vegetation and vehicles."""
    for name, item in scene.geometry.parameters.of_type(Terrain).items():
        ground = ground_beside(scene.geometry, item, scene.stations, scene.tolerance)
        _write_ground(scene, name, item, ground)
        _write_plants(scene, ground)
    vehicles = list(placed_vehicles(scene.geometry))
    scene.look_up((placed.vehicle.station, placed.offset) for placed in vehicles)
    for placed in vehicles:
        _write_vehicle(scene, placed)


def _geographic(scene: Scene, name: str, kind: str, shape: Entity | None, about: str | None = None) -> Entity:
    made = scene.ifc.product("IfcGeographicElement", name, kind, about, Representation=shape)
    scene.ifc.gather("IfcRelContainedInSpatialStructure", scene.site, [made])
    return made


def _sheet(scene: Scene, faces: Faces) -> Entity | None:
    """Add triangles that bound no solid."""
    return scene.ifc.mesh(faces.points, faces.corners.reshape(-1, 3), False)


def _write_ground(scene: Scene, name: str, item: Terrain, ground: GroundMesh) -> None:
    """Add the ground beside the road, batters included."""
    meshes = [_sheet(scene, faces) for faces in ground.faces if len(faces)]
    made = _geographic(scene, name, "TERRAIN", scene.ifc.shape(meshes, "Tessellation"))
    scene.ifc.made_of(made, "grass_ground")
    scene.describe(made, item)


# --- plants ---------------------------------------------------------------------------------------------------------


def _write_plants(scene: Scene, ground: GroundMesh) -> None:
    """Add every stand with its plants, or with its strips of grass, as its parts."""
    stands = {}
    for name, item in scene.geometry.parameters.of_type(Vegetation).items():
        stands[name] = _geographic(scene, name, "VEGETATION", None, f"{item.kind} {item.species}")
        scene.describe(stands[name], item)
        grass = "grass is its strips, without its tufts"
        trees = "a plant is its trunk and its crown's outline, upright, without branches and leaves"
        scene.ifc.trace.reduce(name, grass if item.kind == "grass" else trees)
    for plant in placed_plants(scene.geometry):
        scene.ifc.trace.grow(plant)
        _write_plant(scene, plant, stands[plant.stand])
    for strip in grass_strips(scene.geometry, ground):
        _write_strip(scene, strip, stands[strip.stand])


def _write_plant(scene: Scene, plant: PlacedPlant, stand: Entity) -> None:
    """Add a tree or shrub: the shape of its kind, scaled."""
    ifc, about = scene.ifc, plant.about
    # Readers want parts of a whole to be placed relative to it.
    axes = ifc.add("IfcAxis2Placement3D", ifc.point(*plant.foot), None, None)
    placement = ifc.add("IfcLocalPlacement", ifc.local_frame, axes)
    body = ifc.scaled_shape(
        (about.kind, about.species, plant.variant),
        lambda: _plant_items(scene, plant.shape, about.species),
        plant.scale,
    )
    kind = f"{about.kind} {about.species}"
    made = ifc.product("IfcGeographicElement", plant.name, "VEGETATION", kind, placement, Representation=body)
    ifc.gather("IfcRelAggregates", stand, [made])
    _describe(scene, made, plant)


def _plant_items(scene: Scene, shape: PlantShape, species: str) -> list[Entity]:
    """Add trunk and crown of a plant of height 1, painted."""
    bodies = ((shape.trunk(), f"{species}_bark"), (shape.crown(), f"{species}_leaves"))
    items = []
    for sections, material in bodies:
        if sections is not None:
            faces = loft(sections)
            items.append(scene.ifc.mesh(faces.points, strip_triangles(faces), True))
            scene.ifc.paint(items[-1], material)
    return items


def _write_strip(scene: Scene, strip: GrassStrip, stand: Entity) -> None:
    """Add a strip of grass as the surface at its mean height."""
    ifc = scene.ifc
    shape = ifc.shape([_sheet(scene, strip.faces)], "Tessellation")
    kind = f"grass {strip.about.species}"
    made = ifc.product("IfcGeographicElement", strip.name, "VEGETATION", kind, Representation=shape)
    ifc.gather("IfcRelAggregates", stand, [made])
    ifc.made_of(made, strip.about.species)
    _describe(scene, made, strip)


def _describe(scene: Scene, made: Entity, plant: PlacedPlant | GrassStrip) -> None:
    values = {key: scene.ifc.value(value, "m" if key in _MEASURES else "") for key, value in plant.attributes().items()}
    scene.ifc.properties(made, "SynthRoads", values)


# --- vehicles -------------------------------------------------------------------------------------------------------


def _write_vehicle(scene: Scene, placed: PlacedVehicle) -> None:
    """Add a vehicle as the box around it, where it is at the time 0, on its wheels."""
    ifc, item = scene.ifc, placed.vehicle
    place = scene.place(item.station, placed.offset)
    made = ifc.product("IfcVehicle", placed.name, "VEHICLEWHEELED", item.model, place.placement)
    # The road's surface at a place of its lane: a pothole isn't part of where it stands.
    give_bodies(ifc, made, [(place.inside(placed.box()), "car_paint")])
    scene.describe(made, item)
    scene.stand(made, scene.container(item.station, placed.offset))
    ifc.trace.simplify(placed)
