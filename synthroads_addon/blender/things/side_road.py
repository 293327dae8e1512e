"""Side roads: their mouths and first stretches with verges, markings and the ground around them (SR Side Road)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy
import numpy as np

from ...base.arrays import Float
from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.section import ASPHALTS, CONCRETES
from ...road.side_roads.mouth import Mouth
from ...twin.side_roads import side_road_paint_points, side_road_patches
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, material_of, socket
from ..nodes.solids import paint_faces
from .meshes import attribute, fill, signed_instance
from .model_builder import ModelBuilder
from .registry import model_part

_CLASSES = {"pavement": "road", "verge": "roadside", "ground": "ground", "paint": "road_marking"}
"""Kinds of faces, in the order of the attribute ``kind``, and their classes."""
_KINDS = tuple(_CLASSES)


class _SideRoad(Inputs):
    faces = socket("Geometry", "Faces whose points carry class_number, instance and kind")
    pavement_material = material_of("the pavement", "asphalt")
    verge_material = material_of("the verges", "verge")
    ground_material = material_of("the ground", "grass_ground")
    marking_material = material_of("the markings", "paint_white")


@makes_group("SR Side Road")
def side_road_group(tree: Tree) -> None:
    """The faces of a side road with their classes and materials.

    Their points carry ``class_number``, ``instance``, and ``kind``: 0 pavement, 1 verge, 2 ground, 3 marking.
    """
    road = _SideRoad(tree)
    with tree.frame("Labels"):
        number, instance = (op.named_attribute(tree, name, "INT") for name in ("class_number", "instance"))
        mesh = op.label(road.faces, number, instance, road.pavement_material)
        kind = op.named_attribute(tree, "kind")
        materials = (road.verge_material, road.ground_material, road.marking_material)
        for place, material in enumerate(materials, 1):
            mesh = paint_faces(mesh, material, (kind > place - 0.5) & (kind < place + 0.5))
    tree.output("Mesh", mesh, description="Side road; every face has class_id and instance_id")


class _Part(NamedTuple):
    """Points (N, 3), quadrilaterals (Q, 4), kind, instance number and distance (N,) of a part of a side road's mesh."""

    points: Float
    quads: np.ndarray
    kind: str
    instance: int
    distance: Float


@model_part("side_roads", 25)
def build_side_roads(builder: ModelBuilder) -> None:
    """Add every side road near the stretch that is built, as one object each."""
    start, end = builder.stretch
    for name, mouth in builder.geometry.mouths.items():
        if mouth.start > end or mouth.end < start:
            continue
        parts = run_aside(lambda mouth=mouth: list(_parts(builder, mouth)))
        mesh = _mesh(parts, builder.origin)
        pavement = mouth.section.carriageway.pavement.kind
        assert pavement in (*ASPHALTS, *CONCRETES)
        builder.add(name, mesh, side_road_group(), {"Pavement Material": pavement})


def _parts(builder: ModelBuilder, mouth: Mouth) -> Iterator[_Part]:
    """Yield the parts of a side road's mesh."""
    geometry = builder.geometry
    terrain = geometry.terrain
    for patch in side_road_patches(geometry, mouth, terrain):
        is_ground = patch.kind == "ground" and terrain is not None
        instance = terrain.instance if is_ground and terrain is not None else mouth.side_road.instance
        yield _Part(
            patch.points.reshape(-1, 3), patch.quads(mouth.sign), patch.kind, instance, patch.outwards.ravel()
        )
    points = side_road_paint_points(geometry, mouth).reshape(-1, 3)
    if len(points):
        quads = np.arange(len(points)).reshape(-1, 4)
        yield _Part(points, quads, "paint", mouth.side_road.instance, np.zeros(len(points)))


def _mesh(parts: list[_Part], origin: Float) -> bpy.types.Mesh:
    """Create the mesh of a side road's parts, with the attributes that its node group reads."""
    sizes = [len(part.points) for part in parts]
    first = np.cumsum([0, *sizes[:-1]])
    mesh = bpy.data.meshes.new("SR Side Road")
    quads = np.concatenate([part.quads + begin for part, begin in zip(parts, first, strict=True)])
    fill(mesh, np.concatenate([part.points for part in parts]) - origin, faces=quads)
    numbers = np.array([class_id(_CLASSES[part.kind]) for part in parts])
    attribute(mesh, "class_number", np.repeat(numbers, sizes))
    attribute(mesh, "instance", np.repeat(signed_instance([part.instance for part in parts]), sizes))
    attribute(mesh, "kind", np.repeat([float(_KINDS.index(part.kind)) for part in parts], sizes))
    attribute(mesh, "distance", np.concatenate([part.distance for part in parts]))
    return mesh
