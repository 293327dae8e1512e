"""Utility cabinets with doors, on plinth and pad, under a lid (SR Cabinet), and the objects of emergency phones.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import cabinet as sizes
from ...road.things.body import BURIED
from ...road.things.cabinet import Cabinet
from ..nodes import operations as op
from ..nodes.backbone import height_on
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import material_of, metres
from ..nodes.solids import box, paint_faces, put_on_points, row_of_points
from ..nodes.standing import Standing, put_on
from .emergency_phone import emergency_phone_group
from .model_builder import ModelBuilder
from .registry import model_part

_GAP = 0.006
"""Width of the joint around doors, m; chosen."""
_SLOTS = 5
"""Slots for air of each door; chosen."""
_TWO_DOORS_WIDTH = 0.7
"""Width from which a cabinet has two doors, m."""


class _Cabinet(Standing):
    width = metres(0.8, (0.1, 5.0), "Width of its front")
    depth = metres(0.35, (0.1, 5.0), "Depth (m)")
    height = metres(1.1, (0.3, 5.0), "Top above the surface, or above its pad")
    pad_margin = metres(0.0, (0.0, 2.0), "Reach of the levelled pad around it; 0 for none")
    body_material = material_of("body parts", "cabinet_grey")
    plinth_material = material_of("plinth parts", "concrete")
    fitting_material = material_of("fitting parts", "plastic_black")


@makes_group("SR Cabinet", catalogue="Roadside")
def cabinet_group(tree: Tree) -> None:
    """A utility cabinet, its doors towards those who drive along +y; points carry ``heading`` and ``elevation``."""
    cabinet = _Cabinet(tree)
    body, fitting = cabinet.body_material, cabinet.fitting_material

    with tree.frame("Plinth, body and lid"):
        foot = _block(tree, cabinet, 2.0 * sizes.OVERHANG, 0.0, 1.0)
        walls = _block(tree, cabinet, sizes.OVERHANG, sizes.PLINTH, cabinet.height - sizes.LID)
        lid = _block(tree, cabinet, 0.0, cabinet.height - sizes.LID, cabinet.height)
        plinth = paint_faces(foot, cabinet.plinth_material)
        parts = [paint_faces(op.join(walls, lid), body)]
    with tree.frame("Doors"):
        count = op.switch(cabinet.width >= _TWO_DOORS_WIDTH, 1, 2)
        pitch = (cabinet.width - 2.0 * sizes.OVERHANG) / count
        tall = cabinet.height - (sizes.PLINTH + sizes.LID + 2.0 * _GAP)
        middle = (cabinet.height + (sizes.PLINTH - sizes.LID)) * 0.5
        front = cabinet.depth * -0.5 + (sizes.OVERHANG - sizes.DOOR * 0.5)
        x = (op.index(tree) - (count - 1.0) * 0.5) * pitch
        door = box(tree, op.vector(tree, pitch - 2.0 * _GAP, sizes.DOOR, tall))
        parts.append(
            paint_faces(put_on_points(row_of_points(tree, count), door, op.vector(tree, x, front, middle)), body)
        )
    with tree.frame("Handles"):
        handle = op.vector(tree, x + pitch * 0.36, front - sizes.DOOR * 0.5, middle)
        parts.append(
            paint_faces(put_on_points(row_of_points(tree, count), box(tree, (0.025, 0.01, 0.12)), handle), fitting)
        )
    with tree.frame("Slots for air, some at the top of each door"):
        slot_index = op.index(tree)
        x = ((slot_index // _SLOTS) - (count - 1.0) * 0.5) * pitch
        z = cabinet.height - (sizes.LID + 0.08) - (slot_index % _SLOTS) * 0.022
        slot = box(tree, op.vector(tree, pitch * 0.6, 0.002, 0.007))
        place = op.vector(tree, x, front - sizes.DOOR * 0.5, z)
        parts.append(paint_faces(put_on_points(row_of_points(tree, count * _SLOTS), slot, place), fitting))
    with tree.frame("Level on the highest ground below, its plinth in the lowest"):
        places, highest_ground, lowest_ground = _on_highest_ground(tree, cabinet)
        tall = op.vector(tree, 1.0, 1.0, highest_ground - lowest_ground + (sizes.PLINTH + BURIED))
        body_mesh = put_on(_raised(places, highest_ground), op.join(*parts))
        body_mesh = op.join(put_on(_raised(places, lowest_ground - BURIED), plinth, tall), body_mesh)
        pad = paint_faces(_block(tree, cabinet, -cabinet.pad_margin, 0.0, 1.0), cabinet.plinth_material)
        pad = put_on(
            _raised(places, lowest_ground - BURIED),
            pad,
            op.vector(tree, 1.0, 1.0, highest_ground - lowest_ground + BURIED),
        )
        mesh = op.join(op.only_if(cabinet.pad_margin > 0.0, pad), body_mesh)
        mesh = cabinet.label(mesh, class_id(Cabinet.points_class))
    tree.output("Mesh", mesh, description="Cabinet")


def _block(tree: Tree, cabinet: _Cabinet, inset: Value | float, bottom: Value | float, top: Value | float) -> Value:
    """Add nodes for a box of the cabinet's plan, smaller by `inset` (m) all around, between two heights (m)."""
    size = op.vector(tree, cabinet.width - inset * 2.0, cabinet.depth - inset * 2.0, top - bottom)
    return box(tree, size, op.vector(tree, 0.0, 0.0, (top + bottom) * 0.5))


def _on_highest_ground(tree: Tree, cabinet: _Cabinet) -> tuple[Value, Value, Value]:
    """Add nodes for the points on the surface, and the highest and lowest z below a cabinet or its pad, relative, m.

    If there is a pad, its top takes the place of the highest z.
    """
    places = cabinet.places()
    heading = op.named_attribute(tree, "heading")
    cosine, sine = op.unary("COSINE", heading), op.unary("SINE", heading)
    position, elevation = op.position(tree), op.component(op.position(tree), "Z")
    highest = lowest = elevation * 0.0
    pad_margin = cabinet.pad_margin
    for x_share, y_share in sizes.CORNERS:
        x, y = (cabinet.width + pad_margin * 2.0) * x_share, (cabinet.depth + pad_margin * 2.0) * y_share
        corner = position + op.vector(tree, x * cosine - y * sine, x * sine + y * cosine)
        ground = height_on(cabinet.road, cabinet.terrain, corner) - elevation
        highest, lowest = op.maximum(highest, ground), op.minimum(lowest, ground)
    highest = highest + op.switch(pad_margin > 0.0, 0.0, sizes.PAD_RISE)
    for name, value in (("high", highest), ("low", lowest)):
        places = op.store(places, name, value)
    return places, op.named_attribute(tree, "high"), op.named_attribute(tree, "low")


def _raised(places: Value, height: Value) -> Value:
    """Add nodes that raise points by a height (a field, m)."""
    tree = places.tree
    return op.set_position(places, op.position(tree) + op.vector(tree, 0.0, 0.0, height))


@model_part("cabinets", 150)
def build_cabinets(builder: ModelBuilder) -> None:
    """Add one object per emergency phone and utility cabinet to the model."""
    for name, cabinet in builder.parameters.of_type(Cabinet).items():
        group = emergency_phone_group() if cabinet.kind == "emergency_phone" else cabinet_group()
        builder.add_thing(name, cabinet, group)
