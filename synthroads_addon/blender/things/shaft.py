"""Shafts with a grating or a round cover (SR Shaft)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import shaft as sizes
from ...road.things.body import BURIED
from ...road.things.shaft import Shaft
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import boolean, material_of, metres
from ..nodes.solids import box, move_geometry, paint_faces, put_on_points, row_of_points, tube
from ..nodes.standing import Standing
from .model_builder import ModelBuilder
from .registry import model_part


class _Shaft(Standing):
    manhole = boolean(False, "Round with a cover, else square with a grating")
    size = metres(0.6, (0.1, 5.0), "Width of an inlet, diameter of a manhole")
    height = metres(0.05, (0.0, 2.0), "Top of its concrete above the surface")
    concrete_material = material_of("the concrete", "concrete")
    lid_material = material_of("grating or cover", "galvanised_steel")
    slot_material = material_of("the grating's slots", "plastic_black")


@makes_group("SR Shaft", catalogue="Roadside")
def shaft_group(tree: Tree) -> None:
    """The top of a shaft of the drainage; points carry ``heading`` (rad) and ``elevation`` (m)."""
    shaft = _Shaft(tree)
    lid_width, body_height = shaft.size * sizes.LID, shaft.height + BURIED
    with tree.frame("Manhole: a ring under a cover"):
        ring = move_geometry(tube(tree, shaft.size * 0.5, body_height, sizes.SIDES), (0.0, 0.0, -BURIED))
        lid_place = op.vector(tree, 0.0, 0.0, shaft.height)
        cover = move_geometry(tube(tree, lid_width * 0.5, sizes.LID_RISE, sizes.SIDES), lid_place)
        manhole = op.join(paint_faces(ring, shaft.concrete_material), paint_faces(cover, shaft.lid_material))
    with tree.frame("Inlet: a frame under a grating"):
        frame = box(
            tree, op.vector(tree, shaft.size, shaft.size, body_height), op.vector(tree, z=body_height * 0.5 - BURIED)
        )
        grating_place = op.vector(tree, z=shaft.height + sizes.LID_RISE / 2.0)
        grating = box(tree, op.vector(tree, lid_width, lid_width, sizes.LID_RISE), grating_place)
        parts = [paint_faces(frame, shaft.concrete_material), paint_faces(grating, shaft.lid_material)]
        inlet = op.join(*parts, paint_faces(_slots(tree, shaft, lid_width), shaft.slot_material))
    with tree.frame("Put onto the points"):
        mesh = shaft.put_labelled([op.switch(shaft.manhole, inlet, manhole)], class_id(Shaft.points_class))
    tree.output("Mesh", mesh, description="Shaft")


def _slots(tree: Tree, shaft: _Shaft, lid_width: Value) -> Value:
    """Add nodes for the slots of a grating: dark plates that protrude slightly from it."""
    pitch, (length_share, width_share) = lid_width / sizes.SLOTS, sizes.SLOT
    points = row_of_points(tree, sizes.SLOTS)
    x = (op.index(tree) - (sizes.SLOTS - 1.0) / 2.0) * pitch
    plate = box(tree, op.vector(tree, pitch * width_share, lid_width * length_share, sizes.SLOT_RISE))
    top = shaft.height + (sizes.LID_RISE + sizes.SLOT_RISE / 2.0)
    return op.realize(put_on_points(points, plate, op.vector(tree, x, 0.0, top)))


@model_part("shafts", 112)
def build_shafts(builder: ModelBuilder) -> None:
    """Add one object per shaft to the model."""
    for name, shaft in builder.parameters.of_type(Shaft).items():
        builder.add_thing(name, shaft, shaft_group(), manhole=shaft.kind == "manhole")
