"""Road parameters -> scene: Python writes the backbone and the node groups' inputs, the nodes do the rest."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.parameters.model import RoadParameters
from .materials import vary
from .model_builder import ROLE, ModelBuilder
from .nodes.builder import remove_unused_groups
from .parts import PARTS, needed

COLLECTION = "SynthRoads"
ORIGIN = "synthroads_origin"
"""Custom property of the collection: map coordinates of the local origin."""


@dataclass(frozen=True)
class RoadModel:
    """A road in the scene.

    Attributes:
        collection: holds all of the model's objects.
        objects: by role: ``Backbone``, ``Road``, ``Ground``, ``Terrain``, ``Delineators``, and the parameter
            set's ids of guardrails and vegetation. Hidden helpers are among them.
        origin: (3,) map coordinates of the local origin.
    """

    collection: bpy.types.Collection
    objects: dict[str, bpy.types.Object]
    origin: NDArray[np.float64]


def build_road(
    parameters: RoadParameters,
    tolerance: float,
    vegetation_detail: float = 1.0,
    parts: Collection[str] | None = None,
    stretch: tuple[float, float] | None = None,
) -> RoadModel:
    """Build the road in the current scene; a road built before is replaced, other objects stay as they are.

    Args:
        parameters: the road.
        tolerance: largest chord error of the road's surface, m.
        vegetation_detail: share of the vegetation's triangles, 0 to 1; 0 builds none.
        parts: which of `PARTS` are wanted; all if None. What they need from others is built hidden.
        stretch: stations between which it is built, with an origin of its own; the whole road if None.

    Raises:
        ValueError: a part that there is none of.
    """
    wanted = set(PARTS if parts is None else parts)
    if wanted - set(PARTS):
        raise ValueError(f"parts: {sorted(wanted - set(PARTS))} are not among {tuple(PARTS)}")
    remove_road()
    collection = bpy.data.collections.get(COLLECTION) or bpy.data.collections.new(COLLECTION)
    if COLLECTION not in bpy.context.scene.collection.children:
        bpy.context.scene.collection.children.link(collection)
    builder = ModelBuilder(parameters, collection, tolerance, vegetation_detail, stretch)
    origin = np.array(parameters.transform.translate) + builder.origin
    collection[ORIGIN] = [float(value) for value in origin]
    there = needed(wanted)
    for name, build in PARTS.items():
        if name in there:
            builder.hidden = name not in wanted
            build(builder)
    remove_unused_groups()
    vary(parameters.materials, parameters.environment)
    bpy.context.view_layer.update()
    return RoadModel(collection, builder.objects, origin)


def remove_road() -> None:
    """Remove the objects that `build_road` made, and its collection unless the user keeps something in it."""
    for item in [item for item in bpy.data.objects if ROLE in item]:
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    collection = bpy.data.collections.get(COLLECTION)
    if collection is not None and not collection.all_objects:
        bpy.data.collections.remove(collection)
