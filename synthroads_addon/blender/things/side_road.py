"""Side roads: their mouths and first stretches with verges, markings and the ground around them (SR Side Road)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import bpy
import numpy as np

from ...base.arrays import Float, Int
from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.network.network import network_ground
from ...road.network.patches import side_road_paint_points, side_road_patches
from ...road.other_roads.parts import CrossingRoad
from ...road.side_roads.mouth import Mouth
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, instance_number, material_of, socket
from ..nodes.solids import paint_faces
from .meshes import attribute, fill
from .model_builder import ModelBuilder
from .registry import model_part
from .structure import structure_grounds

_CLASSES = {"pavement": "road", "verge": "roadside", "paint": "road_marking"}
"""Kinds of faces, in the order of the attribute ``kind``, and their classes."""
_KINDS = tuple(_CLASSES)


class _SideRoad(Inputs):
    faces = socket("Geometry", "Faces whose points carry class_number and kind")
    instance = instance_number()
    pavement_material = material_of("the pavement", "asphalt")
    verge_material = material_of("the verges", "verge")
    marking_material = material_of("the markings", "paint_white")


@makes_group("SR Side Road")
def side_road_group(tree: Tree) -> None:
    """The faces of a side road with their classes and materials.

    Their points carry ``class_number`` and ``kind``: 0 pavement, 1 verge, 2 marking.
    """
    road = _SideRoad(tree)
    with tree.frame("Labels"):
        number = op.named_attribute(tree, "class_number", "INT")
        mesh = op.label(road.faces, number, road.instance, road.pavement_material)
        kind = op.named_attribute(tree, "kind")
        mesh = paint_faces(mesh, road.verge_material, (kind > 0.5) & (kind < 1.5))
        mesh = paint_faces(mesh, road.marking_material, kind > 1.5)
    tree.output("Mesh", mesh, description="Side road; every face has class_id and instance_id")


class RoadPart(NamedTuple):
    """Points (N, 3), quadrilaterals (Q, 4), kind and distance (N,) of a part of a side road's mesh."""

    points: Float
    quads: Int
    kind: str
    distance: Float


@model_part("side_roads", 25)
def build_side_roads(builder: ModelBuilder) -> None:
    """Add the pavement, verges and markings of every side road near the stretch that is built, as one object each."""
    for name, mouth in _mouths(builder):
        parts = run_aside(partial(_road_parts, builder, mouth))
        pavement = mouth.section.carriageway.pavement.kind
        add_road_parts(builder, name, parts, mouth.side_road.instance, pavement)


def add_road_parts(builder: ModelBuilder, name: str, parts: list[RoadPart], instance: int, pavement: str) -> None:
    """Add the parts of a road beside the main one as one object with their classes, and one instance number."""
    mesh = parts_mesh(parts, builder.origin)
    sizes = [len(part.points) for part in parts]
    numbers = np.array([class_id(_CLASSES[part.kind]) for part in parts])
    attribute(mesh, "class_number", np.repeat(numbers, sizes))
    attribute(mesh, "kind", np.repeat([float(_KINDS.index(part.kind)) for part in parts], sizes))
    builder.add(name, mesh, side_road_group(), {"Instance": instance, "Pavement Material": pavement})


def add_side_road_ground(builder: ModelBuilder) -> None:
    """Add the ground around all side roads and structures near the stretch as a hidden object for the terrain."""
    if builder.parameters.of_type(CrossingRoad):
        add_network_ground(builder)
        return
    parts = run_aside(lambda: [part for _, mouth in _mouths(builder) for part in _patches(builder, mouth, ("ground",))])
    for patch in run_aside(lambda: structure_grounds(builder)):
        parts.append(RoadPart(patch.points.reshape(-1, 3), patch.quads, "ground", patch.outwards.ravel()))
    if parts:
        mesh = parts_mesh(parts, builder.origin)
        attribute(mesh, "distance", np.concatenate([part.distance for part in parts]))
        builder.add("Side Road Ground", mesh, support=True)


def add_network_ground(builder: ModelBuilder) -> None:
    """Add the ground between the main road and all others as one hidden object, which the terrain takes up."""
    ground = run_aside(partial(network_ground, builder.geometry, builder.tolerance, builder.stretch))
    mesh = bpy.data.meshes.new("SR Network Ground")
    fill(mesh, ground.points - builder.origin, faces=ground.corners)
    attribute(mesh, "distance", ground.distances)
    builder.add("Side Road Ground", mesh, support=True)


def _mouths(builder: ModelBuilder) -> Iterator[tuple[str, Mouth]]:
    """Yield the side roads whose ground reaches into the stretch that is built."""
    start, end = builder.stretch
    for name, mouth in builder.geometry.mouths.items():
        if mouth.start < end and mouth.end > start:
            yield name, mouth


def _patches(builder: ModelBuilder, mouth: Mouth, kinds: tuple[str, ...]) -> Iterator[RoadPart]:
    """Yield the patches of some kinds of a side road."""
    for patch in side_road_patches(builder.geometry, mouth, builder.geometry.terrain):
        if patch.kind in kinds:
            yield RoadPart(patch.points.reshape(-1, 3), patch.quads(mouth.sign), patch.kind, patch.outwards.ravel())


def _road_parts(builder: ModelBuilder, mouth: Mouth) -> list[RoadPart]:
    """Return the pavement, verges and markings of a side road."""
    return [*_patches(builder, mouth, ("pavement", "verge")), *_paint(builder, mouth)]


def _paint(builder: ModelBuilder, mouth: Mouth) -> Iterator[RoadPart]:
    """Yield the markings of a side road."""
    points = side_road_paint_points(builder.geometry, mouth).reshape(-1, 3)
    if len(points):
        yield RoadPart(points, np.arange(len(points)).reshape(-1, 4), "paint", np.zeros(len(points)))


def parts_mesh(parts: list[RoadPart], origin: Float) -> bpy.types.Mesh:
    """Create the mesh of a side road's parts."""
    sizes = [len(part.points) for part in parts]
    first = np.cumsum([0, *sizes[:-1]])
    mesh = bpy.data.meshes.new("SR Side Road")
    quads = np.concatenate([part.quads + begin for part, begin in zip(parts, first, strict=True)])
    fill(mesh, np.concatenate([part.points for part in parts]) - origin, faces=quads)
    return mesh
