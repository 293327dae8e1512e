"""A cloud as Blender's own point cloud: part of the file, saved and rendered, coloured by its attributes."""

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...cloud.tools.display import ColourBy, DisplayCloud
from ..things.model_builder import SUPPORT

CLOUD = "synthroads_cloud"
"""Custom property of a cloud's object: path of its file."""
SHOWN = "shown"
"""Name of the attribute with the colours that are shown."""
_MATERIAL = "SR Cloud"


def add_cloud_object(cloud: DisplayCloud, by: ColourBy, radius: float, offset: NDArray[np.float64]) -> bpy.types.Object:
    """Add a cloud to the open scene as a Blender point cloud object with attributes; return the object.

    Its points have the attributes ``class_id`` (integer), ``intensity`` (float), ``color`` (the cloud's colours, if it
    has any) and ``shown`` (the colours that the material shows). Scans leave the object out.

    Args:
        cloud: the points.
        by: attribute by which they are coloured.
        radius: radius of a rendered point, m.
        offset: vector (3,) from the cloud's coordinates to the scene's, m.
    """
    name = cloud.header.path.name
    item = _new_points(name, cloud.xyz)
    points = item.data
    _fill(points, "radius", "FLOAT", "value", np.full(len(cloud), radius, dtype=np.float32))
    _fill(points, "class_id", "INT", "value", cloud.class_id.astype(np.int32))
    _fill(points, "intensity", "FLOAT", "value", cloud.brightness.astype(np.float32))
    if "rgb" in cloud.colorings():
        _fill(points, "color", "BYTE_COLOR", "color", _to_linear(cloud.colors("rgb")))
    _fill(points, SHOWN, "BYTE_COLOR", "color", _to_linear(cloud.colors(by)))
    points.materials.clear()
    points.materials.append(_material())
    item.location = offset.tolist()
    item[CLOUD], item[SUPPORT] = str(cloud.header.path), True
    return item


def color_cloud_object(item: bpy.types.Object, cloud: DisplayCloud, by: ColourBy) -> None:
    """Recolour the points of a cloud's object by another attribute, in place."""
    _fill(item.data, SHOWN, "BYTE_COLOR", "color", _to_linear(cloud.colors(by)))
    item.data.update_tag()


def cloud_objects(scene: bpy.types.Scene, cloud: DisplayCloud) -> list[bpy.types.Object]:
    """Return a scene's objects made from a cloud's file that have as many points as the cloud."""
    path = str(cloud.header.path)
    return [item for item in scene.objects if item.get(CLOUD) == path and len(item.data.points) == len(cloud)]


def _new_points(name: str, xyz: NDArray[np.float32]) -> bpy.types.Object:
    """Add an object with a new point cloud of points (N, 3) to the scene; return it."""
    points = bpy.data.pointclouds.new(name)
    if not hasattr(points, "resize"):  # Blender 4.5 makes point clouds of meshes only
        bpy.data.pointclouds.remove(points)
        return _converted(name, xyz)
    points.resize(len(xyz))
    points.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(xyz, dtype=np.float32).ravel())
    item = bpy.data.objects.new(name, points)
    bpy.context.scene.collection.objects.link(item)
    return item


def _converted(name: str, xyz: NDArray[np.float32]) -> bpy.types.Object:
    """Add a point cloud object converted from a vertex mesh, for Blender 4.5; the selection is restored."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(xyz))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(xyz, dtype=np.float32).ravel())
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    layer = bpy.context.view_layer
    active_item, selected_items = layer.objects.active, list(layer.objects.selected)
    for selected_item in selected_items:
        selected_item.select_set(False)
    layer.objects.active = item
    item.select_set(True)
    bpy.ops.object.convert(target="POINTCLOUD")
    item.select_set(False)
    for selected_item in selected_items:
        selected_item.select_set(True)
    layer.objects.active = active_item
    if not mesh.users:
        bpy.data.meshes.remove(mesh)
    return item


def _fill(points: Any, name: str, kind: str, field: str, values: NDArray[Any]) -> None:
    """Set a point attribute, created if missing, to values (N,) or (N, C)."""
    attribute = points.attributes.get(name) or points.attributes.new(name, kind, "POINT")
    attribute.data.foreach_set(field, np.ascontiguousarray(values).ravel())


def _to_linear(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return sRGB colours (N, 4) uint8 as linear float32, 0 to 1, alpha unchanged."""
    share = colors.astype(np.float32) / 255.0
    is_linear_part = share[:, :3] <= 0.04045
    # Inverse of the transfer function of sRGB (IEC 61966-2-1).
    share[:, :3] = np.where(is_linear_part, share[:, :3] / 12.92, ((share[:, :3] + 0.055) / 1.055) ** 2.4)
    return share


def _material() -> bpy.types.Material:
    """Return the file's unlit material that shows the points' colour attribute, created if missing."""
    material = bpy.data.materials.get(_MATERIAL) or bpy.data.materials.new(_MATERIAL)
    if material.node_tree is None:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    source, emission, output = (
        nodes.new(kind) for kind in ("ShaderNodeAttribute", "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    )
    source.attribute_name = SHOWN
    material.node_tree.links.new(source.outputs["Color"], emission.inputs["Color"])
    material.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material
