"""Meshes of the vehicles that drive through a section of a road, in the frames of their motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ...base.classes import class_id
from ...road.instances import PassNumbers
from ...road.surroundings import Vehicle
from ...scanning.scene.mesh import SceneMesh
from ...scanning.scene.motion import BodyMotion, MovingMesh, ScannedScene
from ...scanning.scene.surface_values import MeshValues, SurfaceInput
from ..compat import set_modifier_input
from ..materials import RoadMaterials
from ..materials.looks import COLOR
from ..nodes.builder import usual_materials
from ..things.vehicle.models import model_group
from .evaluated import scene_mesh

_COLOR = SurfaceInput("attribute", COLOR)


class VehicleMeshes:
    """Cache of vehicle meshes by model, each built when first needed; must be used on Blender's main thread.

    A material has the same index in all scenes of one instance of this class.

    Args:
        materials: materials of the road.
    """

    def __init__(self, materials: RoadMaterials) -> None:
        self._road_materials = materials
        self._models: dict[str, SceneMesh] = {}
        self._materials: dict[str, None] = {}

    def with_traffic(
        self,
        static: SceneMesh,
        vehicles: Mapping[str, Vehicle],
        motions: Mapping[str, BodyMotion],
        passes: Mapping[str, PassNumbers],
    ) -> ScannedScene:
        """Return a scene to scan of a static mesh and moving vehicles, with common material indices.

        Args:
            static: mesh of what stands still.
            vehicles: vehicles by id.
            motions: their motions by id, in the static mesh's frame.
            passes: instance numbers of their later passes, by id.
        """
        models = {vehicle.model: self._model(vehicle.model) for vehicle in vehicles.values()}
        for mesh in (static, *models.values()):
            self._materials |= dict.fromkeys(mesh.materials)
        names = tuple(self._materials)
        meshes = {model: _with_materials(mesh, names) for model, mesh in models.items()}
        moving = tuple(
            MovingMesh(_as_vehicle(meshes[vehicle.model], vehicle), motions[name], passes[name])
            for name, vehicle in vehicles.items()
        )
        return ScannedScene(_with_materials(static, names), moving)

    def _model(self, model: str) -> SceneMesh:
        """Return the mesh of a vehicle model, built once."""
        if model not in self._models:
            self._models[model] = _model_mesh(model, self._road_materials)
        return self._models[model]


def _model_mesh(model: str, materials: RoadMaterials) -> SceneMesh:
    """Build a vehicle model; return its mesh centred on 0 on the road, x forward, y left, z up, m."""
    item = bpy.data.objects.new("SR Vehicle", bpy.data.meshes.new("SR Vehicle"))
    bpy.context.scene.collection.objects.link(item)
    try:
        modifier = item.modifiers.new("SynthRoads", "NODES")
        modifier.node_group = model_group(model)
        for key, entry in usual_materials(modifier.node_group).items():
            set_modifier_input(modifier, key, materials.material(entry))
        bpy.context.view_layer.update()
        mesh = scene_mesh(objects=[item])
    finally:
        data = item.data
        bpy.data.objects.remove(item)
        bpy.data.meshes.remove(data)
    # The group's model faces +y.
    right, forward, up = mesh.vertices.T
    return replace(
        mesh,
        vertices=np.ascontiguousarray(np.stack([forward, -right, up], axis=1)),
        class_id=np.full(len(mesh), class_id("vehicle"), np.uint8),
        origin=np.zeros(3),
    )


def _as_vehicle(mesh: SceneMesh, vehicle: Vehicle) -> SceneMesh:
    """Return a model's mesh with a vehicle's instance number and colour."""
    surface = mesh.surface
    if surface is not None:
        color = MeshValues(np.array([[*vehicle.color, 1.0]], np.float32), "object")
        parts = (replace(part, values={**part.values, _COLOR: color}) for part in surface.parts)
        surface = replace(surface, parts=tuple(parts))
    return replace(mesh, instance_id=np.full(len(mesh), vehicle.instance, np.uint32), surface=surface)


def _with_materials(mesh: SceneMesh, names: Sequence[str]) -> SceneMesh:
    """Return a mesh with its material indices mapped to those of `names`, which must hold all of its materials."""
    if mesh.materials == tuple(names):
        return mesh
    numbers = np.array([names.index(name) for name in mesh.materials], np.uint16)
    return replace(mesh, material=numbers[mesh.material] if len(numbers) else mesh.material, materials=tuple(names))
