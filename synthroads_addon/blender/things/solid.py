"""Things whose mesh Python makes from solids in their own frame, placed on the surface (SR Solid)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
from mathutils import Matrix

from ...base.classes import class_id
from ...road.things.body import Body
from ...road.things.thing import StandingThing
from ...twin.faces import loft
from ...twin.things import standing_frames
from ..nodes import operations as op
from ..nodes.backbone import height_on
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, instance_number, integer, metres, socket
from ..nodes.solids import move_geometry
from .meshes import fill_polygons
from .model_builder import ModelBuilder

_ALONG = Matrix(((0.0, 1.0, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
"""Turn from the bodies' frame, with y along the road, to the object's, with x along it."""


class _Solid(Inputs):
    body = socket("Geometry", "The thing, its foot on z = 0")
    road = socket("Object", "Surface that it stands on; else it stays at its object's height")
    terrain = socket("Object", "Surface beside the road")
    elevation = metres(0.0, (-20.0, 50.0), "Height of its foot above the surface")
    class_ = integer(0, (0, 255), "Semantic class of the faces")
    instance = instance_number()


@makes_group("SR Solid")
def solid_group(tree: Tree) -> None:
    """A mesh raised onto the surface at its object's origin, with class and instance number."""
    solid = _Solid(tree)
    with tree.frame("On the surface"):
        foot = height_on(solid.road, solid.terrain, op.vector(tree)) + solid.elevation
        mesh = move_geometry(solid.body, op.vector(tree, 0.0, 0.0, foot))
    with tree.frame("Labels"):
        mesh = op.label(mesh, solid.class_, solid.instance)
    tree.output("Mesh", mesh, description="The thing")


def add_solid(builder: ModelBuilder, name: str, item: StandingThing) -> None:
    """Add a thing that stands at one point to the model, with a mesh of its bodies."""
    frame = standing_frames(builder.geometry, [item])[0]
    mesh = bodies_mesh(item.bodies(frame.place()), builder.materials.material)
    mesh.transform(_ALONG)
    builder.add_thing(name, item, solid_group(), mesh, class_=class_id(item.semantic_class))


def bodies_mesh(bodies: Sequence[Body], material: Callable[[str], bpy.types.Material]) -> bpy.types.Mesh:
    """Create a mesh of closed solids, each face with its body's material by name."""
    mesh, names = bpy.data.meshes.new("SR Solid"), list(dict.fromkeys(body.material for body in bodies))
    faces = [loft(body.sections) for body in bodies]
    corners = np.concatenate([part.points[part.corners] for part in faces])
    fill_polygons(mesh, corners, np.concatenate([part.sizes for part in faces]).tolist())
    for name in names:
        mesh.materials.append(material(name))
    slots = [np.full(len(part), names.index(body.material)) for part, body in zip(faces, bodies, strict=True)]
    mesh.polygons.foreach_set("material_index", np.concatenate(slots).astype(np.int32))
    return mesh
