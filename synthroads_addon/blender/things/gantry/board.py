"""SR Gantry Sign: the face of a sign or display that hangs on a gantry."""

from __future__ import annotations

import math

from ....base.classes import class_id
from ....road.things.gantry import Gantry
from ...nodes import operations as op
from ...nodes.builder import Tree, makes_group
from ...nodes.inputs import INSTANCES, Inputs, integer, socket
from ...nodes.solids import move_geometry, put_on_points
from ..sign.face import Face, sign_face_group

_BEFORE = 0.002
"""Distance between a board and the back of its face, m; chosen."""


class _BoardInputs(Inputs):
    gantry = socket("Object", "The gantry, whose points tell where its signs are")
    number = integer(1, (1, 100), "Which of its signs, from 1 on")


@makes_group("SR Gantry Sign")
def gantry_sign_group(tree: Tree) -> None:
    """The face of one sign of a gantry, before its board."""
    sign, face = _BoardInputs(tree), Face(tree)
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    with tree.frame("Middle of the sign"):
        points = op.separate(
            op.object_geometry_across(sign.gantry), op.named_attribute(tree, "number", "INT").equals(sign.number)
        )
    with tree.frame("Face"):
        plate = tree.call(sign_face_group(), instance=instance, **face.values).value
        plate = move_geometry(plate, op.vector(tree, 0.0, face.thickness * -1.0 - _BEFORE))
        turned = op.turn(tree, z=op.switch(op.named_attribute(tree, "facing") > 0.0, math.pi, 0.0))
        mesh = op.realize(put_on_points(points, plate, op.position(tree), 1.0, turned))
    with tree.frame("Labels"):
        mesh = op.along(op.label(mesh, class_id(Gantry.points_class), instance))
    tree.output("Mesh", mesh, description="The face")
