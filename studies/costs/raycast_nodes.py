"""A caster by Blender's Geometry Nodes, for comparison only: docs/casters.md says why SynthRoads doesn't use it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.nodes.builder import Tree
from synthroads_addon.scanning.scene.mesh import SceneMesh


class RaycastNodesCaster:
    """Ray caster on the *Raycast* node, on Blender's main thread; the node itself uses every core.

    It lives in a scene of its own, whose data `close` removes from the open file.
    """

    name = "raycast nodes"
    main_thread_only = True
    kernels = "none: rays are cast by nodes"

    def __init__(self, mesh: SceneMesh) -> None:
        self._scene = bpy.data.scenes.new("SR Rays")
        self._rays = self._object("SR Rays", bpy.data.meshes.new("SR Rays"))
        self._target = self._object("SR Target", _target_mesh(mesh))
        self._group = _cast_group()
        self._modifier = self._rays.modifiers.new("SR Cast", "NODES")
        self._modifier.node_group = self._group
        set_modifier_input(self._modifier, "Target", self._target)

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float | NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """Return the index (N,) of the first face that each ray hits within its range (m), -1 for none."""
        if not len(origins):
            return np.empty(0, np.int32)
        points = self._rays.data
        points.clear_geometry()
        points.vertices.add(len(origins))
        points.vertices.foreach_set("co", origins.ravel())
        _store(points, "direction", "FLOAT_VECTOR", "POINT", "vector", directions)
        limits = np.array(np.broadcast_to(maximum_range, len(origins)), np.float32)
        _store(points, "reach", "FLOAT", "POINT", "value", limits)
        layer = self._scene.view_layers[0]
        layer.update()
        result = self._rays.evaluated_get(layer.depsgraph).data
        faces = np.empty(len(origins), np.int32)
        result.attributes["face"].data.foreach_get("value", faces)
        # The node gives 0 where nothing is hit, and the target's faces are counted from 1.
        return faces - 1

    def occluded(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float | NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Return a mask (N,) of the rays that hit anything within their range (m)."""
        return self.cast(origins, directions, maximum_range) >= 0

    def close(self) -> None:
        """Remove the caster's scene, meshes and node group from the open file."""
        meshes = [self._rays.data, self._target.data]
        for item in (self._rays, self._target):
            bpy.data.objects.remove(item)
        for mesh in meshes:
            bpy.data.meshes.remove(mesh)
        bpy.data.node_groups.remove(self._group)
        bpy.data.scenes.remove(self._scene)

    def _object(self, name: str, mesh: bpy.types.Mesh) -> bpy.types.Object:
        """Add an object with a mesh to the caster's scene."""
        item = bpy.data.objects.new(name, mesh)
        self._scene.collection.objects.link(item)
        return item


def _target_mesh(mesh: SceneMesh) -> bpy.types.Mesh:
    """Create a Blender mesh of the triangles, each face's index plus 1 as its attribute ``number``."""
    target = bpy.data.meshes.new("SR Target")
    target.vertices.add(len(mesh.vertices))
    target.vertices.foreach_set("co", mesh.vertices.ravel())
    target.loops.add(mesh.triangles.size)
    target.loops.foreach_set("vertex_index", mesh.triangles.ravel())
    target.polygons.add(len(mesh.triangles))
    target.polygons.foreach_set("loop_start", np.arange(0, mesh.triangles.size, 3, dtype=np.int32))
    target.update(calc_edges=True)
    _store(target, "number", "INT", "FACE", "value", np.arange(1, len(mesh.triangles) + 1, dtype=np.int32))
    return target


def _store(mesh: bpy.types.Mesh, name: str, kind: str, domain: str, field: str, values: NDArray[Any]) -> None:
    """Store values as an attribute of a mesh."""
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, domain)
    attribute.data.foreach_set(field, values.ravel())


def _cast_group() -> bpy.types.NodeTree:
    """Create a node group that casts a ray from each point along its ``direction`` and stores the ``face`` hit.

    The face's number is the only output of *Raycast* that is used, so that each ray is cast once.
    """
    group = bpy.data.node_groups.new("SR Cast", "GeometryNodeTree")
    group.is_modifier = True
    tree = Tree(group)
    points = tree.input("Geometry", "Geometry", description="Points where rays begin")
    target = tree.input("Target", "Object", description="What they are cast at")
    reach = tree.node("GeometryNodeInputNamedAttribute", data_type="FLOAT", name="reach")
    direction = tree.node("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR", name="direction")
    number = tree.node("GeometryNodeInputNamedAttribute", data_type="INT", name="number")
    cast = tree.node(
        "GeometryNodeRaycast",
        data_type="INT",
        target_geometry=tree.node("GeometryNodeObjectInfo", target)["Geometry"],
        attribute=number.value,
        ray_direction=direction.value,
        ray_length=reach.value,
    )
    store = {"data_type": "INT", "domain": "POINT", "name": "face", "value": cast["Attribute"]}
    tree.output("Geometry", tree.node("GeometryNodeStoreNamedAttribute", points, **store).value)
    tree.finish()
    return group
