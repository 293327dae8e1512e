"""Entrances to fields and mouths of farm tracks, made from their bodies; and grass cut away from them (SR Clearing)."""

from __future__ import annotations

import bpy
import numpy as np

from ...road.things.field_entrance import FieldEntrance
from ...twin.things import standing_frames
from ..compat import set_modifier_input
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, socket
from .meshes import fill_polygons
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import add_solid

CLEARING = "Cleared Ground"
"""Role of the object whose faces no grass grows below."""
_ABOVE = 1000.0
"""Height above the scene's origin at which these faces lie, m: above everything. Chosen."""


class _Clearing(Inputs):
    grass = socket("Geometry", "Grass")
    cleared = socket("Object", "Faces above the ground below which there is no grass")


@makes_group("SR Clearing")
def clearing_group(tree: Tree) -> None:
    """Grass without what stands below the faces of an object."""
    clearing = _Clearing(tree)
    with tree.frame("Faces of grass below those of the object"):
        ray = tree.node(
            "GeometryNodeRaycast",
            target_geometry=op.object_geometry(clearing.cleared),
            ray_direction=(0.0, 0.0, 1.0),
            ray_length=3.0 * _ABOVE,
        )
        kept = op.separate(clearing.grass, ~ray["Is Hit"], "FACE")
    tree.output("Kept Grass", kept, description="Grass beside them")


@model_part("field_entrances", 69)
def build_field_entrances(builder: ModelBuilder) -> None:
    """Make one object per entrance, and hidden faces above them that the grass is cut by."""
    entrances = builder.parameters.of_type(FieldEntrance)
    for name, entrance in entrances.items():
        add_solid(builder, name, entrance)
    if entrances:
        builder.add(CLEARING, _cleared_faces(builder, list(entrances.values())), support=True)


def clear_grass(builder: ModelBuilder, grass: bpy.types.Object) -> None:
    """Cut the grass of an object away from the entrances, if the model has some."""
    cleared = builder.objects.get(CLEARING)
    if cleared is None:
        return
    modifier = grass.modifiers.new("SynthRoads Clearing", "NODES")
    modifier.node_group = clearing_group()
    set_modifier_input(modifier, "Cleared", cleared)


def _cleared_faces(builder: ModelBuilder, entrances: list[FieldEntrance]) -> bpy.types.Mesh:
    """Create a mesh of the tops of tracks and corners, in the scene's frame, far above them."""
    corners, sizes = [], []
    for frame, item in zip(standing_frames(builder.geometry, entrances), entrances, strict=True):
        for body in item.bodies(frame.place()):
            if body.part not in ("track", "field track", "corner"):
                continue
            top = frame.to_local(body.sections[:, : body.sections.shape[1] // 2]) - builder.origin
            quads = np.stack([top[:-1, :-1], top[:-1, 1:], top[1:, 1:], top[1:, :-1]], axis=2).reshape(-1, 4, 3)
            corners.append(quads.reshape(-1, 3))
            sizes += [4] * len(quads)
    places = np.concatenate(corners)
    places[:, 2] = _ABOVE
    mesh = bpy.data.meshes.new("SR Cleared")
    fill_polygons(mesh, places, sizes)
    return mesh
