"""The landscape in pictures: objects that renders show and scans leave out, built only for pictures."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from mathutils import Matrix

from ....road.geometry import RoadGeometry
from ....road.landscape.parcels import parcels_of
from ....road.landscape.relief import LandRelief
from ....road.landscape.trees import land_trees
from ....road.parameters import RoadParameters
from ....road.surroundings import Landscape
from ...materials import RoadMaterials
from ...things.model_builder import SUPPORT
from .far_road import far_road_mesh
from .ground import ground_mesh
from .structures import structures_mesh
from .woods import trees_mesh, woods_group

LANDSCAPE = "synthroads_landscape"
"""Custom property of a landscape's objects: their kind."""


def add_landscape(scene: bpy.types.Scene, parameters: RoadParameters, matrix: Matrix) -> dict[str, bpy.types.Object]:
    """Add the landscape of a parameter set to a scene, replacing an earlier one; return its objects by kind.

    Args:
        scene: scene that shows the road.
        parameters: the road; if they have no landscape, nothing is added.
        matrix: matrix from the road's local coordinates to the scene's.
    """
    remove_landscape(scene)
    landscape = next(iter(parameters.of_type(Landscape).values()), None)
    if landscape is None:
        return {}
    geometry = RoadGeometry(parameters)
    relief, parcels = LandRelief(geometry, landscape), parcels_of(geometry, landscape)
    material = RoadMaterials.of(parameters).material
    meshes: dict[str, Callable[[], bpy.types.Mesh]] = {
        "ground": lambda: ground_mesh(geometry, relief, parcels, material),
        "road": lambda: far_road_mesh(geometry, relief, material),
        "woods": lambda: trees_mesh(land_trees(geometry, landscape, parcels, relief)),
        "structures": lambda: structures_mesh(geometry, landscape, relief, material),
    }
    objects = {kind: _add(scene, kind, make(), matrix) for kind, make in meshes.items()}
    woods = objects["woods"].modifiers.new("SynthRoads", "NODES")
    woods.node_group = woods_group(material, parameters.environment.season == "winter")
    return objects


def _add(scene: bpy.types.Scene, kind: str, mesh: bpy.types.Mesh, matrix: Matrix) -> bpy.types.Object:
    """Add an object of the landscape to a scene; return it."""
    item = bpy.data.objects.new(f"SR Landscape {kind.title()}", mesh)
    item[LANDSCAPE] = kind
    item[SUPPORT] = True  # scans leave it out, as all of it is beyond the terrain
    item.matrix_world = matrix
    scene.collection.objects.link(item)
    return item


def remove_landscape(scene: bpy.types.Scene) -> None:
    """Remove the landscape's objects from a scene, with their meshes."""
    items = [item for item in scene.objects if LANDSCAPE in item]
    meshes = [item.data for item in items]
    bpy.data.batch_remove(items)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
